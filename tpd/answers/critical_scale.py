"""Factor on a ground motion from which a block overturns, and its derivative.

Overturning is not monotone in the size of a motion: above the smallest factor that overturns the block there
may be larger factors that do not. A critical scale is therefore the first crossing of a stated scan, and the
result also has the list of intervals (tongues) above it. The scan begins at a factor at which the block stays
on its base. While the block is at rest, the swing of the bob is proportional to the motion, so no
smaller factor lifts the block. At a crossing the state after the motion is on the stable manifold of the
unstable equilibrium of the tilted block: the growing coordinate q of the last arc vanishes there (for the
nonlinear model where the arc is nearest to that equilibrium), so

    d(scale)/dx = -(dq/dx)/(dq/d scale).
"""

from __future__ import annotations

from functools import partial
from typing import Any

import equinox as eqx
import jax
import jax.numpy as jnp
import numpy as np
from jax.lax import stop_gradient
from jaxtyping import Array, Float

from tpd.answers.run_table import Runs, follow_runs
from tpd.answers.transient import FREE, accuracy_of
from tpd.compiled import simulate
from tpd.compiled.columns import F
from tpd.compiled.derivatives import refused, unknown_in
from tpd.compiled.rows import ground_row_of
from tpd.compiled.simulate import GroundForcing
from tpd.core import checks
from tpd.core.checks import Real
from tpd.models.piecewise import Nonlinear, Piecewise
from tpd.scene.ground_motion import LONGEST_FREE, GroundMotion, refuse_zeros
from tpd.scene.parameters import Parameters
from tpd.scene.pytrees import Number, single
from tpd.scene.scene import Pendulum, Scene
from tpd.scene.status import Status, code_of

SCAN = 0.02
"""Default relative step of a scan."""
HIGHEST = 20.0
"""Default of the largest factor of a scan, relative to the factor that lifts the block without a pendulum."""
TONGUES = 32
"""Largest number of tongues in a result."""
_SECTIONS = 32
"""Number of parts into which an interval around a crossing is divided in one round."""
_HALVINGS = 20
"""Largest number of times that the beginning of a scan is halved: no pendulum reduces the factor that lifts
its block by more than a million."""
_NARROW = 1e-9
"""Relative width below which an interval without a result counts as a crossing."""


class CriticalScale(eqx.Module):
    """Factor on a ground motion from which a block overturns.

    Attributes:
        scale: first factor of the scan at which the block begins to overturn.
        tongues: intervals of factors at which the block overturns, shape (32, 2).
        scan: relative step of the scan.
        highest: largest factor of the scan.
        undecided: intervals of factors without a result, shape (32, 2).
    """

    scale: Number
    """First factor of the scan at which the block begins to overturn. Infinite if no factor of the scan
    overturns the block; NaN if it is unknown, because a run at a smaller factor has no result. Derivatives
    with respect to block, pendulum, and size and time scale of the motion are exact. Those in the samples of
    a record or the shape of a pulse, and those of an infinite or unknown factor, are NaN."""
    tongues: Float[Array, "tongues 2"]
    """Intervals of factors at which the block overturns, as far as the scan resolves them. The last one may
    end at the end of the scan. NaN where there are fewer intervals."""
    scan: float = eqx.field(static=True)
    """Relative step of the scan. Narrower tongues are not found."""
    highest: Number = float("nan")
    """Largest factor of the scan."""
    undecided: Float[Array, "tongues 2"] = eqx.field(default_factory=lambda: jnp.full((TONGUES, 2), jnp.nan))
    """Intervals of factors at which runs have no result, up to the next factors with a result. NaN where
    there are fewer intervals."""

    def __str__(self) -> str:
        if not checks.is_concrete(self.scale):
            return repr(self)
        scale, scan = float(self.scale), f"(scan of {self.scan:.2%})"
        unknown, tongues = _listed(self.undecided), _listed(self.tongues)
        without = f"; no result at {unknown}" if unknown else ""
        if np.isnan(scale):
            factors = f"overturns at {tongues}" if tongues else "no factor with a result overturns the block"
            return f"critical scale unknown {scan}: {factors}{without}"
        if np.isinf(scale):
            return f"does not overturn up to {self.highest:.4g} times the motion {scan}"
        return f"overturns from {scale:.10g} times the motion {scan}: {tongues}{without}"


def _listed(intervals: Array) -> str:
    """Return intervals as text."""
    return ", ".join(f"{a:.6g} to {b:.6g}" for a, b in np.asarray(intervals) if np.isfinite(a))


def critical_scale(
    scene: Scene,
    pendulum: Pendulum | None = None,
    *,
    scan: Real = SCAN,
    highest: Real | None = None,
    free: Real = FREE,
    model: Piecewise | Nonlinear | None = None,
) -> CriticalScale:
    """Find the smallest factor of a scan at which the motion of a scene overturns the block.

    Args:
        scene: a block under a `Pulse` or a `Record`.
        pendulum: pendulum of the block; None for the block without a pendulum.
        scan: relative step between the factors.
        highest: largest factor; by default 20 times the factor that lifts the block without a pendulum.
        free: duration of the free motion after the ground motion, s. If the last arc cannot return, the block
            overturns, whatever its tilt at the end is.
        model: `Piecewise()`, the linear model, by default, or `Nonlinear()`.

    Returns:
        The critical scale, to which `jax.jit` and `jax.grad` apply.

    Raises:
        ValueError: bad input, or a motion whose samples are all zero.
        RuntimeError: JAX is in 32-bit mode.

    Example:
        >>> import tpd
        >>> block = tpd.Block(width=1.0, height=6.0, mass=9000.0, restitution=0.9595)
        >>> scene = tpd.Scene(block, tpd.Pulse.one_sine(frequency=1.2375, acceleration=9.80665 / 6.0))
        >>> critical = tpd.critical_scale(scene, scan=0.05, highest=4.0)
        >>> round(float(critical.scale), 4)
        2.4865
    """
    checks.require_x64()
    checks.instance("scene", scene, Scene)
    checks.instance("excitation", scene.excitation, GroundMotion, ": a harmonic has no critical scale")
    refuse_zeros([scene.excitation])
    scan = checks.within("scan", scan, 1e-4, 0.5)
    free = checks.within("free", free, 0.0, LONGEST_FREE, " s")
    if highest is not None:
        highest = checks.within("highest", highest, 1e-9, 1e9)
    # As in `tpd.transient`, the linear model is the default.
    model = Piecewise() if model is None else model
    p, rate = single((scene.ground_parameters(pendulum), scene.rate))
    pieces, late = jnp.asarray(scene.excitation.pieces()), free * rate
    lifts = (1.0 + p.mu) * p.nu + p.k
    top = HIGHEST * lifts / p.f if highest is None else highest
    # `pure_callback` needs the shapes of its results before the scan runs.
    intervals = jax.ShapeDtypeStruct((TONGUES, 2), jnp.float64)
    shapes = jax.ShapeDtypeStruct((), jnp.float64), intervals, intervals

    # Below half of the factor that lifts the block without a pendulum only a pendulum can lift the block.
    ends = jnp.stack([jnp.asarray(x, dtype=jnp.float64) for x in (0.5 * lifts / p.f, top)])

    def scanned(x: Any, c: Any, late: Any, ends: Any) -> tuple[np.ndarray, ...]:
        run = partial(follow_motion, model, np.asarray(c), float(late))
        return _scanned(run, np.asarray(x), np.asarray(ends), scan)

    # The scan is a callback without derivatives. `_with_slope` adds them.
    inputs = jax.tree.map(stop_gradient, (ground_row_of(p), pieces, jnp.asarray(late), ends))
    first, tongues, undecided = jax.pure_callback(scanned, shapes, *inputs, vmap_method="sequential")
    scale = _with_slope(model, p, inputs[1], late, first) + unknown_in(pieces)
    return CriticalScale(scale, tongues, scan, inputs[3][1], undecided)


def _with_slope(model: Any, p: Parameters, pieces: Any, late: Any, first: Any) -> Any:
    """Return the scale `first` with its derivatives, by the implicit function theorem."""
    finite = jnp.isfinite(first)
    at = jnp.where(finite, first, 1.0)

    # The growing coordinate q of the last arc as a function of the parameters and the scale.
    def growing(p: Parameters, scale: Any) -> Any:
        row, forcing = ground_row_of(p, size=scale), GroundForcing([pieces], late)
        return simulate.follow(model.equations, row, forcing, **accuracy_of(model)).growing

    # The size of the motion is a parameter of the run, but the unknown of the implicit function.
    fixed = jax.tree.map(stop_gradient, p)
    slope = stop_gradient(jax.jvp(lambda s: growing(fixed, s), (at,), (jnp.ones_like(at),))[1])
    q = growing(p, at)
    # In chaotic motions rounding may bring the block to rest at the crossing. The derivative is then unknown.
    is_regular = finite & (slope != 0.0)
    # The value of this correction is zero, and its derivative is that of the scale.
    correction = -(q - stop_gradient(q)) / jnp.where(is_regular, slope, 1.0)
    return refused(first + correction, is_regular)


def follow_motion(model: Any, c: np.ndarray, late: float, rows: np.ndarray) -> Runs:
    """Simulate runs under the motion with the pieces `c`."""
    # The exact solution has the accuracy of rounding.
    rtol = model.rtol if isinstance(model, Nonlinear) else simulate.EXACT
    return follow_runs(model.equations, rows, GroundForcing([c], late), brief=True, rtol=rtol)


def _scanned(
    run: Any, x: np.ndarray, ends: np.ndarray, scan: float
) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """Return the first crossing of a scan, all tongues, and the intervals without a result."""

    def follow(scales: np.ndarray) -> Runs:
        rows = np.repeat(x[None], scales.size, axis=0)
        rows[:, F] *= scales.ravel()
        return run(rows).reshape(*scales.shape)

    none = np.full((TONGUES, 2), np.nan)
    top, stood = ends[1], code_of(Status.stood)
    # A traced motion may turn out to consist of zeros, which overturn nothing.
    if not np.isfinite(top):
        return np.asarray(np.inf), none, none
    # The beginning is lowered by whole steps of the scan until the block stays on its base.
    low, ratio = float(min(ends)), (1.0 + scan) ** np.ceil(np.log(2.0) / np.log1p(scan))
    for _ in range(_HALVINGS):
        if follow(np.array([low])).outcome[0] == stood:
            break
        low /= ratio
    steps = int(np.ceil(np.log(top / low) / np.log1p(scan)))
    scales = np.minimum(low * (1.0 + scan) ** np.arange(steps + 1), top)
    table = follow(scales)
    falls = overturning(table)
    # If the block lifts even at the lowest factor, smaller factors may overturn it.
    if table.outcome[0] != stood:
        falls[0] = np.nan
    answered = ~np.isnan(falls)
    # Each change between two factors is an end of a tongue. Runs without a result count as not overturned.
    edges = np.flatnonzero((falls[1:] == 1.0) != (falls[:-1] == 1.0))
    inner = edges[answered[edges] & answered[edges + 1]]
    lo, hi, is_exact = scales[edges], scales[edges + 1], np.ones(len(edges), dtype=bool)
    # Only changes between two answered factors can be bisected.
    at = np.isin(edges, inner)
    lo[at], hi[at], is_exact[at] = bisected(
        lambda scale: overturning(follow(scale)), scales[inner], scales[inner + 1], falls[inner] == 1.0
    )
    # The end of a tongue is the side on which the block overturns.
    borders = np.where(falls[edges] == 1.0, lo, hi)
    # An odd number of ends means that the last tongue ends with the scan.
    if len(borders) % 2:
        borders = np.concatenate([borders, scales[-1:]])
    # Each run of factors without a result gives an interval that reaches to the next answered factors.
    starts = np.flatnonzero(~answered & np.concatenate([[True], answered[:-1]]))
    stops = np.flatnonzero(~answered & np.concatenate([answered[1:], [True]]))
    outer = scales[np.maximum(starts - 1, 0)], scales[np.minimum(stops + 1, steps)]
    undecided = np.concatenate([np.stack(outer, axis=1), np.stack([lo, hi], axis=1)[~is_exact]])
    begins, _ = undecided.T
    first = borders[0] if len(borders) else np.inf
    # An interval without a result below the first crossing could contain an earlier one.
    if begins.min(initial=np.inf) < first:
        first = np.nan
    return np.asarray(first), _padded(borders.reshape(-1, 2)), _padded(undecided[np.argsort(begins)])


def _padded(intervals: np.ndarray) -> np.ndarray:
    """Return at most `TONGUES` intervals, with NaN where there are fewer."""
    padded = np.full((TONGUES, 2), np.nan)
    padded[: len(intervals)] = intervals[:TONGUES]
    return padded


def overturning(table: Runs) -> np.ndarray:
    """Return 1 for runs in which the block overturns, 0 if it does not, and NaN without a result."""
    return np.where(table.is_unanswered, np.nan, table.is_overturned)


def bisected(
    verdict: Any, lo: np.ndarray, hi: np.ndarray, low_falls: np.ndarray
) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """Narrow the intervals that contain crossings.

    Args:
        verdict: function that returns `overturning` of the runs at given factors.
        lo: lower ends of the intervals, shape (crossings,).
        hi: upper ends, on the other side of each crossing.
        low_falls: whether the block overturns at `lo` (and not at `hi`).

    Returns:
        Lower and upper ends, and whether each interval is narrow. Runs without a result may prevent this.
    """
    lo, hi, is_narrow = lo.copy(), hi.copy(), np.ones(len(lo), dtype=bool)
    share, places = np.linspace(0.0, 1.0, _SECTIONS + 1), np.arange(_SECTIONS + 1)
    # Each round divides the width by 32. Twelve rounds reach the rounding of a double.
    for _ in range(12):
        rows = np.flatnonzero(is_narrow & (hi - lo > 4e-16 * hi))
        if not len(rows):
            break
        factors = lo[rows, None] + (hi - lo)[rows, None] * share
        # The outcomes at both ends are known from the previous round.
        low = low_falls[rows]
        falls = np.column_stack([low, verdict(factors[:, 1:-1]), ~low])
        # The first factor on the upper side, and the last factor on the lower side before it.
        upper = np.argmax(falls == falls[:, -1:], axis=1)
        this = (falls == falls[:, :1]) & (places < upper[:, None])
        lower = _SECTIONS - np.argmax(this[:, ::-1], axis=1)
        every = np.arange(len(rows))
        lo[rows], hi[rows] = factors[every, lower], factors[every, upper]
        # If half of the factors between them have no result, further rounds do not narrow the interval.
        is_narrow[rows] = upper - lower < _SECTIONS // 2
    return lo, hi, is_narrow | (hi - lo < _NARROW * hi)
