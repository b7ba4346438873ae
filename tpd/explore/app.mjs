// The page: controls, figures, tables of results, and the block that rocks.

import { Motion } from "./rocking.mjs";
import { bodyOf, limitShares, parameters, reachOf, upliftMargin } from "./pendulum.mjs";
import { decode, errorAt, lookUp, place } from "./orbits.mjs";

const INK = "#1a1a1a", GREY = "#7a7a7a", BLUE = "#1f5fa8", ORANGE = "#d9822b";
const SIMULATED = "simulated in the browser", EXACT = "exact", PERIODS = 12;
const COLUMNS = 72, ROWS = 54; // Samples of the map.

const data = JSON.parse(document.getElementById("data").textContent);
const { scene, limits, ground, tables } = data, harmonic = !ground;
const grid = harmonic && decode(tables.grid), without = harmonic && decode(tables.without);
const recommended = harmonic && tables.recommended ? decode(tables.recommended) : null;
const eta = ground && forcingOf(ground), duration = ground ? ground.piece * ground.count : 0;
const state = { play: true, speed: 1, push: 0 };
const byId = (id) => document.getElementById(id);
const format = (x, digits = 3) => (Number.isFinite(x) ? String(Number(x.toPrecision(digits))) : "unknown");
const degrees = (tilt) => `${format((tilt * scene.nu * 180) / Math.PI, 2)}°`;

/** Return the base acceleration over its peak as a function of time in s; zero after the motion. */
function forcingOf(motion) {
  const bytes = Uint8Array.from(atob(motion.data), (c) => c.charCodeAt(0)), { order, piece } = motion;
  const powers = new Float32Array(bytes.buffer);
  motion.count = powers.length / order;
  return (time) => {
    const i = Math.floor(time / piece), x = time / piece - i;
    if (!(i >= 0 && i < motion.count)) return 0;
    let value = 0;
    for (let n = order - 1; n >= 0; n--) value = value * x + powers[i * order + n];
    return value;
  };
}

// Controls -----------------------------------------------------------------------------------------------------

const axisOf = (name) => {
  const { values, log } = tables.grid.axes.find((axis) => axis.name === name);
  return { low: values[0], high: values.at(-1), log };
};
const ranged = (name, field) => (harmonic ? axisOf(name) : { low: data.ranges[field][0], high: data.ranges[field][1], log: field !== "damping" });
const controls = [
  { name: "mass", label: "Mass of the bob", unit: "kg", group: "pendulum", value: data.start.mass, ...ranged("pendulum_mass", "mass") },
  { name: "length", label: "Length of the pendulum", unit: "m", group: "pendulum", value: data.start.length, ...ranged("pendulum_length", "length") },
  { name: "damping", label: "Damping ratio of the hinge", unit: "", group: "pendulum", value: data.start.damping_ratio, ...ranged("pendulum_damping", "damping") },
  ...(harmonic ? [
    { name: "frequency", label: "Frequency", unit: "Hz", group: "excitation", value: data.motion.frequency, ...axisOf("frequency") },
    { name: "amplitude", label: "Amplitude", unit: "m", group: "excitation", value: data.motion.amplitude, ...axisOf("amplitude") },
  ] : [{ name: "scale", label: `Factor on ${ground.name}`, unit: "", group: "excitation", value: 1, low: 0.1, high: 5, log: true }]),
];

/** Return the place of a value on a slider of 1000 steps. */
function toSlider({ low, high, log }, value) {
  return 1000 * (log ? Math.log(value / low) / Math.log(high / low) : (value - low) / (high - low));
}

function fromSlider({ low, high, log }, place) {
  const share = place / 1000;
  // Four digits are enough for a slider, and they are what the field beside it shows.
  return Number((log ? low * (high / low) ** share : low + (high - low) * share).toPrecision(4));
}

function addControl(control) {
  const { name, label, unit, group, low, high } = control, row = document.createElement("div");
  row.className = "control";
  row.innerHTML = `<label for="${name}"></label><input type="range" id="${name}-slider" min="0" max="1000" step="any">
    <input type="number" id="${name}" step="any" min="${low}" max="${high}"><span>${unit}</span>`;
  byId(group).append(row);
  row.querySelector("label").textContent = `${label} (${format(low)} to ${format(high)} ${unit})`.replace(" )", ")");
  [control.slider, control.field] = row.querySelectorAll("input");
  control.slider.step = 1;
  control.slider.setAttribute("aria-label", unit ? `${label}, ${unit}` : label);
  control.slider.addEventListener("input", () => set(name, fromSlider(control, control.slider.valueAsNumber)));
  control.field.addEventListener("change", () => set(name, control.field.valueAsNumber));
}

/** Set one value within its range, and show all that depends on it. */
function set(name, value) {
  const control = controls.find((c) => c.name === name);
  if (Number.isFinite(value)) state[name] = Math.min(Math.max(value, control.low), control.high);
  show(control);
  update();
}

function show(control) {
  const value = state[control.name];
  control.slider.value = toSlider(control, value);
  control.slider.setAttribute("aria-valuetext", `${format(value, 4)} ${control.unit}`);
  control.field.value = format(value, 6);
}

// Values -------------------------------------------------------------------------------------------------------

const pendulumOf = () => ({ mass: state.mass, length: state.length, damping: state.damping });
const motionOf = () => (harmonic ? { amplitude: state.amplitude, frequency: state.frequency }
  : { peak: ground.peak * state.scale, frequency: scene.rate / (2 * Math.PI) });

/** Return steady tilts and bob angle at a frequency, each as { value, error, source }. */
function steady(frequency) {
  const corners = place(grid, [state.mass, state.length, state.damping, frequency, state.amplitude]);
  const alone = place(without, [frequency, state.amplitude]);
  const read = (table, name, at, bound = name) => ({ ...lookUp(table, name, at), error: bound ? errorAt(table, bound, at) : NaN });
  return {
    tilt: read(grid, "tilt", corners),
    swing: read(grid, "swing", corners),
    unstable: read(grid, "unstable", corners, ""),
    without: read(without, "tilt", alone),
    withoutUnstable: read(without, "unstable", alone, ""),
  };
}

/** Return the largest values of one motion from the start of the page: its first periods, or the ground motion. */
function simulate(pendulum) {
  const motion = motionFrom(pendulum), end = harmonic ? (PERIODS * 2 * Math.PI * scene.rate) / (2 * Math.PI * state.frequency)
    : (duration + 5) * scene.rate;
  const largest = { tilt: 0, swing: 0, apart: 0, tension: 0, rate: 0 };
  motion.advance(end, ({ y, tension }) => {
    largest.tilt = Math.max(largest.tilt, Math.abs(y[0]) / scene.nu);
    largest.swing = Math.max(largest.swing, Math.abs(y[1]));
    largest.apart = Math.max(largest.apart, Math.abs(y[1] - y[0]));
    largest.tension = Math.max(largest.tension, tension);
    largest.rate = Math.max(largest.rate, Math.abs(y[3] - y[2]) * scene.rate);
  });
  return { ...largest, overturned: motion.overturned };
}

function motionFrom(pendulum) {
  const p = parameters(scene, motionOf(), pendulum), start = [state.push * scene.nu, 0, 0, 0];
  return harmonic ? new Motion(p, start) : new Motion(p, start, (tau) => eta(tau / scene.rate));
}

/** Return the stored validation runs that hold for this pendulum and base motion, or null. */
function runsNear(pendulum) {
  const at = [pendulum.mass, pendulum.length, pendulum.damping];
  const same = harmonic ? ["frequency", "amplitude"].every((name) => Math.abs(state[name] / data.motion[name] - 1) < 1e-6)
    : state.scale === 1;
  const isNear = ({ low, high }) => at.every((x, i) => x >= low[i] * (1 - 1e-6) && x <= high[i] * (1 + 1e-6));
  return same ? data.runs.findLast(isNear) ?? null : null;
}

// Tables -------------------------------------------------------------------------------------------------------

function valueOf({ value, error, source }, unit, digits = 3) {
  if (source === "none") return "no attracting symmetric orbit";
  if (source === "not interpolated") return "–";
  return `${format(value, digits)}${source === "interpolated" ? ` ± ${format(error, 1)}` : ""}${unit}`;
}

function fill(id, rows) {
  const body = byId(id).tBodies[0];
  body.replaceChildren(...rows.map(([name, label, value, source, exceeded]) => {
    const row = document.createElement("tr"), head = document.createElement("th");
    head.scope = "row";
    head.textContent = label;
    row.dataset.name = name;
    row.className = exceeded ? "exceeded" : "";
    const cells = [value, source].map((text) => Object.assign(document.createElement("td"), { textContent: text }));
    row.append(head, ...cells);
    return row;
  }));
}

function runRows(runs) {
  const percent = (x) => `${format(100 * x, 2)} %`;
  if (!runs) {
    const away = "the validation runs of the report hold near its designs, at its base motion";
    return [["overturned", "Share overturned", "not simulated", away], ["mean", "Mean tilt", "not simulated", away]];
  }
  const [share, alone] = runs.overturned.map(([mean, low, high]) => `${percent(mean)} (${percent(low)} to ${percent(high)})`);
  const { mean, low, high } = runs.benefit;
  return [
    ["overturned", "Share overturned (95 % interval)", `${share}; without ${alone}`, `validation runs: ${runs.description}`],
    ["mean", "Mean tilt over the slenderness", `${format(runs.mean[0])}; without ${format(runs.mean[1])}: ${percent(mean)} less (${percent(low)} to ${percent(high)})`, "validation runs"],
  ];
}

function showResults(now, shares, largest, alone, runs) {
  const pendulum = pendulumOf(), body = bodyOf(scene, pendulum), g = scene.gravity;
  const damper = 2 * pendulum.damping * pendulum.mass * pendulum.length ** 1.5 * Math.sqrt(g);
  const period = harmonic ? `first ${PERIODS} periods` : "whole motion";
  const outcome = (motion) => (motion.overturned ? "overturns" : `${format(motion.tilt)} (${degrees(motion.tilt)})`);
  const rows = [];
  if (harmonic) {
    const rests = upliftMargin(parameters(scene, motionOf(), pendulum));
    const wall = 0.5 * scene.cavity - (body ? reachOf(scene, body, now.swing.value + now.tilt.value * scene.nu) : 0);
    const clearance = { ...now.swing, value: wall, error: (body?.rod ?? 0) * (now.swing.error + now.tilt.error * scene.nu) };
    rows.push(["tilt", "Steady tilt over the slenderness", valueOf(now.tilt, ""), now.tilt.source]);
    rows.push(["without", "Steady tilt without a pendulum", valueOf(now.without, ""), now.without.source]);
    rows.push(["swing", "Steady bob angle", valueOf(now.swing, " rad"), now.swing.source]);
    rows.push(["rest", "Resting block", rests > 0 ? "stays at rest once the bob has settled" : "lifts", EXACT]);
    if (scene.cavity) rows.push(["clearance", "Clearance to the wall", valueOf(clearance, " m"), clearance.source]);
  }
  rows.push(...runRows(runs));
  rows.push(["largest", `Largest tilt, ${period}`, outcome(largest), SIMULATED]);
  rows.push(["largest-without", "The same without a pendulum", outcome(alone), SIMULATED]);
  rows.push(["tension", "Largest force in the rod", `${format((largest.tension * pendulum.mass * g) / 1000)} kN`, `${SIMULATED}, ${period}`]);
  rows.push(["moment", "Largest moment of the damper", `${format(damper * largest.rate)} N m`, `${SIMULATED}, ${period}`]);
  rows.push(["natural", "Natural frequency", `${format(Math.sqrt(g / pendulum.length) / (2 * Math.PI))} Hz`, `${EXACT}, undamped, block at rest`]);
  rows.push(["damper", "Damping of the hinge", `${format(damper)} N m s/rad`, EXACT]);
  rows.push(["bob", "Bob as built", body ? `${format(body.mass)} kg, ${format(2 * body.radius)} m wide` : "no body swings as this point", EXACT]);
  rows.push(["rod", "Rod to the centre of the bob", body ? `${format(body.rod)} m` : "–", EXACT]);
  fill("results", rows);
  const source = harmonic ? now.swing.source : "bob at rest";
  const still = ["mass", "thickness", "depth"];
  fill("limits", shares.map(({ name, label, share }) =>
    [name, label, `${format(100 * share)} %${share > 1 ? ": exceeded" : ""}`, still.includes(name) ? EXACT : source, share > 1]));
}

// Figures ------------------------------------------------------------------------------------------------------

/** Return the context of a cleared canvas, its width and its height in CSS pixels. */
function cleared(id) {
  const canvas = byId(id), ratio = window.devicePixelRatio || 1, width = canvas.clientWidth;
  const height = (canvas.dataset.height ??= canvas.getAttribute("height")) * 1;
  canvas.style.height = `${height}px`;
  // A canvas that gets a new size allocates memory: most frames keep it.
  if (canvas.width !== Math.round(width * ratio)) [canvas.width, canvas.height] = [Math.round(width * ratio), height * ratio];
  const context = canvas.getContext("2d");
  context.setTransform(ratio, 0, 0, ratio, 0, 0);
  context.clearRect(0, 0, width, height);
  context.font = "12px system-ui, sans-serif";
  return { context, width, height };
}

/** Return round numbers between two values. */
function ticks(low, high, log = false) {
  if (log) return [1, 2, 5].flatMap((n) => Array.from({ length: 16 }, (_, i) => n * 10 ** (i - 8))).sort((a, b) => a - b)
    .filter((x) => x >= low && x <= high);
  const step = [1, 2, 5, 10].map((n) => n * 10 ** Math.floor(Math.log10((high - low) / 5))).find((s) => (high - low) / s <= 6);
  return Array.from({ length: 8 }, (_, i) => Number((Math.ceil(low / step) * step + i * step).toPrecision(6))).filter((x) => x <= high);
}

/** Draw axes, and return the places of values on them. */
function drawAxes({ context: c, width, height }, x, y) {
  const left = 46, right = width - 12, top = 10, bottom = height - 34;
  const scaled = ({ low, high, log }, from, to) => (value) =>
    from + (to - from) * (log ? Math.log(value / low) / Math.log(high / low) : (value - low) / (high - low));
  const px = scaled(x, left, right), py = scaled(y, bottom, top);
  c.strokeStyle = c.fillStyle = INK;
  c.lineWidth = 1;
  c.strokeRect(left, top, right - left, bottom - top);
  c.textAlign = "center";
  for (const value of ticks(x.low, x.high, x.log)) c.fillText(format(value), px(value), bottom + 14);
  c.fillText(x.label, (left + right) / 2, height - 4);
  c.textAlign = "right";
  for (const value of ticks(y.low, y.high, y.log)) c.fillText(format(value), left - 4, py(value) + 4);
  c.save();
  c.translate(11, (top + bottom) / 2);
  c.rotate(-Math.PI / 2);
  c.textAlign = "center";
  c.fillText(y.label, 0, 0);
  c.restore();
  return { px, py, left, right, top, bottom };
}

/** Draw a line through points; a point without a number interrupts it. */
function drawLine(c, points, color, width, dash = []) {
  c.strokeStyle = color;
  c.lineWidth = width;
  c.setLineDash(dash);
  c.beginPath();
  let on = false;
  for (const [x, y] of points) {
    if (Number.isFinite(y)) (on ? c.lineTo : c.moveTo).call(c, x, y);
    on = Number.isFinite(y);
  }
  c.stroke();
  c.setLineDash([]);
}

function drawResponse(now) {
  const view = cleared("response"), { context: c } = view, range = axisOf("frequency");
  const fine = tables.without.axes[0].values, most = Math.max(tables.grid.fields.tilt.scale, tables.without.fields.tilt.scale);
  const { px, py, top, bottom } = drawAxes(view, { ...range, label: "frequency (Hz)" },
    { low: 0, high: Math.min(1, 1.1 * most), label: "tilt / slenderness" });
  const curve = (table, name, point) => fine.map((f) => [px(f), py(lookUp(table, name, place(table, point(f))).value)]);
  const alone = (f) => [f, state.amplitude], own = (f) => [state.mass, state.length, state.damping, f, state.amplitude];
  drawLine(c, curve(without, "tilt", alone), GREY, 2.5);
  drawLine(c, curve(without, "unstable", alone), GREY, 1.5, [2, 4]);
  if (recommended) drawLine(c, curve(recommended, "tilt", alone), INK, 1, [6, 4]);
  drawLine(c, curve(grid, "tilt", own), BLUE, 2.5);
  drawLine(c, curve(grid, "unstable", own), BLUE, 1.5, [2, 4]);
  drawLine(c, [[px(state.frequency), top], [px(state.frequency), bottom]], ORANGE, 1, [3, 3]);
  if (Number.isFinite(now.tilt.value)) drawMark(c, px(state.frequency), py(now.tilt.value), "user");
  byId("response").setAttribute("aria-label", `Steady tilt against frequency. ${sentence(now)}`);
}

function drawMark(c, x, y, kind) {
  c.beginPath();
  if (kind === "user") c.arc(x, y, 6, 0, 7);
  else for (let i = 0; i < 10; i++) c.lineTo(x + (i % 2 ? 4 : 9) * Math.sin((i * Math.PI) / 5), y - (i % 2 ? 4 : 9) * Math.cos((i * Math.PI) / 5));
  c.closePath();
  [c.fillStyle, c.strokeStyle, c.lineWidth] = [kind === "user" ? ORANGE : "white", INK, 1.5];
  c.fill();
  c.stroke();
}

// The body of each sample of the map depends on nothing that the sliders move.
const samples = harmonic ? samplesOfMap() : [];

function samplesOfMap() {
  const [mass, length] = [axisOf("pendulum_mass"), axisOf("pendulum_length")], out = [];
  const at = ({ low, high }, share) => low * (high / low) ** share;
  for (let j = 0; j < ROWS; j++) for (let i = 0; i < COLUMNS; i++) {
    const pendulum = { mass: at(mass, (i + 0.5) / COLUMNS), length: at(length, 1 - (j + 0.5) / ROWS), damping: 0 };
    const corners = place({ axes: grid.axes.slice(0, 2), strides: [grid.axes[1].values.length, 1] }, [pendulum.mass, pendulum.length]);
    out.push({ pendulum, corners, body: bodyOf(scene, pendulum) });
  }
  return out;
}

/** Return a field at all nodes of mass and length, interpolated in damping, frequency and amplitude. */
function slice(name) {
  const [masses, lengths] = grid.axes;
  return masses.values.flatMap((mass) => lengths.values.map((length) =>
    lookUp(grid, name, place(grid, [mass, length, state.damping, state.frequency, state.amplitude])).value));
}

function drawMap(now) {
  const view = cleared("map"), { context: c } = view, [mass, length] = [axisOf("pendulum_mass"), axisOf("pendulum_length")];
  const tilts = slice("tilt"), swings = slice("swing"), most = Math.max(...tilts.filter(Number.isFinite), 1e-9);
  const pixels = new ImageData(COLUMNS, ROWS), regions = {};
  const mean = (values, corners) => corners.reduce((sum, [index, weight]) => sum + weight * values[index], 0);
  const worst = samples.map(({ pendulum, corners, body }, n) => {
    const tilt = mean(tilts, corners), swing = mean(swings, corners), known = Number.isFinite(tilt);
    // Light is a small tilt, dark a large one; a place without a value stays white.
    const shade = known ? 245 - (175 * tilt) / most : 255;
    pixels.data.set(known ? [shade - 25, shade - 8, shade + 8, 255] : [255, 255, 255, 255], 4 * n);
    const motion = known ? { tilt, swing, without: now.without.value } : null;
    return limitShares(scene, limits, pendulum, motion, body).filter(({ share }) => share > 1).sort((a, b) => b.share - a.share)[0]?.name;
  });
  const { px, py, left, right, top, bottom } = drawAxes(view, { ...mass, label: "mass of the bob (kg)" }, { ...length, label: "length (m)" });
  const picture = drawMap.picture ??= Object.assign(document.createElement("canvas"), { width: COLUMNS, height: ROWS });
  picture.getContext("2d").putImageData(pixels, 0, 0);
  c.imageSmoothingEnabled = true;
  c.drawImage(picture, left, top, right - left, bottom - top);
  // Each limit has hatching of its own direction, so that the regions differ without colours.
  const [wide, high] = [(right - left) / COLUMNS, (bottom - top) / ROWS];
  worst.forEach((name, n) => {
    if (name) (regions[name] ??= []).push([left + (n % COLUMNS) * wide, top + Math.floor(n / COLUMNS) * high]);
  });
  Object.entries(regions).forEach(([, places], i) => {
    c.save();
    c.beginPath();
    for (const [x, y] of places) c.rect(x, y, wide + 0.5, high + 0.5);
    c.clip();
    c.fillStyle = "rgba(255, 255, 255, 0.45)";
    c.fillRect(left, top, right - left, bottom - top);
    hatch(c, left, top, right, bottom, (Math.PI / 4) * (1 + 2 * i) + (i > 1 ? Math.PI / 4 : 0));
    c.restore();
  });
  for (const [name, places] of Object.entries(regions)) labelRegion(c, name, places);
  const { space } = data;
  c.setLineDash([5, 4]);
  [c.strokeStyle, c.lineWidth] = [INK, 1];
  c.strokeRect(px(space.mass[0]), py(space.length[1]), px(space.mass[1]) - px(space.mass[0]), py(space.length[0]) - py(space.length[1]));
  c.setLineDash([]);
  c.strokeRect(left, top, right - left, bottom - top);
  if (data.recommended) drawMark(c, px(data.recommended.mass), py(data.recommended.length), "recommended");
  drawMark(c, px(state.mass), py(state.length), "user");
  drawMap.at = { px, py, left, right, top, bottom, mass, length };
  byId("map-caption").textContent = `At ${format(state.frequency, 4)} Hz, ${format(state.amplitude, 4)} m and a damping ratio of `
    + `${format(state.damping)} (interpolated). Lightest: 0; darkest: ${format(most)} of the slenderness; white: no attracting `
    + "symmetric orbit, or not interpolated. Hatched: a limit is exceeded. Dashed frame: range of the search. Circle: your "
    + `pendulum.${data.recommended ? " Star: recommended pendulum." : ""}`;
}

function hatch(c, left, top, right, bottom, angle) {
  const size = right - left + bottom - top;
  c.translate((left + right) / 2, (top + bottom) / 2);
  c.rotate(angle);
  [c.strokeStyle, c.lineWidth] = ["rgba(26, 26, 26, 0.55)", 1];
  c.beginPath();
  for (let x = -size; x < size; x += 7) [c.moveTo(x, -size), c.lineTo(x, size)];
  c.stroke();
}

function labelRegion(c, name, places) {
  if (places.length < 0.02 * COLUMNS * ROWS) return;
  const middle = [0, 1].map((k) => places.map((p) => p[k]).sort((a, b) => a - b)[places.length >> 1]);
  // The label stands on the sample of the region that is nearest to its middle.
  const [x, y] = places.reduce((a, b) => (Math.hypot(a[0] - middle[0], a[1] - middle[1]) < Math.hypot(b[0] - middle[0], b[1] - middle[1]) ? a : b));
  [c.textAlign, c.strokeStyle, c.lineWidth, c.fillStyle] = ["center", "white", 4, INK];
  c.strokeText(name.replace("_", " "), x, y);
  c.fillText(name.replace("_", " "), x, y);
}

/** Draw the block with its pendulum at angles, in metres from the middle of its base. */
function drawBlock(c, body, tilt, swing, color, walls = true) {
  const a = scene.width / 2, h = 2 * scene.halfHeight, side = Math.sign(tilt);
  c.save();
  c.translate(side * a, 0);
  c.rotate(tilt);
  c.translate(-side * a, 0);
  [c.fillStyle, c.strokeStyle] = ["#e4e4e4", INK];
  c.fillRect(-a, -h, 2 * a, h);
  c.strokeRect(-a, -h, 2 * a, h);
  if (walls && scene.cavity) {
    c.fillStyle = "white";
    c.fillRect(-scene.cavity / 2, -h, scene.cavity, h);
    c.strokeRect(-scene.cavity / 2, -h, scene.cavity, h);
  }
  if (body) {
    c.translate(0, -h);
    // The angle of the bob is measured from the vertical, and the block is tilted.
    c.rotate(swing - tilt);
    [c.strokeStyle, c.fillStyle] = [color, color];
    c.beginPath();
    c.moveTo(0, 0);
    c.lineTo(0, body.rod);
    c.stroke();
    c.beginPath();
    if (scene.bob.shape === "ball") c.arc(0, body.rod, body.radius, 0, 7);
    else c.rect(-body.radius, body.rod - body.half, 2 * body.radius, 2 * body.half);
    c.fill();
  }
  c.restore();
}

function drawDesign(now, largest) {
  const { context: c, width, height } = cleared("drawing"), body = bodyOf(scene, pendulumOf()), h = 2 * scene.halfHeight;
  const known = harmonic && Number.isFinite(now.swing.value), angle = known ? now.swing.value : Math.min(largest.swing, Math.PI / 2);
  byId("angle-source").textContent = known ? `steady (${now.swing.source})` : SIMULATED;
  const whole = Math.min((height - 20) / h, (0.4 * width) / scene.width);
  const deep = body ? 1.25 * (body.rod + body.half) : state.length, near = Math.min((height - 40) / deep, (0.5 * width) / (1.1 * scene.width));
  const part = (x, y, scale, poses) => {
    c.save();
    c.translate(x, y);
    c.scale(scale, scale);
    c.lineWidth = 1.5 / scale;
    for (const [swing, color] of poses) drawBlock(c, body, 0, swing, color, swing === poses[0][0]);
    c.restore();
  };
  part(0.22 * width, height - 10, whole, [[0, BLUE]]);
  c.save();
  c.beginPath();
  c.rect(0.46 * width, 10, 0.54 * width, height - 10);
  c.clip();
  const a = scene.width / 2, middle = 0.73 * width, top = 24;
  [c.fillStyle, c.strokeStyle, c.lineWidth] = ["#e4e4e4", INK, 1.5];
  c.fillRect(middle - a * near, top, 2 * a * near, height);
  c.strokeRect(middle - a * near, top, 2 * a * near, height + 9);
  const inside = (scene.cavity ?? 0) * near;
  c.fillStyle = "white";
  c.fillRect(middle - inside / 2, top, inside, height);
  if (inside) c.strokeRect(middle - inside / 2, top, inside, height + 9);
  if (body) for (const [swing, color] of [[-angle, "#a9c3df"], [angle, "#a9c3df"], [0, BLUE]]) {
    c.save();
    c.translate(middle, top);
    c.scale(near, near);
    c.rotate(swing);
    [c.strokeStyle, c.fillStyle, c.lineWidth] = [color, color, 1.5 / near];
    c.beginPath();
    c.moveTo(0, 0);
    c.lineTo(0, body.rod);
    c.stroke();
    c.beginPath();
    if (scene.bob.shape === "ball") c.arc(0, body.rod, body.radius, 0, 7);
    else c.rect(-body.radius, body.rod - body.half, 2 * body.radius, 2 * body.half);
    c.fill();
    c.restore();
  }
  c.restore();
  c.fillStyle = INK;
  c.textAlign = "center";
  if (body) c.fillText(`rod ${format(body.rod)} m, bob ${format(2 * body.radius)} m wide`, middle, 16);
}

// The block that rocks -----------------------------------------------------------------------------------------

let motions = [], traces = [[], []], clock = 0, before = 0, frames = [];

function restart() {
  motions = [motionFrom(null), motionFrom(pendulumOf())];
  traces = [[], []];
  clock = 0;
}

/** Show one frame of the animation; `time` is in ms. */
function frame(time) {
  frames = [...frames.filter((t) => t > time - 1000), time];
  // A tab that was hidden does not catch up.
  const passed = Math.min((time - before) / 1000, 0.1);
  before = time;
  if (state.play) {
    clock += passed * state.speed;
    motions.forEach((motion, i) => {
      motion.advance(clock * scene.rate);
      traces[i].push([clock, motion.y[0] / scene.nu]);
    });
    if (ground && clock > duration + 5) restart();
    drawMotions();
  }
  requestAnimationFrame(frame);
}

function drawMotions() {
  const body = bodyOf(scene, pendulumOf()), h = 2 * scene.halfHeight;
  ["without", "with"].forEach((name, i) => {
    const { context: c, width, height } = cleared(`block-${name}`), motion = motions[i], tilt = motion.y[0];
    const scale = Math.min((height - 30) / h, width / (1.6 * h + 2 * scene.width));
    const shift = harmonic ? -state.amplitude * Math.sin(2 * Math.PI * state.frequency * clock) : 0;
    c.translate(width / 2 + shift * scale, height - 14);
    c.scale(scale, scale);
    c.lineWidth = 1.5 / scale;
    drawBlock(c, i ? body : null, Math.abs(tilt) < Math.PI / 2 ? tilt : (Math.sign(tilt) * Math.PI) / 2, motion.y[1], BLUE);
    drawLine(c, [[-h, 0], [h, 0]], INK, 2.5 / scale);
    byId(`state-${name}`).textContent = motion.overturned ? "The block has overturned." : `Tilt ${degrees(tilt / scene.nu)} at ${clock.toFixed(1)} s.`;
  });
  drawTrace();
}

function drawTrace() {
  const span = harmonic ? PERIODS / state.frequency : duration + 5, from = Math.max(0, clock - span), view = cleared("trace");
  traces = traces.map((trace) => (trace.length && trace[0][0] < from - 0.5 ? trace.filter(([t]) => t >= from) : trace));
  const most = Math.max(0.1, ...traces.flatMap((trace) => trace.map(([, tilt]) => Math.min(1.2, Math.abs(tilt)))));
  const { px, py } = drawAxes(view, { low: from, high: from + span, label: "time (s)" }, { low: -1.1 * most, high: 1.1 * most, label: "tilt" });
  const points = (trace) => trace.filter(([t]) => t >= from).map(([t, tilt]) => [px(t), py(Math.max(-1.1 * most, Math.min(1.1 * most, tilt)))]);
  drawLine(view.context, points(traces[0]), GREY, 1.5, [5, 3]);
  drawLine(view.context, points(traces[1]), BLUE, 1.8);
}

// Everything together ------------------------------------------------------------------------------------------

function sentence(now) {
  const at = harmonic ? `Steady tilt ${valueOf(now.tilt, "")} with your pendulum, ${valueOf(now.without, "")} without.` : "";
  const over = sentence.exceeded.length ? `Limits exceeded: ${sentence.exceeded.join(", ")}.` : "All limits shown are kept.";
  return `${at} ${over}`;
}
sentence.exceeded = [];

function update() {
  const begin = performance.now(), pendulum = pendulumOf(), now = harmonic ? steady(state.frequency) : {};
  const known = harmonic && Number.isFinite(now.tilt.value);
  const motion = known ? { tilt: now.tilt.value, swing: now.swing.value, without: now.without.value } : null;
  const shares = limitShares(scene, limits, pendulum, motion), largest = simulate(pendulum), alone = simulate(null);
  sentence.exceeded = shares.filter(({ share }) => share > 1).map(({ label }) => label);
  showResults(now, shares, largest, alone, runsNear(pendulum));
  if (harmonic) [drawResponse(now), drawMap(now)];
  drawDesign(now, largest);
  restart();
  drawMotions();
  // A screen reader hears the result once the slider has come to rest.
  clearTimeout(update.timer);
  update.timer = setTimeout(() => (byId("summary").textContent = sentence(now)), 400);
  update.duration = performance.now() - begin;
}

function begin() {
  const title = data.title ? `${data.title}: explore the design` : "Explore the design";
  byId("title").textContent = document.title = title;
  byId("verdict").textContent = data.verdict;
  byId("version").textContent = `Written by tpd ${data.version}.`;
  byId("other-limits").textContent = data.other_limits.length ? `Not evaluated on this page: ${data.other_limits.join(", ")}.` : "";
  if (ground) for (const id of ["response-figure", "map-figure"]) byId(id).hidden = true;
  controls.forEach(addControl);
  const first = () => controls.forEach((control) => ((state[control.name] = control.value), show(control)));
  first();
  byId("reset").addEventListener("click", () => (first(), update()));
  byId("play").addEventListener("click", (event) => (event.target.textContent = (state.play = !state.play) ? "Pause" : "Play"));
  byId("restart").addEventListener("click", () => (restart(), drawMotions()));
  byId("speed").addEventListener("change", (event) => (state.speed = Number(event.target.value)));
  byId("push").addEventListener("change", (event) => {
    state.push = Math.max(-0.9, Math.min(0.9, event.target.valueAsNumber || 0));
    update();
  });
  byId("controls").addEventListener("submit", (event) => event.preventDefault());
  byId("map").addEventListener("click", ({ offsetX, offsetY }) => {
    const { left, right, top, bottom, mass, length } = drawMap.at;
    const at = ({ low, high }, share) => low * (high / low) ** Math.min(1, Math.max(0, share));
    state.mass = at(mass, (offsetX - left) / (right - left));
    state.length = at(length, (bottom - offsetY) / (bottom - top));
    controls.forEach(show);
    update();
  });
  window.addEventListener("resize", update);
  // Readers who want less motion start the animation themselves.
  if (window.matchMedia("(prefers-reduced-motion: reduce)").matches) byId("play").click();
  update();
  requestAnimationFrame(frame);
}

begin();
// For tests and measurements of the page.
globalThis.tpdPage = { state, set, update, get duration() { return update.duration; }, get frames() { return frames.length; } };
