"use strict";
// The library is stored compressed; every browser since 2023 can unpack it.
async function library() {
  const packed = document.getElementById("plotly").textContent;
  const bytes = Uint8Array.from(atob(packed), (c) => c.charCodeAt(0));
  const stream = new Blob([bytes]).stream().pipeThrough(new DecompressionStream("gzip"));
  (0, eval)(await new Response(stream).text());
}

const COMMON = {
  font: { family: "system-ui, sans-serif", size: 12, color: "#1b1f24" },
  margin: { l: 70, r: 34, t: 40, b: 44 },
  paper_bgcolor: "#fff",
  plot_bgcolor: "#fff",
  legend: { orientation: "h", y: 1, yanchor: "bottom", x: 0, xanchor: "left", font: { size: 11 } },
  modebar: { orientation: "v" },
};
const AXIS = { gridcolor: "#eaeef2", zerolinecolor: "#d0d7de", linecolor: "#d0d7de", ticks: "outside",
               tickcolor: "#d0d7de" };
const OPTIONS = { responsive: true, displaylogo: false,
                  modeBarButtonsToRemove: ["sendChartToCloud", "select2d", "lasso2d", "autoScale2d"] };

function laidOut(layout) {
  const whole = { ...COMMON, ...layout };
  for (const key of Object.keys(whole))
    if (/^[xy]axis/.test(key)) whole[key] = { ...AXIS, ...whole[key] };
  return whole;
}

// Zooming one axis of time zooms them all, except that of the worst second.
function link(figures) {
  const linked = figures.filter((f) => f.xaxisOfTime).map((f) => document.getElementById(f.name));
  let busy = false;
  for (const one of linked)
    one.on("plotly_relayout", async (change) => {
      if (busy) return;
      const range = change["xaxis.range"] ?? (change["xaxis.range[0]"] === undefined ? null
        : [change["xaxis.range[0]"], change["xaxis.range[1]"]]);
      if (!range && !change["xaxis.autorange"]) return;
      busy = true;
      const update = range ? { "xaxis.range": range } : { "xaxis.autorange": true };
      await Promise.all(linked.filter((l) => l !== one).map((l) => Plotly.relayout(l, update)));
      busy = false;
    });
}

async function draw() {
  const figures = JSON.parse(document.getElementById("figures").textContent);
  await library();
  for (const figure of figures) {
    await Plotly.newPlot(figure.name, figure.data, laidOut(figure.layout), OPTIONS);
    document.querySelector(`[data-figure="${figure.name}"]`).addEventListener("click", () => {
      const file = new Blob([JSON.stringify(figure.data)], { type: "application/json" });
      const anchor = document.createElement("a");
      anchor.href = URL.createObjectURL(file);
      anchor.download = `${figure.name}.json`;
      anchor.click();
    });
  }
  link(figures);
  const fit = () => figures.forEach((f) => Plotly.Plots.resize(f.name));
  window.addEventListener("beforeprint", fit);
  window.addEventListener("afterprint", fit);
  document.body.dataset.drawn = figures.length;
}
draw().catch((problem) => {
  const note = document.createElement("p");
  note.className = "warning";
  note.textContent = `The figures could not be drawn: ${problem.message}`;
  document.querySelector("header").append(note);
});
