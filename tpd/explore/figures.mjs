// Drawing on canvases: axes, lines, marks, hatching, and block and pendulum to scale.

import { shareOf } from "./orbits.mjs";

export const INK = "#1a1a1a", GREY = "#9a9a9a", BLUE = "#1f5fa8", PALE = "#a9c3df", ORANGE = "#d9822b";
const STONE = "#e4e4e4";

/** Return a number as a text of a few digits. */
export function format(x, digits = 3) {
  return Number.isFinite(x) ? String(Number(x.toPrecision(digits))) : "unknown";
}

/** Return the context of a cleared canvas, its width and its height in CSS pixels. */
export function cleared(canvas) {
  const ratio = window.devicePixelRatio || 1, width = canvas.clientWidth, high = canvas.clientHeight;
  const sizes = [width, high].map((size) => Math.round(size * ratio));
  // A canvas that gets a new size allocates memory: most frames keep it.
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
    const numbers = Array.from({ length: 60 }, (_, i) => [1, 2, 5][i % 3] * 10 ** (Math.floor(i / 3) - 8));
    return numbers.filter((x) => x >= low && x <= high);
  }
  const power = 10 ** Math.floor(Math.log10((high - low) / 5));
  const step = [1, 2, 5, 10].map((n) => n * power).find((s) => (high - low) / s <= 6);
  return Array.from({ length: 8 }, (_, i) => (Math.ceil(low / step) + i) * step).filter((x) => x <= high);
}

/** Draw axes of two ranges { low, high, log, label }, and return the places of values on them. */
export function drawAxes({ c, width, high }, x, y) {
  const left = 48, right = width - 12, top = 10, bottom = high - 34;
  const px = (value) => left + (right - left) * shareOf(x, value);
  const py = (value) => bottom - (bottom - top) * shareOf(y, value);
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
export function drawLine(c, points, color, width, dash = []) {
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
export function drawMark(c, x, y, isStar = false) {
  c.beginPath();
  for (let i = 0; i < (isStar ? 10 : 24); i++) {
    const radius = isStar ? [13, 6][i % 2] : 5, angle = (2 * Math.PI * i) / (isStar ? 10 : 24);
    c.lineTo(x + radius * Math.sin(angle), y - radius * Math.cos(angle));
  }
  c.closePath();
  c.fillStyle = isStar ? "white" : ORANGE;
  c.fill();
  // A white edge sets the mark apart from a dark field.
  for (const [color, width] of [["white", 4], [INK, 1.5]]) {
    [c.strokeStyle, c.lineWidth] = [color, width];
    c.stroke();
  }
}

/** Hatch a region of rectangles. Regions with different numbers have lines of different directions. */
export function hatch(c, places, [wide, tall], number) {
  const lines = Array.from({ length: 400 }, (_, i) => 7 * (i - 200));
  c.save();
  c.beginPath();
  for (const [x, y] of places) c.rect(x, y, wide + 0.5, tall + 0.5);
  c.clip();
  c.fillStyle = "rgba(255, 255, 255, 0.35)";
  c.fill();
  c.rotate((Math.PI / 4) * [1, 3, 2, 0, 1.5, 2.5][number % 6]);
  drawLine(c, lines.flatMap((x) => [[x, -2000], [x, 2000], [0, NaN]]), "rgba(26, 26, 26, 0.55)", 1);
  c.restore();
}

/** Return the pieces of the line of a level through a grid of values, as pairs of places in cells. */
export function contour(values, columns, level) {
  return values.flatMap((_, n) => {
    const x = n % columns, y = Math.floor(n / columns);
    if (x + 1 === columns || n + columns >= values.length) return [];
    const corners = [[x, y], [x + 1, y], [x + 1, y + 1], [x, y + 1]].map(([i, j]) => [i, j, values[i + j * columns]]);
    const crossings = corners.flatMap(([i, j, here], side) => {
      const [right, below, there] = corners[(side + 1) % 4], share = (level - here) / (there - here);
      return here < level === there < level ? [] : [[i + share * (right - i), j + share * (below - j)]];
    });
    // A saddle has four crossings, and two pieces.
    return [crossings.slice(0, 2), crossings.slice(2)].filter((piece) => piece.length);
  });
}

/** Write a text with a white edge around a place, within the width of the figure. */
export function writeOver(c, text, x, y) {
  const half = c.measureText(text).width / 2, most = c.canvas.clientWidth - half - 14;
  [c.textAlign, c.strokeStyle, c.lineWidth, c.fillStyle] = ["center", "white", 4, INK];
  for (const write of ["strokeText", "fillText"]) c[write](text, Math.max(half + 50, Math.min(x, most)), y);
}

/** Draw a rod and its bob, in m from the hinge. */
function drawPendulum(c, scene, body, angle, color) {
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

/** Draw the block and its cavity or frame, in m from the middle of its base, and pendulums as [angle, color]. */
export function drawBlock(c, scene, body, tilt, pendulums) {
  const corner = (Math.sign(tilt) * scene.width) / 2, { height } = scene;
  c.save();
  c.translate(corner, 0);
  c.rotate(tilt);
  c.translate(-corner, -height);
  c.strokeStyle = INK;
  const cavity = scene.frame ? 0 : 2 * (scene.wall ?? 0), above = scene.hinge - height;
  for (const [width, color] of [[scene.width, STONE], [cavity, "white"]]) {
    c.fillStyle = color;
    c.fillRect(-width / 2, 0, width, height);
    if (width) c.strokeRect(-width / 2, 0, width, height);
  }
  if (scene.frame) c.strokeRect(-scene.wall, -above, 2 * scene.wall, above);
  // The hinge may be below or above the top. The angle of the bob is measured from the vertical.
  c.translate(0, height - scene.hinge);
  if (body) for (const [swing, color] of pendulums) drawPendulum(c, scene, body, swing - tilt, color);
  c.restore();
}
