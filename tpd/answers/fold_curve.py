"""Curve of folds in two parameters: the border of the region in which a block cannot rock symmetrically.

At a fold the largest symmetric orbit and the saddle merge and vanish. The fold is a zero of three functions
of crossing time, phase and parameters (`tpd.compiled.orbits.Vanishing`), so two parameters leave a curve
in four unknowns. Two orbits that merge between points of a grid are the initial guess, and pseudo-arclength
continuation follows the curve: a step along the tangent, then Newton's method in the plane
normal to the tangent. The curve can therefore turn back in either parameter.
"""

from __future__ import annotations

import math
from collections.abc import Iterator
from dataclasses import dataclass
from enum import StrEnum
from typing import Any, NamedTuple

import numpy as np
from scipy.ndimage import binary_erosion

from tpd.answers.design_map import check_together, line_of
from tpd.compiled.columns import CROSSED, MERGED, SIZES, TURNING, XI, F
from tpd.compiled.orbits import sample_path, solve_orbits, vanishing
from tpd.core import checks
from tpd.core.formatting import Printed, span
from tpd.scene.parameters import NAMES, Parameters
from tpd.scene.quantities import UNITS, Setup, named
from tpd.scene.scene import Pendulum, Scene

_RANGES: dict[str, tuple[float, float]] = {
    **{"nu": (0.05, 0.5), "mu": (0.0, 1.0), "lam": (0.05, 3.0), "zeta": (0.0, 1.0), "k": (0.0, 0.3)},
    **{"f": (0.01, 1.0), "xi": (0.5, 10.0), "rho": (0.1, 1.0), "e": (0.3, 1.0), "kappa": (0.5, 2.5)},
}
"""Default ranges of parameters, which include most scenes. Quantities of a scene have no default."""
_EQUATIONS = [TURNING, CROSSED, MERGED]
"""Entries of `vanishing` that are zero at a fold."""
_FIRST, _LONGEST, _SHORTEST = 1e-2, 2e-2, 1e-7
"""First, longest and shortest step along the curve. A step of 1 is half a period in the crossing time, 1 rad
in the phase, or the whole range of a parameter."""
_STRAIGHT = math.cos(0.15)
"""Smallest cosine of the angle between the tangents at the two ends of a step."""
_LARGEST_STEP = 0.3
"""Largest step of Newton's method, in the same unit. From farther away it may converge to another fold."""
_CONVERGED, _MOST_STEPS = 1e-9, 12
"""Newton step at which the error is at rounding, because the next step would be of the size of its square,
and largest number of steps."""
_GRID, _GUESSES = 65, 50
"""Number of values of each parameter at which orbits are computed, and largest number of first guesses."""
_HALVINGS = 40
"""Number of bisections of the last step. The last point is within rounding of the end of the curve."""
_TINY = 1e-100
"""Imaginary step for complex-step differentiation."""


class End(StrEnum):
    """Reasons why a curve of folds ends."""

    bound = "bound"
    """A parameter reaches an end of its range."""
    cusp = "cusp"
    """The curve has a cusp, where it meets another curve of folds."""
    no_orbit = "no_orbit"
    """Beyond this point the equations of the fold have a solution that is no motion: the block would stick,
    turn back or touch its base between the turns."""
    closed = "closed"
    """The curve returns to its beginning."""
    most_points = "most_points"
    """The largest number of points is reached."""
    stalled = "stalled"
    """Newton's method does not converge, even after the shortest step."""
    no_fold = "no_fold"
    """The curve has no point: no two orbits merge between the points of a grid over these ranges."""


@dataclass(frozen=True, kw_only=True, repr=False)
class FoldCurve(Printed):
    """Folds of symmetric period-one orbits along a curve in two parameters. Angles are in rad."""

    x_name: str
    """Name of the first parameter or quantity."""
    y_name: str
    """Name of the second parameter or quantity."""
    points: np.ndarray
    """Values of both, shape (n, 2), in the order along the curve. The first value increases at the point that
    is closest to the subject."""
    tangents: np.ndarray
    """Directions of the curve, shape (n, 2). Their lengths are 1 if each parameter is divided by its
    range."""
    statuses: tuple[End, End]
    """Reasons why the curve ends, at its first point and at its last point."""
    amplitude: np.ndarray
    """Largest |phi| of the orbit, shape (n,)."""
    phase: np.ndarray
    """Phase xi tau of the forcing at the upper turn, in (-pi, pi], shape (n,)."""
    crossing: np.ndarray
    """Dimensionless time from the upper turn to the crossing of phi = 0, shape (n,)."""
    gradients: np.ndarray
    """Gradients of the condition in both numbers, shape (n, 2). They are normal to the curve and point to the
    side without the orbits. Almost everywhere the condition is f_fold - f with the smallest forcing f_fold;
    where more forcing removes the orbits, it is f - f_fold with the largest forcing."""
    slopes: np.ndarray
    """Derivatives of the same condition with respect to all parameters, in the order of
    `tpd.scene.parameters.NAMES`, each with the others constant. The derivative with respect to f is -1 or
    1."""

    def __str__(self) -> str:
        first, last = (status.value.replace("_", " ") for status in self.statuses)
        if not len(self.points):
            return f"Curve of folds in {self.x_name} and {self.y_name}: {last}"
        (x, y), rows = self.points.T, {"amplitude": (self.amplitude, "rad")}
        rows = {name: (v, UNITS.get(name, "")) for name, v in ((self.x_name, x), (self.y_name, y))} | rows
        title = f"Curve of folds, {len(self.points)} points, from {first} to {last}"
        return "\n".join([title, *(f"  {name:15} {span(*values)}" for name, values in rows.items())])


def fold_curve(
    subject: Parameters | Scene,
    x: str,
    y: str,
    *,
    x_range: tuple[checks.Real, checks.Real] | None = None,
    y_range: tuple[checks.Real, checks.Real] | None = None,
    pendulum: Pendulum | None = None,
    most: checks.Whole = 1000,
) -> FoldCurve:
    """Follow the folds of symmetric period-one orbits along their curve in two parameters.

    On one side of the curve two orbits exist, of which one usually attracts. On the other side both are lost,
    and with them this rocking. Other motions are not excluded there: see `tpd.branches` and `tpd.design_map`.
    Each point satisfies the equations of the fold to rounding.

    Several curves can cross the ranges. The result is the curve that is closest to the subject.

    Args:
        subject: dimensionless parameters, or a scene. Its own values of `x` and `y` only select the curve.
        x: name of the first parameter or quantity, see `tpd.answers.bifurcations`.
        y: name of the second.
        x_range: lowest and highest value of `x`. Only parameters have a default.
        y_range: lowest and highest value of `y`.
        pendulum: pendulum of the scene; None without a pendulum.
        most: largest number of points.

    Raises:
        ValueError: unknown names, two names that change the same parameter, a quantity without a range,
            batched parameters, or a range that is empty or not allowed.
        RuntimeError: JAX is in 32-bit mode.

    Example:
        >>> import tpd
        >>> p = tpd.Parameters(nu=0.2, mu=0.05, lam=0.8, zeta=0.1, k=0.0, f=0.0286, xi=3.0, e=0.9)
        >>> curve = tpd.fold_curve(p, "mu", "f", x_range=(0.0, 0.2), y_range=(0.01, 0.1))
        >>> [status.value for status in curve.statuses], len(curve.points) > 10
        (['bound', 'bound'], True)
    """
    checks.require_x64()
    setup, most = Setup.of(subject, pendulum), checks.count("most", most, 2, 1_000_000)
    lines = {}
    for argument, name, ends in (("x", named(x), x_range), ("y", named(y), y_range)):
        # The name is checked first, because the message about a missing range would hide a wrong name.
        setup.check_name(argument, name)
        ends = _RANGES.get(name) if ends is None else ends
        if ends is None:
            raise ValueError(f"`{argument}_range` must be given for {name!r}, which has no default range")
        ends = checks.interval(f"{argument}_range", ends, -math.inf, math.inf)
        lines[name] = line_of(setup, argument, (name, ends))[1]
    check_together(setup, lines)
    folds = _Folds.between(setup, lines)
    start = next(folds.guesses(), None)
    if start is None:
        return _result(folds, [], (End.no_fold, End.no_fold))
    # The start is somewhere in the middle of the curve.
    ahead, last = _followed(folds, start, most)
    if last is End.closed:
        return _result(folds, ahead, (last, last))
    # The same walk in the opposite direction leads to the other end.
    behind, first = _followed(folds, start.turned(), most)
    return _result(folds, [point.turned() for point in behind[:0:-1]] + ahead, (first, last))


class _Point(NamedTuple):
    """Fold on the curve. The unknowns z are crossing time, phase and both numbers that vary."""

    z: np.ndarray
    """Unknowns, shape (4,)."""
    tangent: np.ndarray
    """Tangent of the curve in the scaled unknowns, of length 1."""
    merging: np.ndarray
    """Direction in crossing time and phase in which both orbits merge."""
    bend: float
    """Derivative of the determinant in this direction, which is zero at a cusp."""
    amplitude: float
    """Largest |phi|; NaN if the path is no orbit."""
    gradient: np.ndarray
    """See `FoldCurve.gradients`."""
    slopes: np.ndarray
    """See `FoldCurve.slopes`."""

    def turned(self) -> _Point:
        """Return the point with the opposite tangent."""
        return self._replace(tangent=-self.tangent)


class _Folds(NamedTuple):
    """Equations of the fold in crossing time, phase and two numbers of a setup."""

    setup: Setup
    """All numbers."""
    names: tuple[str, ...]
    """Names of both numbers that vary."""
    low: np.ndarray
    """Lowest values of both."""
    high: np.ndarray
    """Highest values of both."""
    scale: np.ndarray
    """Units of the unknowns."""

    @staticmethod
    def between(setup: Setup, lines: dict[str, np.ndarray]) -> _Folds:
        """Return the equations for two names with their lowest and highest values."""
        low, high = np.array(list(lines.values())).T
        # The unit of the crossing time only has to have the right size, and may be that of another xi.
        middle = setup.vector(dict(zip(lines, 0.5 * (low + high), strict=True)))
        return _Folds(setup, tuple(lines), low, high, np.array([np.pi / middle[XI], 1.0, *(high - low)]))

    def at(self, z: np.ndarray) -> tuple[np.ndarray, np.ndarray, np.ndarray, np.ndarray]:
        """Return the values of the equations, shape (3,), their derivatives in the unknowns and in the
        parameters, shapes (3, 4) and (3, 10), and the parameters."""
        numbers: dict[str, Any] = dict(zip(self.names, z[2:], strict=True))
        # Complex-step differentiation, as in `tpd.scene.quantities.Axis.jacobian`.
        rows = [self.setup.vector({**numbers, n: complex(v, _TINY)}) for n, v in numbers.items()]
        x, x_by = np.real(rows[0]), np.imag(rows).T / _TINY
        values, by_u, by_x = (part[_EQUATIONS] for part in vanishing(np.append(z[:2], 1.0), x))
        return values, np.hstack([by_u[:, :2], by_x @ x_by]), by_x, x

    def solved(self, z: np.ndarray, normal: np.ndarray | None = None) -> np.ndarray | None:
        """Return the fold near z by Newton's method; None if it does not converge nearby.

        With a normal the fold lies in the plane through z with this normal. Without it each step is the
        shortest one to the linearised curve.
        """
        for _ in range(_MOST_STEPS):
            values, by_z, _, _ = self.at(z)
            system, wanted = by_z * self.scale, -values
            if normal is not None:
                system, wanted = np.vstack([system, normal]), np.append(wanted, 0.0)
            # Lengths and frequencies must be positive, also in a step beyond the end of a range.
            if np.any((z[2:] <= 0.0) & (self.low > 0.0)) or not np.all(np.isfinite(system)):
                return None
            # Of the solutions of three equations in four unknowns this is the shortest.
            step = np.linalg.lstsq(system, wanted, rcond=None)[0]
            z, size = z + step * self.scale, np.abs(step).max()
            if size < _CONVERGED or size > _LARGEST_STEP:
                return z if size < _CONVERGED else None
        return None

    def point(self, z: np.ndarray, before: _Point | None = None) -> _Point:
        """Return the fold at a solution, with directions that continue those of the point before."""
        _, by_z, by_x, x = self.at(z)
        by_u = by_z[:, :2]
        tangent, (columns, _, rows) = np.linalg.svd(by_z * self.scale)[2][-1], np.linalg.svd(by_u[:2])
        # The last column combines both equations of the orbit in such a way that they do not depend on
        # crossing time and phase, to first order. To second order they are a square, whose sign is that of
        # the product, and the orbits are lost where the change by the parameters has the same sign.
        combined = columns[:, 1] * np.sign(np.linalg.det(columns) * np.linalg.det(rows) * (by_u[2] @ rows[1]))
        combined = combined / np.abs(combined @ by_x[:2, F])
        merging = rows[1]
        # The signs of singular vectors are arbitrary. They must not change along the curve.
        if before is not None:
            tangent = tangent * np.sign(tangent @ before.tangent)
            merging = merging * np.sign(merging @ before.merging)
        # A solution of the equations is an orbit only if the block moves down all the way to its next turn.
        path, half = sample_path(z[:2], x), np.pi / x[XI]
        falling = max(float(path.rates.max()), path.leaving, path.arriving) < 0.0
        amplitude = path.height if falling and path.height > 0.0 and 0.0 < z[0] < half else math.nan
        slopes = combined @ by_z[:2, 2:], combined @ by_x[:2]
        return _Point(z, tangent, merging, float(by_u[2] @ merging), amplitude, *slopes)

    def ahead(self, point: _Point, step: float) -> _Point | None:
        """Return the fold one step ahead of a point; None if Newton's method does not converge nearby."""
        z = self.solved(point.z + step * point.tangent * self.scale, point.tangent)
        return None if z is None else self.point(z, point)

    def end(self, before: _Point, point: _Point) -> End | None:
        """Return the reason why the curve ends between two points; None if it does not end."""
        if np.any(point.z[2:] < self.low) or np.any(point.z[2:] > self.high):
            return End.bound
        if math.isnan(point.amplitude):
            return End.no_orbit
        return End.cusp if point.bend * before.bend < 0.0 else None

    def guesses(self) -> Iterator[_Point]:
        """Yield folds near pairs of orbits that merge on a grid, those closest to the subject first."""
        grid = np.stack(np.meshgrid(*np.linspace(self.low, self.high, _GRID).T, indexing="ij"))
        numbers = self.setup.vector(dict(zip(self.names, grid, strict=True)))
        rows = np.stack(np.broadcast_arrays(*numbers), axis=-1).reshape(-1, len(NAMES))
        places = solve_orbits(rows)["sizes"][..., [SIZES["crossing"], SIZES["phase"]]]
        # Of the orbits of a design those two merge that are closest to each other, and a fold lies between
        # two neighbours on the grid of which only one has the orbits. The phase is unknown by whole turns.
        gaps = np.diff(places, axis=1)
        gaps[..., 1] = np.remainder(gaps[..., 1] + np.pi, 2.0 * np.pi) - np.pi
        apart = np.nan_to_num(np.abs(gaps / self.scale[:2]).sum(axis=-1), nan=np.inf)
        pair, n = np.argmin(apart, axis=1), np.arange(len(rows))
        middles = (places[n, pair] + 0.5 * gaps[n, pair]).reshape(_GRID, _GRID, 2)
        has_pair = np.isfinite(middles[..., 0])
        is_near = has_pair & ~binary_erosion(has_pair, border_value=1)
        starts = np.concatenate([middles[is_near], grid[:, is_near].T], axis=1)
        middle = zip(self.names, 0.5 * (self.low + self.high), strict=True)
        own = [self.setup.values.get(name, value) for name, value in middle]
        apart = np.abs((starts[:, 2:] - own) / self.scale[2:]).sum(axis=1)
        for start in starts[np.argsort(apart)][:: len(starts) // _GUESSES + 1]:
            if (z := self.solved(start)) is not None:
                point = self.point(z)
                # The solution can lie outside of the ranges, or belong to a path that is no motion.
                if self.end(point, point) is None:
                    yield point.turned() if point.tangent[2] < 0.0 else point


def _followed(folds: _Folds, start: _Point, most: int) -> tuple[list[_Point], End]:
    """Return the points of the curve ahead of a point, which comes first, and the reason of the end."""
    points, step = [start], _FIRST
    while len(points) < most:
        point = folds.ahead(points[-1], step)
        # On a sharp turn Newton's method could converge to another part of the curve.
        if point is None or point.tangent @ points[-1].tangent < _STRAIGHT:
            step *= 0.5
            if step < _SHORTEST:
                return points, End.stalled
            continue
        if (end := folds.end(points[-1], point)) is not None:
            return _bisected(folds, points, step, end)
        points.append(point)
        back = (start.z - point.z) / folds.scale
        # The first steps are also close to the start, but lead away from it.
        if np.abs(back).max() < step and back @ point.tangent > 0.0 and point.tangent @ start.tangent > 0.9:
            return [*points, start], End.closed
        # Most of the curve is smooth, so the step recovers after each sharp turn.
        step = min(1.5 * step, _LONGEST)
    return points, End.most_points


def _bisected(folds: _Folds, points: list[_Point], step: float, end: End) -> tuple[list[_Point], End]:
    """Return the points with the last one before the curve ends, which is within a step, and the reason."""
    last, good = points[-1], 0.0
    for _ in range(_HALVINGS):
        middle = 0.5 * (good + step)
        point = folds.ahead(points[-1], middle)
        # Newton's method can fail close to the end, as it does beyond it.
        reason = end if point is None else folds.end(points[-1], point)
        if point is None or reason is not None:
            step, end = middle, reason or end
        else:
            good, last = middle, point
    return [*points, last] if good else points, end


def _result(folds: _Folds, points: list[_Point], statuses: tuple[End, End]) -> FoldCurve:
    """Return the result from the points."""
    z, tangents = (np.array([getattr(p, n) for p in points]).reshape(-1, 4) for n in ("z", "tangent"))
    # At a cusp the curve has no speed in both numbers, but still a direction.
    along = tangents[:, 2:] / np.linalg.norm(tangents[:, 2:], axis=1, keepdims=True)
    return FoldCurve(
        x_name=folds.names[0],
        y_name=folds.names[1],
        points=z[:, 2:],
        tangents=along * folds.scale[2:],
        statuses=statuses,
        amplitude=np.array([p.amplitude for p in points]),
        phase=np.remainder(z[:, 1] + np.pi, -2.0 * np.pi) + np.pi,
        crossing=z[:, 0],
        gradients=np.array([p.gradient for p in points]).reshape(-1, 2),
        slopes=np.array([p.slopes for p in points]).reshape(-1, len(NAMES)),
    )
