"""The exact model: known answers and gradients, losses next to folds and events, and its limits."""

import jax
import jax.numpy as jnp
import numpy as np
import pytest

from tests.answers.test_bifurcations import BARE as FOLDING
from tests.answers.test_bifurcations import TOUCHING, Kind, lost
from tests.exact.orbit_cases import among
from tests.exact.orbit_cases import solve as orbits
from tests.reference import (
    BARE,
    CASES,
    HUNG,
    NAMES,
    OVERTURNING,
    STILL,
    assert_overturned,
    differences,
    exact,
    named,
    parameters,
)
from tpd import Block, Harmonic, Pendulum, Piecewise, Scene, steady_state
from tpd.scene.status import SETTLED, names_of

NU, MU, LAM, ZETA, K, F, XI, E = range(8)


def moved(x, i, value):
    """All eight parameters, one of them changed."""
    out = np.ones(8)
    out[: len(x)] = x
    out[i] = value
    return out


def power(distances, values):
    """The exponent of a power law."""
    return float(np.polyfit(np.log(distances), np.log(values), 1)[0])


# Known answers


@pytest.mark.parametrize("case", CASES, ids=named)
def test_amplitude_and_gradient_are_the_known_ones(case):
    answer = exact(case.x, case.y0)
    assert answer.status == ("rest" if case is STILL else "rocking")
    assert answer.amplitude == pytest.approx(case.amplitude, rel=case.amplitude_rtol, abs=case.amplitude_atol)
    known = np.isfinite(case.gradient)
    found, expected = answer.slopes[0][known], np.array(case.gradient)[known]
    np.testing.assert_allclose(found, expected, rtol=case.gradient_rtol, atol=case.gradient_atol)


@pytest.mark.parametrize("x", [STILL.x, (*HUNG[3].x, 0.8)], ids=["rest", "impacts"])
def test_amplitude_and_stroke_have_the_gradients_of_differences(x):
    # From the settled state, since far steps from elsewhere may end on another orbit. The amplitude is known
    # to about 1e-14 of itself, hence its differences to 1e-8 even where they are small.
    answer = exact(x)
    for i in range(len(x)):
        expected = differences(
            lambda x: np.array([(a := exact(x, answer.steady.state)).amplitude, a.stroke]), x, i
        )
        np.testing.assert_allclose(answer.slopes[:2, i], expected, rtol=1e-7, atol=1e-11, err_msg=NAMES[i])


def test_the_gradient_of_a_bare_block_says_what_a_first_light_bob_would_do():
    case = BARE[0]
    bare, h = exact(case.x, case.y0), 1e-4
    values = [exact(moved(case.x, MU, mu), case.y0).amplitude for mu in (0, h, 2 * h, 3 * h)]
    assert bare.slopes[0, MU] == pytest.approx(np.dot([-11, 18, -9, 2], values) / (6 * h), rel=1e-6)


@pytest.mark.mends("the derivative of the estimate was zero")
def test_an_estimate_that_nobody_made_has_no_derivative():
    def estimate(mu):
        return jnp.asarray(steady_state(parameters((0.25, mu, *HUNG[0].x[2:]))).estimate)

    assert np.isnan(jax.grad(estimate)(0.05))


def test_settings_that_make_no_sense_are_refused():
    with pytest.raises(ValueError, match="`max_periods` must be a whole number, 1 or more, but is 0"):
        Piecewise(max_periods=0)


# Folds, breaking of symmetry, grazing, sticking


def test_next_to_a_fold_the_gradient_is_refused_by_name():
    x = moved(FOLDING, F, (b := lost(Kind.fold)).value * (1.0 + 5e-14))
    o = orbits([x])
    assert list(o.status[0, :2]) == ["near_fold", "near_fold"]
    assert np.all(np.isnan(o.slopes[0, :2]))
    np.testing.assert_allclose(o.amplitude[0, :2], b.amplitude, rtol=1e-5)
    settled = exact(x, o.state[0, 0])
    assert settled.status == "near_fold"
    assert np.all(np.isnan(settled.slopes))
    assert settled.amplitude == pytest.approx(b.amplitude, rel=1e-5)


def test_next_to_a_grazing_the_gradient_is_refused_by_name():
    b, distances = lost(Kind.grazing), 10.0 ** np.linspace(-9.0, -3.0, 7)
    o = among(TOUCHING, "f", b.value * (1.0 - distances))
    # The margin vanishes in proportion: below 1e-7 of what is usual it is called grazing.
    assert power(distances, o.grazing[:, 1]) == pytest.approx(1.0, abs=0.01)
    told = o.status[:, 1] == "grazing"
    np.testing.assert_array_equal(told, o.grazing[:, 1] < 1e-7)
    assert 2 <= told.sum() <= 4
    assert np.all(np.isnan(o.slopes[told, 1]))
    assert np.all(np.isfinite(o.slopes[~told, 1]))
    np.testing.assert_allclose(o.amplitude[told, 1], b.amplitude, rtol=1e-6)
    assert among(TOUCHING, "f", np.array([b.value * (1.0 + 1e-6)])).status[0, 1] == "no_orbit"


# Overturning


def test_an_overturning_has_a_status_and_no_gradient():
    assert_overturned(exact(OVERTURNING))


def test_starts_that_all_but_overturn_have_the_attractor_s_answer_or_a_name():
    answers, low, high = [], 0.16, 0.3
    for _ in range(45):
        tilt = 0.5 * (low + high)
        answers.append(exact(BARE[1].x, (tilt, 0.0, 0.0, 0.0)))
        low, high = (low, tilt) if answers[-1].status == "overturned" else (tilt, high)
    # Every one is the attractor with its gradient, or rest, or lost, or the saddle in between, refused.
    assert {a.status for a in answers} == {"rocking", "rest", "overturned", "unstable"}
    saddle = next(a.amplitude for a in answers if a.status == "unstable")
    assert saddle > 0.2
    sizes = {"rocking": BARE[1].amplitude, "rest": 0.0, "overturned": np.inf, "unstable": saddle}
    for a in answers:
        assert a.amplitude == pytest.approx(sizes[a.status], rel=1e-6)
        assert np.all(np.isfinite(a.slopes[0])) == (a.status in names_of(SETTLED))


# Limits


def test_at_resonance_a_bob_under_a_resting_block_swings_by_its_damping_alone():
    nu, lam, f = 0.25, 0.8, 0.1
    xi = np.sqrt((1.0 + nu**2) / (0.75 * lam))
    for zeta in (1e-1, 1e-3, 1e-6):
        light = exact((nu, 0.0, lam, zeta, 0.05, f, xi))
        assert light.status == "rest"
        assert light.stroke == pytest.approx(f / (2.0 * zeta), rel=1e-9)
        assert light.slopes[1, ZETA] == pytest.approx(-f / (2.0 * zeta**2), rel=1e-6)
    for zeta in (1e-2, 1e-8):
        heavy = exact((nu, 0.1, lam, zeta, 0.05, f, xi))
        assert heavy.status in ("overturned", "event_bound")
        assert np.all(np.isnan(heavy.slopes))


def test_resonance_without_damping_to_the_last_digit_is_told():
    # 1 - lam rho xi^2 is zero.
    answer = exact((0.5, 0.1, 1.0 / 0.6, 0.0, 0.05, 0.1, 1.0))
    assert answer.status == "failed"
    assert np.isnan(answer.amplitude)
    assert np.all(np.isnan(answer.slopes))


def test_a_period_too_long_to_be_followed_is_told():
    answer = exact((0.2, 0.1, 0.4, 0.2, 0.05, 0.1, 1e-6))
    assert answer.status == "event_bound"
    assert np.all(np.isnan(answer.slopes))


@pytest.mark.parametrize("f", [1e1, 1e100, 1e300])
def test_huge_shaking_overturns_or_is_told_to_be_beyond_numbers(f):
    answer = exact((0.2, 0.1, 0.4, 0.2, 0.05, f, 3.5))
    assert answer.status == ("failed" if f == 1e300 else "overturned")
    assert np.all(np.isnan(answer.slopes))


def dimensionless(size, mass):
    """The paper's block and its shaking, `size` times as large and shaken that much slower."""
    block = Block(width=0.1 * size, height=0.4 * size, mass=mass, friction=0.05, restitution=1.0)
    motion = Harmonic(amplitude=0.015 * size, frequency=2.5 / np.sqrt(size))
    p = Scene(block, motion).parameters(Pendulum(mass=0.05 * mass, length=0.04 * size, damping_ratio=0.1))
    return tuple(float(getattr(p, n)) for n in ("nu", "mu", "lam", "zeta", "k", "f", "xi", "e"))


@pytest.mark.parametrize(("height", "density"), [(1e-3, 4e5), (1e3, 20.0)])
def test_neither_millimetres_nor_kilometres_change_a_dimensionless_answer(height, density):
    x = dimensionless(height / 0.4, density * height**3 / 16.0)
    usual = dimensionless(1.0, 16.2)
    np.testing.assert_allclose(x, usual, rtol=1e-14)
    answer, expected = exact(x), exact(usual)
    assert answer.status == expected.status == "rocking"
    assert answer.amplitude == pytest.approx(expected.amplitude, rel=1e-11)
    np.testing.assert_allclose(answer.slopes[0], expected.slopes[0], rtol=1e-8, atol=1e-10)
