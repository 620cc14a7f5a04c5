// main.mjs: replays replay.bin through strapdown.wasm and compares it with what Python made of it.
//
//     node main.mjs [FILE [LARGEST]]
//
// Structs of strapdown.h lie in the memory of the module; all their numbers have eight bytes.
import { readFile } from "node:fs/promises";

const FILTER = $filter, NAV = $nav, COLUMNS = $columns, SOURCES = $sources; // bytes, or counts
const BOOKS = $books, ACCEPTED = $accepted, REJECTED = $rejected, STD = $std;
const END = 0n, SAMPLE = 1n, FIX = 2n, ROW = 3n;

const here = (name) => new URL(name, import.meta.url);
const module = await WebAssembly.compile(await readFile(here("strapdown.wasm")));
const env = Object.fromEntries(WebAssembly.Module.imports(module).map(({ name }) => [name, Math[name]]));
const { exports: c } = await WebAssembly.instantiate(module, { env });

const filter = (Number(c.__heap_base) + 15) & ~15, given = filter + FILTER;
c.memory.grow(Math.ceil((FILTER + 1024) / 65536));
const view = new DataView(c.memory.buffer);
const doubles = (at, count) => new Float64Array(c.memory.buffer, at, count);

const file = await readFile(process.argv[2] ?? here("replay.bin"));
const largest = Number(process.argv[3] ?? 1e-9);
let at = 0;
const whole = () => { at += 8; return file.readBigInt64LE(at - 8); };
const number = () => { at += 8; return file.readDoubleLE(at - 8); };
const lay = (count, place = given) => {
  for (let i = 0; i < count; i++) view.setFloat64(place + 8 * i, number(), true);
};
const must = (result, what) => { if (result < 0) { console.log(what); process.exit(2); } };

const [, values, sources, parameters, columns] = Array.from({ length: 5 }, () => Number(whole()));
if (sources !== SOURCES || columns !== COLUMNS) must(-1, "replay.bin is of another export");
lay(values);
must(c.strapdown_start(filter, given), "the filter refuses its start");
for (let source = 0; source < sources; source++) {
  lay(parameters);
  must(c.strapdown_source(filter, source, given, number()), "the filter refuses a source");
}

function difference(got, want) {
  let worst = 0;
  for (let i = 0; i < 15; i++) {
    const scale = i < 2 ? 6.4e6 : i >= 6 && i < 9 ? 2 : 1;
    const column = i < 6 ? 1 + i : 2 + i; // the scalar part of the quaternion is left out
    const std = want[STD + i];
    if (!(std > 0)) continue;
    const d = Math.max(scale * Math.abs(got[column] - want[column]), Math.abs(got[STD + i] - std)) / std;
    if (!(d <= worst)) worst = d;
  }
  return worst;
}

let samples = 0, rows = 0, worst = 0, notTaken = 0, kind;
const begin = performance.now();
while ((kind = whole()) !== END) {
  if (kind === FIX) {
    const source = Number(whole()), t = number();
    lay(6);
    if (c.strapdown_fix(filter, source, t, given, given + 24) < 0) notTaken++;
  } else if (kind === SAMPLE) {
    const t = number(), dt = number();
    lay(6);
    samples++;
    must(c.strapdown_sample(filter, t, dt, given, given + 24), "the filter stopped, or refuses a sample");
  } else {
    const want = Array.from({ length: COLUMNS }, number);
    const d = difference(doubles(filter + NAV, COLUMNS), want);
    if (!(d <= worst)) worst = d;
    rows++;
  }
}
const spent = performance.now() - begin;
for (let i = 0; i < SOURCES; i++)
  console.log(`source $${i}: $${view.getBigInt64(filter + ACCEPTED + BOOKS * i, true)} accepted, ` +
    `$${view.getBigInt64(filter + REJECTED + BOOKS * i, true)} rejected`);
console.log(`$${samples} samples, $${notTaken} fixes not taken, $${FILTER} bytes of state, ` +
  `$${((1000 * spent) / samples).toFixed(1)} us per sample`);
console.log(`$${rows} rows; largest difference $${worst.toPrecision(3)} standard deviations`);
process.exit(rows > 0 && worst <= largest ? 0 : 1);
