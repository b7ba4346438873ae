"""The steady state: to 50 digits, its multipliers and exponents, its verdict, and what has no derivative."""

import jax
import jax.numpy as jnp
import numpy as np
import pytest

from tests.compiled.test_trajectory import REACH, clock, scales, states
from tests.reference import (
    MOVING,
    SLOW,
    UNSTABLE,
    WITH,
    WITHOUT,
    along,
    differences,
    exact,
    parameters,
)
from tests.truth import load
from tpd import Piecewise, simulate, status_name, steady_state
from tpd.compiled import columns
from tpd.models.base import scale_of
from tpd.scene.parameters import as_arrays
from tpd.scene.status import names_of

ROWS = [r for r in load("harmonic") if r["what"] == "settled"]
REPELLING = next(r for r in load("harmonic") if r["name"] == "repelling")
SETTLE = jax.jit(lambda x, y0: steady_state(parameters(x), y0=y0, model=Piecewise(max_events=4000)))
CHAOTIC = (0.321, 0.205, 0.096, 0.047, 0.087, 0.347, 2.803, 1.0)
PERIOD_THREE = (0.16, 0.11, 0.18, 0.1, 0.03, 0.32, 4.5)


@pytest.mark.parametrize("row", ROWS, ids=lambda row: row["name"])
def test_a_settled_motion_agrees_with_a_solution_of_fifty_digits(row):
    x = np.array(row["parameters"])
    s = SETTLE(x, np.array(row["y0"]))
    assert status_name(s.status) in ("rocking", "sticking", "rest")
    assert float(s.amplitude) == pytest.approx(float(row["amplitude"]), rel=REACH)
    assert float(s.swing) == pytest.approx(float(row["swing"]), rel=REACH)
    end = np.array([float(v) for v in row["end"]])
    # On any of the forcing periods of its motion: on which one it is depends on how long it was followed.
    begins = np.array([0.0, *2.0 * np.pi / x[6] * np.arange(1, int(s.periods) + 1)])
    visited = simulate(parameters(x), s.state, begins).ys
    assert (np.abs(np.asarray(visited) - end) / scales(x)).max(axis=1).min() < REACH


def verdict(residual=0.0, multiplier=0.5, to_fold=0.5, transversality=1.0, outcome=columns.ROCKING, **state):
    """Verdict by the rules of compiled code and of JAX; by default on a motion that repeats."""
    flags = {"neutral": False, "small": False, "damped": True, "finite": True} | state
    numbers = outcome, residual, multiplier, to_fold, transversality, *flags.values()
    return str(names_of(columns.verdict(*numbers)))


LOSSES = [
    ({}, "rocking"),
    ({"transversality": 1e-8}, "grazing"),
    ({"transversality": 1e-6}, "rocking"),
    ({"to_fold": 1e-6}, "near_fold"),
    ({"to_fold": 1e-5}, "rocking"),
    ({"multiplier": 1.001}, "unstable"),
    ({"residual": 1e-7}, "not_settled"),
    ({"residual": np.nan}, "not_settled"),
    ({"neutral": True}, "neutral"),
    ({"small": True}, "rest"),
    ({"finite": False}, "failed"),
    ({"multiplier": np.inf}, "failed"),
    ({"outcome": columns.AT_REST, "residual": np.inf}, "event_bound"),
    ({"outcome": columns.AT_REST, "residual": np.inf, "damped": False}, "rest"),
    ({"outcome": columns.OVERTURNED, "finite": False}, "overturned"),
]


@pytest.mark.parametrize(("what", "status"), LOSSES)
def test_compiled_code_and_jax_assign_the_same_status_to_each_case(what, status):
    assert verdict(**what) == status


@pytest.mark.parametrize("case", MOVING[::2], ids=lambda case: case.name)
def test_the_multiplier_is_the_largest_eigenvalue_of_the_return_map(case):
    answer = exact(case.x, case.y0)
    slopes = along(case.x, answer.steady.state, clock(case.x, 1))[1][-1]
    felt = [0, 2] if case.x[1] == 0 else [0, 1, 2, 3]
    largest = np.abs(np.linalg.eigvals(slopes[np.ix_(felt, felt)])).max()
    assert answer.steady.multiplier == pytest.approx(largest, rel=1e-9)
    # Sizes are the largest angles of a settled period; a peak hides at most half a sample from the nearest.
    angles = np.abs(states(case.x, answer.steady.state, clock(case.x, 1))[:, :2]).max(axis=0)
    np.testing.assert_allclose([answer.amplitude, answer.swing], angles, rtol=5e-4)
    assert np.all(np.array([answer.amplitude, answer.swing]) >= angles * (1 - 1e-12))


@pytest.mark.parametrize("x", [WITH[3].x, PERIOD_THREE], ids=["period one", "period three"])
def test_the_lyapunov_exponent_of_an_orbit_is_the_rate_of_its_multiplier(x):
    found = exact(x).steady
    duration = int(found.periods) * 2.0 * np.pi / x[6]
    assert float(found.lyapunov) == pytest.approx(np.log(float(found.multiplier)) / duration, rel=1e-12)


def test_a_bob_at_rest_has_the_multiplier_of_its_decay():
    # Nothing shakes: the bob's rate, which is watched for its turns, is zero throughout.
    nu, mu, lam, zeta, xi = 0.1, 0.4, 1.1, 0.1, 5.8
    answer = exact((nu, mu, lam, zeta, 0.3, 0.0, xi), (0.0, -0.02, 0.0, 0.03))
    assert answer.status == "rest"
    rate = zeta / np.sqrt(lam * 0.75 / (1.0 + nu**2))
    assert float(answer.steady.multiplier) == pytest.approx(np.exp(-rate * 2.0 * np.pi / xi), rel=1e-9)
    np.testing.assert_array_equal(answer.slopes[0], 0.0)


def test_the_gradient_of_an_orbit_of_period_three_equals_differences():
    answer, x = exact(PERIOD_THREE), PERIOD_THREE
    assert answer.steady.periods == 3

    def state(y):
        """On the same of the periods of an orbit or of its mirror image, whichever was met first."""
        found, halves = exact(y, answer.steady.state).steady, np.arange(201)
        visited = states(y, found.state, halves * np.pi / y[6]) * (-1.0) ** halves[:, None]
        return min(visited[: 2 * int(found.periods)], key=lambda v: np.linalg.norm(v - answer.steady.state))

    for i in range(7):
        expected = differences(state, x, i, share=1e-3)
        reach = 1e-5 * np.abs(answer.slopes[2:]).max()
        np.testing.assert_allclose(answer.slopes[2:, i], expected, rtol=0, atol=reach)


def test_derivatives_of_multiplier_and_lyapunov_exponent_are_nan():
    @jax.jit
    @jax.jacfwd
    def slopes(x):
        found = steady_state(parameters(x))
        return jnp.stack([found.multiplier, found.lyapunov])

    assert np.all(np.isnan(slopes(np.array(WITH[3].x))))


def test_a_motion_with_unequal_sides_is_not_called_symmetric():
    answer = exact((0.19, 0.04, 0.58, 0.1, 0.09, 0.43, 1.66, 0.81), (-0.0117, 0.66787, 0.26387, -0.93402))
    assert answer.status == "rocking"
    assert int(answer.steady.periods) == 1
    assert not bool(answer.steady.symmetric)
    assert bool(exact(WITHOUT[0].x, WITHOUT[0].y0).steady.symmetric)


def test_a_motion_on_an_unstable_orbit_has_no_gradient():
    x, amplitude, half = UNSTABLE
    answer = exact(x, REPELLING["states"][0])
    assert answer.status == "unstable"
    assert answer.amplitude == pytest.approx(amplitude, abs=5e-7)
    assert answer.steady.multiplier == pytest.approx(half**2, abs=2e-3)
    assert np.all(np.isnan(answer.slopes))


def test_the_swing_of_an_undamped_bob_is_the_sum_of_its_two_oscillations():
    # lam rho psi'' + psi = f sin(xi tau) from rest: two swings whose peaks meet sooner or later.
    nu, mu, lam, f, xi = 0.2, 0.1, 0.4, 0.1, 4.0
    ratio = xi * np.sqrt(lam * 0.75 / (1 + nu**2))
    answer = exact((nu, mu, lam, 0.0, 0.03, f, xi))
    assert answer.status == "rest"
    assert answer.swing == pytest.approx(f / abs(1 - ratio**2) * (1 + ratio), rel=0.1)
    # The derivative of the stroke does not exist, and does not spoil that of the amplitude in reverse mode.
    np.testing.assert_array_equal(answer.slopes[0], 0.0)
    assert np.all(np.isnan(answer.slopes[1]))


def test_a_motion_that_decays_slowly_is_not_settled_and_not_aperiodic():
    # So tight a tolerance leaves the short way to the orbit out.
    model = Piecewise(tolerance=1e-11, max_periods=200)

    @jax.jit
    def sizes(x):
        s = steady_state(parameters(x), model=model)
        return s.amplitude, s

    slopes, s = jax.jacrev(sizes, has_aux=True)(np.array(SLOW))
    assert status_name(s.status) == "not_settled"
    assert -0.05 < s.lyapunov < 0.0
    assert np.all(np.isnan(slopes))


def test_the_derivative_of_a_chaotic_motion_grows_at_the_lyapunov_rate():
    answer = exact(CHAOTIC)
    assert answer.status == "aperiodic"
    assert np.isnan(answer.steady.multiplier)
    assert np.all(np.isnan(answer.slopes))
    # The amplitude is the largest of the hundred periods, not of the last one.
    after = states(CHAOTIC, answer.steady.state, clock(CHAOTIC, 1))
    assert np.max(np.abs(after[:, 0])) < answer.amplitude
    # Over the hundred periods after those that were followed, as in the report.
    p, times = as_arrays(parameters(CHAOTIC)), np.arange(201) * 2.0 * np.pi / CHAOTIC[6]
    settled, scale, rates = jax.jit(Piecewise().settle)(p, jnp.zeros(4)), np.asarray(scale_of(p)), []
    assert status_name(settled.status) == "not_settled"
    # Rounding alone makes another motion of each start within the hundred periods, and over so few the rate
    # scatters by a tenth.
    for more in 1.0 + 0.05 * np.random.default_rng(0).normal(size=(8, 4)):
        _, slopes, status = along(CHAOTIC, np.asarray(settled.state) * more, times)
        assert status == "rocking"
        sizes = np.linalg.norm(slopes @ scale / scale, axis=1)[:101]
        assert sizes[-1] > 1e13
        rates.append(np.log(sizes[-1] / sizes[0]) / times[100])
    assert np.std(rates) < 0.15 * np.mean(rates)
    # The rate of a hundred periods scatters by 6 %: that of a thousand is compared.
    long = steady_state(p, model=Piecewise(lyapunov_periods=1000)).lyapunov
    assert np.mean(rates) == pytest.approx(float(long), abs=2.0 * np.std(rates))


def test_an_orbit_has_the_fewest_periods_after_which_it_closes():
    x = (0.34684076, 0.33654631, 0.95543206, 0.18860575, 0.12086973, 0.59603433, 1.37835798, 0.36302871)
    early, late = (steady_state(parameters(x), model=m) for m in (Piecewise(), Piecewise(tolerance=1e-11)))
    assert int(early.elapsed) < 40 < int(late.elapsed)
    for found in (early, late):
        assert int(found.periods) == 1
        assert bool(found.symmetric)
    assert float(early.multiplier) == pytest.approx(float(late.multiplier), rel=1e-9)
    assert float(early.amplitude) == pytest.approx(float(late.amplitude), rel=1e-12)


@pytest.mark.parametrize("row", ROWS, ids=lambda row: row["name"])
def test_numbers_have_the_same_bits_with_and_without_derivatives(row):
    x, y0 = np.array(row["parameters"]), np.array(row["y0"])
    values = SETTLE(x, y0)
    pushed, _ = jax.jit(lambda x: jax.jvp(lambda x: steady_state(parameters(x), y0=y0), (x,), (x,)))(x)
    batch = jax.vmap(lambda x: steady_state(parameters(x), y0=y0))(x[None])
    for name in ("amplitude", "swing", "state", "status", "multiplier", "lyapunov", "periods", "elapsed"):
        a, b, c = (np.asarray(jax.tree.leaves(getattr(s, name))[0]) for s in (values, pushed, batch))
        np.testing.assert_array_equal(a, b, err_msg=name)
        np.testing.assert_array_equal(a, c[0], err_msg=name)
