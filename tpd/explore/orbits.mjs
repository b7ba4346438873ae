// Tables of symmetric orbits that the package has solved, and multilinear interpolation between their nodes.
//
// A table has axes (one array of increasing values each) and fields. A field holds a whole number for each node, in
// C order: 65535 stands for "no such orbit", and any other number n for the value n / 65534 * scale.

const NONE = 65535;

/** Return the value at a share of a range { low, high, log }. */
export function valueAt({ low, high, log }, share) {
  return log ? low * (high / low) ** share : low + (high - low) * share;
}

/** Return the share of a range at which a value lies. */
export function shareOf({ low, high, log }, value) {
  return log ? Math.log(value / low) / Math.log(high / low) : (value - low) / (high - low);
}

/** Return the bytes of a text in base64. */
export function bytesOf(text) {
  return Uint8Array.from(atob(text), (character) => character.charCodeAt(0)).buffer;
}

/** Return a table whose fields are decoded from base64. */
export function decode(table) {
  const fields = {};
  for (const [name, { scale, data }] of Object.entries(table.fields)) {
    fields[name] = { codes: new Uint16Array(bytesOf(data)), unit: scale / (NONE - 1) };
  }
  const strides = table.axes.map((_, i) => table.axes.slice(i + 1).reduce((n, axis) => n * axis.values.length, 1));
  return { axes: table.axes, fields, strides };
}

/** Return the cell of a value on an axis: the lower node, and the share of the cell below the value. */
function cellOf(axis, value) {
  const { values, log } = axis, last = values.length - 1;
  // Numbers from a text field differ from a node by rounding.
  const near = values.findIndex((node) => Math.abs(value - node) <= 1e-9 * node);
  if (near >= 0) return { low: near, share: 0 };
  if (!(value > values[0] && value < values[last])) return null;
  let low = 0;
  while (values[low + 1] < value) low++;
  return { low, share: shareOf({ low: values[low], high: values[low + 1], log }, value) };
}

/** Return the nodes around a point, their indices and weights; null outside of the table. */
export function place(table, point) {
  let corners = [[0, 1]];
  for (const [i, axis] of table.axes.entries()) {
    const cell = cellOf(axis, point[i]), stride = table.strides[i];
    if (cell === null) return null;
    corners = corners.flatMap(([index, weight]) => {
      const lower = [index + cell.low * stride, weight * (1 - cell.share)];
      // On a node the cell has no extent along this axis.
      return cell.share === 0 ? [lower] : [lower, [index + (cell.low + 1) * stride, weight * cell.share]];
    });
  }
  return corners;
}

/**
 * Return a field at a place, as { value, error, source }.
 *
 * The source is "exact" on a node, "interpolated" between nodes that all have the orbit, "none" between nodes
 * without it, and "not interpolated" where the nodes differ or the point is outside of the table. The error is the
 * estimated error of the interpolation, for a field that has one.
 */
export function lookUp(table, name, corners) {
  const { codes, unit } = table.fields[name], bounds = table.fields[`${name}_error`];
  const known = corners?.filter(([index]) => codes[index] !== NONE);
  if (known?.length === 0) return { value: NaN, source: "none" };
  if (known?.length !== corners?.length || !corners) return { value: NaN, source: "not interpolated" };
  const mean = (field) => known.reduce((sum, [index, weight]) => sum + weight * field.codes[index] * field.unit, 0);
  const isExact = known.length === 1, value = mean({ codes, unit });
  return { value, error: isExact || !bounds ? 0 : mean(bounds), source: isExact ? "exact" : "interpolated" };
}
