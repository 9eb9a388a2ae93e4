"""docs/notebook.ipynb as a page: its text, its code and the outputs that it was saved with."""

from __future__ import annotations

import json
from pathlib import Path
from typing import Any

from mkdocs.structure.files import File, Files

NAME = "notebook"


def on_files(files: Files, /, config: Any, **_: Any) -> Files:
    """Add the page; the notebook itself stays beside it, for download."""
    cells = json.loads((Path(config["docs_dir"]) / f"{NAME}.ipynb").read_text(encoding="utf-8"))["cells"]
    files.append(File.generated(config, f"{NAME}.md", content="\n\n".join(map(_cell, cells)) + "\n"))
    return files


def _cell(cell: dict[str, Any]) -> str:
    text = "".join(cell["source"])
    if cell["cell_type"] == "markdown":
        return text
    return "\n\n".join([f"```python\n{text}\n```", *map(_output, cell["outputs"])])


def _output(output: dict[str, Any]) -> str:
    if output["output_type"] == "stream":
        return f"```text\n{''.join(output['text']).rstrip()}\n```"
    data = output["data"]
    if "text/html" in data:
        # Markdown leaves a block alone as long as no line of it is empty.
        shown = "\n".join(line for line in "".join(data["text/html"]).splitlines() if line.strip())
        return f'<div class="output">{shown}</div>'
    if "image/png" in data:
        picture = "".join(data["image/png"]).replace("\n", "")
        return f'<div class="output"><img src="data:image/png;base64,{picture}" alt="the figure of the cell"></div>'
    return f"```text\n{''.join(data['text/plain'])}\n```"
