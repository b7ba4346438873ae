"""The factor on a ground motion from which a block overturns, and its derivative.

Overturning is not monotone in the size of a motion: above the first factor that overturns the block there may
be others that do not. Hence a critical scale is the first crossing of a stated scan, and comes with the list
of tongues above it. The scan begins where the block stays on its base: up to there the bob swings in
proportion to the motion, so that no smaller factor lifts the block. At a crossing the state after the motion
lies on the stable manifold of the leaning block's unstable equilibrium: the growing coordinate q of the last
arc vanishes there, so that

    d(scale)/dx = -(dq/dx)/(dq/d scale).
"""

from __future__ import annotations

from typing import Any

import equinox as eqx
import jax
import jax.numpy as jnp
import numpy as np
from jax.lax import stop_gradient
from jaxtyping import Array, Float

from tpd.answers.runs import Runs, follow_runs
from tpd.answers.transient import FREE
from tpd.core import checks
from tpd.core.checks import Real
from tpd.exact import runs
from tpd.exact.derivatives import refused
from tpd.exact.rows import ground_row_of
from tpd.exact.runs import GroundForcing
from tpd.exact.terms import F
from tpd.scene.ground_motion import LONGEST_FREE, GroundMotion, refuse_zeros
from tpd.scene.parameters import Parameters
from tpd.scene.pytrees import Number, single
from tpd.scene.scene import Pendulum, Scene
from tpd.scene.status import Status, code_of
from tpd.theory.equations import Terms

SCAN = 0.02
HIGHEST = 20.0
"""Largest factor of a scan by default, over that which lifts the bare block."""
TONGUES = 32
"""Tongues that are listed, at most."""
_SECTIONS = 32
"""Parts into which an interval around a crossing is divided at once."""
_HALVINGS = 20
"""Times that the beginning of a scan is halved, at most: no pendulum lowers what lifts its block by a factor
of a million."""
_NARROW = 1e-9
"""Relative width of an interval without an answer that is taken for a crossing."""


class CriticalScale(eqx.Module):
    """Factor on a ground motion from which a block overturns."""

    scale: Number
    """First factor of the scan's crossing; infinite if no factor of the scan overturns the block. NaN if it
    is not known, because a run below it has no answer. Its derivatives in block, pendulum and motion are
    exact; those of an infinite or unknown one are NaN."""
    tongues: Float[Array, "tongues 2"]
    """Intervals of factors that overturn the block, as far as the scan sees them; the last one may end with
    the scan. NaN where there are fewer."""
    scan: float = eqx.field(static=True)
    """Relative step of the scan: narrower tongues are not seen."""
    highest: Number = float("nan")
    """Largest factor of the scan."""
    undecided: Float[Array, "tongues 2"] = eqx.field(default_factory=lambda: jnp.full((TONGUES, 2), jnp.nan))
    """Intervals of factors in which runs have no answer; they reach to the next factors that have one. NaN
    where there are fewer."""

    def __str__(self) -> str:
        if not checks.is_concrete(self.scale):
            return repr(self)
        scale, scan = float(self.scale), f"(scan of {self.scan:.2%})"
        open_, tongues = _listed(self.undecided), _listed(self.tongues)
        without = f"; no answer at {open_}" if open_ else ""
        if np.isnan(scale):
            found = f"overturns at {tongues}" if tongues else "no factor with an answer overturns"
            return f"not known from which factor on the motion overturns {scan}: {found}{without}"
        if np.isinf(scale):
            return f"does not overturn up to {self.highest:.4g} times the motion {scan}"
        return f"overturns from {scale:.10g} times the motion on {scan}: {tongues}{without}"


def _listed(intervals: Array) -> str:
    """Intervals in words."""
    return ", ".join(f"{a:.6g} to {b:.6g}" for a, b in np.asarray(intervals) if np.isfinite(a))


def critical_scale(
    scene: Scene,
    pendulum: Pendulum | None = None,
    *,
    scan: Real = SCAN,
    highest: Real | None = None,
    free: Real = FREE,
) -> CriticalScale:
    """Find the smallest factor on the motion of a scene, seen by a scan, that overturns the block.

    Args:
        scene: a block under a `Pulse` or a `Record`.
        pendulum: None is the bare block.
        scan: relative step between factors that are tried.
        highest: largest factor; by default 20 times that which lifts the bare block.
        free: free motion after the ground motion that is followed, s. An arc that leads beyond return counts
            however far it has come by then.

    Raises:
        ValueError: bad input, or a motion of zeros.
        RuntimeError: JAX is in 32-bit mode.
    """
    checks.require_x64()
    checks.instance("scene", scene, Scene)
    checks.instance("motion", scene.motion, GroundMotion, ": a harmonic has no critical scale")
    refuse_zeros([scene.motion])
    scan = checks.within("scan", scan, 1e-4, 0.5)
    free = checks.within("free", free, 0.0, LONGEST_FREE, " s")
    if highest is not None:
        highest = checks.within("highest", highest, 1e-9, 1e9)
    p, rate = single((scene.ground_parameters(pendulum), scene.rate))
    pieces, late = jnp.asarray(scene.motion.pieces()), free * rate
    lifts = (1.0 + p.mu) * p.nu + p.k
    top = HIGHEST * lifts / p.f if highest is None else highest
    intervals = jax.ShapeDtypeStruct((TONGUES, 2), jnp.float64)
    shapes = jax.ShapeDtypeStruct((), jnp.float64), intervals, intervals

    # Below half of what lifts the bare block, only a pendulum can lift it.
    ends = jnp.stack([jnp.asarray(x, dtype=jnp.float64) for x in (0.5 * lifts / p.f, top)])

    def scanned(x: Any, c: Any, late: Any, ends: Any) -> tuple[np.ndarray, ...]:
        return _scanned(np.asarray(x), np.asarray(c), float(late), np.asarray(ends), scan)

    held = jax.tree.map(stop_gradient, (ground_row_of(p), pieces, jnp.asarray(late), ends))
    first, tongues, undecided = jax.pure_callback(scanned, shapes, *held, vmap_method="sequential")
    scale = _with_slope(p, pieces, late, first)
    return CriticalScale(scale, tongues, scan, held[3][1], undecided)


def _with_slope(p: Parameters, pieces: Any, late: Any, first: Any) -> Any:
    """The scale `first` with its derivatives, by the implicit function theorem."""
    finite = jnp.isfinite(first)
    at = jnp.where(finite, first, 1.0)

    def growing(p: Parameters, scale: Any) -> Any:
        wide = eqx.tree_at(lambda q: q.f, p, p.f * scale)
        return runs.follow(Terms.linear, ground_row_of(wide), GroundForcing([pieces], late)).growing

    # The size of the motion is a parameter like the others, but for the implicit function it is the unknown.
    fixed = jax.tree.map(stop_gradient, p)
    slope = jax.jvp(lambda s: growing(fixed, s), (at,), (jnp.ones_like(at),))[1]
    q = growing(p, at)
    # Zero, but for its derivative.
    moved = -(q - stop_gradient(q)) / jnp.where(finite, stop_gradient(slope), 1.0)
    return refused(first + moved, finite)


def _scanned(
    x: np.ndarray, c: np.ndarray, late: float, ends: np.ndarray, scan: float
) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """First crossing of a scan, all tongues, and the intervals without an answer."""

    def followed(scales: np.ndarray) -> Runs:
        rows = np.repeat(x[None], scales.size, axis=0)
        rows[:, F] *= scales.ravel()
        return follow_runs(Terms.linear, rows, GroundForcing([c], late), brief=True).reshape(*scales.shape)

    none = np.full((TONGUES, 2), np.nan)
    top, stood = ends[1], code_of(Status.stood)
    # A traced motion may turn out to be one of zeros, which overturns nothing.
    if not np.isfinite(top):
        return np.asarray(np.inf), none, none
    # Lowered by whole steps of the scan until the block stays on its base: so it does at all below.
    low, ratio = float(min(ends)), (1.0 + scan) ** np.ceil(np.log(2.0) / np.log1p(scan))
    for _ in range(_HALVINGS):
        if followed(np.array([low])).outcome[0] == stood:
            break
        low /= ratio
    steps = int(np.ceil(np.log(top / low) / np.log1p(scan)))
    scales = np.minimum(low * (1.0 + scan) ** np.arange(steps + 1), top)
    scanned = followed(scales)
    falls = overturning(scanned)
    if scanned.outcome[0] != stood:
        falls[0] = np.nan
    known = ~np.isnan(falls)
    # Every change between two factors is a border of a tongue.
    edges = np.flatnonzero((falls[1:] == 1.0) != (falls[:-1] == 1.0))
    inner = edges[known[edges] & known[edges + 1]]
    lo, hi, found = scales[edges], scales[edges + 1], np.ones(len(edges), dtype=bool)
    at = np.isin(edges, inner)
    lo[at], hi[at], found[at] = bisected(
        lambda scale: overturning(followed(scale)), scales[inner], scales[inner + 1], falls[inner] == 1.0
    )
    borders = np.where(falls[edges] == 1.0, lo, hi)
    if len(borders) % 2:
        borders = np.concatenate([borders, scales[-1:]])
    # A factor without an answer leaves all open up to its neighbours that have one.
    starts = np.flatnonzero(~known & np.concatenate([[True], known[:-1]]))
    stops = np.flatnonzero(~known & np.concatenate([known[1:], [True]]))
    outer = scales[np.maximum(starts - 1, 0)], scales[np.minimum(stops + 1, steps)]
    undecided = np.concatenate([np.stack(outer, axis=1), np.stack([lo, hi], axis=1)[~found]])
    undecided = undecided[np.argsort(undecided[:, 0])]
    pairs = borders.reshape(-1, 2)
    first = pairs[0, 0] if len(pairs) else np.inf
    if len(undecided) and undecided[0, 0] < first:
        first = np.nan
    return np.asarray(first), _padded(pairs), _padded(undecided)


def _padded(intervals: np.ndarray) -> np.ndarray:
    """The first of the intervals, with NaN where there are fewer than `TONGUES`."""
    padded = np.full((TONGUES, 2), np.nan)
    padded[: len(intervals)] = intervals[:TONGUES]
    return padded


def overturning(found: Runs) -> np.ndarray:
    """1 where the block overturns in a run, 0 where it does not, and NaN where there is no answer."""
    return np.where(found.is_unanswered, np.nan, found.is_overturned)


def bisected(
    verdict: Any, lo: np.ndarray, hi: np.ndarray, low_falls: np.ndarray
) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """Narrow the intervals that hold crossings, and say which are found.

    Args:
        verdict: function of factors, see `overturning`.
        lo: factors, shape (crossings,).
        hi: factors, on the other side of each crossing.
        low_falls: whether `lo` is the side that overturns the block.

    Returns:
        Lower and upper ends, and whether runs without an answer left the interval as wide as it is.
    """
    lo, hi, found = lo.copy(), hi.copy(), np.ones(len(lo), dtype=bool)
    share, places = np.linspace(0.0, 1.0, _SECTIONS + 1), np.arange(_SECTIONS + 1)
    # Each round divides the distance by 32; twelve reach the rounding of a double.
    for _ in range(12):
        rows = np.flatnonzero(found & (hi - lo > 4e-16 * hi))
        if not len(rows):
            break
        tried = lo[rows, None] + (hi - lo)[rows, None] * share
        falls = np.empty_like(tried)
        falls[:, 0], falls[:, -1] = low_falls[rows], ~low_falls[rows]
        falls[:, 1:-1] = verdict(tried[:, 1:-1])
        # The first factor on the other side, and the last on this side before it.
        upper = np.argmax(falls == falls[:, -1:], axis=1)
        this = (falls == falls[:, :1]) & (places < upper[:, None])
        lower = _SECTIONS - np.argmax(this[:, ::-1], axis=1)
        every = np.arange(len(rows))
        lo[rows], hi[rows] = tried[every, lower], tried[every, upper]
        # Where half an interval has no answer, no further round makes it much narrower.
        found[rows] = upper - lower < _SECTIONS // 2
    return lo, hi, found | (hi - lo < _NARROW * hi)
