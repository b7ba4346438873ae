// The page: controls, tables of results, figures, and the block that rocks.

import { Motion, overturns } from "./rocking.mjs";
import { atRest, bodyOf, limitShares, parameters, reachOf } from "./pendulum.mjs";
import { bytesOf, decode, lookUp, place, shareOf, valueAt } from "./orbits.mjs";
import { BLUE, GREY, INK, ORANGE, PALE, cleared, drawAxes, drawBlock, drawLine } from "./figures.mjs";
import { contour, drawMark, format, hatch, writeOver } from "./figures.mjs";

const SIMULATED = "simulated in the browser", EXACT = "exact";
const WINDOW = 12, FRAME = 0.008; // Periods in the figure of the tilt against time; steps of this figure, s.
const LEVELS = [0.05, 0.1, 0.2, 0.3, 0.5, 0.7, 0.9]; // Shares on the lines of the map.
const PAUSE = 500; // Time without a change after which the runs begin, ms.
const PUSH = { label: "Initial tilt over the slenderness", unit: "", low: -0.9, high: 0.9 };
const COLUMNS = 90, ROWS = 64; // Samples of the map.

const byId = (id) => document.getElementById(id);
const create = (tag, properties = {}) => Object.assign(document.createElement(tag), properties);
const percent = (x) => (x === null ? "unknown" : `${(100 * x).toFixed(1)} %`);

const data = JSON.parse(byId("data").textContent);
const { scene, limits, controls, grounds, tables, trials } = data;
const tableOf = (name) => tables?.[name] && decode(tables[name]);
const grid = tableOf("grid"), without = tableOf("without"), recommended = tableOf("recommended");
const shares = trials && decode(trials.map);
let ground = grounds?.[0];
const ranges = Object.fromEntries(controls.map((control) => [control.name, control]));
const state = { play: true, speed: 1, push: 0 };

// Controls: each quantity has a slider and a number field

/** Add the slider and the number field of a quantity. */
function addControl(control) {
  const { name, label, unit, low, high } = control, row = create("div", { className: "control" });
  const text = `${label} (${format(low, 4)} to ${format(high, 4)}${unit && ` ${unit}`})`;
  control.slider = create("input", { type: "range", id: `${name}-slider`, min: 0, max: 1000, step: 1 });
  control.field = create("input", { type: "number", id: name, step: "any" });
  row.append(create("label", { htmlFor: name, textContent: text }), control.slider, control.field, unit);
  byId(control.group).append(row);
  control.slider.setAttribute("aria-label", unit ? `${label}, ${unit}` : label);
  // Four digits are enough for a slider.
  const sliderValue = () => Number(valueAt(control, control.slider.valueAsNumber / 1000).toPrecision(4));
  control.slider.addEventListener("input", () => set({ [name]: clamped(sliderValue(), low, high) }));
  control.field.addEventListener("change", () => set({ [name]: typedIn(control.field, control, state[name]) }, false));
}

const clamped = (x, low, high) => Math.max(low, Math.min(high, x));

/** Return the value that holds after a number was typed into a field, and show a notice if it is another number. */
function typedIn({ value: text, valueAsNumber: typed }, { label, unit, low, high }, own) {
  const value = Number.isFinite(typed) ? clamped(typed, low, high) : own;
  const [used, given, least, most] = [value, typed, low, high].map((x) => format(x, 6));
  const fault = `${label} must be from ${least} to ${most} ${unit}, but is ${text || "empty"}: ${used} is used.`;
  byId("notice").textContent = used === given ? "" : fault;
  return value;
}

/** Set values, and show all that depends on them. */
function set(values, isNoticed = true) {
  if (isNoticed) byId("notice").textContent = "";
  for (const control of controls) {
    const own = (state[control.name] = values[control.name] ?? state[control.name]);
    control.slider.value = 1000 * shareOf(control, own);
    control.slider.setAttribute("aria-valuetext", `${format(own, 4)} ${control.unit}`);
    control.field.value = format(own, 6);
  }
  update();
}

/** Return whether all controls but mass and length have their first values, for which the map of shares holds. */
const isFixed = () => controls.every((control) => ["mass", "length"].includes(control.name) || isFirst(control));
/** Return whether a control has its first value; runs and verdict of a report hold for all levels. */
const isFirst = ({ name, value }) => name === "level" || Math.abs(state[name] - value) <= 1e-6 * Math.abs(value);

// Values and their sources

/** Return the excitation of the controls, as `parameters` takes it. */
function excitation() {
  // Under a ground motion the frequency only sets the length of a step.
  if (ground) return { peak: ground.peak * state.level, frequency: scene.rate / (2 * Math.PI) };
  return { amplitude: state.amplitude, frequency: state.frequency };
}

/** Return the motion of a block at rest under a settled bob, which exists if its margin is positive. */
const restOf = (pendulum) => atRest(parameters(scene, excitation(), pendulum));

/** Return fields of the settled motion in a table, each as { value, error, source }: of an orbit, else of rest. */
function settled(table, names, point, pendulum) {
  const corners = place(table, point), rest = restOf(pendulum);
  return names.map((name) => {
    const found = lookUp(table, name, corners), isRest = found.source === "none" && rest.margin > 0;
    return isRest ? { value: rest[name], error: 0, source: EXACT } : found;
  });
}

/** Return steady tilts and bob angle, each as { value, error, source }; null under a pulse or record. */
function steady() {
  if (ground) return null;
  const { mass, length, damping, frequency, amplitude } = state;
  const [tilt, swing] = settled(grid, ["tilt", "swing"], [mass, length, damping, frequency, amplitude], state);
  return { tilt, swing, without: settled(without, ["tilt"], [frequency, amplitude], null)[0] };
}

/** Return the acceleration of the base as the simulation takes it; null under a harmonic. */
function base() {
  if (!ground) return null;
  const { units, data } = ground, order = units.length;
  ground.powers ??= Float32Array.from(new Int16Array(bytesOf(data)), (code, n) => code * units[n % order]);
  return { powers: ground.powers, order, span: ground.piece * scene.rate };
}

/** Return the duration of a validation run, s, which is also that of a simulation; and its description. */
const duration = () => (ground ? ground.seconds : data.periods / state.frequency);
const spanText = () => `${ground ? "whole motion" : `${data.periods} periods`}, ${format(duration())} s`;

/** Return largest values, outcome and history of the motion from the start of the controls; null is no pendulum. */
function simulate(pendulum) {
  const motion = new Motion(parameters(scene, excitation(), pendulum), [state.push * scene.nu, 0, 0, 0], base());
  const parts = Math.ceil(ground ? ground.seconds : data.periods), history = [];
  const largest = { tilt: 0, swing: 0, rodAngle: 0, tension: 0, rate: 0 };
  const record = ({ y, tau, tension, hasEnded }) => {
    const time = tau / scene.rate, tilt = y[0] / scene.nu;
    if (hasEnded || !(time < history.at(-1)?.[0] + FRAME)) history.push([time, tilt, y[1]]);
    const rate = (y[3] - y[2]) * scene.rate;
    const values = { tilt, swing: y[1], rodAngle: y[1] - y[0], rate, tension: Math.max(tension, 0) };
    for (const name in largest) largest[name] = Math.max(largest[name], Math.abs(values[name]));
  };
  record(motion);
  motion.complete(duration() * scene.rate, parts, record);
  const { hasEnded, stalled, tau } = motion, fall = `overturns after ${format(tau / scene.rate)} s`;
  const outcome = stalled ? "has no result (too many events)" : hasEnded ? fall : "does not overturn";
  return { ...largest, history, hasEnded, outcome };
}

/** Return the stored validation runs that hold for this pendulum and excitation; undefined without any. */
function runsNear({ mass, length, damping }) {
  const at = [mass, length, damping], motion = controls.filter(({ group }) => group === "excitation");
  const holds = ({ low, high }) => at.every((x, i) => x >= low[i] * (1 - 1e-6) && x <= high[i] * (1 + 1e-6));
  return motion.every(isFirst) ? data.runs.findLast(holds) : undefined;
}

/** Return a value with the bound of its error, or the reason why there is no value. */
function textOf({ value, error, source }, unit = "") {
  if (source === "none") return "no stable symmetric orbit below the toppling tilt";
  if (source === "not interpolated") return "–";
  if (source === "exact") return `${format(value)}${unit}`;
  // The three digits that are shown are rounded as well.
  const rounding = 0.5 * 10 ** (Math.floor(Math.log10(Math.abs(value))) - 2);
  return `${format(value)} ± ${format(Math.max(error, rounding), 1)}${unit}`;
}

/** Return a steady tilt as a text; a motion that ends before it settles does not reach it. */
const steadyText = (tilt, { hasEnded }) =>
  `${textOf(tilt)}${hasEnded && tilt.value ? " (not reached from this start)" : ""}`;

/** Return a text about a motion that lasts, or the outcome of a motion that ends early. */
const unlessEnded = ({ hasEnded, outcome }, text) => (hasEnded ? outcome : text);
const angleText = (tilt) => `${format(tilt)} (${format((tilt * scene.nu * 180) / Math.PI, 2)}°)`;

// Tables

/** Show rows [name, label, value, source] in a table. */
function fill(id, rows) {
  const elements = rows.map(([name, label, value, source]) => {
    const row = create("tr", { className: value.endsWith("exceeded") ? "exceeded" : "" });
    row.dataset.name = name;
    row.append(create("th", { scope: "row", textContent: label }));
    const from = source === "none" ? "exact orbits around this point" : source;
    for (const textContent of [value, from]) row.append(create("td", { textContent }));
    return row;
  });
  byId(id).tBodies[0].replaceChildren(...elements);
}

/** Return the rows of the steady motion. */
function steadyRows(now, [largest, alone], pendulum, body) {
  if (!now) return [];
  const { tilt, swing } = now, rests = restOf(pendulum).margin > 0;
  const reach = reachOf(scene, body, swing.value + tilt.value * scene.nu);
  const error = body.rod * (swing.error + tilt.error * scene.nu);
  const clearance = { ...swing, value: scene.wall - reach, error };
  return [
    ["tilt", "Steady-state tilt over the slenderness", steadyText(tilt, largest), tilt.source],
    ["without", "Steady-state tilt without a pendulum", steadyText(now.without, alone), now.without.source],
    ["swing", "Steady-state bob angle", textOf(swing, " rad"), swing.source],
    ["rest", "Resting block", rests ? "stays at rest once the bob has settled" : "lifts", EXACT],
    ["clearance", "Clearance to the wall", textOf(clearance, " m"), clearance.source],
  ].slice(0, scene.wall && body.exists ? 5 : 4);
}

/** Return the share of a limit as a text, with the digits that decide. */
function usedText({ name, share, exceeded }, without) {
  const digits = [3, 4, 5, 6].map((n) => format(100 * share, n)).find((text) => text !== "100") ?? "100";
  // The share of a change that is allowed would read as a change itself. Next to rest the limit is no such change.
  const change = share * (1 + limits.worsening) - 1, allowed = `${percent(limits.worsening)} more allowed`;
  const changed = `${percent(Math.abs(change))} ${change > 0 ? "more" : "less"} tilt, ${allowed}`;
  return `${name === "worsening" && without > 0.02 ? changed : `${digits} %`}${exceeded ? ": exceeded" : ""}`;
}

/** Show both tables of results. */
function showResults(now, shares, basis, largest, alone, pendulum, body) {
  const g = scene.gravity, { mass, length, damping } = pendulum;
  const damper = 2 * damping * mass * length ** 1.5 * Math.sqrt(g), natural = Math.sqrt(g / length) / (2 * Math.PI);
  const source = `${SIMULATED}, ${spanText()}`;
  // The loads of a block that falls are no loads of a design.
  const force = largest.tension * mass * g, load = force < 1000 ? `${format(force)} N` : `${format(force / 1000)} kN`;
  const moment = `${format(damper * largest.rate)} N m`;
  const size = body.exists ? `${format(body.mass)} kg, ${format(2 * body.radius)} m wide` : "no body swings like it";
  fill("results", [
    ["largest", "Largest tilt over the slenderness", unlessEnded(largest, angleText(largest.tilt)), source],
    ["largest-without", "Largest tilt without a pendulum", unlessEnded(alone, angleText(alone.tilt)), source],
    ...steadyRows(now, [largest, alone], pendulum, body),
    ...(runsNear(pendulum)?.rows ?? data.no_runs),
    ["tension", "Largest force in the rod", unlessEnded(largest, load), source],
    ["moment", "Largest moment of the damper", unlessEnded(largest, moment), source],
    ["natural", "Natural frequency", `${format(natural)} Hz`, `${EXACT}, undamped, block at rest`],
    ["damper", "Damping of the hinge", `${format(damper)} N m s/rad`, EXACT],
    ["bob", "Bob as built", size, EXACT],
    ["rod", "Rod to the centre of the bob", body.exists ? `${format(body.rod)} m` : "–", EXACT],
  ]);
  fill("limits", shares.map((own) => {
    const source = data.still.includes(own.name) ? EXACT : basis;
    return [own.name, data.limit_labels[own.name], usedText(own, now?.without.value), source];
  }));
}

// Runs of the validation

/** Return the share of ones with its interval of 95 % confidence (Wilson's) as a text. */
function shareText(hits) {
  const n = hits.length, share = hits.reduce((a, b) => a + b, 0) / n, square = 1.96 ** 2 / n, scale = 1 + square;
  const half = Math.sqrt(square * (share * (1 - share) + square / 4)) / scale, middle = (share + square / 2) / scale;
  const [low, high] = [middle - half, middle + half].map((x) => Math.abs(100 * x).toFixed(0));
  return n ? `${(100 * share).toFixed(0)} % (${low} to ${high} %)` : "no result yet";
}

/** Simulate all runs with and without the pendulum. Pauses keep the page responsive, and a later call ends this one. */
async function simulateRuns(pendulum) {
  const call = (simulateRuns.call = {}), key = JSON.stringify(excitation()), all = trials.kinds["all starts"];
  // The runs without a pendulum are still valid if the excitation is the same.
  if (simulateRuns.key !== key) [simulateRuns.key, simulateRuns.alone] = [key, []];
  const cases = [{ pendulum, falls: [] }, { pendulum: null, falls: simulateRuns.alone }], [own, alone] = cases;
  const pause = (time) => new Promise((done) => setTimeout(done, time));
  const answered = (rows) => rows.filter((n) => Number.isFinite(own.falls[n] + alone.falls[n]));
  const texts = (rows) => cases.map(({ falls }) => shareText(answered(rows).map((n) => falls[n])));
  const only = (a, b) => answered(all).filter((n) => a.falls[n] > b.falls[n]).length;
  const label = (name, rows) => `${name}: ${answered(rows).length} runs`;
  const show = ([name, rows]) => [name, label(name, rows), ...texts(rows)];
  byId("runs-text").textContent = `${all.length} runs are simulated, with and without your pendulum.`;
  fill("runs", Object.entries(trials.kinds).map(show));
  await pause(PAUSE);
  for (const n of all) {
    for (const { pendulum, falls } of cases) {
      if (simulateRuns.call !== call) return;
      const p = parameters(scene, excitation(), pendulum), isHousner = scene.restitution === "housner";
      falls[n] ??= overturns(p, trials.scatter, n, isHousner, data.periods);
      await pause(0);
    }
    fill("runs", Object.entries(trials.kinds).map(show));
  }
  const [share, without] = texts(all);
  byId("runs-text").textContent = `${share} of the runs overturn with your pendulum, ${without} without one (95 % `
    + `intervals). Only without it ${only(alone, own)} runs overturn, and only with it ${only(own, alone)}.`;
}

// Figures

/** Draw the steady tilt against frequency. */
function drawResponse(now) {
  const view = cleared(byId("response")), { c } = view, values = without.axes[0].values;
  const most = 1.1 * Math.max(tables.grid.fields.tilt.scale, tables.without.fields.tilt.scale);
  const vertical = { low: 0, high: Math.min(1, most), label: "tilt / slenderness" };
  const { px, py, top, bottom } = drawAxes(view, { ...ranges.frequency, label: "frequency (Hz)" }, vertical);
  const alone = (f) => [f, state.amplitude], own = (f) => [state.mass, state.length, state.damping, f, state.amplitude];
  // A repelling orbit can be larger than all attracting ones: a value above the figure is not drawn.
  const inside = (y) => (y <= vertical.high ? py(y) : NaN);
  const curve = (table, name, point) =>
    values.map((f) => [px(f), inside(lookUp(table, name, place(table, point(f))).value)]);
  drawLine(c, curve(without, "tilt", alone), GREY, 5);
  drawLine(c, curve(without, "unstable", alone), GREY, 3, [3, 5]);
  if (recommended) drawLine(c, curve(recommended, "tilt", alone), INK, 1, [6, 4]);
  drawLine(c, curve(grid, "tilt", own), BLUE, 2);
  drawLine(c, curve(grid, "unstable", own), BLUE, 1.5, [2, 4]);
  drawLine(c, [[px(state.frequency), top], [px(state.frequency), bottom]], ORANGE, 1, [3, 3]);
  if (Number.isFinite(now.tilt.value)) drawMark(c, px(state.frequency), py(now.tilt.value));
}

// Samples of the map with their bodies, which no slider changes.
const plane = grid && { axes: grid.axes.slice(0, 2), strides: [grid.axes[1].values.length, 1] };
const samples = Array.from({ length: grid ? COLUMNS * ROWS : 0 }, (_, n) => {
  const mass = valueAt(ranges.mass, ((n % COLUMNS) + 0.5) / COLUMNS);
  const length = valueAt(ranges.length, 1 - (Math.floor(n / COLUMNS) + 0.5) / ROWS);
  return { mass, length, corners: place(plane, [mass, length]), body: bodyOf(scene, { mass, length }) };
});

/** Return a field at all nodes of mass and length, interpolated in damping, frequency and amplitude. */
function slice(name) {
  const [masses, lengths] = grid.axes, rest = [state.damping, state.frequency, state.amplitude];
  const at = (mass, length) => lookUp(grid, name, place(grid, [mass, length, ...rest])).value;
  return masses.values.flatMap((mass) => lengths.values.map((length) => at(mass, length)));
}

/** Draw shades from 0 (light) to 1 (dark) over mass and length, a place without a value white; return the axes. */
function drawPlane(id, shades) {
  const view = cleared(byId(id)), { c } = view, pixels = new ImageData(COLUMNS, ROWS);
  const [x, y] = [{ ...ranges.mass, label: "mass of the bob (kg)" }, { ...ranges.length, label: "length (m)" }];
  const { left, right, top, bottom, ...axes } = drawAxes(view, x, y);
  const picture = (drawPlane.picture ??= create("canvas", { width: COLUMNS, height: ROWS }));
  shades.forEach((share, n) => {
    const shade = 235 - 150 * share;
    pixels.data.set(Number.isFinite(share) ? [shade - 20, shade - 5, shade + 10, 255] : [255, 255, 255, 255], 4 * n);
  });
  picture.getContext("2d").putImageData(pixels, 0, 0);
  c.drawImage(picture, left, top, right - left, bottom - top);
  drawMap.area = { left, right, top, bottom };
  return { c, left, top, wide: (right - left) / COLUMNS, tall: (bottom - top) / ROWS, ...axes };
}

/** Draw the range of the search, and both pendulums. */
function drawPendulums({ c, px, py }) {
  const { mass, length } = data.space, corner = (i, j) => [px(mass[i]), py(length[j])];
  drawLine(c, [corner(0, 0), corner(0, 1), corner(1, 1), corner(1, 0), corner(0, 0)], INK, 1, [5, 4]);
  if (data.recommended) drawMark(c, px(data.recommended.mass), py(data.recommended.length), true);
  drawMark(c, px(state.mass), py(state.length));
}

/** Return the share of runs that overturn with a pendulum of the map, interpolated. */
const shareAt = ({ mass, length }) => lookUp(shares, "share", place(shares, [mass, length])).value;

/** Draw the share of runs that overturn over mass and length, with lines of equal shares. */
function drawShares() {
  const alone = trials.without, values = (drawShares.values ??= samples.map(shareAt)), labels = [];
  // Two lines next to each other would have labels that hide each other.
  const levels = [alone, ...LEVELS.filter((x) => Math.abs(x - alone) > 0.03)];
  const lines = (drawShares.lines ??= levels.map((level) => contour(values, COLUMNS, level)));
  const axes = drawPlane("shares", values.map((share) => 0.8 * share)), { c, left, top, wide, tall } = axes;
  const at = ([i, j]) => [left + (i + 0.5) * wide, top + (j + 0.5) * tall];
  lines.forEach((line, i) => {
    const pieces = line.map((piece) => piece.map(at)), text = `${Math.round(100 * levels[i])} %${i ? "" : " (none)"}`;
    drawLine(c, pieces.flatMap((piece) => [...piece, [0, NaN]]), INK, i ? 1 : 3);
    for (const [[x, y]] of pieces) {
      const isFree = ([a, b, own]) => Math.hypot(a - x, b - y) > (own === text ? 180 : 60);
      if (Math.abs(y - at([0, ROWS / 2])[1]) < 0.45 * ROWS * tall && labels.every(isFree)) labels.push([x, y, text]);
    }
  });
  for (const [x, y, text] of labels) writeOver(c, text, x, y + 4);
  drawPendulums(axes);
  const least = Math.min(...values), { mass, length } = samples[values.indexOf(least)];
  const own = isFixed() ? ` and ${percent(shareAt(state))} with yours` : "";
  byId("shares-text").textContent = `Of the runs ${percent(alone)} overturn without a pendulum${own}. The least `
    + `share is ${percent(least)}, at ${format(mass)} kg and ${format(length)} m. `
    + (lines[0].length ? "Thick line: as many as without a pendulum." : "No pendulum of the map is as bad as none.");
}

/** Draw the shares of the validation runs that overturn, over the level of the ground motions. */
function drawLevels() {
  const [low, high] = [data.levels[0].level[0], data.levels.at(-1).level[1]], view = cleared(byId("levels"));
  const x = { low, high, log: true, label: ranges.level.label.replace("Level: ", "") };
  const { px, py, top, bottom } = drawAxes(view, x, { low: 0, high: 1, label: "share" });
  const line = (i) => data.levels.map(({ level: [a, b], overturned }) => [px(Math.sqrt(a * b)), py(overturned[i])]);
  drawLine(view.c, line(1), GREY, 2, [5, 3]);
  drawLine(view.c, line(0), BLUE, 1.8);
  const now = px(clamped(state.level, low, high));
  drawLine(view.c, [[now, top], [now, bottom]], INK, 1);
}

/** Draw the steady tilt over mass and length, the regions of exceeded limits, and both pendulums. */
function drawMap(now) {
  const tilts = slice("tilt"), swings = slice("swing");
  const finite = tilts.filter(Number.isFinite), [least, most] = [Math.min(...finite), Math.max(...finite)];
  const shades = [], regions = {};
  const mean = (values, corners) => corners.reduce((sum, [index, weight]) => sum + weight * values[index], 0);
  samples.forEach(({ mass, length, corners, body }, n) => {
    const pendulum = { mass, length, damping: state.damping };
    const tilt = mean(tilts, corners), swing = mean(swings, corners);
    const hasTilt = Number.isFinite(tilt), own = hasTilt ? { tilt, swing } : restOf(pendulum);
    const motion = hasTilt || own.margin > 0 ? { ...own, without: now.without.value } : null;
    // Light is the smallest tilt, dark the largest; a place without a value stays white.
    shades.push((tilt - least) / (most - least || 1));
    const exceeded = limitShares(scene, limits, pendulum, motion, body).filter(({ exceeded }) => exceeded);
    if (exceeded.length) (regions[exceeded.reduce((a, b) => (b.share > a.share ? b : a)).name] ??= []).push(n);
  });
  const axes = drawPlane("map", shades), { c, left, top, wide, tall } = axes;
  Object.entries(regions).forEach(([name, numbers], i) => {
    const places = numbers.map((n) => [left + (n % COLUMNS) * wide, top + Math.floor(n / COLUMNS) * tall]);
    // The label stands in the middle of the middle row of its region.
    const row = places.filter(([, down]) => down === places[places.length >> 1][1]);
    const [across, down] = row[row.length >> 1];
    hatch(c, places, [wide, tall], i);
    // A label on a very small region would hide its neighbours.
    if (places.length > 0.02 * samples.length) writeOver(c, name.replace("_", " "), across, down);
  });
  drawPendulums(axes);
  const range = finite.length ? ` Lightest: ${format(least)}, darkest: ${format(most)} of the slenderness.` : "";
  byId("map-values").textContent = `${format(state.frequency, 4)} Hz, ${format(state.amplitude, 4)} m and a damping `
    + `ratio of ${format(state.damping)}.${range}`;
}

/** Draw the whole block, and its top with the bob at rest and at its largest angle. */
function drawDesign(angle, source, body) {
  const { c, width, high } = cleared(byId("drawing"));
  byId("angle-source").textContent = source;
  const whole = Math.min((high - 20) / scene.height, (0.4 * width) / scene.width);
  const depth = 1.25 * (body.rod + body.half);
  const near = Math.min((high - 30) / depth, (0.5 * width) / scene.width);
  // The second part is around the hinge.
  const bottom = 24 + near * scene.hinge;
  const parts = [[0, 0.22 * width, high - 10, whole], [0.45 * width, 0.73 * width, bottom, near]];
  for (const [left, middle, bottom, scale] of parts) {
    c.save();
    c.beginPath();
    c.rect(left, 0, width, high);
    c.clip();
    c.translate(middle, bottom);
    c.scale(scale, scale);
    c.lineWidth = 1.5 / scale;
    drawBlock(c, scene, body, 0, left ? [[-angle, PALE], [angle, PALE], [0, BLUE]] : [[0, BLUE]]);
    c.restore();
  }
  [c.fillStyle, c.textAlign] = [INK, "center"];
  if (body.exists) c.fillText(`rod ${format(body.rod)} m, bob ${format(2 * body.radius)} m wide`, 0.73 * width, 16);
}

// The block that rocks

let shown = [], clock = 0, before = 0, frames = [];

/** Return time, tilt over nu and bob angle of a simulated motion now, and its history since `from`. */
function present({ history }, from) {
  const next = history.findIndex(([time]) => time > clock), n = next < 0 ? history.length - 1 : next;
  const [a, b] = [history[Math.max(n - 1, 0)], history[n]], share = (clock - a[0]) / (b[0] - a[0] || 1);
  const now = a.map((x, i) => x + Math.min(share, 1) * (b[i] - x));
  return { now, path: [...history.slice(0, n).filter(([time]) => time >= from), now] };
}

/** Show one frame of the animation; `time` is in ms. */
function animate(time) {
  frames = [...frames.filter((t) => t > time - 1000), time];
  // A page that was hidden does not catch up.
  const seconds = Math.min((time - before) / 1000, 0.1);
  before = time;
  if (state.play) {
    clock += seconds * state.speed;
    if (clock > duration()) clock = 0;
    drawMotions();
  }
  requestAnimationFrame(animate);
}

/** Draw both blocks as they are now, and the history of their tilts. */
function drawMotions() {
  const span = ground ? duration() : WINDOW / state.frequency, from = Math.max(0, clock - span);
  const body = bodyOf(scene, state), states = shown.map((motion) => present(motion, from));
  states.forEach(({ now: [time, tilt, swing] }, i) => {
    const name = ["without", "with"][i], { c, width, high } = cleared(byId(`block-${name}`));
    const floor = 0.4 * scene.height + scene.width, { hasEnded, outcome } = shown[i], phi = tilt * scene.nu;
    const scale = Math.min((high - 30) / scene.height, width / (0.9 * scene.height + scene.width));
    const shift = ground ? 0 : -state.amplitude * Math.sin(2 * Math.PI * state.frequency * clock);
    c.translate(width / 2 + shift * scale, high - 14);
    c.scale(scale, scale);
    c.lineWidth = 1.5 / scale;
    drawBlock(c, scene, i ? body : null, phi, [[swing, BLUE]]);
    drawLine(c, [[-floor, 0], [floor, 0]], INK, 2.5 / scale);
    const text = `Tilt ${((phi * 180) / Math.PI).toFixed(2)}° at ${time.toFixed(1)} s.`;
    byId(`state-${name}`).textContent = hasEnded && time < clock ? `The block ${outcome}.` : text;
  });
  const points = states.flatMap(({ path }) => path), larger = (a, [, tilt]) => Math.max(a, Math.abs(tilt));
  const most = 1.1 * Math.min(1.2, points.reduce(larger, 0.1));
  const view = cleared(byId("trace")), vertical = { low: -most, high: most, label: "tilt" };
  const { px, py } = drawAxes(view, { low: from, high: from + span, label: "time (s)" }, vertical);
  const lines = states.map(({ path }) => path.map(([t, tilt]) => [px(t), py(clamped(tilt, -most, most))]));
  drawLine(view.c, lines[0], GREY, 2, [5, 3]);
  drawLine(view.c, lines[1], BLUE, 1.8);
}

// Everything together

/** Return the largest values without a pendulum, which only a change of the excitation or of the start changes. */
function simulateAlone() {
  const key = JSON.stringify([grounds?.indexOf(ground), excitation(), state.push]);
  if (simulateAlone.key !== key) [simulateAlone.key, simulateAlone.values] = [key, simulate(null)];
  return simulateAlone.values;
}

/** Return the motion to which the limits apply, or null, and its source. */
function limitedMotion(now, largest) {
  if (ground && !largest.hasEnded) return [largest, SIMULATED];
  if (!Number.isFinite(now?.tilt.value)) return [null, "bob at rest"];
  const [tilt, swing, without] = [now.tilt, now.swing, now.without].map(({ value }) => value);
  return [{ tilt, swing, without, rodAngle: swing + tilt * scene.nu }, `steady motion, ${now.swing.source}`];
}

/** Compute and show everything that depends on the controls. */
function update(isNew = true) {
  const { mass, length, damping } = state, pendulum = { mass, length, damping };
  const body = bodyOf(scene, pendulum), now = steady(), largest = simulate(pendulum), alone = simulateAlone();
  const [motion, basis] = limitedMotion(now, largest), shares = limitShares(scene, limits, pendulum, motion, body);
  showResults(now, shares, basis, largest, alone, pendulum, body);
  if (now) [drawResponse(now), drawShares(), drawMap(now)];
  drawDesign(motion ? motion.rodAngle : 0, basis, body);
  if (trials && isNew) simulateRuns(pendulum);
  // Figures of another size show the same motion.
  [shown, clock] = [[alone, largest], isNew ? 0 : clock];
  drawMotions();
  const stale = "Verdict of the report, which does not hold for the values below: ";
  byId("verdict").textContent = data.verdict && !controls.every(isFirst) ? stale + data.verdict : data.verdict;
  if (ground) byId("ground").textContent = `peak ${format(ground.peak * state.level)} m/s²`;
  if (data.levels?.length) drawLevels();
  const exceeded = shares.filter(({ exceeded }) => exceeded).map(({ name }) => data.limit_labels[name]);
  const outcomes = `With your pendulum the block ${largest.outcome}; without a pendulum it ${alone.outcome} `
    + `(one motion ${state.push ? "after a push" : "from rest"}, ${spanText()}). `;
  const tilts = now ? `Steady-state tilt ${steadyText(now.tilt, largest)} with your pendulum, `
    + `${steadyText(now.without, alone)} without. ` : "";
  const verdict = exceeded.length ? `Limits exceeded: ${exceeded.join(", ")}` : "No limit is exceeded";
  const sentence = shares.length ? `${verdict} (${basis}).` : "No limit is evaluated.";
  // A screen reader says the result once the slider has stopped.
  clearTimeout(update.timer);
  update.timer = setTimeout(() => (byId("summary").textContent = outcomes + tilts + sentence), 400);
}

/** Fill the page for the first time, and listen to its controls. */
function begin() {
  byId("title").textContent = document.title = data.title ? `${data.title}: explore the design` : "Explore the design";
  byId("version").textContent = `Written by tpd ${data.version}.`;
  const others = data.other_limits.join(", ");
  byId("other-limits").textContent = others && `Not evaluated on this page: ${others}.`;
  for (const part of document.querySelectorAll(".harmonic")) part.hidden = Boolean(ground);
  byId("ground-text").hidden = byId("motion").hidden = !ground;
  byId("levels-figure").hidden = !data.levels?.length;
  byId("motion").append(...(grounds ?? []).map(({ name }, i) => create("option", { textContent: name, value: i })));
  byId("motion").addEventListener("change", ({ target }) => ((ground = grounds[target.value]), update()));
  byId("runs-words").textContent = trials?.words ?? "";
  controls.forEach(addControl);
  const first = Object.fromEntries(controls.map(({ name, value }) => [name, value]));
  byId("reset").addEventListener("click", () => ((byId("motion").value = 0), (ground = grounds?.[0]), set(first)));
  const play = byId("play"), toggle = () => (play.textContent = (state.play = !state.play) ? "Pause" : "Play");
  play.addEventListener("click", toggle);
  byId("restart").addEventListener("click", () => ((clock = 0), drawMotions()));
  byId("speed").addEventListener("change", ({ target }) => (state.speed = Number(target.value)));
  const push = byId("push"), start = () => (push.value = state.push = typedIn(push, PUSH, state.push));
  push.addEventListener("change", () => (start(), update()));
  const choose = ({ offsetX, offsetY }) => {
    const { left, right, top, bottom } = drawMap.area;
    const [x, y] = [(offsetX - left) / (right - left), (bottom - offsetY) / (bottom - top)];
    // The labels beside the axes are no values.
    if (Math.min(x, y, 1 - x, 1 - y) >= 0) set({ mass: valueAt(ranges.mass, x), length: valueAt(ranges.length, y) });
  };
  for (const id of ["shares", "map"]) byId(id).addEventListener("click", choose);
  window.addEventListener("resize", () => update(false));
  // Readers who want less motion start the animation themselves.
  if (window.matchMedia("(prefers-reduced-motion: reduce)").matches) toggle();
  set(first);
  requestAnimationFrame(animate);
}

begin();
// Tests and measurements read these.
globalThis.tpdPage = {
  state, control: (name) => ranges[name], area: () => drawMap.area, clock: () => clock,
  frames: () => frames.length,
};
