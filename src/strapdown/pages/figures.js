// Unpacks and draws the figures, those in view first; colours follow the page's light or dark theme.
const dark = window.matchMedia("(prefers-color-scheme: dark)");
const plots = [...document.querySelectorAll(".plot")];
const near = new Set();  // figures in view, or nearly

async function inflated(id) {
  const text = atob(document.getElementById(id).textContent), raw = new Uint8Array(text.length);
  for (let k = 0; k < raw.length; k++) raw[k] = text.charCodeAt(k);
  return new Response(new Blob([raw]).stream().pipeThrough(new DecompressionStream("deflate"))).arrayBuffer();
}

// What packing.py packed.
async function unpacked(id) {
  const bytes = new Uint8Array(await inflated(id)), end = bytes.indexOf(10), numbers = bytes.subarray(end + 1);
  return JSON.parse(new TextDecoder().decode(bytes.subarray(0, end)), (key, value) => value && value.packed ? column(numbers, value.packed, value.unknown) : value);
}

function column(bytes, [at, n, step], unknown) {
  const values = new Float64Array(n);
  for (let k = 0, whole = 0; k < n; k++) {
    const folded = bytes[at + k] | bytes[at + n + k] << 8 | bytes[at + 2 * n + k] << 16 | bytes[at + 3 * n + k] << 24;
    whole += (folded >>> 1) ^ -(folded & 1);
    values[k] = whole * step;
  }
  for (let k = 0; k < unknown.length; k += 2) values.fill(NaN, unknown[k], unknown[k] + unknown[k + 1]);
  return values;
}

const axes = (layout, letter) => Object.keys(layout).filter(key => new RegExp(`^${letter}axis\\d*$`).test(key));

function theme(layout, [ink, rule, card] = ["--ink", "--line", "--card"].map(name => getComputedStyle(document.documentElement).getPropertyValue(name).trim())) {
  const look = {};
  look["font.color"] = ink;
  look["paper_bgcolor"] = look["plot_bgcolor"] = "rgba(0,0,0,0)";
  look["hoverlabel.bgcolor"] = card;
  look["hoverlabel.font.color"] = ink;
  look["legend.bgcolor"] = look["modebar.bgcolor"] = "rgba(0,0,0,0)";
  look["modebar.color"] = rule;
  look["modebar.activecolor"] = ink;
  for (const axis of [...axes(layout, "x"), ...axes(layout, "y")]) look[axis + ".gridcolor"] = look[axis + ".linecolor"] = rule;
  for (const axis of layout.scene ? ["xaxis", "yaxis", "zaxis"] : []) look[`scene.${axis}.gridcolor`] = look[`scene.${axis}.zerolinecolor`] = rule;
  return look;
}

function put(layout, changes) {
  for (const [path, value] of Object.entries(changes)) {
    const keys = path.split("."), last = keys.pop();
    keys.reduce((part, key) => part[key] = part[key] || {}, layout)[last] = value;
  }
  return layout;
}

// Of an absolute clock: ticks of the time axes at round steps, with UTC below the seconds.
const steps = [0.1, 0.2, 0.5, 1, 2, 5, 10, 20, 30, 60, 120, 300, 600, 1200, 1800, 3600, 7200, 14400, 21600, 43200, 86400];

function clocked(plot, layout, [low, high]) {
  const ticks = {};
  if (!layout.meta || layout.meta.clock === undefined) return ticks;
  const most = plot.clientWidth / 100, step = steps.find(each => (high - low) / each <= most) || 86400 * Math.ceil((high - low) / 86400 / most);
  const values = [], digits = step < 1 ? 1 : 0;
  for (let k = Math.ceil(low / step); k * step <= high; k++) values.push(k * step);
  const texts = values.map(value => `${value.toFixed(digits)}<br>${new Date(layout.meta.clock + 1000 * value).toISOString().slice(11, digits ? 21 : 19)}`);
  for (const axis of axes(layout, "x")) { ticks[axis + ".tickvals"] = values; ticks[axis + ".ticktext"] = texts; }
  return ticks;
}

const onceDrawn = [];  // functions of a figure and of what it was made from, which linked.js adds

async function draw(plot) {
  const figure = await unpacked("data-" + plot.id), layout = put(figure.layout, theme(figure.layout));
  const narrow = window.innerWidth < 700;
  if (narrow) {
    layout.margin.l = Math.min(layout.margin.l, 54);
    const eye = layout.scene && layout.scene.camera && layout.scene.camera.eye;
    for (const axis in eye) eye[axis] *= 1.6;  // all of it fits into the width
  }
  if (layout.xaxis && layout.xaxis.range) put(layout, clocked(plot, layout, layout.xaxis.range));
  plot.first = Object.fromEntries([...axes(layout, "x"), ...axes(layout, "y")].filter(axis => layout[axis].range).map(axis => [axis, [...layout[axis].range]]));
  await Plotly.newPlot(plot, figure.data, layout, {responsive: true, displayModeBar: narrow ? false : "hover", displaylogo: false, showSendToCloud: false, doubleClickDelay: 500,
    modeBarButtonsToRemove: ["toImage", "select2d", "lasso2d", "autoScale2d"]});
  offerPictures(plot);
  for (const each of onceDrawn) await each(plot);
}

const plain = text => text.normalize("NFKD").toLowerCase().replace(/[^a-z0-9]+/g, "-").replace(/^-+|-+$/g, "");
const headingOf = plot => [...plot.closest("figure").querySelector("h3").childNodes].map(part => part.textContent).join(", ");
const pictureName = plot => plain(headingOf(plot)) || plot.id;

// A figure on white with its heading, whatever the theme of the page: the text of an SVG, or the bytes of a PNG in base64.
function picture(plot, format) {
  const {data, layout: shown} = plot, layout = {...shown, ...JSON.parse(JSON.stringify(shown, (key, value) => ArrayBuffer.isView(value) ? undefined : value))};
  put(layout, theme(layout, ["#1f2933", "#d5dce3", "#ffffff"]));
  put(layout, {paper_bgcolor: "#ffffff", "title.text": headingOf(plot).replace(/&/g, "&amp;").replace(/</g, "&lt;"), "title.x": 0.01, "title.y": 0.985, "title.yanchor": "top", "title.font.size": 15, "margin.t": plot._fullLayout.margin.t + 26});
  const {width, height} = plot._fullLayout;
  return Plotly.toImage({data, layout}, {format, width, height: height + 26, scale: format === "png" ? 2 : 1, imageDataOnly: true});
}

async function savePicture(plot, format) {
  const content = await picture(plot, format), link = document.createElement("a");
  const blob = format === "svg" ? new Blob([content], {type: "image/svg+xml"}) : new Blob([Uint8Array.from(atob(content), letter => letter.charCodeAt(0))], {type: "image/png"});
  link.href = URL.createObjectURL(blob);
  link.download = `${pictureName(plot)}.${format}`;
  link.click();
  setTimeout(() => URL.revokeObjectURL(link.href), 1000);
}

function offerPictures(plot) {
  const offer = document.createElement("span");
  offer.className = "saving";
  for (const format of ["svg", "png"]) {
    const button = document.createElement("button");
    Object.assign(button, {type: "button", textContent: format.toUpperCase(), title: `Save this figure as ${format.toUpperCase()}`});
    button.addEventListener("click", () => savePicture(plot, format));
    offer.append(button);
  }
  plot.after(offer);
}

async function drawAll() {
  const script = document.createElement("script");
  script.textContent = new TextDecoder().decode(await inflated("plotly"));
  document.head.append(script);
  const waiting = new Set(plots);
  while (waiting.size) {
    const plot = plots.find(each => waiting.has(each) && near.has(each)) || waiting.values().next().value;
    waiting.delete(plot);
    try { await draw(plot); } catch (error) {
      plot.textContent = /map/.test(plot.dataset.kinds) ? "The map cannot be drawn: its tiles come from the network, which does not answer." : `This figure cannot be drawn: ${error.message}`;
    }
    await new Promise(done => setTimeout(done));
  }
  document.body.dataset.drawn = drawnPlots().length;
}

const drawnPlots = () => plots.filter(plot => plot.layout);
dark.addEventListener("change", () => drawnPlots().forEach(plot => Plotly.relayout(plot, theme(plot.layout))));
document.addEventListener("toggle", event => drawnPlots().filter(plot => event.target.open && event.target.contains(plot)).forEach(plot => Plotly.Plots.resize(plot)), true);
const watched = new IntersectionObserver(entries => {
  for (const entry of entries) near[entry.isIntersecting ? "add" : "delete"](entry.target);
  if (window.refresh) window.refresh();
}, {rootMargin: "300px 0px"});
plots.forEach(plot => watched.observe(plot));
// on paper all figures are as wide, whatever the window; page.css makes them smaller
window.addEventListener("beforeprint", () => drawnPlots().forEach(plot => Plotly.relayout(plot, {width: 830, autosize: false})));
window.addEventListener("afterprint", () => drawnPlots().forEach(plot => Plotly.relayout(plot, {width: null, autosize: true})));
if (window.DecompressionStream) setTimeout(drawAll);
else plots.forEach(plot => { plot.textContent = "This browser is too old to draw the figures: it cannot unpack them (DecompressionStream). Any browser since 2023 can."; });
