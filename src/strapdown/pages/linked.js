// One time for all figures: zooming one time axis zooms all, and the cursor stands at the same time in all of them and on the track.
// A figure says meta.time, the s that its x = 0 stands for, or meta.track, whose traces have their times as customdata.
const isTimed = plot => plot.layout && plot.layout.meta && plot.layout.meta.time !== undefined;
const isTrack = plot => plot.layout && plot.layout.meta && plot.layout.meta.track;
let span = null;    // [first, last] s that the time axes show; null: each what it began with
let cursor = null;  // s
let held = null;    // where the cursor goes back to when the mouse leaves
const stale = new Set();  // figures that show another span

const zoomed = plot => span ? span.map(t => t - plot.layout.meta.time) : plot.first.xaxis;
const differ = (a, b) => !a || !b || Math.abs(a[0] - b[0]) + Math.abs(a[1] - b[1]) > 1e-6 * Math.abs(b[1] - b[0]);

async function follow(plot) {
  stale.delete(plot);
  const range = zoomed(plot), change = {};
  if (!range) return;
  if (differ(plot.layout.xaxis.range, range)) for (const axis of axes(plot.layout, "x")) change[axis + ".range"] = [...range];
  if (!span) for (const axis of axes(plot.layout, "y")) if (plot.first[axis] && differ(plot.layout[axis].range, plot.first[axis])) change[axis + ".range"] = [...plot.first[axis]];
  Object.assign(change, plot.shows === String(range) ? {} : clocked(plot, plot.layout, range));
  plot.shows = String(range);
  if (!Object.keys(change).length) return;
  plot.following = true;
  await Plotly.relayout(plot, change);
  plot.following = false;
}

// Figures in view at once, the others when there is time.
let following = false;
async function followAll() {
  if (following) return;
  following = true;
  while (stale.size) {
    await follow([...stale].find(plot => near.has(plot)) || stale.values().next().value);
    place();
    await new Promise(done => setTimeout(done));
  }
  following = false;
}

function show(range) {
  span = range;
  plots.filter(isTimed).forEach(plot => stale.add(plot));
  document.body.dataset.span = range ? range.map(t => t.toFixed(3)).join(" ") : "";
  followAll();
}

function place() {
  for (const plot of plots) {
    if (!plot.layout || !near.has(plot)) continue;
    if (isTimed(plot)) placeLine(plot);
    if (isTrack(plot)) placeMarks(plot);
  }
}

function overlay(plot, name, colour) {
  const mark = document.createElement("i");
  mark.className = name;
  if (colour) mark.style.background = colour;
  plot.append(mark);
  return mark;
}

function placeLine(plot) {
  const line = plot.cursorLine = plot.cursorLine || overlay(plot, "cursor"), {xaxis, _size} = plot._fullLayout;
  const x = cursor === null ? NaN : xaxis.d2p(cursor - plot.layout.meta.time);
  line.hidden = !(x >= 0 && x <= xaxis._length);
  if (!line.hidden) Object.assign(line.style, {left: xaxis._offset + x + "px", top: _size.t + "px", height: _size.h + "px"});
}

// Index of the last of the rising times that is not after t.
function rowAt(times, t) {
  let low = 0, high = times.length - 1;
  while (low < high) { const middle = (low + high + 1) >> 1; times[middle] <= t ? low = middle : high = middle - 1; }
  return low;
}

const flat = type => type === "scatter" || type === undefined;
const isPath = trace => trace.customdata && trace.customdata.length && /lines/.test(trace.mode || "lines") && trace.meta !== "cursor";

function placeMarks(plot) {
  const paths = plot.data.filter(isPath), {xaxis, yaxis} = plot._fullLayout;
  paths.forEach((trace, k) => {
    const times = trace.customdata, row = cursor === null ? -1 : rowAt(times, cursor);
    const inside = row >= 0 && cursor >= times[0] - 1 && cursor <= times[times.length - 1] + 1 && trace.visible !== "legendonly";
    if (!flat(trace.type)) { moveMark(plot, trace, k, inside ? row : -1); return; }
    const marks = plot.cursorMarks = plot.cursorMarks || [];
    const mark = marks[k] = marks[k] || overlay(plot, "here", trace.line && trace.line.color);
    const x = inside ? xaxis.d2p(trace.x[row]) : NaN, y = inside ? yaxis.d2p(trace.y[row]) : NaN;
    mark.hidden = !(x >= 0 && x <= xaxis._length && y >= 0 && y <= yaxis._length);
    if (!mark.hidden) Object.assign(mark.style, {left: xaxis._offset + x + "px", top: yaxis._offset + y + "px"});
  });
}

// In three dimensions and on a map the mark is a trace of one point, which takes long to move.
const moving = new Map();
function moveMark(plot, trace, k, row) {
  if (!moving.size) setTimeout(() => { [...moving.values()].forEach(move => move()); moving.clear(); }, 100);
  moving.set(plot.id + " " + k, () => movedMark(plot, trace, k, row));
}

function movedMark(plot, trace, k, row) {
  const index = plot.data.findIndex(each => each.meta === "cursor" && each.uid === "cursor" + k), place = {};
  for (const key of ["x", "y", "z", "lat", "lon"]) if (trace[key]) place[key] = [[row < 0 ? null : trace[key][row]]];
  if (index >= 0) Plotly.restyle(plot, place, [index]);
}

function marked(plot) {
  const paths = plot.data.filter(isPath), marks = [];
  paths.forEach((trace, k) => {
    if (flat(trace.type)) return;
    const mark = {type: trace.type, mode: "markers", meta: "cursor", uid: "cursor" + k, showlegend: false, hoverinfo: "skip", marker: {size: trace.type === "scatter3d" ? 6 : 13, color: trace.line && trace.line.color}};
    for (const key of ["x", "y", "z", "lat", "lon"]) if (trace[key]) mark[key] = [null];
    marks.push(mark);
  });
  return marks.length ? Plotly.addTraces(plot, marks) : null;
}

// Values at the cursor in the figures in view, as plotly says them below the mouse.
function say(source) {
  for (const plot of plots.filter(each => isTimed(each) && near.has(each) && each !== source)) {
    if (cursor === null) Plotly.Fx.unhover(plot);
    else Plotly.Fx.hover(plot, {xval: cursor - plot.layout.meta.time}, Object.keys(plot._fullLayout._plots), true);
  }
}

let asked = false;
function point(t, source) {
  cursor = t;
  document.body.dataset.cursor = t === null ? "" : t.toFixed(3);
  if (asked) return;
  asked = true;
  requestAnimationFrame(() => { asked = false; place(); say(source); if (window.told) window.told(cursor); });
}

function hold(t) { held = t; point(t); }

window.refresh = () => { place(); if (stale.size) followAll(); };

onceDrawn.push(async plot => {
  if (isTimed(plot)) {
    plot.shows = String(plot.first.xaxis);
    if (span) await follow(plot);
    plot.on("plotly_relayout", change => {
      if (plot.following || !Object.keys(change).some(key => /^xaxis\d*\.(range|autorange)/.test(key))) return;
      const range = plot.layout.xaxis.range.map(x => x + plot.layout.meta.time);
      show(plot.first.xaxis && !differ(plot.layout.xaxis.range, plot.first.xaxis) ? null : range);
    });
    plot.on("plotly_doubleclick", () => { if (!differ(plot.layout.xaxis.range, plot.first.xaxis)) show(null); });
    plot.addEventListener("mousemove", event => {
      const {xaxis} = plot._fullLayout, x = event.clientX - plot.getBoundingClientRect().left - xaxis._offset;
      if (x >= 0 && x <= xaxis._length) point(xaxis.p2d(x) + plot.layout.meta.time, plot);
    });
    plot.addEventListener("mouseleave", () => point(held));
    plot.addEventListener("keydown", event => keyed(event, plot));
  }
  if (isTrack(plot)) {
    await marked(plot);
    plot.on("plotly_hover", ({points}) => { if (typeof points[0].customdata === "number") point(points[0].customdata, plot); });
    plot.on("plotly_unhover", () => point(held));
    plot.on("plotly_relayout", () => place());
  }
});

// Arrow keys move the cursor of a figure that has the focus, + and - zoom, 0 shows all.
function keyed(event, plot) {
  const [first, last] = plot.layout.xaxis.range.map(x => x + plot.layout.meta.time), width = last - first, at = cursor === null ? (first + last) / 2 : cursor;
  const zoom = {"+": 0.5, "=": 0.5, "-": 2}[event.key], step = {ArrowLeft: -0.01, ArrowRight: 0.01}[event.key];
  if (zoom) show([at - zoom * (at - first), at + zoom * (last - at)]);
  else if (step) hold(at + step * width);
  else if (event.key === "0" || event.key === "Escape") show(null);
  else return;
  event.preventDefault();
}

// An event or a stretch in a list: data-jump is its first and its last second.
document.addEventListener("click", event => {
  const asker = event.target.closest("[data-jump]");
  if (!asker) return;
  const [first, last] = asker.dataset.jump.split(" ").map(Number), all = asker.closest("[data-whole]").dataset.whole.split(" ").map(Number), margin = 0.05 * (all[1] - all[0]);
  show([Math.max(all[0], first - margin), Math.min(all[1], last + margin)]);
  hold(first);
  const figures = plots.filter(isTimed);
  if (figures.length && !figures.some(plot => { const box = plot.getBoundingClientRect(); return box.top < innerHeight && box.bottom > 0; })) figures[0].scrollIntoView({block: "center"});
});
