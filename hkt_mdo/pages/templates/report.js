"use strict";
(() => {
  const page = JSON.parse(document.getElementById("data").textContent);
  const dark = window.matchMedia("(prefers-color-scheme: dark)");
  const touch = window.matchMedia("(pointer: coarse)");
  const choice = document.getElementById("view");
  const config = { responsive: true, displaylogo: false,
    modeBarButtonsToRemove: ["select2d", "lasso2d", "autoScale2d"] };

  const color = name => getComputedStyle(document.documentElement).getPropertyValue(name).trim();

  function webgl() {
    try { return Boolean(document.createElement("canvas").getContext("webgl")); }
    catch { return false; }
  }

  // the chart in the colours of the screen
  function themed(chart, element) {
    let text = JSON.stringify(chart);
    if (dark.matches) {
      for (const [light, other] of Object.entries(page.dark)) text = text.replaceAll(light, other);
    }
    const { data, layout } = JSON.parse(text);
    const ink = color("--ink"), rule = color("--rule"), width = element.clientWidth;
    const axis = { gridcolor: rule, linecolor: rule, zerolinecolor: rule };
    const size = width < 600 ? 11 : 13, margin = { l: 8, r: 12, b: 50 };
    // room for the legend above, which plotly.js does not make
    const names = data.filter(each => each.showlegend).map(each => 48 + 0.56 * size * each.name.length);
    const columns = Math.max(1, Math.floor((width - 20) / Math.max(...names, 1)));
    margin.t = names.length ? 12 + 1.75 * size * Math.ceil(names.length / columns) : 8;
    Object.assign(layout, { autosize: true, paper_bgcolor: "rgba(0,0,0,0)",
      plot_bgcolor: "rgba(0,0,0,0)", font: { color: ink, size }, margin,
      height: layout.height + margin.t + margin.b, hovermode: layout.hovermode || "x",
      hoversubplots: "axis", hoverlabel: { namelength: -1 },
      legend: { orientation: "h", x: 0, xanchor: "left", y: 1, yref: "container", yanchor: "top",
        entrywidth: Math.max(...names, 1) - 40, traceorder: "normal" } });
    if (touch.matches) layout.dragmode = false; // a finger scrolls the page
    for (const [key, own] of Object.entries(layout)) {
      if (key.startsWith("xaxis")) Object.assign(own, { ...axis, ...own }).title.standoff = 8;
      // zoom is along the horizontal axis that the panels share
      if (key.startsWith("yaxis")) layout[key] = { ...axis, fixedrange: true, automargin: true, ...own };
    }
    if (layout.scene) {
      const view = layout.scene, { x, y } = view.aspectratio;
      const high = Math.min(640, 1.1 * width * y / x), wide = 1.4 * Math.min(width / high / x, 1 / y);
      layout.height = high + margin.t; // below the legend
      view.domain = { y: [0, high / layout.height] };
      for (const side of "xyz") view.aspectratio[side] *= wide;
      layout.margin = { l: 0, r: 0, t: 0, b: 0 };
      delete layout.dragmode;
    }
    return [data, layout];
  }

  function draw(element) {
    const of = element.dataset;
    const chart = of.chart ? page.charts[of.chart] : page.views[chosen()][of.view];
    element.closest("figure").hidden = !chart;
    if (!chart) return Promise.resolve();
    if (!element.dataset.drawn) element.textContent = "";
    return Plotly.react(element, ...themed(chart, element), config)
      .then(() => { element.dataset.drawn = of.chart || chosen(); });
  }

  const chosen = () => choice ? choice.value : Object.keys(page.views)[0];
  const turned = webgl();
  const elements = [...document.querySelectorAll(".chart")]
    .filter(element => turned || !("webgl" in element.dataset));
  // one that fails says so in its place, and the others are drawn
  const failed = (element, error) => {
    console.error(error);
    Plotly.purge(element);
    delete element.dataset.drawn;
    element.textContent = `This chart cannot be drawn (${error.message}); please report it.`;
  };
  const drawAll = which => which.reduce((before, each) =>
    before.then(() => draw(each)).catch(error => failed(each, error)), Promise.resolve());

  if (!turned) document.getElementById("solid")?.remove();
  else document.getElementById("picture")?.remove();
  dark.addEventListener("change", () => drawAll(elements));
  choice?.addEventListener("change", () => drawAll(elements.filter(e => e.dataset.view)));
  drawAll(elements).then(() => { document.body.dataset.ready = "yes"; });
})();
