"use strict";
// The library is stored compressed; every browser since 2023 can unpack it.
async function library() {
  const packed = document.getElementById("plotly").textContent;
  const bytes = Uint8Array.from(atob(packed), (c) => c.charCodeAt(0));
  const stream = new Blob([bytes]).stream().pipeThrough(new DecompressionStream("gzip"));
  (0, eval)(await new Response(stream).text());
}

// On paper and on a light screen, and on a dark one.
const LIGHT = { text: "#1b1f24", paper: "#fff", grid: "#eaeef2", line: "#d0d7de",
                event: "#afb8c1", number: "#57606a" };
const DARK = { text: "#e6edf3", paper: "#0d1117", grid: "#21262d", line: "#484f58",
               event: "#484f58", number: "#9198a1" };
const darkScreen = window.matchMedia("(prefers-color-scheme: dark)");
const narrow = () => window.innerWidth < 700;
const PRINTED = { width: 680, height: 840 }; // between the margins of A4 and of letter
const SCENE_RATIO = 1.7; // of width to height, at which the whole path is seen

const COMMON = {
  margin: { l: 70, r: 34, t: 40, b: 44 },
  legend: { orientation: "h", y: 1, yanchor: "bottom", x: 0, xanchor: "left", font: { size: 11 } },
  modebar: { orientation: "v" },
};
const OPTIONS = { responsive: true, displaylogo: false,
                  modeBarButtonsToRemove: ["sendChartToCloud", "select2d", "lasso2d", "autoScale2d"] };

function coloured(whole, theme) {
  const look = { paper_bgcolor: theme.paper, plot_bgcolor: theme.paper,
                 font: { family: "system-ui, sans-serif", size: 12, color: theme.text } };
  for (const key of Object.keys(whole).filter((one) => /^[xy]axis/.test(one)))
    for (const [name, colour] of [["gridcolor", theme.grid], ["zerolinecolor", theme.line],
                                  ["linecolor", theme.line], ["tickcolor", theme.line]])
      look[`${key}.${name}`] = colour;
  (whole.shapes ?? []).forEach((one, k) => {
    if (one.layer === "below") look[`shapes[${k}].line.color`] = theme.event;
  });
  (whole.annotations ?? []).forEach((_, k) => {
    look[`annotations[${k}].font.color`] = theme.number;
  });
  return look;
}

function laidOut(layout) {
  const whole = { ...COMMON, ...layout };
  if (narrow()) whole.margin = { ...whole.margin, l: 46, r: 8 };
  for (const key of Object.keys(whole)) {
    // No prefix of SI before a unit that stands in the title: 20µ of mm.
    const exponentformat = whole[key].type === "log" ? "none" : "power";
    if (/^[xy]axis/.test(key))
      whole[key] = { ticks: "outside", exponentformat, automargin: true, ...whole[key] };
    if (narrow() && /^legend/.test(key)) whole[key] = { ...whole[key], font: { size: 10 } };
  }
  return whole;
}

// A legend that wraps takes its rows from the axes: the figure grows by as much. A scene is not
// higher than its width shows whole, and nothing is higher than a sheet of paper.
function fit(figure, print) {
  const element = document.getElementById(figure.name);
  const width = print ? PRINTED.width : element.clientWidth;
  const declared = (figure.layout.margin ?? COMMON.margin).t;
  const legend = Math.max(0, Math.ceil(element._fullLayout._size.t - declared));
  const whole = figure.layout.scene ? Math.min(figure.layout.height, width / SCENE_RATIO)
    : figure.layout.height;
  const height = Math.min(whole + legend, print ? PRINTED.height : Infinity);
  if (height === element.layout.height) return;
  element.style.height = `${height}px`;
  Plotly.relayout(element, { height });
}

// A scene is drawn anew with the next frame, which paper does not wait for: on paper it is the picture
// of the screen, as it was turned, scaled.
function paint(figure, look, print) {
  const element = document.getElementById(figure.name);
  const { width } = element._fullLayout;
  element.style.zoom = print ? PRINTED.width / width : "";
  const size = print ? { width, autosize: false } : { width: null, autosize: true };
  Plotly.relayout(element, { ...look, ...size });
  element._fullLayout.scene._scene.glplot.redraw();
}

// Of numbers of events that would lie over one another the first is shown; zooming shows more.
function thinNumbers(element) {
  let end = -Infinity;
  for (const one of element.querySelectorAll(".annotation")) {
    one.style.visibility = "";
    const box = one.getBoundingClientRect();
    if (box.left < end) one.style.visibility = "hidden";
    else end = box.right;
  }
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
    const drawn = document.getElementById(figure.name);
    drawn.on("plotly_afterplot", () => thinNumbers(drawn));
    document.querySelector(`[data-figure="${figure.name}"]`).addEventListener("click", () => {
      const file = new Blob([JSON.stringify(figure.data)], { type: "application/json" });
      const anchor = document.createElement("a");
      anchor.href = URL.createObjectURL(file);
      anchor.download = `${figure.name}.json`;
      anchor.click();
    });
    document.querySelector(`[data-svg="${figure.name}"]`).addEventListener("click", async () => {
      const element = document.getElementById(figure.name);
      const light = { ...laidOut(figure.layout), ...element.layout };
      await Plotly.relayout(figure.name, coloured(light, LIGHT));
      await Plotly.downloadImage(figure.name, { format: "svg", filename: figure.name,
                                                width: PRINTED.width, height: figure.layout.height });
      if (darkScreen.matches) Plotly.relayout(figure.name, coloured(light, DARK));
    });
    document.querySelector(`[data-pdf="${figure.name}"]`).addEventListener("click", () => {
      document.getElementById(figure.name).closest("section").classList.add("only");
      document.body.dataset.only = figure.name;
      window.print(); // the browser's "save as PDF" writes this figure alone
    });
  }
  link(figures);
  const theme = (print) => {
    const colours = !print && darkScreen.matches ? DARK : LIGHT;
    const size = print ? { width: PRINTED.width, autosize: false } : { width: null, autosize: true };
    for (const figure of figures) {
      const look = coloured(figure.layout, colours);
      if (figure.layout.scene) paint(figure, look, print);
      else Plotly.relayout(figure.name, { ...look, ...size });
      if (!figure.layout.scene || !print) fit(figure, print);
    }
  };
  theme(false);
  darkScreen.addEventListener("change", () => theme(false));
  // The page is laid out for paper only after this event: the width is set here, not measured.
  window.addEventListener("beforeprint", () => theme(true));
  window.addEventListener("afterprint", () => {
    delete document.body.dataset.only;
    document.querySelectorAll("section.only").forEach((one) => one.classList.remove("only"));
    theme(false);
  });
  document.body.dataset.drawn = figures.length;
}
draw().catch((problem) => {
  const note = document.createElement("p");
  note.className = "warning";
  note.textContent = `The figures could not be drawn: ${problem.message}`;
  document.querySelector("header").append(note);
});
