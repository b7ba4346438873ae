"""A hinge below or above the top of the block, in every model.

The digits of settled amplitudes, of the critical scale, of the impact and of El Centro are those of two codes
that share nothing with the package.
"""

from __future__ import annotations

import dataclasses
from functools import partial
from typing import Any

import jax
import jax.numpy as jnp
import numpy as np
import pytest

import tpd
from tests.reference import EventDriven
from tpd.answers.critical_scale import _scanned, follow_motion
from tpd.compiled.rows import ground_row_of
from tpd.scene import impacts

BASE: Any = {
    "nu": 0.2,
    "mu": 0.05,
    "lam": 0.6,
    "zeta": 0.1,
    "k": 0.0,
    "f": 0.3,
    "xi": 3.0,
    "e": 0.9,
}
COLUMN = tpd.Block(width=1.0, height=6.0, mass=9000.0, restitution=0.9595)


def amplitude(kappa: Any, model: Any = None, **changed: Any) -> Any:
    return tpd.steady_state(tpd.Parameters(**BASE | changed, kappa=kappa), model=model)


@pytest.mark.parametrize(
    ("kappa", "linear", "nonlinear"),
    [(1.0, 0.05522386, 0.05547106), (2.0, 0.05615304, 0.05628076), (2.5, np.inf, np.inf)],
)
def test_settled_amplitudes_agree_with_two_independent_codes(kappa, linear, nonlinear):
    assert float(amplitude(kappa).amplitude) == pytest.approx(linear, rel=2e-7)
    assert float(amplitude(kappa, tpd.Nonlinear()).amplitude) == pytest.approx(nonlinear, rel=2e-7)


@pytest.mark.parametrize(("kappa", "known"), [(1.0, 3.29065), (2.0, 6.536614)])
def test_the_first_critical_scale_agrees_with_two_independent_codes(kappa, known):
    pieces = tpd.Pulse.one_sine(acceleration=1.0, frequency=1.0).pieces()
    p = tpd.Parameters(
        nu=0.25, mu=0.05, lam=0.3, zeta=0.1, k=0.0, f=0.25, xi=5.0 * len(pieces), rho=1.0, e=0.9, kappa=kappa
    )
    run = partial(follow_motion, tpd.Piecewise(), pieces, 20.0)
    tongues = _scanned(run, ground_row_of(p), np.array([1.5, 8.0]), 0.02)[1]
    assert tongues[0, 0] == pytest.approx(known, rel=1e-6)


def test_an_impact_with_a_swinging_bob_agrees_with_an_independent_code():
    nu, mu, lam, rho, kappa, psi = 0.25, 0.1, 0.4, 0.75 / (1.0 + 0.25**2), 1.2, 0.4
    e = impacts.housner(nu, rho, mu)
    law = e, nu, mu, lam, rho, kappa, 1.0, np.sin(psi), np.cos(psi)
    ratio = impacts.velocity_ratio(*law)
    assert -ratio == pytest.approx(-0.9197884324, abs=1e-10)
    assert 0.5 - impacts.bob_change(ratio, e, nu, lam, kappa, *law[-3:]) == pytest.approx(
        0.2543887204, abs=1e-10
    )


@pytest.mark.parametrize(
    ("hinge", "linear", "nonlinear"),
    [(None, 0.034361, 0.032657), (6.0, 0.034361, 0.032657), (3.0, 0.032111, 0.032255)],
)
def test_the_tilt_under_el_centro_agrees_with_two_independent_codes(hinge, linear, nonlinear):
    scene = tpd.Scene(COLUMN, tpd.records.el_centro().scaled(1.155))
    pendulum = tpd.Pendulum(mass=783.0, length=2.042, damping_ratio=0.129, hinge_height=hinge)
    for model, known in ((tpd.Piecewise(), linear), (tpd.Nonlinear(), nonlinear)):
        assert float(tpd.transient(scene, pendulum, model=model).tilt) == pytest.approx(known, abs=5e-7)


@pytest.mark.parametrize("nonlinear", [False, True])
@pytest.mark.parametrize("kappa", [0.8, 3.1])
def test_states_agree_with_an_integration_from_event_to_event(kappa, nonlinear):
    x, y0, times = (
        [0.23, 0.17, 0.6, 0.15, 0.04, 0.35, 2.3, 0.9],
        [0.08, -0.1, 0.0, 0.2],
        np.linspace(0.0, 6.0, 25),
    )
    names = "nu", "mu", "lam", "zeta", "k", "f", "xi", "e"
    p = tpd.Parameters(**dict(zip(names, x, strict=True)), kappa=kappa)
    found = tpd.simulate(p, y0, times, model=tpd.Nonlinear() if nonlinear else tpd.Piecewise())
    loop = EventDriven(x, nonlinear=nonlinear, kappa=kappa)
    known = loop.run(y0, times)
    # After the block has fallen one of them has no states, at different tilts.
    steps = min(int(np.sum(np.isfinite(found.ys[:, 0]))), len(known))
    assert steps > 5
    np.testing.assert_allclose(found.ys[:steps], known[:steps], rtol=1e-7, atol=1e-9)


def slope_and_difference(function: Any, kappa: float, h: float) -> tuple[Any, Any]:
    # One program for the values and the slope.
    both = jax.jit(lambda x: jax.jvp(function, (x,), (1.0,)))
    back_2, back, ahead, ahead_2 = (both(kappa + i * h)[0] for i in (-2, -1, 1, 2))
    return both(kappa)[1], (8.0 * (ahead - back) - (ahead_2 - back_2)) / (12.0 * h)


@pytest.mark.parametrize("changed", [{}, {"k": 0.05, "e": None}])
def test_the_derivative_of_a_settled_motion_equals_differences(changed):
    def sizes(kappa):
        steady = amplitude(kappa, **changed)
        return jnp.stack([steady.amplitude, steady.swing, *steady.state])

    slope, difference = slope_and_difference(sizes, 1.3, 1e-3)
    np.testing.assert_allclose(slope, difference, rtol=1e-8, atol=1e-8)


def test_derivatives_in_the_hinge_height_equal_differences():
    p = tpd.Parameters(**BASE | {"k": 0.05}, kappa=1.3)
    start = tpd.steady_state(p).state
    at = lambda kappa: dataclasses.replace(p, kappa=kappa)  # noqa: E731
    quantities = {
        "symmetric orbit": lambda x: tpd.symmetric_orbits(at(x)).amplitude[0],
        "fold margin": lambda x: tpd.symmetric_orbits(at(x)).margins.fold[0],
        "periodic orbit": lambda x: tpd.periodic_orbit(at(x), start).amplitude,
        "trajectory": lambda x: tpd.simulate(at(x), [0.1, 0.0, 0.0, 0.0], [0.0, 1.0, 2.0]).ys,
        "smoothed trajectory": lambda x: (
            tpd.simulate(at(x), [0.1, 0.0, 0.0, 0.0], [0.0, 1.0], model=tpd.Smoothed(rtol=1e-11)).ys
        ),
        "balance": lambda x: tpd.theory.one_harmonic_branches(at(x)).amplitude[0],
        "uplift": lambda x: tpd.theory.uplift(at(x)).margin,
        "free motion": lambda x: tpd.theory.free_motion(at(x)).amplitude,
    }
    for name, quantity in quantities.items():
        slope, difference = slope_and_difference(quantity, 1.3, 1e-3)
        np.testing.assert_allclose(slope, difference, rtol=1e-6, atol=1e-8, err_msg=name)
        assert np.any(np.abs(difference) > 1e-6), name


def test_derivatives_under_a_record_equal_differences():
    scene = tpd.Scene(COLUMN, tpd.records.el_centro().scaled(1.155))
    pulse = tpd.Scene(COLUMN, tpd.Pulse.one_sine(frequency=1.2375, acceleration=9.80665 / 6.0))

    def hung(height):
        return tpd.Pendulum(mass=783.0, length=2.042, damping_ratio=0.129, hinge_height=height)

    slope, difference = slope_and_difference(lambda x: tpd.transient(scene, hung(x)).tilt, 4.0, 1e-4)
    assert slope == pytest.approx(float(difference), rel=1e-6)
    slope, difference = slope_and_difference(lambda x: tpd.critical_scale(pulse, hung(x)).scale, 4.0, 1e-4)
    assert slope == pytest.approx(float(difference), rel=1e-5)


def test_the_static_limit_falls_with_the_height_of_the_hinge():
    for kappa in (0.5, 2.0, 3.5):
        p = tpd.Parameters(**BASE | {"f": 0.0}, kappa=kappa)
        limit = 0.2 * 1.05 / (1.0 + kappa * 0.05)
        below, above = (
            tpd.simulate(p, [x * limit, 0.0, 0.0, 0.0], [0.0, 0.05]).ys[-1, 2] for x in (0.999, 1.001)
        )
        assert below < 0.0 < above


@pytest.mark.parametrize("kappa", [0.0, -1.0, 20.01])
def test_a_hinge_at_the_base_or_far_above_the_block_is_rejected(kappa):
    with pytest.raises(ValueError, match=r"`kappa` must be .*, but is"):
        tpd.Parameters(**BASE, kappa=kappa)
