"""The dimensionless parameters."""

import dataclasses

import jax
import numpy as np
import pytest

from tpd import Parameters
from tpd.scene.parameters import as_arrays, check_parameters

P = Parameters(nu=0.25, mu=0.1, lam=0.4, zeta=0.2, k=0.0, f=0.3, xi=2.5, e=None)


def test_derived_parameters_equal_their_formulas():
    assert P.inertia_ratio == pytest.approx(0.75 / (1 + 0.25**2), rel=1e-15)
    assert dataclasses.replace(P, rho=0.6).inertia_ratio == 0.6
    assert P.hinge == pytest.approx(2 * 0.2 * np.sqrt(0.4 * P.inertia_ratio), rel=1e-15)
    assert P.period == pytest.approx(2 * np.pi / 2.5, rel=1e-15)
    assert dataclasses.replace(P, e=0.9).velocity_ratio == 0.9
    arrays = as_arrays(dataclasses.replace(P, mu=1))
    assert all(isinstance(x, np.ndarray) and x.dtype == float for x in jax.tree.leaves(arrays))
    assert arrays.rho is arrays.e is None


def test_a_bob_so_heavy_that_restitution_is_negative_is_rejected():
    # A scene refuses a bob heavier than its block before: only parameters can have one.
    most, rest = 1 / (0.6 * 0.25) - 2, {"lam": 0.4, "zeta": 0.2, "k": 0.0, "f": 0.3, "xi": 2.5, "e": None}
    at_most = Parameters(nu=0.5, mu=most - 1e-9, **rest)
    assert at_most.velocity_ratio == pytest.approx(0.0, abs=1e-9)
    with pytest.raises(ValueError, match=r"`mu` must be at most 4\.66667, .* Housner's .*, but is 5"):
        Parameters(nu=0.5, mu=5.0, **rest)
    with pytest.raises(ValueError, match=r"`mu` must be at most 4\.66667, .*, but is 6"):
        Parameters(nu=0.5, mu=np.array([1.0, 6.0]), **rest)


def test_an_argument_that_is_no_parameters_object_is_rejected():
    check_parameters(P)
    with pytest.raises(ValueError, match=r"`p` must be a Parameters, but is 3$"):
        check_parameters(3)
