"""Tables of symmetric orbits for the page: exact orbits on a grid, with bounds of the interpolation error.

An orbit of the page is a symmetric period-one orbit of the linear equations (25), see
`tpd.answers.symmetric_orbits`. Between the nodes of a grid the browser interpolates linearly along each axis.
"""

from __future__ import annotations

import base64
from collections.abc import Iterable, Sequence
from typing import Any, NamedTuple

import numpy as np

from tpd.compiled.columns import NEUTRAL, ROCKING, SIZES, UNSTABLE
from tpd.compiled.orbits import solve_orbits
from tpd.compiled.rows import row_of
from tpd.scene.parameters import Parameters
from tpd.scene.scene import Scene, dimensionless

NONE = 65535
"""Code of a node without the orbit. Any other code n stands for the value n/65534 times the scale of the
field."""
SAFETY = 2.0
"""Factor on the error that the second differences of the nodes estimate."""
_LEAST_DISTANCE = 0.4
"""Least distance of a node from a value that is made a node, in shares of the distance between nodes."""
_OTHERS = UNSTABLE, NEUTRAL


class GridAxis(NamedTuple):
    """Axis of a table, in SI units."""

    name: str
    """Name of the quantity in `tpd.scene.scene.Scene.quantities`."""
    values: np.ndarray
    """Nodes, increasing."""
    log: bool
    """Whether the browser interpolates over the logarithm of the quantity."""

    @property
    def places(self) -> np.ndarray:
        """Nodes on the scale on which values are interpolated."""
        return np.log(self.values) if self.log else self.values


class Table(NamedTuple):
    """Orbits on a grid: the largest attracting one of every node, and the largest one that repels."""

    axes: tuple[GridAxis, ...]
    fields: dict[str, np.ndarray]
    """Tilt over the slenderness and bob angle (rad) of the attracting orbit, `tilt` and `swing`, tilt of the
    repelling one, `unstable`, and bounds of the interpolation error of the first two, `tilt_error` and
    `swing_error`; NaN where there is no such orbit, or the bound is not known."""

    def encoded(self, *names: str) -> dict[str, Any]:
        """Return axes and some of the fields (default all) as numbers and texts for JSON.

        Values become whole numbers of two bytes in base64, rounded by at most 1e-5 of the largest value.
        """
        fields = {}
        for name in names or self.fields:
            values = self.fields[name]
            scale = float(np.nanmax(values, initial=0.0)) or 1.0
            codes = np.where(np.isnan(values), NONE, np.rint(np.nan_to_num(values) / scale * (NONE - 1)))
            # The browser reads numbers in the byte order of its machine, which is little-endian everywhere.
            data = base64.b64encode(codes.astype("<u2").tobytes()).decode()
            fields[name] = {"scale": scale, "data": data}
        axes = [{"name": a.name, "values": a.values.tolist(), "log": a.log} for a in self.axes]
        return {"axes": axes, "fields": fields}


def axis(
    name: str, low: float, high: float, count: int, keep: Iterable[float] = (), *, log: bool = True
) -> GridAxis:
    """Return an axis between two values, on which some values are nodes.

    Args:
        name: of the quantity.
        low: first node.
        high: last node.
        count: number of nodes without those that are kept.
        keep: values that must be nodes; values out of range are left out.
        log: whether nodes are evenly spaced on the logarithm.
    """
    even = np.geomspace(low, high, count) if log else np.linspace(low, high, count)
    scale = np.log if log else np.asarray
    step = float(scale(even[1]) - scale(even[0]))
    nodes = [float(x) for x in even]
    for value in keep:
        if low < value < high:
            # A node next to this value would only make the table larger. Both ends stay.
            inner = [x for x in nodes[1:-1] if abs(float(scale(x) - scale(value))) > _LEAST_DISTANCE * step]
            nodes = sorted({nodes[0], *inner, float(value), nodes[-1]})
    return GridAxis(name, np.array(nodes), log)


def solve(scene: Scene, axes: Sequence[GridAxis], pendulum: Any = None) -> Table:
    """Return the exact orbits of a scene on a grid of SI quantities.

    Args:
        scene: block and harmonic; its values of the quantities of the axes are not used.
        axes: quantities that vary.
        pendulum: a `Pendulum` whose values hold where no axis varies them; None is no pendulum.
    """
    # All nodes are one batch of the compiled code, which solves them on all cores.
    grid = np.meshgrid(*(a.values for a in axes), indexing="ij")
    shape = grid[0].shape
    # Housner's restitution stays tied to the mass of the bob, which may vary along an axis.
    quantities = scene.quantities(pendulum) | {a.name: x.ravel() for a, x in zip(axes, grid, strict=True)}
    orbits = solve_orbits(row_of(Parameters(**dimensionless(quantities))))
    nu = float(scene.block.slenderness)
    sizes, status = orbits["sizes"], orbits["status"].astype(int)
    # Of several attracting orbits the page shows the largest, which is the cautious choice. Orbits next to a
    # fold count as none: their stability is not known.
    # The linear model has orbits also beyond the toppling tilt, where no block rocks.
    largest = sizes[..., SIZES["amplitude"]] / nu
    attracts, repels = (np.isin(status, kinds) & (largest < 1.0) for kinds in (ROCKING, _OTHERS))
    fields = {
        "tilt": _first(largest, attracts).reshape(shape),
        "swing": _first(sizes[..., SIZES["swing"]], attracts).reshape(shape),
        "unstable": _first(largest, repels).reshape(shape),
    }
    errors = {f"{name}_error": interpolation_error(fields[name], axes) for name in ("tilt", "swing")}
    return Table(tuple(axes), fields | errors)


def _first(sizes: np.ndarray, is_wanted: np.ndarray) -> np.ndarray:
    """Sizes (n, orbits) of the first wanted orbit of each row, NaN without any; orbits come largest first."""
    # Without a wanted orbit the index is 0, and the orbit is not wanted.
    first = np.arange(len(sizes)), np.argmax(is_wanted, axis=1)
    return np.where(is_wanted[first], sizes[first], np.nan)


def interpolation_error(values: np.ndarray, axes: Sequence[GridAxis]) -> np.ndarray:
    """Return an estimate of the largest error of the multilinear interpolation next to each node.

    Linear interpolation between two nodes at the distance h has at most the error h^2/8 |v''|. The second
    derivative follows from three nodes, and the errors of all axes are added. Next to a node without an orbit
    three nodes are missing: there the error along an axis is a quarter of the largest step to a neighbour, or
    zero without a neighbour, because nothing is interpolated along this axis then. This is an estimate and no
    proof: the tests measure how often it holds. NaN where there is no orbit.
    """
    total = np.zeros_like(values)
    for i, a in enumerate(axes):
        # The axis comes last, so that differences along it need no further index.
        v, h = np.moveaxis(values, i, -1), np.diff(a.places)
        beside = [(0, 0)] * (v.ndim - 1) + [(1, 1)]
        steps = np.pad(np.diff(v, axis=-1), beside, constant_values=np.nan)
        # Second derivative at the inner nodes, for nodes at unequal distances.
        curvature = 2.0 * np.abs(np.diff(steps[..., 1:-1] / h, axis=-1)) / (h[1:] + h[:-1])
        # A node belongs to the cells on both sides: the wider one has the larger error.
        widest = np.maximum(np.append(h, 0.0), np.append(0.0, h))
        error = np.pad(curvature, beside, constant_values=np.nan) * widest**2 / 8.0
        # The first and the last node have the curvature of their neighbours.
        if len(h) > 1:
            for end in (0, -1):
                error[..., end] = curvature[..., end] * h[end] ** 2 / 8.0
        jump = 0.25 * np.fmax(np.abs(steps[..., :-1]), np.abs(steps[..., 1:]))
        total = total + np.moveaxis(np.where(np.isnan(error), np.nan_to_num(jump), error), -1, i)
    return np.where(np.isnan(values), np.nan, SAFETY * total)
