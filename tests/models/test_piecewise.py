"""The exact model: known answers and gradients, losses next to folds and events, and its limits."""

import functools

import jax
import jax.numpy as jnp
import numpy as np
import pytest
from scipy.optimize import fsolve

from tests.answers.test_bifurcations import BARE as FOLDING
from tests.answers.test_bifurcations import HELD, TOUCHING, Kind, lost
from tests.exact.orbits import among
from tests.exact.orbits import solve as orbits
from tests.reference import (
    BARE,
    CASES,
    HUNG,
    NAMES,
    OVERTURNING,
    REST,
    STILL,
    UNSTABLE,
    assert_overturned,
    differences,
    exact,
    named,
    parameters,
)
from tpd import Block, Harmonic, Pendulum, Piecewise, Scene, status_name, steady_state
from tpd.scene.status import SETTLED

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


@pytest.mark.parametrize(
    "x", [HUNG[0].x, HUNG[3].x, STILL.x, (*HUNG[3].x, 0.8)], ids=["light", "heavy", "rest", "impacts"]
)
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
    for mu in (1e-6, 1e-9, 1e-12):
        more = exact(moved(case.x, MU, mu), case.y0).amplitude - bare.amplitude
        assert more == pytest.approx(bare.slopes[0, MU] * mu, rel=1e-4, abs=1e-15)
    # Without mass it cannot be felt, whatever its rod and hinge.
    for lam, zeta in ((0.4, 0.0), (1.5, 0.6), (0.1, 1.0), (0.7, 2.5)):
        answer = exact((*case.x[:2], lam, zeta, *case.x[4:]), case.y0)
        assert answer.status == "rocking"
        assert answer.amplitude == pytest.approx(bare.amplitude, rel=1e-13)
        np.testing.assert_allclose(answer.slopes[0, 2:4], 0.0, atol=1e-9)


@pytest.mark.mends("the derivative of the estimate was zero")
def test_an_estimate_that_nobody_made_has_no_derivative():
    def estimate(mu):
        return jnp.asarray(steady_state(parameters((0.25, mu, *HUNG[0].x[2:]))).estimate)

    assert np.isnan(jax.grad(estimate)(0.05))


def test_a_batch_gives_each_design_what_it_gets_alone():
    designs = [HUNG[0].x, STILL.x, OVERTURNING, HUNG[3].x, BARE[0].x]
    starts = [*[REST] * 4, BARE[0].y0]
    batch = jax.jit(jax.vmap(lambda x, y0: steady_state(parameters(x), y0=y0)))
    together = batch(np.array(designs), np.array(starts))
    for i, alone in enumerate(exact(x, y0) for x, y0 in zip(designs, starts, strict=True)):
        assert status_name(jax.tree.map(lambda a, i=i: a[i], together.status)) == alone.status
        assert together.amplitude[i] == pytest.approx(alone.amplitude, rel=1e-13)
        assert together.stroke[i] == pytest.approx(alone.stroke, rel=1e-12)
        assert together.elapsed[i] == alone.steady.elapsed


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


def test_a_little_farther_from_a_fold_steady_state_and_orbits_have_the_same_large_gradient():
    x = moved(FOLDING, F, lost(Kind.fold).value * (1.0 + 1e-8))
    o = orbits([x])
    settled = exact(x, o.state[0, 0])
    assert settled.status == "rocking"
    assert settled.slopes[0, F] > 1000.0
    assert settled.slopes[0, F] == pytest.approx(o.slopes[0, 0, 0, F], rel=1e-6)


def test_beyond_the_breaking_of_symmetry_the_motion_leans_as_the_root_and_its_gradient_as_the_inverse():
    b, distances = lost(Kind.symmetry_breaking), 10.0 ** np.linspace(-2.0, -4.5, 6)
    straight = among(UNSTABLE[0], "xi", b.value * (1.0 - distances))
    refused = exact(moved(UNSTABLE[0], XI, b.value * (1.0 - distances[0])), straight.state[0, 0])
    assert refused.status == "unstable"
    assert np.all(np.isnan(refused.slopes))
    lean, leans, slopes = 0.01 * straight.state[0, 0], [], []
    for i, distance in enumerate(distances):
        answer = exact(moved(UNSTABLE[0], XI, b.value * (1.0 - distance)), straight.state[i, 0] + lean)
        assert answer.status == "rocking"
        assert not bool(answer.steady.symmetric)
        leans.append(answer.amplitude - straight.amplitude[i, 0])
        slopes.append(straight.slopes[i, 0, 0, XI] - answer.slopes[0, XI])
        lean = (np.asarray(answer.steady.state) - straight.state[i, 0]) * 10.0**-0.25
    assert power(distances[2:], np.array(leans)[2:]) == pytest.approx(0.5, abs=0.02)
    assert power(distances[2:], np.array(slopes)[2:]) == pytest.approx(-0.5, abs=0.02)


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


def test_where_sticking_begins_amplitude_and_gradient_are_continuous_and_the_status_changes():
    b, distances = lost(Kind.sticking), 10.0 ** np.linspace(-6.0, -3.0, 7)
    o = among(HELD, "f", b.value * (1.0 + distances))
    assert set(o.status[:, 0]) == {"rocking"}
    assert power(distances, o.sticking[:, 0]) == pytest.approx(1.0, abs=0.01)
    slips, sticks = (exact(moved(HELD, F, b.value * (1.0 + d)), o.state[0, 0]) for d in (1e-6, -1e-6))
    assert (slips.status, sticks.status) == ("rocking", "sticking")
    assert sticks.amplitude == pytest.approx(slips.amplitude, rel=1e-4)
    np.testing.assert_allclose(sticks.slopes[0], slips.slopes[0], rtol=1e-3, atol=1e-5)
    beyond = moved(HELD, F, b.value * (1.0 - 1e-3))
    answer = exact(beyond, o.state[0, 0])
    assert answer.status == "sticking"
    expected = differences(lambda x: exact(x, answer.steady.state).amplitude, beyond, F, share=1e-4)
    assert answer.slopes[0, F] == pytest.approx(expected, rel=1e-6)


# Overturning


def test_an_overturning_has_a_status_and_no_gradient():
    assert_overturned(exact(OVERTURNING))


def test_starts_that_all_but_overturn_have_the_attractor_s_answer_or_a_name():
    answers, low, high = [], 0.16, 0.3
    for _ in range(50):
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
        assert np.all(np.isfinite(a.slopes[0])) == (a.status in SETTLED)


# Limits


def test_at_resonance_a_bob_under_a_resting_block_swings_by_its_damping_alone():
    nu, lam, f = 0.25, 0.8, 0.1
    xi = np.sqrt((1.0 + nu**2) / (0.75 * lam))
    for zeta in (1e-1, 1e-3, 1e-6):
        light = exact((nu, 0.0, lam, zeta, 0.05, f, xi))
        assert light.status == "rest"
        assert light.stroke == pytest.approx(f / (2.0 * zeta), rel=1e-9)
        assert light.slopes[1, ZETA] == pytest.approx(-f / (2.0 * zeta**2), rel=1e-6)
    assert exact((nu, 0.1, lam, 0.1, 0.05, f, xi)).status == "rest"
    for zeta in (1e-2, 1e-4, 1e-6, 1e-8):
        heavy = exact((nu, 0.1, lam, zeta, 0.05, f, xi))
        assert heavy.status in ("overturned", "event_bound")
        assert np.all(np.isnan(heavy.slopes))


@pytest.mark.parametrize("mu", [0.0, 0.1])
def test_resonance_without_damping_to_the_last_digit_is_told(mu):
    # 1 - lam rho xi^2 is zero.
    answer = exact((0.5, mu, 1.0 / 0.6, 0.0, 0.05, 0.1, 1.0))
    assert answer.status == "failed"
    assert np.isnan(answer.amplitude)
    assert np.all(np.isnan(answer.slopes))


def test_a_slender_block_s_amplitude_is_in_proportion_as_nu_vanishes():
    shares = np.array([1e-1, 1e-2, 1e-3, 1e-8])
    answers = [exact(np.array(HUNG[3].x) * np.array([s, 1, 1, 1, s, s, 1])) for s in shares]
    assert {a.status for a in answers} == {"rocking"}
    sizes = np.array([a.amplitude for a in answers]) / shares
    # rho is all that changes, by nu^2.
    assert power(shares[:3], np.abs(sizes[:3] - sizes[3])) == pytest.approx(2.0, abs=0.01)
    assert answers[3].slopes[0, NU] == pytest.approx(answers[2].slopes[0, NU], rel=1e-6)


def fast_limit(nu, k, f):
    """What xi^2 times the amplitude of a bare block tends to as xi grows: u = xi^2 phi obeys u'' = k - nu -
    f sin(theta + gamma) from the turn on, and 2 nu more after u = 0."""

    def conditions(unknown):
        top, crossing, gamma = unknown

        def u(theta):
            bend = 0.5 * (k - nu) * theta**2 + nu * max(theta - crossing, 0.0) ** 2
            return top + bend + f * (np.sin(theta + gamma) - np.sin(gamma) - theta * np.cos(gamma))

        turning = (k - nu) * np.pi + 2.0 * nu * (np.pi - crossing) - 2.0 * f * np.cos(gamma)
        return [u(crossing), u(np.pi) + top, turning]

    return float(fsolve(conditions, (0.74, 1.4, 1.2), xtol=1e-13)[0])


def test_under_fast_shaking_the_amplitude_is_that_of_a_block_that_nothing_topples():
    nu, k, f = 0.2, 0.05, 0.5
    rates = np.array([10.0, 30.0, 100.0, 300.0])
    o = among((nu, 0.0, 0.4, 0.2, k, f, 1.0, 1.0), "xi", rates)
    assert set(o.status[:, 0]) == {"rocking"}
    apart = np.abs(o.amplitude[:, 0] * rates**2 / fast_limit(nu, k, f) - 1.0)
    assert power(rates, apart) == pytest.approx(-2.0, abs=0.05)
    for i in (0, 2):
        answer = exact((nu, 0.0, 0.4, 0.2, k, f, rates[i]))
        assert answer.amplitude == pytest.approx(o.amplitude[i, 0], rel=1e-9)
    # Farther out the events are too gentle by the scales of the exact model, and it says so.
    for rate in (1e4, 1e6):
        assert exact((nu, 0.0, 0.4, 0.2, k, f, rate)).status not in SETTLED


def test_under_slow_shaking_the_block_rests_or_overturns_and_the_bob_follows():
    rates = np.array([1e-1, 1e-2, 1e-3])
    answers = [exact((0.2, 0.1, 0.4, 0.2, 0.05, 0.1, xi)) for xi in rates]
    assert {a.status for a in answers} == {"rest"}
    assert power(rates, np.array([a.stroke - 0.1 for a in answers])) == pytest.approx(2.0, abs=0.01)
    for xi in rates:
        assert exact((0.2, 0.1, 0.4, 0.2, 0.05, 0.5, xi)).status == "overturned"


def test_a_period_too_long_to_be_followed_is_told():
    for xi in (1e-6, 1e-8):
        for f in (0.1, 0.5):
            answer = exact((0.2, 0.1, 0.4, 0.2, 0.05, f, xi))
            assert answer.status in ("event_bound", "failed", "overturned")
            assert np.all(np.isnan(answer.slopes))
    assert exact((0.2, 0.1, 0.4, 0.2, 0.05, 0.1, 1e-6)).status == "event_bound"


@pytest.mark.parametrize("f", [1e1, 1e6, 1e100, 1e300])
def test_huge_shaking_overturns_or_is_told_to_be_beyond_numbers(f):
    answer = exact((0.2, 0.1, 0.4, 0.2, 0.05, f, 3.5))
    assert answer.status == ("failed" if f == 1e300 else "overturned")
    assert np.all(np.isnan(answer.slopes))


def test_far_outside_every_design_there_is_no_nan_with_a_settled_status():
    rng = np.random.default_rng(7)
    low = np.array([1e-6, 1e-9, 1e-3, 1e-2, 1e-6, 1e-4, 1e-1, 1e-3])
    high = np.array([0.5, 1e6, 1e6, 1e3, 1e2, 1e6, 1e4, 1.0])
    met = set()
    for _ in range(60):
        x = np.exp(rng.uniform(np.log(low), np.log(high)))
        if rng.random() < 0.5:
            x[F], x[K] = x[NU] * np.exp(rng.uniform(-1.0, 3.0)), x[NU] * rng.random()
        answer = exact(x, rng.uniform(-1.0, 1.0, 4) * x[NU] * (rng.random() < 0.3))
        sizes = [answer.amplitude, answer.stroke, *np.asarray(answer.steady.state), *answer.slopes[0]]
        assert np.all(np.isfinite(sizes)) or answer.status not in SETTLED, (answer.status, list(x))
        assert np.all(np.isnan(answer.slopes)) or answer.status in SETTLED, (answer.status, list(x))
        met.add(answer.status)
    assert met >= {"rest", "overturned"}


@functools.cache
def dimensionless(size, mass):
    """The paper's block and its shaking, `size` times as large and shaken that much slower."""
    block = Block(width=0.1 * size, height=0.4 * size, mass=mass, friction=0.05)
    motion = Harmonic(amplitude=0.015 * size, frequency=2.5 / np.sqrt(size))
    p = Scene(block, motion).parameters(Pendulum(mass=0.05 * mass, length=0.04 * size, damping_ratio=0.1))
    return tuple(float(getattr(p, n)) for n in ("nu", "mu", "lam", "zeta", "k", "f", "xi", "e"))


@pytest.mark.parametrize("height", [1e-3, 1e3], ids="{:g} m".format)
@pytest.mark.parametrize("density", [20.0, 4e5], ids="{:g} kg per m3".format)
def test_neither_millimetres_nor_kilometres_change_a_dimensionless_answer(height, density):
    x = dimensionless(height / 0.4, density * height**3 / 16.0)
    usual = dimensionless(1.0, 16.2)
    np.testing.assert_allclose(x, usual, rtol=1e-14)
    answer, expected = exact(x), exact(usual)
    assert answer.status == expected.status == "rocking"
    assert answer.amplitude == pytest.approx(expected.amplitude, rel=1e-11)
    np.testing.assert_allclose(answer.slopes[0], expected.slopes[0], rtol=1e-8, atol=1e-10)
