"use strict";
// Draws the figures one after the other, so that the first can be read while the others follow; colours follow the page's light or dark theme.
const dark = window.matchMedia("(prefers-color-scheme: dark)");
const plots = [...document.querySelectorAll(".plot")];

function theme(layout) {
  const colours = getComputedStyle(document.documentElement), look = {};
  const ink = colours.getPropertyValue("--ink").trim(), rule = colours.getPropertyValue("--line").trim(), card = colours.getPropertyValue("--card").trim();
  look["font.color"] = ink;
  look["paper_bgcolor"] = look["plot_bgcolor"] = "rgba(0,0,0,0)";
  look["hoverlabel.bgcolor"] = card;
  look["hoverlabel.font.color"] = ink;
  look["legend.bgcolor"] = look["modebar.bgcolor"] = "rgba(0,0,0,0)";
  look["modebar.color"] = rule;
  look["modebar.activecolor"] = ink;
  for (const axis of Object.keys(layout).filter(key => /^[xy]axis/.test(key))) look[axis + ".gridcolor"] = look[axis + ".linecolor"] = rule;
  return look;
}

function themed(layout) {
  for (const [path, value] of Object.entries(theme(layout))) {
    const keys = path.split("."), last = keys.pop();
    keys.reduce((part, key) => part[key] = part[key] || {}, layout)[last] = value;
  }
  return layout;
}

async function draw(index) {
  if (index === plots.length) { document.body.dataset.drawn = index; return; }
  const figure = JSON.parse(document.getElementById("data-" + plots[index].id).textContent);
  await Plotly.newPlot(plots[index], figure.data, themed(figure.layout), {responsive: true, displayModeBar: window.innerWidth < 700 ? false : "hover", displaylogo: false, showSendToCloud: false,
    modeBarButtonsToRemove: ["select2d", "lasso2d", "autoScale2d"]});
  setTimeout(() => draw(index + 1), 0);
}

dark.addEventListener("change", () => plots.filter(plot => plot.layout).forEach(plot => Plotly.relayout(plot, theme(plot.layout))));
draw(0);
