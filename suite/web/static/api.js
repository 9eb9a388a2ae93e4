// Calls to the server. A refusal becomes a Refused with the server's own sentence; a lost server likewise.

export class Refused extends Error {
  constructor(sentence, line = null, status = 0) {
    super(sentence);
    this.line = line;
    this.status = status;
  }
}

export const LOST = "The server does not answer. Start it again with `unmodelled serve` and open its new address; until then nothing here is lost.";

async function ask(path, options) {
  try {
    return await fetch(path, options);
  } catch (error) {
    if (error.name === "AbortError") throw error;
    throw new Refused(LOST);
  }
}

async function refusal(answer) {
  const said = await answer.json().catch(() => ({}));
  return new Refused(said.error || `The server refused (${answer.status} ${answer.statusText}).`, said.line ?? null, answer.status);
}

export async function get(path) {
  const answer = await ask(path);
  if (!answer.ok) throw await refusal(answer);
  return answer.json();
}

export async function post(path, body, signal) {
  const answer = await ask(path, {
    method: "POST",
    headers: { "Content-Type": "application/json" },
    body: JSON.stringify(body),
    signal,
  });
  if (!answer.ok) throw await refusal(answer);
  return answer.headers.get("Content-Type")?.includes("json") ? answer.json() : answer.text();
}

export async function upload(file) {
  const answer = await ask(`api/data?name=${encodeURIComponent(file.name)}`, { method: "POST", body: file });
  if (!answer.ok) throw await refusal(answer);
  return answer.json();
}

/** Lines of JSON as they come; `told` hears each progress, the result is returned. */
export async function stream(path, options, told) {
  const answer = await ask(path, options);
  if (!answer.ok) throw await refusal(answer);
  const reader = answer.body.pipeThrough(new TextDecoderStream()).getReader();
  let rest = "";
  for (;;) {
    let part;
    try {
      part = await reader.read();
    } catch (error) {
      if (error.name === "AbortError") throw error;
      throw new Refused(LOST);
    }
    const lines = (rest + (part.value ?? "")).split("\n");
    rest = part.done ? "" : lines.pop();
    for (const line of lines.filter((text) => text.trim())) {
      const said = JSON.parse(line);
      if (said.error) throw new Refused(said.error, said.line ?? null);
      if ("result" in said) return said.result;
      told(said);
    }
    if (part.done) throw new Refused("The work ended without a result. Please try it again.");
  }
}

export const analyse = (model, data, signal, told) =>
  stream(
    "api/analyse",
    {
      method: "POST",
      headers: { "Content-Type": "application/json" },
      body: JSON.stringify({ model, data: data.map((entry) => entry.id), absolute: false }),
      signal,
    },
    told,
  );

export const compare = (model, data) => post("api/compare", { model, data: data.map((entry) => entry.id) });
