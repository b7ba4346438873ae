"""The factor on a ground motion from which a block overturns, and its derivative.

Overturning is not monotone in the size of a motion: above the first factor that overturns the block there may
be others that do not. Hence a critical scale is the first crossing of a stated scan, and comes with the list
of tongues above it. At a crossing the state after the motion lies on the stable manifold of the leaning
block's unstable equilibrium: the growing coordinate q of the last arc vanishes there, so that

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

from tpd.analysis.transient import FREE, MAX_EVENTS
from tpd.core import checks
from tpd.core.ground_motion import GroundMotion
from tpd.core.parameters import Number, Parameters
from tpd.core.scene import Pendulum, Scene
from tpd.exact.derivatives import refused
from tpd.models.compiled_linear import packed

SCAN = 0.02
HIGHEST = 20.0
"""Largest factor of a scan by default, over that which lifts the bare block."""
TONGUES = 32
"""Tongues that are listed, at most."""
_SECTIONS = 32
"""Parts into which an interval around a crossing is divided at once."""


class CriticalScale(eqx.Module):
    """Factor on a ground motion from which a block overturns."""

    scale: Number
    """First factor of the scan's crossing; infinite if no factor of the scan overturns the block. Its
    derivatives in block, pendulum and motion are exact; those of an infinite one are NaN."""
    tongues: Float[Array, "tongues 2"]
    """Intervals of factors that overturn the block, as far as the scan sees them; the last one may end with
    the scan. NaN where there are fewer."""
    scan: float = eqx.field(static=True)
    """Relative step of the scan: narrower tongues are not seen."""
    highest: Number = float("nan")
    """Largest factor of the scan."""

    def __str__(self) -> str:
        if not checks.is_concrete(self.scale):
            return repr(self)
        if not np.isfinite(self.scale):
            return f"does not overturn up to {self.highest:.4g} times the motion (scan of {self.scan:.2%})"
        listed = [t for t in np.asarray(self.tongues) if np.isfinite(t[0])]
        text = ", ".join(f"{a:.6g} to {b:.6g}" for a, b in listed)
        return (
            f"overturns from {float(self.scale):.10g} times the motion on (scan of {self.scan:.2%}): {text}"
        )


def critical_scale(
    scene: Scene,
    pendulum: Pendulum | None = None,
    *,
    scan: float = SCAN,
    highest: float | None = None,
    free: float = FREE,
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
        ValueError: bad input.
        RuntimeError: JAX is in 32-bit mode.
    """
    checks.require_x64()
    checks.instance("scene", scene, Scene)
    checks.instance("motion", scene.motion, GroundMotion, ": a harmonic has no critical scale")
    checks.within("scan", scan, 1e-4, 0.5)
    checks.not_negative("free", free)
    if highest is not None:
        checks.positive("highest", highest)
    p, pieces = scene.ground_parameters(pendulum), jnp.asarray(scene.motion.pieces())
    late = free * scene.rate
    lifts = (1.0 + p.mu) * p.nu + p.k
    top = HIGHEST * lifts / p.f if highest is None else highest
    shapes = jax.ShapeDtypeStruct((), jnp.float64), jax.ShapeDtypeStruct((TONGUES, 2), jnp.float64)

    # Below half of what lifts the bare block, a pendulum would have to throw it over.
    ends = jnp.stack([jnp.asarray(x, dtype=jnp.float64) for x in (0.5 * lifts / p.f, top)])

    def scanned(x: Any, c: Any, late: Any, ends: Any) -> tuple[np.ndarray, np.ndarray]:
        return _scanned(np.asarray(x), np.asarray(c), float(late), np.asarray(ends), scan)

    held = jax.tree.map(stop_gradient, (packed(p), pieces, jnp.asarray(late), ends))
    first, tongues = jax.pure_callback(scanned, shapes, *held, vmap_method="sequential")
    scale = _with_slope(p, pieces, late, first)
    return CriticalScale(scale, tongues, scan, held[3][1])


def _with_slope(p: Parameters, pieces: Any, late: Any, first: Any) -> Any:
    """The scale `first` with its derivatives, by the implicit function theorem."""
    from tpd.models.compiled_shaken import follow

    finite = jnp.isfinite(first)
    at = jnp.where(finite, first, 1.0)

    def growing(p: Parameters, scale: Any) -> Any:
        wide = eqx.tree_at(lambda q: q.f, p, p.f * scale)
        return follow(wide, pieces, late, jnp.zeros(4), MAX_EVENTS).growing

    # The size of the motion is a parameter like the others, but for the implicit function it is the unknown.
    fixed = jax.tree.map(stop_gradient, p)
    slope = jax.jvp(lambda s: growing(fixed, s), (at,), (jnp.ones_like(at),))[1]
    q = growing(p, at)
    # Zero, but for its derivative.
    moved = -(q - stop_gradient(q)) / jnp.where(finite, stop_gradient(slope), 1.0)
    return refused(first + moved, finite)


def _scanned(
    x: np.ndarray, c: np.ndarray, late: float, ends: np.ndarray, scan: float
) -> tuple[np.ndarray, np.ndarray]:
    """First crossing of a scan, and all tongues."""
    from tpd.models.compiled_shaken import follow_all
    from tpd.models.shaken_kernel import OVERTURNED

    row = x.copy()
    row[6] = 2.0 * np.pi / row[6]

    def overturns(scales: np.ndarray) -> np.ndarray:
        rows = np.repeat(row[None], scales.size, axis=0)
        rows[:, 5] *= scales.ravel()
        found, _ = follow_all(
            rows, [c], np.zeros(scales.size, dtype=int), np.full(scales.size, late), brief=True
        )
        return (found.status == OVERTURNED).reshape(scales.shape)

    tongues = np.full((TONGUES, 2), np.nan)
    low, top = ends
    steps = max(1, int(np.ceil(np.log(top / low) / np.log1p(scan))))
    scales = low * (1.0 + scan) ** np.arange(steps + 1)
    falls = overturns(scales)
    # Every change between two factors is a border of a tongue.
    edges = np.flatnonzero(falls[1:] != falls[:-1])
    borders = bisected(overturns, scales[edges], scales[edges + 1], falls[edges])
    if falls[0]:
        borders = np.concatenate([[scales[0]], borders])
    if len(borders) % 2:
        borders = np.concatenate([borders, [scales[-1]]])
    pairs = borders.reshape(-1, 2)[:TONGUES]
    tongues[: len(pairs)] = pairs
    first = pairs[0, 0] if len(pairs) else np.inf
    return np.asarray(first), tongues


def bisected(
    overturns: Any, lo: np.ndarray, hi: np.ndarray, low_falls: np.ndarray, rounds: int = 12
) -> np.ndarray:
    """Crossings between `lo` and `hi`; the end that overturns the block.

    Args:
        overturns: function of factors, shape (crossings, k): whether each overturns the block.
        lo: factors, shape (crossings,).
        hi: factors, on the other side of each crossing.
        low_falls: whether `lo` is the side that overturns the block.
        rounds: each divides the distance by 32; twelve reach the rounding of a double.
    """
    lo, hi = lo.copy(), hi.copy()
    share = np.linspace(0.0, 1.0, _SECTIONS + 1)
    for _ in range(rounds):
        if not len(lo) or np.all(hi - lo <= 4e-16 * hi):
            break
        tried = lo[:, None] + (hi - lo)[:, None] * share
        changed = np.ones_like(tried, dtype=bool)
        changed[:, 0] = False
        changed[:, 1:-1] = overturns(tried[:, 1:-1]) != low_falls[:, None]
        first = np.argmax(changed, axis=1)
        rows = np.arange(len(lo))
        lo, hi = tried[rows, first - 1], tried[rows, first]
    return np.where(low_falls, lo, hi)
