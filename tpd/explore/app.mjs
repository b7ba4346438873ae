// The page: controls, figures, tables of results, and the block that rocks.

import { Motion } from "./rocking.mjs";
import { bodyOf, limitShares, parameters, reachOf, upliftMargin } from "./pendulum.mjs";
import { decode, errorAt, lookUp, place } from "./orbits.mjs";

const INK = "#1a1a1a", GREY = "#7a7a7a", BLUE = "#1f5fa8", PALE = "#a9c3df", ORANGE = "#d9822b", STONE = "#e4e4e4";
const SIMULATED = "simulated in the browser", EXACT = "exact";
const PERIODS = 12; // Periods of the base motion that are simulated for the tables.
const FREE = 5; // Free motion after a pulse or record, s.
const COLUMNS = 90, ROWS = 64; // Samples of the map.
const STILL = ["mass", "thickness", "depth"]; // Limits that no motion changes.

const byId = (id) => document.getElementById(id);
const data = JSON.parse(byId("data").textContent), { scene, limits, ground, tables } = data;
const [grid, without, recommended] = ["grid", "without", "recommended"].map((name) => tables?.[name] && decode(tables[name]));
const base = ground && forcingOf(ground), height = 2 * scene.halfHeight;
const state = { play: true, speed: 1, push: 0 };

const format = (x, digits = 3) => (Number.isFinite(x) ? String(Number(x.toPrecision(digits))) : "unknown");
const percent = (x) => `${format(100 * x, 2)} %`;
const degrees = (tilt) => `${format((tilt * scene.nu * 180) / Math.PI, 2)}°`;
const create = (tag, properties = {}) => Object.assign(document.createElement(tag), properties);

/** Return the value at a share of a range { low, high, log }, and the share of a value. */
const valueAt = ({ low, high, log }, share) => (log ? low * (high / low) ** share : low + (high - low) * share);
const shareOf = ({ low, high, log }, x) => (log ? Math.log(x / low) / Math.log(high / low) : (x - low) / (high - low));

/** Return the base acceleration over its peak as a function of the time in s, and its duration. */
function forcingOf({ data: text, order, piece }) {
  const bytes = Uint8Array.from(atob(text), (character) => character.charCodeAt(0));
  const powers = new Float32Array(bytes.buffer), count = powers.length / order;
  const at = (time) => {
    const i = Math.floor(time / piece), x = time / piece - i;
    let value = 0;
    if (i >= 0 && i < count) for (let n = order - 1; n >= 0; n--) value = value * x + powers[i * order + n];
    return value;
  };
  return { at, duration: count * piece };
}

// Controls: each quantity has a slider and a number field ------------------------------------------------------------

const { ranges, start } = data;
const controls = [
  { name: "mass", label: "Mass of the bob", unit: "kg", group: "pendulum", value: start.mass },
  { name: "length", label: "Length of the pendulum", unit: "m", group: "pendulum", value: start.length },
  { name: "damping", label: "Damping ratio of the hinge", unit: "", group: "pendulum", value: start.damping_ratio },
  ...(ground ? [{ name: "scale", label: `Factor on ${ground.name}`, unit: "", group: "excitation", value: 1 }] : [
    { name: "frequency", label: "Frequency", unit: "Hz", group: "excitation", value: data.motion.frequency },
    { name: "amplitude", label: "Amplitude", unit: "m", group: "excitation", value: data.motion.amplitude },
  ]),
].map((control) => ({ ...control, ...ranges[control.name] }));

function addControl(control) {
  const { name, label, unit, group, low, high } = control, row = create("div", { className: "control" });
  const text = `${label} (${format(low)} to ${format(high)}${unit && ` ${unit}`})`;
  control.slider = create("input", { type: "range", id: `${name}-slider`, min: 0, max: 1000, step: 1 });
  control.field = create("input", { type: "number", id: name, step: "any" });
  row.append(create("label", { htmlFor: name, textContent: text }), control.slider, control.field, unit);
  byId(group).append(row);
  control.slider.setAttribute("aria-label", unit ? `${label}, ${unit}` : label);
  // Four digits are enough for a slider.
  const dragged = () => Number(valueAt(control, control.slider.valueAsNumber / 1000).toPrecision(4));
  control.slider.addEventListener("input", () => set({ [name]: dragged() }));
  control.field.addEventListener("change", () => set({ [name]: control.field.valueAsNumber }));
}

/** Set values within their ranges, and show all that depends on them. */
function set(values) {
  for (const control of controls) {
    const value = values[control.name];
    if (Number.isFinite(value)) state[control.name] = Math.min(Math.max(value, control.low), control.high);
    const own = state[control.name];
    control.slider.value = 1000 * shareOf(control, own);
    control.slider.setAttribute("aria-valuetext", `${format(own, 4)} ${control.unit}`);
    control.field.value = format(own, 6);
  }
  update();
}

// Values and their sources -------------------------------------------------------------------------------------------

const pendulumOf = () => ({ mass: state.mass, length: state.length, damping: state.damping });
const excitation = () => (ground ? { peak: ground.peak * state.scale, frequency: scene.rate / (2 * Math.PI) }
  : { amplitude: state.amplitude, frequency: state.frequency });

/** Return steady tilts and bob angle, each as { value, error, source }; null under a pulse or record. */
function steady() {
  if (ground) return null;
  const corners = place(grid, [state.mass, state.length, state.damping, state.frequency, state.amplitude]);
  const alone = place(without, [state.frequency, state.amplitude]);
  const read = (table, name, at) => ({ ...lookUp(table, name, at), error: errorAt(table, name, at) });
  return { tilt: read(grid, "tilt", corners), swing: read(grid, "swing", corners), without: read(without, "tilt", alone) };
}

function motionFrom(pendulum) {
  const p = parameters(scene, excitation(), pendulum), first = [state.push * scene.nu, 0, 0, 0];
  if (!ground) return new Motion(p, first);
  const motion = new Motion(p, first, (tau) => base.at(tau / scene.rate));
  motion.step = Math.min(motion.step, ground.piece * scene.rate);
  return motion;
}

/** Return the largest values of the motion that the page shows, over its first periods or the whole ground motion. */
function simulate(pendulum) {
  const motion = motionFrom(pendulum), seconds = ground ? base.duration + FREE : PERIODS / state.frequency;
  const largest = { tilt: 0, swing: 0, tension: 0, rate: 0 };
  motion.advance(seconds * scene.rate, ({ y, tension }) => {
    const values = { tilt: y[0] / scene.nu, swing: y[1], rate: (y[3] - y[2]) * scene.rate, tension: Math.max(tension, 0) };
    for (const name in largest) largest[name] = Math.max(largest[name], Math.abs(values[name]));
  });
  return { ...largest, overturned: motion.overturned };
}

/** Return the stored validation runs that hold for this pendulum and base motion; undefined without any. */
function runsNear(pendulum) {
  const at = Object.values(pendulum), same = controls.slice(3).every(({ name, value }) => Math.abs(state[name] / value - 1) < 1e-6);
  const holds = ({ low, high }) => at.every((x, i) => x >= low[i] * (1 - 1e-6) && x <= high[i] * (1 + 1e-6));
  return same ? data.runs.findLast(holds) : undefined;
}

function textOf({ value, error, source }, unit = "") {
  if (source === "none") return "no attracting symmetric orbit";
  if (source === "not interpolated") return "–";
  return `${format(value)}${source === "interpolated" ? ` ± ${format(error, 1)}` : ""}${unit}`;
}

// Tables -------------------------------------------------------------------------------------------------------------

/** Show rows [name, label, value, source] in a table. */
function fill(id, rows) {
  byId(id).tBodies[0].replaceChildren(...rows.map(([name, label, value, source]) => {
    const row = create("tr", { className: value.endsWith("exceeded") ? "exceeded" : "" });
    row.dataset.name = name;
    row.append(create("th", { scope: "row", textContent: label }), ...[value, source].map((textContent) => create("td", { textContent })));
    return row;
  }));
}

function steadyRows(now, pendulum, body) {
  if (!now) return [];
  const { tilt, swing } = now, rests = upliftMargin(parameters(scene, excitation(), pendulum)) > 0;
  const reach = body ? reachOf(scene, body, swing.value + tilt.value * scene.nu) : NaN;
  const clearance = { ...swing, value: scene.cavity / 2 - reach, error: body?.rod * (swing.error + tilt.error * scene.nu) };
  return [
    ["tilt", "Steady tilt over the slenderness", textOf(tilt), tilt.source],
    ["without", "Steady tilt without a pendulum", textOf(now.without), now.without.source],
    ["swing", "Steady bob angle", textOf(swing, " rad"), swing.source],
    ["rest", "Resting block", rests ? "stays at rest once the bob has settled" : "lifts", EXACT],
    ...(scene.cavity ? [["clearance", "Clearance to the wall", textOf(clearance, " m"), clearance.source]] : []),
  ];
}

function runRows(runs) {
  const labels = ["Share overturned (95 % interval)", "Mean tilt over the slenderness"];
  if (!runs) return ["overturned", "mean"].map((name, i) => [name, labels[i], "not simulated", "no validation runs near this design and base motion"]);
  const [share, alone] = runs.overturned.map(([mean, low, high]) => `${percent(mean)} (${percent(low)} to ${percent(high)})`);
  const { mean, low, high } = runs.benefit, source = `validation runs: ${runs.description}`;
  return [
    ["overturned", labels[0], `${share}; without a pendulum ${alone}`, source],
    ["mean", labels[1], `${format(runs.mean[0])}; without a pendulum ${format(runs.mean[1])}: reduction ${percent(mean)} (${percent(low)} to ${percent(high)})`, source],
  ];
}

function showResults(now, shares, largest, alone, pendulum, body) {
  const g = scene.gravity, { mass, length, damping } = pendulum, damper = 2 * damping * mass * length ** 1.5 * Math.sqrt(g);
  const period = ground ? "whole motion" : `first ${PERIODS} periods`, source = `${SIMULATED}, ${period}`;
  const outcome = ({ overturned, tilt }) => (overturned ? "overturns" : `${format(tilt)} (${degrees(tilt)})`);
  fill("results", [
    ...steadyRows(now, pendulum, body),
    ...runRows(runsNear(pendulum)),
    ["largest", "Largest tilt over the slenderness", outcome(largest), source],
    ["largest-without", "The same without a pendulum", outcome(alone), source],
    ["tension", "Largest force in the rod", `${format((largest.tension * mass * g) / 1000)} kN`, source],
    ["moment", "Largest moment of the damper", `${format(damper * largest.rate)} N m`, source],
    ["natural", "Natural frequency", `${format(Math.sqrt(g / length) / (2 * Math.PI))} Hz`, `${EXACT}, undamped, block at rest`],
    ["damper", "Damping of the hinge", `${format(damper)} N m s/rad`, EXACT],
    ["bob", "Bob as built", body ? `${format(body.mass)} kg, ${format(2 * body.radius)} m wide` : "no body swings as this point", EXACT],
    ["rod", "Rod to the centre of the bob", body ? `${format(body.rod)} m` : "–", EXACT],
  ]);
  const ofMotion = now ? now.swing.source : "bob at rest";
  fill("limits", shares.map(({ name, label, share }) =>
    [name, label, `${format(100 * share)} %${share > 1 ? ": exceeded" : ""}`, STILL.includes(name) ? EXACT : ofMotion]));
}

// Figures ------------------------------------------------------------------------------------------------------------

/** Return the context of a cleared canvas, its width and its height in CSS pixels. */
function cleared(id) {
  const canvas = byId(id), ratio = window.devicePixelRatio || 1, width = canvas.clientWidth, high = canvas.clientHeight;
  // A canvas that gets a new size allocates memory: most frames keep it.
  const sizes = [width, high].map((size) => Math.round(size * ratio));
  if (canvas.width !== sizes[0] || canvas.height !== sizes[1]) [canvas.width, canvas.height] = sizes;
  const c = canvas.getContext("2d");
  c.setTransform(ratio, 0, 0, ratio, 0, 0);
  c.clearRect(0, 0, width, high);
  c.font = "12px system-ui, sans-serif";
  return { c, width, high };
}

/** Return round numbers in a range. */
function ticks({ low, high, log }) {
  if (log && high / low > 5) {
    return Array.from({ length: 60 }, (_, i) => [1, 2, 5][i % 3] * 10 ** (Math.floor(i / 3) - 8)).filter((x) => x >= low && x <= high);
  }
  const power = 10 ** Math.floor(Math.log10((high - low) / 5)), step = [1, 2, 5, 10].map((n) => n * power).find((s) => (high - low) / s <= 6);
  return Array.from({ length: 8 }, (_, i) => (Math.ceil(low / step) + i) * step).filter((x) => x <= high);
}

/** Draw axes of two ranges, and return the places of values on them. */
function drawAxes({ c, width, high }, x, y) {
  const left = 48, right = width - 12, top = 10, bottom = high - 34;
  const px = (value) => left + (right - left) * shareOf(x, value), py = (value) => bottom - (bottom - top) * shareOf(y, value);
  [c.strokeStyle, c.fillStyle, c.lineWidth, c.textAlign] = [INK, INK, 1, "center"];
  c.strokeRect(left, top, right - left, bottom - top);
  for (const value of ticks(x)) c.fillText(format(value), px(value), bottom + 14);
  c.fillText(x.label, (left + right) / 2, high - 4);
  c.textAlign = "right";
  for (const value of ticks(y)) c.fillText(format(value), left - 4, py(value) + 4);
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
  [c.strokeStyle, c.lineWidth] = [color, width];
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

/** Draw the circle of the user's pendulum, or the star of the recommended one. */
function drawMark(c, x, y, isStar = false) {
  c.beginPath();
  if (!isStar) c.arc(x, y, 5, 0, 7);
  for (let i = 0; isStar && i < 10; i++) c.lineTo(x + (i % 2 ? 6 : 13) * Math.sin((i * Math.PI) / 5), y - (i % 2 ? 6 : 13) * Math.cos((i * Math.PI) / 5));
  c.closePath();
  [c.fillStyle, c.strokeStyle, c.lineWidth] = [isStar ? "white" : ORANGE, INK, 1.5];
  c.fill();
  c.stroke();
}

function drawResponse(now) {
  const view = cleared("response"), { c } = view, values = without.axes[0].values;
  const most = Math.min(1, 1.1 * Math.max(tables.grid.fields.tilt.scale, tables.without.fields.tilt.scale));
  const { px, py, top, bottom } = drawAxes(view, { ...ranges.frequency, label: "frequency (Hz)" }, { low: 0, high: most, label: "tilt / slenderness" });
  const curve = (table, name, point) => values.map((f) => [px(f), py(lookUp(table, name, place(table, point(f))).value)]);
  const alone = (f) => [f, state.amplitude], own = (f) => [state.mass, state.length, state.damping, f, state.amplitude];
  drawLine(c, curve(without, "tilt", alone), GREY, 2.5);
  drawLine(c, curve(without, "unstable", alone), GREY, 1.5, [2, 4]);
  if (recommended) drawLine(c, curve(recommended, "tilt", alone), INK, 1, [6, 4]);
  drawLine(c, curve(grid, "tilt", own), BLUE, 2.5);
  drawLine(c, curve(grid, "unstable", own), BLUE, 1.5, [2, 4]);
  drawLine(c, [[px(state.frequency), top], [px(state.frequency), bottom]], ORANGE, 1, [3, 3]);
  if (Number.isFinite(now.tilt.value)) drawMark(c, px(state.frequency), py(now.tilt.value));
}

/** Return the samples of the map with their bodies, which no slider changes. */
function samplesOfMap() {
  const plane = { axes: grid.axes.slice(0, 2), strides: [grid.axes[1].values.length, 1] };
  return Array.from({ length: COLUMNS * ROWS }, (_, n) => {
    const shares = [((n % COLUMNS) + 0.5) / COLUMNS, 1 - (Math.floor(n / COLUMNS) + 0.5) / ROWS];
    const pendulum = { mass: valueAt(ranges.mass, shares[0]), length: valueAt(ranges.length, shares[1]), damping: 0 };
    return { pendulum, corners: place(plane, [pendulum.mass, pendulum.length]), body: bodyOf(scene, pendulum) };
  });
}
const samples = ground ? [] : samplesOfMap();

/** Return a field at all nodes of mass and length, interpolated in damping, frequency and amplitude. */
function slice(name) {
  const [masses, lengths] = grid.axes, rest = [state.damping, state.frequency, state.amplitude];
  return masses.values.flatMap((mass) => lengths.values.map((length) => lookUp(grid, name, place(grid, [mass, length, ...rest])).value));
}

function drawMap(now) {
  const view = cleared("map"), { c } = view, tilts = slice("tilt"), swings = slice("swing"), known = tilts.filter(Number.isFinite);
  const [least, most] = [Math.min(...known), Math.max(...known)], pixels = new ImageData(COLUMNS, ROWS), regions = {};
  const mean = (values, corners) => corners.reduce((sum, [index, weight]) => sum + weight * values[index], 0);
  samples.forEach(({ pendulum, corners, body }, n) => {
    const tilt = mean(tilts, corners), motion = Number.isFinite(tilt) ? { tilt, swing: mean(swings, corners), without: now.without.value } : null;
    // Light is the smallest tilt, dark the largest; a place without a value stays white.
    const shade = 235 - (150 * (tilt - least)) / (most - least || 1);
    pixels.data.set(motion ? [shade - 20, shade - 5, shade + 10, 255] : [255, 255, 255, 255], 4 * n);
    const over = limitShares(scene, limits, pendulum, motion, body).filter(({ share }) => share > 1);
    if (over.length) (regions[over.reduce((a, b) => (b.share > a.share ? b : a)).name] ??= []).push(n);
  });
  const { px, py, left, right, top, bottom } = drawAxes(view, { ...ranges.mass, label: "mass of the bob (kg)" }, { ...ranges.length, label: "length (m)" });
  const picture = (drawMap.picture ??= create("canvas", { width: COLUMNS, height: ROWS })), wide = (right - left) / COLUMNS, tall = (bottom - top) / ROWS;
  picture.getContext("2d").putImageData(pixels, 0, 0);
  c.drawImage(picture, left, top, right - left, bottom - top);
  Object.entries(regions).forEach(([name, numbers], i) => {
    const places = numbers.map((n) => [left + (n % COLUMNS) * wide, top + Math.floor(n / COLUMNS) * tall]);
    hatch(c, places, wide, tall, (Math.PI / 4) * [1, 3, 2, 0, 1.5, 2.5][i % 6]);
    const [x, y] = places[places.length >> 1];
    [c.textAlign, c.strokeStyle, c.lineWidth, c.fillStyle] = [x > (left + right) / 2 ? "right" : "left", "white", 4, INK];
    // A label on a very small region would hide its neighbours.
    if (places.length > 0.02 * samples.length) [c.strokeText(name, x, y), c.fillText(name, x, y)];
  });
  const { mass, length } = data.space, corner = (i, j) => [px(mass[i]), py(length[j])];
  drawLine(c, [corner(0, 0), corner(0, 1), corner(1, 1), corner(1, 0), corner(0, 0)], INK, 1, [5, 4]);
  if (data.recommended) drawMark(c, px(data.recommended.mass), py(data.recommended.length), true);
  drawMark(c, px(state.mass), py(state.length));
  drawMap.area = { left, right, top, bottom };
  byId("map-caption").textContent = `At ${format(state.frequency, 4)} Hz, ${format(state.amplitude, 4)} m and a damping ratio of `
    + `${format(state.damping)}, interpolated. Lightest: ${format(least)}, darkest: ${format(most)} of the slenderness. White: no attracting `
    + "symmetric orbit, or not interpolated. Hatched: a limit is exceeded. Dashed: range of the search. Circle: your pendulum."
    + `${data.recommended ? " Star: recommended pendulum." : ""}`;
}

/** Hatch samples of the map; each limit has lines of its own direction, so that regions differ without colours. */
function hatch(c, places, wide, tall, angle) {
  c.save();
  c.beginPath();
  for (const [x, y] of places) c.rect(x, y, wide + 0.5, tall + 0.5);
  c.clip();
  c.fillStyle = "rgba(255, 255, 255, 0.35)";
  c.fill();
  c.rotate(angle);
  drawLine(c, Array.from({ length: 400 }, (_, i) => [[7 * (i - 200), -2000], [7 * (i - 200), 2000], [0, NaN]]).flat(), "rgba(26, 26, 26, 0.55)", 1);
  c.restore();
}

/** Draw a rod and its bob, in m from the hinge. */
function drawPendulum(c, body, angle, color) {
  c.save();
  c.rotate(angle);
  drawLine(c, [[0, 0], [0, body.rod]], color, c.lineWidth);
  c.fillStyle = color;
  c.beginPath();
  if (scene.bob.shape === "ball") c.arc(0, body.rod, body.radius, 0, 7);
  else c.rect(-body.radius, body.rod - body.half, 2 * body.radius, 2 * body.half);
  c.fill();
  c.restore();
}

/** Draw the block and its cavity, in m from the middle of its base, and pendulums as [angle from the vertical, color]. */
function drawBlock(c, body, tilt, pendulums) {
  const corner = (Math.sign(tilt) * scene.width) / 2;
  c.save();
  c.translate(corner, 0);
  c.rotate(tilt);
  c.translate(-corner, -height);
  c.strokeStyle = INK;
  for (const [width, color] of [[scene.width, STONE], [scene.cavity ?? 0, "white"]]) {
    c.fillStyle = color;
    c.fillRect(-width / 2, 0, width, height);
    if (width) c.strokeRect(-width / 2, 0, width, height);
  }
  // The angle of the bob is measured from the vertical, and the block is tilted.
  if (body) for (const [swing, color] of pendulums) drawPendulum(c, body, swing - tilt, color);
  c.restore();
}

function drawDesign(now, largest, body) {
  const { c, width, high } = cleared("drawing"), isSteady = now && Number.isFinite(now.swing.value);
  const angle = isSteady ? now.swing.value : Math.min(largest.swing, Math.PI / 2);
  byId("angle-source").textContent = isSteady ? `steady motion (${now.swing.source})` : SIMULATED;
  const whole = Math.min((high - 20) / height, (0.4 * width) / scene.width), depth = body ? 1.25 * (body.rod + body.half) : state.length;
  const near = Math.min((high - 30) / depth, (0.5 * width) / scene.width);
  for (const [left, x, bottom, scale] of [[0, 0.22, high - 10, whole], [0.45 * width, 0.73, 24 + near * height, near]]) {
    c.save();
    c.beginPath();
    c.rect(left, 0, width, high);
    c.clip();
    c.translate(x * width, bottom);
    c.scale(scale, scale);
    c.lineWidth = 1.5 / scale;
    drawBlock(c, body, 0, left ? [[-angle, PALE], [angle, PALE], [0, BLUE]] : [[0, BLUE]]);
    c.restore();
  }
  [c.fillStyle, c.textAlign] = [INK, "center"];
  if (body) c.fillText(`rod ${format(body.rod)} m, bob ${format(2 * body.radius)} m wide`, 0.73 * width, 16);
}

// The block that rocks -----------------------------------------------------------------------------------------------

let motions = [], traces = [[], []], clock = 0, before = 0, frames = [];

function restart() {
  [motions, traces, clock] = [[motionFrom(null), motionFrom(pendulumOf())], [[], []], 0];
}

/** Show one frame of the animation; `time` is in ms. */
function animate(time) {
  frames = [...frames.filter((t) => t > time - 1000), time];
  // A page that was hidden does not catch up.
  const seconds = Math.min((time - before) / 1000, 0.1);
  before = time;
  if (state.play) {
    clock += seconds * state.speed;
    motions.forEach((motion, i) => traces[i].push([clock, motion.advance(clock * scene.rate).y[0] / scene.nu]));
    if (ground && clock > base.duration + FREE) restart();
    drawMotions();
  }
  requestAnimationFrame(animate);
}

function drawMotions() {
  const body = bodyOf(scene, pendulumOf());
  motions.forEach((motion, i) => {
    const name = ["without", "with"][i], { c, width, high } = cleared(`block-${name}`), tilt = Math.max(-Math.PI / 2, Math.min(Math.PI / 2, motion.y[0]));
    const scale = Math.min((high - 30) / height, width / (0.9 * height + scene.width));
    const shift = ground ? 0 : -state.amplitude * Math.sin(2 * Math.PI * state.frequency * clock);
    c.translate(width / 2 + shift * scale, high - 14);
    c.scale(scale, scale);
    c.lineWidth = 1.5 / scale;
    drawBlock(c, i ? body : null, tilt, [[motion.y[1], BLUE]]);
    drawLine(c, [[-0.4 * height - scene.width, 0], [0.4 * height + scene.width, 0]], INK, 2.5 / scale);
    byId(`state-${name}`).textContent = motion.overturned ? "The block has overturned." : `Tilt ${degrees(tilt / scene.nu)} at ${clock.toFixed(1)} s.`;
  });
  const span = ground ? base.duration + FREE : PERIODS / state.frequency, from = Math.max(0, clock - span), view = cleared("trace");
  traces = traces.map((trace) => trace.filter(([t]) => t >= from));
  const most = 1.1 * Math.max(0.1, ...traces.flatMap((trace) => trace.map(([, tilt]) => Math.min(1.2, Math.abs(tilt)))));
  const { px, py } = drawAxes(view, { low: from, high: from + span, label: "time (s)" }, { low: -most, high: most, label: "tilt" });
  const points = (trace) => trace.map(([t, tilt]) => [px(t), py(Math.max(-most, Math.min(most, tilt)))]);
  drawLine(view.c, points(traces[0]), GREY, 1.5, [5, 3]);
  drawLine(view.c, points(traces[1]), BLUE, 1.8);
}

// Everything together ------------------------------------------------------------------------------------------------

function update() {
  const begin = performance.now(), pendulum = pendulumOf(), body = bodyOf(scene, pendulum), now = steady();
  const motion = now && Number.isFinite(now.tilt.value) ? { tilt: now.tilt.value, swing: now.swing.value, without: now.without.value } : null;
  const shares = limitShares(scene, limits, pendulum, motion, body), largest = simulate(pendulum), alone = simulate(null);
  showResults(now, shares, largest, alone, pendulum, body);
  if (now) [drawResponse(now), drawMap(now)];
  drawDesign(now, largest, body);
  restart();
  drawMotions();
  const over = shares.filter(({ share }) => share > 1).map(({ label }) => label);
  const tilts = now ? `Steady tilt ${textOf(now.tilt)} with your pendulum, ${textOf(now.without)} without. ` : "";
  const summary = `${tilts}${over.length ? `Limits exceeded: ${over.join(", ")}.` : "No limit is exceeded."}`;
  // A screen reader says the result once the slider has stopped.
  clearTimeout(update.timer);
  update.timer = setTimeout(() => (byId("summary").textContent = summary), 400);
  update.duration = performance.now() - begin;
}

function begin() {
  byId("title").textContent = document.title = data.title ? `${data.title}: explore the design` : "Explore the design";
  byId("verdict").textContent = data.verdict;
  byId("version").textContent = `Written by tpd ${data.version}.`;
  byId("other-limits").textContent = data.other_limits.length ? `Not evaluated on this page: ${data.other_limits.join(", ")}.` : "";
  for (const id of ["response-figure", "map-figure"]) byId(id).hidden = Boolean(ground);
  controls.forEach(addControl);
  const first = Object.fromEntries(controls.map(({ name, value }) => [name, value]));
  byId("reset").addEventListener("click", () => set(first));
  byId("play").addEventListener("click", () => (byId("play").textContent = (state.play = !state.play) ? "Pause" : "Play"));
  byId("restart").addEventListener("click", () => (restart(), drawMotions()));
  byId("speed").addEventListener("change", ({ target }) => (state.speed = Number(target.value)));
  byId("push").addEventListener("change", ({ target }) => {
    target.value = state.push = Math.max(-0.9, Math.min(0.9, target.valueAsNumber || 0));
    update();
  });
  byId("map").addEventListener("click", ({ offsetX, offsetY }) => {
    const { left, right, top, bottom } = drawMap.area;
    set({ mass: valueAt(ranges.mass, (offsetX - left) / (right - left)), length: valueAt(ranges.length, (bottom - offsetY) / (bottom - top)) });
  });
  window.addEventListener("resize", update);
  // Readers who want less motion start the animation themselves.
  if (window.matchMedia("(prefers-reduced-motion: reduce)").matches) byId("play").click();
  set(first);
  requestAnimationFrame(animate);
}

begin();
// Tests and measurements read these.
globalThis.tpdPage = { state, set, frames: () => frames.length, duration: () => update.duration };
