"""What a method is here: a curve of error over time, its accuracy knob running along it."""

from collections.abc import Callable
from typing import Any, NamedTuple

import numpy as np


class Unable(Exception):
    """A method has no answer to a scene; the message, a few words, is a cell of the chart."""


class Scene(NamedTuple):
    """What is settled into from `y0` at tau = 0, and near which state that orbit is there."""

    name: str
    x: tuple[float, ...]
    """nu, mu, lam, zeta, k, f, xi, e."""
    y0: tuple[float, ...]
    near: tuple[float, ...]
    wrt: tuple[int, int, int]
    """Places in `x` of the parameters that the gradient is asked for."""

    def moved(self, i: int, by: float) -> "Scene":
        """With the parameter in place `i` changed by `by`."""
        x = list(self.x)
        x[i] += by
        return self._replace(x=tuple(x))


Call = Callable[[], Any]
"""The timed work. What belongs to its first call only, compiling, is inside of it."""


class Method(NamedTuple):
    """Its functions take a scene and a setting of the knob and return the work, ready to be called;
    they or the work raise `Unable`."""

    name: str
    ours: bool
    knob: str
    """What the settings are of, with the unit, if any."""
    settings: tuple[float, ...]
    """From coarse to fine."""
    value: Callable[[Scene, float], Callable[[], float]] | None = None
    """The settled amplitude (rad)."""
    gradient: Callable[[Scene, float], Callable[[], np.ndarray]] | None = None
    """Its derivatives in the parameters `wrt`, shape (3,)."""
    batch: Callable[[np.ndarray, np.ndarray, tuple[int, ...], float], Callable[[], np.ndarray]] | None = None
    """Of designs (n, 8), starts (n, 4), places and a setting: the gradients of all, shape (n, 3), on
    all cores."""
