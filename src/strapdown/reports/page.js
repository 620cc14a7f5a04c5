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

// Of an absolute clock: ticks of the time axes at round steps, with UTC below the seconds.
const steps = [0.1, 0.2, 0.5, 1, 2, 5, 10, 20, 30, 60, 120, 300, 600, 1200, 1800, 3600, 7200, 14400, 21600, 43200, 86400];

function clocked(plot) {
  const clock = plot.layout.meta.clock, [low, high] = plot.layout.xaxis.range, ticks = {};
  const most = plot.clientWidth / 100, step = steps.find(each => (high - low) / each <= most) || 86400 * Math.ceil((high - low) / 86400 / most);
  const values = [], digits = step < 1 ? 1 : 0;
  for (let k = Math.ceil(low / step); k * step <= high; k++) values.push(k * step);
  const texts = values.map(value => `${value.toFixed(digits)}<br>${new Date(clock + 1000 * value).toISOString().slice(11, digits ? 21 : 19)}`);
  for (const axis of Object.keys(plot.layout).filter(key => /^xaxis/.test(key))) { ticks[axis + ".tickvals"] = values; ticks[axis + ".ticktext"] = texts; }
  return Plotly.relayout(plot, ticks);
}

async function draw(index) {
  if (index === plots.length) { document.body.dataset.drawn = index; return; }
  const figure = JSON.parse(document.getElementById("data-" + plots[index].id).textContent);
  await Plotly.newPlot(plots[index], figure.data, themed(figure.layout), {responsive: true, displayModeBar: window.innerWidth < 700 ? false : "hover", displaylogo: false, showSendToCloud: false,
    modeBarButtonsToRemove: ["select2d", "lasso2d", "autoScale2d"]});
  if (figure.layout.meta && figure.layout.meta.clock !== undefined) {
    await clocked(plots[index]);
    plots[index].on("plotly_relayout", change => { if (Object.keys(change).some(key => /^xaxis\d*\.(range|autorange)/.test(key))) clocked(plots[index]); });
  }
  setTimeout(() => draw(index + 1), 0);
}

dark.addEventListener("change", () => plots.filter(plot => plot.layout).forEach(plot => Plotly.relayout(plot, theme(plot.layout))));
draw(0);
