// Colours of the plots: Okabe and Ito (2008), told apart with every kind of colour vision; the same as in the report.

const dark = window.matchMedia("(prefers-color-scheme: dark)");

/** The palette for light or dark; `candidate` is purple wherever a candidate is drawn. */
export function colours() {
  const night = dark.matches;
  return {
    ink: night ? "#E6E6E6" : "#222222",
    quiet: night ? "#A9AFB6" : "#5C6066",
    grid: night ? "#343A42" : "#E4E4E4",
    dots: night ? "#B9BEC4" : "#6A6A6A",
    blue: night ? "#56B4E9" : "#0072B2",
    model: night ? "#FF7A2F" : "#D55E00",
    orange: "#E69F00",
    green: "#009E73",
    candidate: night ? "#E29AC4" : "#A8508A",
    surface: night ? "#1B1F24" : "#FFFFFF",
  };
}

/** Calls `hear` when the reader's preference changes. */
export const onTheme = (hear) => dark.addEventListener("change", hear);

/** A colour with an opacity, for bands. */
export function faint(colour, opacity) {
  const [r, g, b] = [1, 3, 5].map((k) => parseInt(colour.slice(k, k + 2), 16));
  return `rgba(${r},${g},${b},${opacity})`;
}

/** The layout every plot shares. */
export function layout(xTitle, yTitle, extra = {}) {
  const c = colours();
  const axis = {
    gridcolor: c.grid,
    zeroline: false,
    linecolor: c.grid,
    ticks: "",
    fixedrange: true,
    automargin: true,
    nticks: 7,
    tickfont: { size: 11, color: c.quiet },
    exponentformat: "e",
  };
  // No markup in text: Plotly would need inline styles for it.
  const title = (text) => ({ text: text.replaceAll("<", "‹"), font: { size: 12, color: c.quiet }, standoff: 4 });
  return {
    paper_bgcolor: "rgba(0,0,0,0)",
    plot_bgcolor: "rgba(0,0,0,0)",
    font: { family: "system-ui, 'Segoe UI', Roboto, 'Helvetica Neue', Arial, sans-serif", size: 12, color: c.ink },
    margin: { l: 46, r: 10, t: 4, b: 30 },
    dragmode: false,
    hovermode: "closest",
    hoverlabel: { font: { size: 12, color: c.ink }, bgcolor: c.surface, bordercolor: c.quiet },
    showlegend: true,
    legend: { orientation: "h", x: 0, xanchor: "left", y: 1.01, yanchor: "bottom", font: { size: 11.5 }, tracegroupgap: 0, itemclick: false, itemdoubleclick: false },
    xaxis: { ...axis, title: title(xTitle), showgrid: false, ...extra.xaxis },
    yaxis: { ...axis, title: title(yTitle), nticks: 5, ...extra.yaxis },
    shapes: extra.shapes ?? [],
    annotations: extra.annotations ?? [],
    ...extra.more,
  };
}
