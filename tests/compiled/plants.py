"""Plants of the compiled code, for vectors of parameters as in `tests.reference`, and calls of that code."""

import numba
import numpy as np

from tests.reference import NAMES
from tpd.compiled.plant import COMPLEX_PLANT, PLANT, STEP, plant
from tpd.scene import parameters


def entry(function):
    """A compiled function for Python: those of the package can be called by compiled code only."""
    return numba.njit(lambda *args: function(*args))


@numba.njit
def _put(x, plants):
    for i in range(len(x)):
        plant(x[i], plants[i])


def _numbers(x):
    """Rows of the kernels, from those of `tests.reference` with seven or, with e, eight parameters."""
    named = dict(zip(NAMES, x.T, strict=False))
    ones = np.ones(len(x))
    values = {"rho": 0.75 / (1.0 + named["nu"] ** 2), "e": ones, "kappa": 2.0 * ones, **named}
    return np.column_stack([values[name] for name in parameters.NAMES])


def plants_of(x, linear=True):
    """The plants of rows of parameters, for the equations (25) or (4)."""
    plants = np.zeros(len(x), PLANT)
    _put(_numbers(np.asarray(x, dtype=float)), plants)
    plants["linear"], plants["slack"] = linear, 4e-15 * (plants["k"] + plants["weight"])
    return plants


def slopes_of(x):
    """Derivatives of a plant in each of its parameters, rho being tied to nu."""
    plants = np.zeros(len(x), COMPLEX_PLANT)
    _put(_numbers(x + 1j * STEP * np.eye(len(x))), plants)
    return {name: plants[name].imag / STEP for name in COMPLEX_PLANT.names}
