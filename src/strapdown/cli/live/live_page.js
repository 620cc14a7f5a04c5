"use strict";
const MAX_TRACK = 4000, MAX_FIXES = 1000, MAX_EVENTS = 200, MAX_TESTS = 300;
const SILENCE = 2000; // ms without numbers after which the page says that there is no connection
const AGAIN = 2000; // ms until it asks again where it was refused
const at = id => document.getElementById(id);
const put = (id, text) => { const node = at(id); if (node.textContent !== text) node.textContent = text; };
const known = value => value !== null && value !== undefined;

let newest = null, heard = -Infinity, heardAt = "";
let track = [], fixes = [], events = [], ratios = {}, due = false;

// ---- numbers with their units

const digits = std => known(std) && std > 0 ? Math.min(Math.max(1 - Math.floor(Math.log10(std)), 0), 4) : 2;
const spaced = unit => unit === "°" ? unit : ` ${unit}`;
function withStd(value, std, unit) {
  if (!known(value)) return "not known";
  const places = digits(std);
  return value.toFixed(places) + (known(std) ? ` ± ${std.toFixed(places)}` : "") + spaced(unit);
}
const inUnit = (value, unit, places = 2) => known(value) ? value.toFixed(places) + spaced(unit) : "not known";
const short = value => known(value) ? (Math.abs(value) >= 1000 ? value.toFixed(0) : value.toPrecision(3)) : "–";

function writeNumbers(it) {
  put("name", `strapdown live: ${it.name}`);
  put("filter", it.filter);
  put("t", inUnit(it.t, "s"));
  at("of-utc").hidden = !it.utc;
  if (it.utc) put("utc", it.utc.replace("T", " ").replace("+00:00", ""));
  put("since", `${it.since_sample.toFixed(it.since_sample < 10 ? 1 : 0)} s ago`);
  put("alignments", `${it.alignments}`);
  const look = {valid: "right", bridged: "doubt", doubtful: "doubt", invalid: "wrong"}[it.status];
  at("status").className = `verdict ${look}`;
  put("word", it.status);
  put("reason", it.reason);
  const {of, word, error} = it.verdict;
  put("verdict-of", (of ? `Verdict on ${of}.` : `Verdict: ${word}.`) + (error ? ` The last attempt failed: ${error}. The filter goes on.` : ""));
  document.querySelectorAll(".of-position").forEach(each => { each.hidden = !it.has_position; });
  const [lat, lon] = it.lat_lon || [], [north, east, up] = it.position_std || [];
  put("lat", inUnit(lat, "°", 7));
  put("lon", inUnit(lon, "°", 7));
  put("height", withStd(it.height, up, "m"));
  put("std-north", inUnit(north, "m", digits(north)));
  put("std-east", inUnit(east, "m", digits(east)));
  const v = it.v_n || [], std = it.velocity_std || [], rph = it.rph || [], angles = it.rph_std || [];
  put("speed", known(it.speed) ? `${inUnit(it.speed, "m/s")} (${inUnit(3.6 * it.speed, "km/h", 1)})` : "not known");
  ["north", "east", "down"].forEach((axis, k) => put(`v-${axis}`, withStd(v[k], std[k], "m/s")));
  ["roll", "pitch", "heading"].forEach((angle, k) => put(angle, withStd(rph[k], angles[k], "°")));
  turnHorizon(rph);
}

function writeVerdict(html) {
  // what was unfolded stays so
  const box = at("verdict"), folds = () => [...box.querySelectorAll("details")];
  const open = folds().filter(each => each.open).map(each => each.firstChild.textContent);
  box.innerHTML = html; // of the pages of `fuse`, escaped there
  folds().forEach(each => { each.open = open.includes(each.firstChild.textContent); });
}

// ---- attitude

const SCALE = 1.1; // units of the drawing per degree of pitch
at("ladder").innerHTML = [-60, -40, -20, 20, 40, 60].map(angle =>
  `<line x1="-9" x2="9" y1="${-SCALE * angle}" y2="${-SCALE * angle}"/><text x="-11" y="${-SCALE * angle}">${angle}°</text>`).join("");
function turnHorizon([roll, pitch]) {
  at("horizon").style.visibility = known(roll) && known(pitch) ? "" : "hidden";
  if (known(roll) && known(pitch)) at("ground").setAttribute("transform", `rotate(${-roll}) translate(0 ${SCALE * pitch})`);
}

// ---- drawing

const colour = name => getComputedStyle(document.documentElement).getPropertyValue(name).trim();
function cleared(canvas) {
  const ratio = devicePixelRatio || 1, width = canvas.clientWidth, height = canvas.clientHeight;
  if (canvas.width !== Math.round(width * ratio) || canvas.height !== Math.round(height * ratio)) {
    canvas.width = Math.round(width * ratio);
    canvas.height = Math.round(height * ratio);
  }
  const pen = canvas.getContext("2d");
  pen.setTransform(ratio, 0, 0, ratio, 0, 0);
  pen.clearRect(0, 0, width, height);
  pen.font = "12px system-ui, sans-serif";
  pen.lineWidth = 1;
  return [pen, width, height];
}
function line(pen, points, style, width = 1, dash = []) {
  pen.strokeStyle = style;
  pen.lineWidth = width;
  pen.setLineDash(dash);
  pen.beginPath();
  points.forEach(([x, y], k) => k ? pen.lineTo(x, y) : pen.moveTo(x, y));
  pen.stroke();
  pen.setLineDash([]);
}
function mark(pen, x, y, accepted, style) {
  if (accepted) {
    pen.fillStyle = style;
    pen.beginPath();
    pen.arc(x, y, 2.2, 0, 7);
    pen.fill();
  } else {
    line(pen, [[x - 3, y - 3], [x + 3, y + 3]], colour("--wrong"), 1.5);
    line(pen, [[x - 3, y + 3], [x + 3, y - 3]], colour("--wrong"), 1.5);
  }
}
function step(range, count) {
  const rough = range / count, power = 10 ** Math.floor(Math.log10(rough));
  return power * [1, 2, 5, 10].find(each => each * power >= rough);
}

function window_(width, height) {
  // the part of the plane that the track shows, in m: its middle, and m per px
  const asked = +at("view").value, here = newest.place || track.at(-1);
  if (asked && here) return [here[0], here[1], asked / Math.min(width, height)];
  const shown = [...track, ...fixes.map(fix => fix.slice(1, 3)), ...(here ? [here] : [])];
  const [east, north] = [0, 1].map(k => shown.map(point => point[k]));
  const ends = [east, north].map(each => [each.reduce((a, b) => Math.min(a, b)), each.reduce((a, b) => Math.max(a, b))]);
  const [[west, right], [south, top]] = ends;
  const scale = Math.max((right - west) / (width - 30), (top - south) / (height - 30), 10 / Math.min(width, height));
  return [(west + right) / 2, (south + top) / 2, scale];
}
function drawTrack() {
  const canvas = at("track");
  if (!canvas.clientWidth) return;
  const [pen, width, height] = cleared(canvas), soft = colour("--soft");
  if (!track.length && !newest.place) {
    pen.fillStyle = soft;
    pen.fillText("No position yet", 12, 22);
    return;
  }
  const left = 56, below = 22, [e0, n0, scale] = window_(width - left, height - below);
  const x = e => left + (width - left) / 2 + (e - e0) / scale, y = n => (height - below) / 2 - (n - n0) / scale;
  drawGrid(pen, x, y, [width, height, left, below], [e0, n0, scale]);
  pen.save();
  pen.beginPath();
  pen.rect(left, 0, width - left, height - below);
  pen.clip();
  pen.globalAlpha = 0.5;
  for (const [, e, n, accepted] of fixes) mark(pen, x(e), y(n), accepted, soft);
  pen.globalAlpha = 1;
  const all = newest.place ? [...track, newest.place] : track;
  line(pen, all.map(([e, n]) => [x(e), y(n)]), colour("--accent"), 2);
  if (newest.place) drawPlace(pen, x(newest.place[0]), y(newest.place[1]), scale);
  pen.restore();
}
function drawGrid(pen, x, y, [width, height, left, below], [e0, n0, scale]) {
  const grid = step(scale * Math.min(width, height), 4), ink = colour("--line"), soft = colour("--soft");
  const places = Math.max(0, -Math.floor(Math.log10(grid)));
  pen.fillStyle = soft;
  const east = scale * (width - left) / 2, north = scale * (height - below) / 2;
  pen.textAlign = "center";
  for (let k = Math.ceil((e0 - east) / grid); k * grid < e0 + east; k++) {
    line(pen, [[x(k * grid), 0], [x(k * grid), height - below]], ink);
    if (x(k * grid) > left + 20 && x(k * grid) < width - 24) pen.fillText(`${(k * grid).toFixed(places)} m`, x(k * grid), height - 6);
  }
  pen.textAlign = "right";
  for (let k = Math.ceil((n0 - north) / grid); k * grid < n0 + north; k++) {
    line(pen, [[left, y(k * grid)], [width, y(k * grid)]], ink);
    if (y(k * grid) > 22 && y(k * grid) < height - below - 6) pen.fillText(`${(k * grid).toFixed(places)} m`, left - 5, y(k * grid) + 4);
  }
  pen.textAlign = "left";
  pen.fillText("north", 2, 12);
  pen.textAlign = "right";
  pen.fillText("east", left - 5, height - 6);
  pen.textAlign = "left";
}
function drawPlace(pen, x, y, scale) {
  const ink = colour("--ink"), ellipse = newest.ellipse;
  if (ellipse && ellipse.every(known)) {
    const [nn, ne, ee] = ellipse, mean = (nn + ee) / 2, half = Math.hypot((nn - ee) / 2, ne);
    const turn = Math.atan2(ne, (ee - nn) / 2) / 2; // of the long axis from east to north
    pen.strokeStyle = ink;
    pen.lineWidth = 1.5;
    pen.beginPath();
    pen.ellipse(x, y, Math.sqrt(mean + half) / scale, Math.sqrt(Math.max(mean - half, 0)) / scale, -turn, 0, 7);
    pen.stroke();
  }
  pen.fillStyle = colour("--accent");
  pen.strokeStyle = ink;
  pen.lineWidth = 1.5;
  pen.beginPath();
  pen.arc(x, y, 3.5, 0, 7);
  pen.fill();
  pen.stroke();
}

// ---- sources

function writeSources(it) {
  const box = at("sources"), names = (it.sources || []).map(each => each.name).join("\n");
  if (box.dataset.names !== names) {
    box.dataset.names = names;
    box.replaceChildren(...(it.sources || []).map(sourceBox));
    if (!names) box.textContent = "No sources in the configuration.";
  }
  (it.sources || []).forEach((source, k) => {
    const test = it.tests[k], said = [`${source.used} used`, `${source.rejected} rejected`];
    if (test) said.push(`innovation ${short(test.innovation)} ${test.unit}`, known(test.gate) ? `NIS ${short(test.nis)}, gate ${short(test.gate)} (no unit)` : "no gate");
    else said.push("no measurement yet");
    const [text, silent] = box.children[k].querySelectorAll("p span");
    text.textContent = said.join(" · ");
    silent.textContent = known(source.silent) ? `silent for ${source.silent.toFixed(0)} s` : "";
  });
}
function sourceBox({name}) {
  const box = document.createElement("div");
  box.className = "source";
  box.innerHTML = "<p><b></b><span></span><span class=silent></span></p><canvas role=img></canvas>";
  box.querySelector("b").textContent = name;
  box.querySelector("canvas").setAttribute("aria-label", `Innovations of ${name} over their gate`);
  return box;
}
const TOP = 1.5;
function drawRatios(canvas, rows) {
  if (!canvas.clientWidth) return;
  const [pen, width, height] = cleared(canvas), soft = colour("--soft"), left = 26, below = 16;
  const y = ratio => 4 + (height - below - 8) * (1 - Math.min(ratio, TOP) / TOP);
  pen.fillStyle = soft;
  for (const value of [0, 1]) {
    line(pen, [[left, y(value)], [width, y(value)]], value ? soft : colour("--line"), 1, value ? [4, 4] : []);
    pen.fillText(`${value}`, 10, y(value) + 4);
  }
  const tested = rows.filter(([, ratio]) => known(ratio));
  if (!tested.length) {
    pen.fillText(rows.length ? "not tested against a gate" : "no measurement yet", left + 6, y(0.5));
    return;
  }
  const first = tested[0][0], last = tested.at(-1)[0], span = Math.max(last - first, 1);
  const x = t => left + 4 + (width - left - 10) * (1 - (last - t) / span);
  for (const [t, ratio, accepted] of tested) mark(pen, x(t), y(ratio), accepted, colour("--accent"));
  pen.fillStyle = soft;
  pen.fillText(`${(last - span).toFixed(1)} s`, left, height - 3);
  pen.textAlign = "right";
  pen.fillText(`${last.toFixed(1)} s`, width - 2, height - 3);
  pen.textAlign = "left";
}

// ---- events, ports and counts

function writeEvents() {
  const rows = [...events].reverse().map(([t, text]) => {
    const item = document.createElement("li"), when = document.createElement("time");
    when.textContent = `${t.toFixed(2)} s`;
    item.append(when, text);
    return item;
  });
  if (rows.length) at("events").replaceChildren(...rows);
  else at("events").textContent = "none so far";
}
function writeRows(id, rows) {
  const text = JSON.stringify(rows), body = at(id);
  if (body.dataset.rows === text) return;
  body.dataset.rows = text;
  body.replaceChildren(...rows.map(cells => {
    const row = document.createElement("tr");
    cells.forEach(cell => { row.insertCell().textContent = cell; });
    return row;
  }));
}
function writeCounts(it) {
  const ports = Object.entries(it.ports || {}).map(([port, error]) => [port, error || "works"]);
  const clocks = Object.entries(it.clocks || {}).map(([port, text]) => [`${port}, clock`, text]);
  writeRows("ports", [...ports, ...clocks]);
  const losses = Object.entries(it.dropped || {}).map(([cause, count]) => [`samples and measurements: ${cause}`, count]);
  const ofPorts = (what, counts) => Object.entries(counts || {}).filter(each => each[1]).map(([port, count]) => [`${port}: ${what}`, count]);
  losses.push(["lines or pieces that cannot be read", it.bad || 0], ...ofPorts("datagrams dropped by the system", it.missed), ...ofPorts("states not written", it.unsent));
  writeRows("losses", losses);
}

// ---- what comes

function append(list, more, most) {
  list.push(...more);
  if (list.length > most) list.splice(0, list.length - most);
}
function take(it) {
  if (it.whole) [track, fixes, events, ratios] = [[], [], [], {}];
  newest = it;
  track.push(...it.track);
  if (track.length > MAX_TRACK) track = track.filter((_, k) => k % 2 === 0);
  append(fixes, it.fixes, MAX_FIXES);
  append(events, it.events, MAX_EVENTS);
  for (const [source, rows] of Object.entries(it.ratios)) append(ratios[source] ??= [], rows, MAX_TESTS);
  heard = performance.now();
  heardAt = new Date().toLocaleTimeString();
  setLost(false);
  if (it.events.length || it.whole) writeEvents();
  if (it.verdicts.length || it.whole) writeVerdict((it.verdicts.at(-1) || [""])[0]);
  if (!due) { due = true; requestAnimationFrame(draw); }
}
function draw() {
  due = false;
  if (!newest) return;
  writeNumbers(newest);
  writeSources(newest);
  writeCounts(newest);
  drawTrack();
  document.querySelectorAll(".source canvas").forEach((canvas, k) => drawRatios(canvas, ratios[k] || []));
}
function setLost(isLost) {
  document.body.classList.toggle("lost", isLost);
  document.title = isLost ? "no connection – strapdown live" : `${newest.status} – strapdown live`;
  if (isLost && newest) put("lost-since", `The numbers below are those of ${heardAt}, ${((performance.now() - heard) / 1000).toFixed(0)} s ago. The page connects by itself when the program runs again.`);
}

let stream = null, broken = true;
function connect() {
  stream = new EventSource("/events");
  stream.onopen = () => { broken = false; };
  stream.onmessage = ({data}) => take(JSON.parse(data));
  stream.onerror = () => {
    broken = true;
    setLost(true);
    // refused, for example because there are too many viewers: a browser does not try again by itself
    if (stream.readyState === EventSource.CLOSED) setTimeout(connect, AGAIN);
  };
}
setInterval(() => { if (broken || performance.now() - heard > SILENCE) setLost(true); }, 500);
at("view").addEventListener("change", draw);
addEventListener("resize", draw);
connect();
