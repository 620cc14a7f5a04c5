// The bar that plays the recording: moves the cursor, and says where the vehicle was and how it moved.
const bar = document.getElementById("playback");
const slider = bar.querySelector("input"), button = bar.querySelector("button"), rate = bar.querySelector("[name=rate]"), which = bar.querySelector("[name=solution]");
let tracks = null, playing = false, since = 0;

const digits = (value, unit, std) => Number.isFinite(value) ? `${value.toFixed(Math.abs(value) < 100 ? 2 : 1)}${Number.isFinite(std) ? ` ± ${Number(std.toPrecision(2))}` : ""} ${unit}` : "–";

function tell(t) {
  if (!tracks || t === null) return;
  const {clock, solutions} = tracks, rows = solutions[which ? which.value : 0], row = rowAt(rows.t, t);
  slider.value = t;
  const day = clock === null ? "" : new Date(clock + 1000 * t).toISOString().replace("T", " ").slice(0, 21) + " UTC";
  bar.querySelector("output").textContent = `${t.toFixed(1)} s`;
  bar.querySelector(".utc").textContent = day;
  slider.setAttribute("aria-valuetext", `${t.toFixed(1)} s ${day}`);
  for (const cell of bar.querySelectorAll("dd")) {
    const values = rows[cell.dataset.of], stds = rows["std " + cell.dataset.of];
    cell.textContent = values ? digits(values[row], cell.dataset.unit, stds ? stds[row] : NaN) : "–";
  }
}
window.told = tell;

function play(on) {
  playing = on;
  button.textContent = on ? "⏸" : "▶";
  button.setAttribute("aria-label", on ? "Pause" : "Play");
  since = performance.now();
  if (on) { if (+slider.value >= +slider.max) slider.value = slider.min; requestAnimationFrame(frame); }
}

function frame(now) {
  if (!playing) return;
  const t = Math.min(+slider.max, (held === null ? +slider.min : held) + (now - since) / 1000 * rate.value);
  since = now;
  hold(t);
  if (t >= +slider.max) play(false); else requestAnimationFrame(frame);
}

button.addEventListener("click", () => { held = +slider.value; play(!playing); });
slider.addEventListener("input", () => hold(+slider.value));
bar.querySelector("[name=all]").addEventListener("click", () => show(null));
if (which) which.addEventListener("change", () => tell(+slider.value));
document.addEventListener("keydown", event => {
  if (event.target.closest("input, select, button, summary, a, .plot, .scroll") || event.ctrlKey || event.metaKey || event.altKey) return;
  const step = {ArrowLeft: -0.01, ArrowRight: 0.01}[event.key];
  if (event.key === " ") { held = +slider.value; play(!playing); }
  else if (step) hold(Math.max(+slider.min, Math.min(+slider.max, +slider.value + step * (slider.max - slider.min))));
  else return;
  event.preventDefault();
});
if (window.DecompressionStream) unpacked("playback-data").then(found => { tracks = found; bar.hidden = false; document.body.classList.add("plays"); tell(+slider.value); });
