"""Selection of a model: the model that answers, its estimated error and its reason."""

import functools
from dataclasses import replace
from types import SimpleNamespace

import jax
import jax.numpy as jnp
import numpy as np
import pytest

from tests.reference import STILL, WITH, parameters
from tests.reference import exact as linear
from tpd import Auto, Parameters, status_name, steady_state
from tpd.answers.auto import estimated_error
from tpd.theory import lightest_pendulum, uplift

LOW = (*STILL.x[:5], 0.05, STILL.x[6])
"""Never lifts."""
LIFTS = (0.2, 0.1, 0.8, 0.2, 0.05, 0.45, 4.0)
SMALL = (0.02, 0.1, 0.8, 0.2, 0.004, 0.04, 4.0)
"""Lifts a little: small angles."""


@functools.cache
def chosen(x, tolerance=0.05):
    return steady_state(parameters(x), model=Auto(tolerance=tolerance))


def test_auto_uses_the_closed_form_if_the_block_never_lifts():
    found = chosen(LOW)
    assert found.model == "uplift"
    assert status_name(found.status) == "rest"
    assert found.amplitude == 0.0
    assert 0.0 < float(found.estimate) < 0.05
    assert found.swing == pytest.approx(linear(LOW).swing, rel=1e-9)
    np.testing.assert_allclose(found.state, linear(LOW).steady.state, atol=1e-12)
    assert "of the moment that would lift the block remains in reserve" in found.reason


@pytest.mark.parametrize(("masses", "model"), [(0.95, "nonlinear"), (1.05, "uplift")])
def test_auto_uses_the_closed_form_only_above_the_mass_of_the_lightest_pendulum(masses, model):
    p, swing = Parameters(nu=0.1, mu=0.0, lam=1.0, zeta=0.0, k=0.0, f=0.12, xi=4.0), 0.05
    law = lightest_pendulum(p, swing=swing)
    p = replace(p, mu=masses * float(law.mu), lam=float(law.lam))
    # The bob is longer than the resonant one, and swings against the base.
    found = steady_state(p, model=Auto(), y0=[0.0, 0.0, 0.0, -swing * p.xi])
    assert found.model == model
    assert (status_name(found.status) == "rest") == (model == "uplift")
    if model == "uplift":
        assert float(found.swing) == pytest.approx(swing)


@pytest.mark.parametrize("x", [SMALL, LIFTS, WITH[3].x], ids=["small", "lifts", "hung"])
def test_a_tight_tolerance_selects_the_nonlinear_model(x):
    found, top = chosen(x, 0.5), chosen(x, 1e-5)
    assert (found.model, top.model) == ("exact", "nonlinear")
    assert abs(float(found.amplitude) / float(top.amplitude) - 1.0) <= float(found.estimate) <= 0.5
    assert "within the tolerance 0.5" in found.reason
    assert (
        f"error of the linear model is {float(found.estimate):.2g}, above the tolerance 1e-05" in top.reason
    )
    if x == WITH[3].x:
        assert float(found.amplitude) == pytest.approx(WITH[3].amplitude, rel=1e-9)
        # SciPy's LSODA with signs smoothed by 1e-4 gives 0.065997.
        assert float(top.amplitude) == pytest.approx(0.0659875, rel=1e-5)


def test_auto_does_not_trust_a_linear_model_without_a_result():
    x = (0.25, 0.1, 0.2, 0.1, 0.05, 0.6, 2.67)
    assert linear(x).status == "overturned"
    found = chosen(x)
    assert found.model == "nonlinear"
    assert "with the linear model the outcome is overturned" in found.reason


def test_the_nonlinear_model_decides_which_attractor_is_reached():
    p = parameters((0.3482, 0.2248, 0.6407, 0.4573, 0.0525, 0.3503, 4.9036))
    y0 = jnp.array([-0.1314, -0.0447, 0.0, 0.0])
    by_linear = steady_state(p, y0=y0)
    assert status_name(by_linear.status) == "rocking"
    found = steady_state(p, model=Auto(), y0=y0)
    assert status_name(found.status) == "rest"
    assert found.amplitude == 0.0
    assert found.model == "nonlinear"
    assert "the outcome is rocking with the linear and " in found.reason
    # On the linear motion itself the estimate holds: nothing else is asked.
    near = steady_state(p, model=Auto(), y0=by_linear.state)
    assert near.model == "exact"
    assert float(near.amplitude) == pytest.approx(float(by_linear.amplitude), rel=1e-9)
    assert float(near.estimate) < 0.05


def test_a_bob_without_mass_adds_no_error():
    p = Parameters(nu=0.2, mu=0.0, lam=1.0, zeta=0.1, k=0.05, f=0.3, xi=3.0, e=0.9)
    slope = SimpleNamespace(nu=1.0, f=1.0, lam=1.0, mu=1.0, e=1.0)
    still, swings = (float(estimated_error(p, 0.1, psi, slope)) for psi in (0.0, 0.5))
    assert 0.0 < still == swings < np.inf


def test_auto_rejects_traced_parameters():
    with pytest.raises(ValueError, match=r"`Auto` chooses by numbers: .* but is traced or batched"):
        jax.jit(lambda x: steady_state(parameters(x), model=Auto()).amplitude)(np.array(SMALL))
    for wrong in (1.5, 0):
        with pytest.raises(ValueError, match=f"`tolerance` must be between 1e-05 and 1, but is {wrong}"):
            Auto(tolerance=float(wrong))


@pytest.mark.parametrize("mu", [0.0, 0.1])
def test_an_undamped_bob_keeps_its_free_swing_if_the_block_never_lifts(mu):
    p = Parameters(nu=0.25, mu=mu, lam=0.5, zeta=0.0, k=0.05, f=0.02, xi=2.0)
    found = steady_state(p, model=Auto())
    assert (found.model, status_name(found.status)) == ("uplift", "rest")
    # From rest the own swing is as large as the forced one at the start asks: sqrt(lam rho) xi times it.
    forced = float(uplift(p).swing)
    own = np.sqrt(0.5 * p.inertia_ratio) * 2.0 * forced
    assert float(found.swing) == pytest.approx(forced + own, rel=1e-12)
    np.testing.assert_array_equal(found.state, np.zeros(4))
