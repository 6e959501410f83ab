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
  function themed(chart) {
    let text = JSON.stringify(chart);
    if (dark.matches) {
      for (const [light, other] of Object.entries(page.dark)) text = text.replaceAll(light, other);
    }
    const { data, layout } = JSON.parse(text);
    const ink = color("--ink"), rule = color("--rule");
    const axis = { gridcolor: rule, linecolor: rule, zerolinecolor: rule, automargin: true };
    const narrow = window.innerWidth < 600;
    Object.assign(layout, { autosize: true, paper_bgcolor: "rgba(0,0,0,0)",
      plot_bgcolor: "rgba(0,0,0,0)", font: { color: ink, size: narrow ? 11 : 13 },
      hovermode: "x", hoversubplots: "axis", margin: { l: 8, r: 12, t: 40, b: 40, ...layout.margin },
      legend: { orientation: "h", x: 0, xanchor: "left", y: 1, yref: "container", yanchor: "top",
        ...layout.legend },
      hoverlabel: { namelength: -1 } });
    if (touch.matches) layout.dragmode = false; // a finger scrolls the page
    for (const key of Object.keys(layout)) {
      if (key.startsWith("xaxis")) layout[key] = { ...axis, ...layout[key] };
      // zoom is along the horizontal axis that the panels share
      if (key.startsWith("yaxis")) layout[key] = { ...axis, fixedrange: true, ...layout[key] };
    }
    if (layout.scene) {
      Object.assign(layout.scene.xaxis, { color: ink, gridcolor: rule });
      layout.margin = { l: 0, r: 0, t: 0, b: 0 };
      delete layout.dragmode;
      if (narrow) { layout.height = 300; layout.scene.camera.projection.type = "perspective"; }
    }
    return [data, layout];
  }

  function draw(element) {
    const of = element.dataset;
    const chart = of.chart ? page.charts[of.chart] : page.views[chosen()][of.view];
    element.closest("figure").hidden = !chart;
    if (!chart) return Promise.resolve();
    return Plotly.react(element, ...themed(chart), config)
      .then(() => { element.dataset.drawn = of.chart || chosen(); });
  }

  const chosen = () => choice ? choice.value : Object.keys(page.views)[0];
  const turned = webgl();
  const elements = [...document.querySelectorAll(".chart")]
    .filter(element => turned || !("webgl" in element.dataset));
  const drawAll = which => which.reduce((before, each) => before.then(() => draw(each)), Promise.resolve());

  if (!turned) document.getElementById("solid")?.remove();
  else document.getElementById("picture")?.remove();
  dark.addEventListener("change", () => drawAll(elements));
  choice?.addEventListener("change", () => drawAll(elements.filter(e => e.dataset.view)));
  drawAll(elements).then(() => { document.body.dataset.ready = "yes"; });
})();
