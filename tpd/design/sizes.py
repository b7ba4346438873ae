"""Evaluation of limits and objectives, with derivatives by JAX."""

from __future__ import annotations

from collections import OrderedDict
from collections.abc import Callable, Iterable
from dataclasses import fields
from functools import lru_cache
from typing import Any

import jax
import jax.numpy as jnp
import numpy as np

from tpd.core.batch import in_chunks
from tpd.design.criteria import Evaluation, Geometry, Limit, Motion, Objective, Ratios, Size
from tpd.scene.bob import Bob

_NUMBERS = [x.name for x in fields(Geometry) if x.name != "bob"]
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
    motion = Motion(e.tilt, e.swing, angle, e.margin, e.multiplier, e.reserve)
    moves = Motion(e.tilt_slope, e.swing_slope, turning, none, none, e.reserve_slope)
    design = Ratios(*(np.broadcast_to(x[:, None], (m, n)) for x in e.design.T))
    numbers = [np.broadcast_to(getattr(g, name), (m, n)) for name in _NUMBERS]
    batch = [motion, design, numbers, *([moves] if slopes else [])]
    # Without a pair, a pair of ones gives the names of the sizes.
    count, one = m * n, max(m * n, 1)
    flat = jax.tree.map(lambda x: np.resize(x if count else 1.0, (one, *x.shape[2:])), batch)
    try:
        values, by = in_chunks(_sizes_of(functions, g.bob, slopes), flat)
    except (TypeError, jax.errors.JAXTypeError) as error:
        names, why = ", ".join(f.name for f in functions), str(error).splitlines()[0]
        raise ValueError(
            f"`size` of each of {names} must be one number that JAX can differentiate (with `jax.numpy` and "
            f"without `if`), but has the error: {why}"
        ) from error
    # A derivative that does not exist shows no direction.
    finite = {name: np.where(np.isfinite(x), x, 0.0)[:count].reshape(m, n, 3) for name, x in by.items()}
    return [Size(name, x[:count].reshape(m, n), finite.get(name, none)) for name, x in values.items()]


@lru_cache(maxsize=64)
def _sizes_of(functions: tuple[Limit | Objective, ...], bob: Bob, slopes: bool) -> Callable[[Any], Any]:
    """Return a function of one motion, for `in_chunks`: all sizes by their names, and their derivatives."""

    def sizes(motion: Motion, design: Ratios, numbers: Any) -> OrderedDict[str, Any]:
        geometry = Geometry(**dict(zip(_NUMBERS, numbers, strict=True)), bob=bob)
        every = (f.sizes(motion, design, geometry) for f in functions)
        # JAX keeps the order of this class only. A plain number is a constant, without a derivative.
        return OrderedDict((n, jnp.asarray(x, float).reshape(())) for one in every for n, x in one.items())

    def with_slopes(motion: Motion, design: Ratios, numbers: Any, moves: Motion) -> Any:
        def along(move: Motion, axis: Any) -> Any:
            return jax.jvp(lambda m, d: sizes(m, d, numbers), (motion, design), (move, Ratios(*axis)))

        return jax.vmap(along, in_axes=-1, out_axes=(None, -1))(moves, jnp.eye(3))

    return lambda batch: with_slopes(*batch) if slopes else (sizes(*batch), {})
