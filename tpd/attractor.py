"""Which motions a design can settle into, and the share of starts that reach each.

Rest, rocking of several kinds, chaos and overturning exist side by side; which one is reached
depends on the start and on the phase of the shaking. So a seeded set of starts is followed by the
exact engine, and what they settle into is sorted.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from functools import lru_cache
from typing import Any

import equinox as eqx
import jax
import jax.numpy as jnp
import numpy as np

from tpd import checks
from tpd.models.interface import Settled
from tpd.models.piecewise import Piecewise
from tpd.models.settling import scale_of
from tpd.parameters import Parameters, as_arrays
from tpd.pool import settle_all
from tpd.status import status_name
from tpd.steady import Steady, steady_state

_SAME = 1e-4
"""Relative difference of amplitudes and strokes below which two motions are the same or mirror
images."""


@dataclass(frozen=True, kw_only=True)
class Starts:
    """A seeded set of states at tau = 0, spread evenly over a box; the first is at rest.

    Raises:
        ValueError: a size below one, or a spread below zero.
    """

    size: int = 64
    seed: int = 0
    tilt: float = 0.8
    """Largest |phi|, in shares of nu."""
    tilt_rate: float = 0.5
    """Largest |phi'|, in shares of nu."""
    swing: float = 0.2
    """Largest |psi|, rad."""
    swing_rate: float = 0.2
    """Largest |psi'|, rad per unit tau."""

    def __post_init__(self) -> None:
        checks.positive("size", self.size)
        for name in ("tilt", "tilt_rate", "swing", "swing_rate"):
            checks.not_negative(name, getattr(self, name))

    def states(self, nu: float) -> np.ndarray:
        """The states (phi, psi, phi', psi'), shape (size, 4): a Latin hypercube."""
        rng = np.random.default_rng(self.seed)
        reach = np.array([self.tilt * nu, self.swing, self.tilt_rate * nu, self.swing_rate])
        strata = np.stack([rng.permutation(self.size) for _ in range(4)], axis=1)
        unit = 2.0 * (strata + rng.random((self.size, 4))) / self.size - 1.0
        unit[0] = 0.0
        return unit * reach


@dataclass(frozen=True)
class Attractor:
    """One motion that some of the starts reach."""

    status: str
    """Name of the `Status`: rocking, sticking, rest, aperiodic, overturned, not_settled, ..."""
    periods: int
    """Forcing periods in one period of the motion; 1 where it has none."""
    symmetric: bool
    """Whether the motion is its own mirror image half a period of it later."""
    share: float
    """Share of the starts that reach it, or its mirror image, or itself some forcing periods later."""
    starts: tuple[int, ...]
    """Which of the starts."""
    steady: Steady
    """The settled motion of the first of these; for gradients call `steady_state` from that start."""


def attractors(
    p: Parameters,
    *,
    starts: Starts | None = None,
    model: Piecewise | None = None,
    progress: Callable[[int, int], None] | None = None,
) -> tuple[Attractor, ...]:
    """The motions that a set of starts settles into, the one most often reached first.

    Motions that do not repeat (aperiodic, not_settled, overturned, event_bound) are kept together by
    their status. The shares are estimates: of n starts, a share s is known to about
    sqrt(s (1 - s)/n).

    Args:
        p: dimensionless parameters, plain numbers.
        starts: default `Starts()`, 64 of them, seed 0.
        model: settings of the exact model.
        progress: called with (starts followed, of how many).

    Raises:
        ValueError: bad input.
        RuntimeError: JAX is in 32-bit mode.
    """
    checks.require_x64()
    model = Piecewise() if model is None else model
    starts = Starts() if starts is None else starts
    fixed = as_arrays(p)
    y0 = starts.states(float(fixed.nu))
    settled = settle_all(fixed, y0, model=model, progress=progress)
    found = [
        _describe(fixed, model, y0, settled, group) for group in _groups(settled, np.asarray(scale_of(fixed)))
    ]
    return tuple(sorted(found, key=lambda a: -a.share))


def _groups(settled: Settled, scale: np.ndarray) -> list[np.ndarray]:
    """Indices of the starts that reach the same motion."""
    names = _names(settled)
    groups: list[list[int]] = []
    for i, name in enumerate(names):
        for group in groups:
            first = group[0]
            if names[first] == name and _same(settled, first, i, name, scale):
                group.append(i)
                break
        else:
            groups.append([i])
    return [np.array(g) for g in groups]


def _same(settled: Settled, i: int, j: int, name: str, scale: np.ndarray) -> bool:
    if name not in ("rocking", "sticking"):
        return True
    if settled.periods[i] != settled.periods[j]:
        return False
    sizes = np.stack([np.asarray(settled.amplitude), np.asarray(settled.stroke)], axis=-1)
    a, b = sizes[i], sizes[j]
    close = np.abs(a - b) <= _SAME * np.maximum(a, b)
    # A bob without mass (mu = 0) cannot be felt; its swing may still be on the way.
    return bool(close[0] and (close[1] or not np.isfinite(scale[1])))


def _names(settled: Settled) -> list[str]:
    values = np.asarray(jax.tree.leaves(settled.status)[0])
    return [status_name(jax.tree.map(lambda _, v=v: v, settled.status)) for v in values]


def _describe(
    p: Parameters, model: Piecewise, y0: np.ndarray, settled: Settled, group: np.ndarray
) -> Attractor:
    i = int(group[0])
    steady = _solver(model)(p, jnp.asarray(y0[i]))
    return Attractor(
        status=status_name(steady.status),
        periods=int(steady.periods),
        symmetric=bool(steady.symmetric),
        share=len(group) / len(y0),
        starts=tuple(int(g) for g in group),
        steady=steady,
    )


@lru_cache(maxsize=8)
def _solver(model: Piecewise) -> Callable[[Parameters, Any], Steady]:
    return eqx.filter_jit(lambda p, y0: steady_state(p, model=model, y0=y0))
