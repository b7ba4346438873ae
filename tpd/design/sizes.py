"""Motions of designs under all conditions, and limits and objectives of them, with derivatives by JAX."""

from __future__ import annotations

from collections import OrderedDict
from collections.abc import Callable, Iterable
from dataclasses import fields
from functools import lru_cache
from typing import Any, NamedTuple

import jax
import jax.numpy as jnp
import numpy as np

from tpd.core.batch import in_chunks
from tpd.design.geometry import Geometry, Ratios
from tpd.limits import Limit, Motion, Objective
from tpd.scene.bob import Bob

ROCKING, NEAR, REST, UNSTABLE, NONE = range(5)
"""Kinds of motion of a design under a condition: a stable orbit, an orbit near a fold, rest, an unstable
orbit, no orbit. A smaller number takes precedence."""
MOTION_KINDS = ("rocking", "near_fold", "rest", "unstable", "no_orbit")
"""Names of these kinds."""


class Evaluation(NamedTuple):
    """Results of m designs under n conditions: arrays (m, n), with derivatives (m, n, 3) with respect to (mu,
    lam, zeta)."""

    merit: np.ndarray
    """Quantity that the search minimises. Where the block rocks it is the value of the objective, by default
    what remains of a disturbance. Where the block rests it is minus the uplift margin, so a resting design is
    better than any rocking one. Where the orbit does not attract it is the value plus 1, and above 2 where
    there is no orbit. All merits have derivatives except those of orbits near a fold."""
    merit_slope: np.ndarray
    """Derivatives of the merit."""
    tilt: np.ndarray
    """Largest |phi| over nu; 0 at rest. Where no motion attracts: that of the largest orbit, or infinite."""
    tilt_slope: np.ndarray
    """Derivatives of the tilt."""
    swing: np.ndarray
    """Largest |psi| of the same motion, rad."""
    swing_slope: np.ndarray
    """Derivatives of the swing."""
    margin: np.ndarray
    """Uplift margin: positive if the settled block stays at rest."""
    multiplier: np.ndarray
    """Largest modulus of the Floquet multipliers; 0 at rest."""
    reserve: np.ndarray
    """Margin of the orbit to the loss of its stability: the smallest of fold, symmetry and torus in
    `Margins`; 1 at rest."""
    reserve_slope: np.ndarray
    """Derivatives of the reserve."""
    remaining: np.ndarray
    """Factor per period by which a disturbance of the block falls, see `limits.Settling`; 0 at rest."""
    remaining_slope: np.ndarray
    """Derivatives of this factor."""
    kind: np.ndarray
    """Kind of motion, an index into `MOTION_KINDS`."""
    turn: np.ndarray
    """phi, psi, phase of the forcing and psi' at the upper turning point of the orbit that counts, (m, n,
    4)."""
    design: np.ndarray
    """Designs (mu, lam, zeta), (m, 3)."""
    rod_angle: np.ndarray | None = None
    """Largest |psi - phi|, rad, if it was computed; else None."""

    @staticmethod
    def blank(m: int, n: int) -> Evaluation:
        """Return an evaluation of m designs under n conditions in which all sizes are one."""
        one, slope = np.ones((m, n)), np.zeros((m, n, 3))
        kind, turn = np.zeros((m, n), int), np.full((m, n, 4), np.nan)
        sizes = one, slope, one, slope, one, slope
        return Evaluation(*sizes, one, one, one, slope, one, slope, kind, turn, np.ones((m, 3)))

    @property
    def attracts(self) -> np.ndarray:
        """Whether there is an attracting motion among rest and the symmetric orbits."""
        return self.kind <= REST

    def at(self, rows: np.ndarray | list[int]) -> Evaluation:
        """Return the evaluation of some of the designs."""
        return Evaluation(*(None if x is None else x[rows] for x in self))  # type: ignore[arg-type]


class Size(NamedTuple):
    """Quantity over its limit, or over its reference value, under every condition. A limit is kept if the
    value is at most 1."""

    name: str
    """Name in reports."""
    value: np.ndarray
    """Quantity over its limit, (m, n)."""
    slope: np.ndarray
    """Derivatives with respect to (mu, lam, zeta), (m, n, 3); zero where a derivative does not exist."""


_NUMBERS = [x.name for x in fields(Geometry) if x.name not in ("bob", "obstacle")]
"""Numbers of the geometry of one condition."""


def evaluate_sizes(
    functions: Iterable[Limit | Objective], e: Evaluation, g: Geometry, *, slopes: bool = False
) -> list[Size]:
    """Return the sizes of limits or objectives for m designs under n conditions.

    Without `slopes` all derivatives are zero.

    Raises:
        ValueError: a function cannot be traced by JAX, or does not return one number.
    """
    (m, n), functions = e.tilt.shape, tuple(functions)
    if not functions:
        return []
    # The tilt is stored over nu, so multiply by nu to get an angle. Largest tilt and largest swing need not
    # occur at the same time: their sum is an upper bound of the angle between rod and block.
    nu, none = g.slenderness, np.zeros((m, n, 3))
    angle, turning = e.rod_angle, none
    if angle is None:
        angle, turning = e.swing + e.tilt * nu, e.swing_slope + e.tilt_slope * nu[:, None]
    motion = Motion(e.tilt, e.swing, angle, e.margin, e.multiplier, e.reserve, e.remaining)
    moves = Motion(e.tilt_slope, e.swing_slope, turning, none, none, e.reserve_slope, e.remaining_slope)
    design = Ratios(*(np.broadcast_to(x[:, None], (m, n)) for x in e.design.T))
    numbers = [np.broadcast_to(getattr(g, name), (m, n)) for name in _NUMBERS]
    batch = [motion, design, numbers, *([moves] if slopes else [])]
    # Without a pair, a pair of ones gives the names of the sizes.
    count, one = m * n, max(m * n, 1)
    flat = jax.tree.map(lambda x: np.resize(x if count else 1.0, (one, *x.shape[2:])), batch)
    evaluate = _sizes_of(functions, g.bob, g.obstacle, slopes)
    try:
        values, along = in_chunks(evaluate, flat)
    except (TypeError, ValueError, jax.errors.JAXTypeError) as error:
        names, why = ", ".join(f.name for f in functions), str(error).splitlines()[0]
        raise ValueError(
            f"`size` of each of {names} must be one number that JAX can differentiate (with `jax.numpy` and "
            f"without `if`), but has the error: {why}"
        ) from error
    # A motion that is finite has a size that is a number. NaN would neither keep nor exceed a limit.
    is_motion = np.all([np.isfinite(x) for x in (*motion, *design)], axis=0).ravel()
    for name, x in values.items():
        if np.isnan(x[:count][is_motion]).any():
            raise ValueError(f"`size` of {name} must be a number for every motion, but is NaN for some")
    # A derivative that does not exist shows no direction.
    finite = {name: np.where(np.isfinite(x), x, 0.0)[:count].reshape(m, n, 3) for name, x in along.items()}
    return [Size(name, x[:count].reshape(m, n), finite.get(name, none)) for name, x in values.items()]


@lru_cache(maxsize=64)
def _sizes_of(
    functions: tuple[Limit | Objective, ...], bob: Bob, obstacle: str, slopes: bool
) -> Callable[[Any], Any]:
    """Return a function of one motion, for `in_chunks`: all sizes by their names, and their derivatives."""

    def sizes(motion: Motion, design: Ratios, numbers: Any) -> OrderedDict[str, Any]:
        geometry = Geometry(**dict(zip(_NUMBERS, numbers, strict=True)), bob=bob, obstacle=obstacle)
        every = (f.sizes(motion, design, geometry) for f in functions)
        # JAX keeps the order of this class only. A plain number is a constant, without a derivative.
        return OrderedDict((n, jnp.asarray(x, float).reshape(())) for one in every for n, x in one.items())

    def with_slopes(motion: Motion, design: Ratios, numbers: Any, moves: Motion) -> Any:
        def along(move: Motion, axis: Any) -> Any:
            return jax.jvp(lambda m, d: sizes(m, d, numbers), (motion, design), (move, Ratios(*axis)))

        return jax.vmap(along, in_axes=-1, out_axes=(None, -1))(moves, jnp.eye(3))

    return lambda batch: with_slopes(*batch) if slopes else (sizes(*batch), {})
