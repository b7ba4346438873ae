"""Parameters as rows of numbers, in the order of `tpd.scene.parameters.NAMES`: what compiled code takes."""

from __future__ import annotations

from collections.abc import Iterable
from typing import Any

import jax.numpy as jnp
import numpy as np
from jaxtyping import Array, Float

from tpd.core import checks
from tpd.scene.parameters import NAMES, Parameters


def numbers_of(p: Parameters) -> tuple[Any, ...]:
    """Return the parameters in the order of a row, with inertia and velocity ratios of their own."""
    # From where they are kept: by its name a field of an equinox module takes five times as long.
    values = vars(p)
    if values["rho"] is None or values["e"] is None:
        values = {**values, "rho": p.inertia_ratio, "e": p.velocity_ratio}
    return tuple(map(values.__getitem__, NAMES))


def row_of(p: Parameters, *, piece: Any = None) -> Any:
    """Return the row of one set of parameters, or the rows of many, shape (..., 9): an array of NumPy where
    all numbers are known, and of JAX where one is traced.

    Args:
        p: parameters; arrays among them are broadcast against each other.
        piece: duration of a piece of a ground motion in tau, which takes the place of the frequency.
    """
    values = dict(zip(NAMES, numbers_of(p), strict=True))
    if piece is not None:
        values["xi"] = piece
    xp = checks.namespace(*values.values())
    return xp.stack(xp.broadcast_arrays(*(xp.asarray(values[name], dtype=float) for name in NAMES)), axis=-1)


def ground_row_of(p: Parameters) -> Any:
    """Return the row of parameters of `Scene.ground_parameters`."""
    return row_of(p, piece=2.0 * np.pi / p.xi)


def packed(values: Iterable[Any]) -> Float[Array, "n"]:
    """Return numbers, some of them traced, as one array."""
    return jnp.stack([jnp.asarray(x, dtype=jnp.float64) for x in values])
