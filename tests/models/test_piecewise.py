"""The exact piecewise solution, against closed forms, known answers and adaptive integration."""

import dataclasses

import jax
import jax.numpy as jnp
import numpy as np
import pytest
from scipy.optimize import fsolve

from tests.reference import (
    BARE,
    CASES,
    HUNG,
    MOVING,
    NAMES,
    REST,
    SLOW,
    STILL,
    UNSTABLE,
    EventDriven,
    differences,
    exact,
    named,
    parameters,
)
from tpd import Harmonic, Piecewise, Status, paper_scene, simulate, status_name, steady_state
from tpd.models.rows import settle_all
from tpd.scene.parameters import as_arrays
from tpd.scene.status import names_of
from tpd.theory import uplift
from tpd.theory.equations import Linear

SAMPLES = 201
"""Of every trajectory here, so that one compilation serves them all."""

OVERTURNING = ((0.25, 0.1, 0.2, 0.1, 0.05, 0.6, 2.67), REST)
RINGING = ((0.2, 0.1, 0.4, 0.0, 0.03, 0.25, 4.0), REST)
"""As the still case, but nothing damps the bob, which keeps rattling the block for ever."""
RESTING_UNDAMPED = (0.2, 0.1, 0.4, 0.0, 0.03, 0.1, 4.0)
CHAOTIC = (0.321, 0.205, 0.096, 0.047, 0.087, 0.347, 2.803)
PERIOD_THREE = (0.16, 0.11, 0.18, 0.1, 0.03, 0.32, 4.5)


def clock(x, periods, begin=0.0):
    """Times that cover so many forcing periods."""
    return begin + np.linspace(0.0, periods * 2.0 * np.pi / x[6], SAMPLES)


def states(x, y0, times):
    motion = simulate(parameters(x), np.asarray(y0, dtype=float), times)
    assert status_name(motion.status) == "rocking"
    return np.asarray(motion.ys)


def after_one_period(x, y0):
    return states(x, y0, clock(x, 1))[-1]


# Known answers


@pytest.mark.parametrize("case", CASES, ids=named)
def test_amplitude_is_the_known_one(case):
    answer = exact(case.x, case.y0)
    assert answer.status == ("rest" if case is STILL else "rocking")
    assert answer.amplitude == pytest.approx(case.amplitude, rel=case.amplitude_rtol, abs=case.amplitude_atol)


@pytest.mark.parametrize("case", CASES, ids=named)
def test_gradient_is_the_known_one(case):
    known = np.isfinite(case.gradient)
    found = exact(case.x, case.y0).slopes[0][known]
    expected = np.array(case.gradient)[known]
    np.testing.assert_allclose(found, expected, rtol=case.gradient_rtol, atol=case.gradient_atol)


@pytest.mark.parametrize("case", [*HUNG, *BARE], ids=named)
def test_gradient_is_that_of_differences(case):
    # From the settled state, since far steps from elsewhere may end on another orbit. The amplitude
    # is known to about 1e-14 of itself, hence its differences to 1e-8 even where they are small.
    state = exact(case.x, case.y0).steady.state
    gradient = exact(case.x, case.y0).slopes[0]
    for i in range(7) if case in HUNG else (0, 4, 5, 6):
        expected = differences(lambda x: exact(x, state).amplitude, case.x, i)
        assert gradient[i] == pytest.approx(expected, rel=1e-8), NAMES[i]


@pytest.mark.parametrize("case", BARE, ids=named)
def test_gradient_of_a_bare_block_says_what_a_first_light_bob_would_do(case):
    h = 1e-4
    values = [exact((case.x[0], mu, *case.x[2:]), case.y0).amplitude for mu in (0, h, 2 * h, 3 * h)]
    one_sided = np.dot([-11, 18, -9, 2], values) / (6 * h)
    assert exact(case.x, case.y0).slopes[0, 1] == pytest.approx(one_sided, rel=1e-6)


@pytest.mark.parametrize("x", [HUNG[3].x, STILL.x, (*HUNG[3].x, 0.8)], ids=["rocking", "rest", "impacts"])
def test_stroke_has_the_gradient_of_differences(x):
    slopes = exact(x).slopes[1]
    for i in range(len(x)):
        step = differences(lambda x: exact(x).stroke, x, i)
        assert slopes[i] == pytest.approx(step, rel=1e-7, abs=1e-11), i


def test_gradient_in_the_impact_ratio_is_that_of_differences():
    x = (*HUNG[3].x, 0.8)
    gradient = exact(x).slopes[0]
    for i in range(8):
        assert gradient[i] == pytest.approx(differences(lambda x: exact(x).amplitude, x, i), rel=1e-8), i


@pytest.mark.parametrize("case", [*HUNG, BARE[0]], ids=named)
def test_amplitude_and_stroke_are_the_largest_angles_of_a_settled_period(case):
    answer = exact(case.x, case.y0)
    angles = np.abs(states(case.x, answer.steady.state, clock(case.x, 1))[:, :2]).max(axis=0)
    sizes = np.array([answer.amplitude, answer.stroke])
    assert np.all(sizes >= angles * (1 - 1e-12))
    # A peak hides at most half a sample away from the nearest sample.
    np.testing.assert_allclose(sizes, angles, rtol=5e-4)


# Trajectories


@pytest.mark.parametrize(
    ("x", "y0", "periods", "met"),
    [
        (STILL.x, REST, 8, {"slip", "stick", "rest"}),
        (STILL.x, (0.1, 0.0, 0.0, 0.1), 8, {"slip"}),
        (HUNG[0].x, REST, 20, {"slip", "rest"}),
        ((*HUNG[3].x, 0.8), REST, 12, {"slip", "rest"}),
        ((0.15, 0.38, 0.23, 0.2, 0.02, 0.19, 3.0), (-0.07, 0.0, 0.0, 0.0), 8, {"slip", "stick"}),
        ((0.1, 0.34, 1.25, 0.2, 0.1, 0.17, 4.2, 0.5), (-0.012, 0.0, 0.0, 0.0), 8, {"slip", "stick", "rest"}),
        ((0.2, 0.3, 0.6, 1.4, 0.04, 0.3, 3.0), (0.12, 0.0, 0.0, 0.0), 8, {"slip"}),
    ],
    ids=["rattle to rest", "rocking start", "transient", "impacts", "rattles", "plastic", "overdamped"],
)
def test_transient_is_that_of_adaptive_integration(x, y0, periods, met):
    reference = EventDriven(x)
    expected = reference.run(y0, clock(x, periods))
    assert set(reference.kinds) >= met
    np.testing.assert_allclose(states(x, y0, clock(x, periods)), expected, rtol=0, atol=1e-9)


def test_a_free_swing_is_the_hyperbolic_cosine():
    # (10), until the crossing at a quarter of the period of (11).
    nu, height = 0.2, 0.15
    x, quarter = (nu, 0.0, 0.4, 0.2, 0.0, 0.0, 2.0), np.arccosh(nu / (nu - height))
    times = np.linspace(0.0, quarter, SAMPLES)
    phi = states(x, (height, 0.0, 0.0, 0.0), times)[:, 0]
    np.testing.assert_allclose(phi, nu + (height - nu) * np.cosh(times), rtol=0, atol=1e-14)
    assert phi[-1] == pytest.approx(0.0, abs=1e-14)


def test_a_free_swing_returns_after_the_period_of_its_height():
    nu, height = 0.2, 0.15
    x, period = (nu, 0.0, 0.4, 0.2, 0.0, 0.0, 2.0), 4 * np.arccosh(nu / (nu - height))
    times = np.linspace(0.0, 9.7 * period, SAMPLES)
    late = (times + period / 4) % (period / 2) - period / 4
    side = np.where((times + period / 4) % period < period / 2, 1.0, -1.0)
    phi = states(x, (height, 0.0, 0.0, 0.0), times)[:, 0]
    np.testing.assert_allclose(phi, side * (nu + (height - nu) * np.cosh(late)), rtol=0, atol=1e-12)


def test_a_forced_swing_with_friction_is_its_closed_form():
    nu, k, f, xi, height = 0.2, 0.03, 0.1, 2.0, 0.12
    times = np.linspace(0.0, 0.5, SAMPLES)
    forced = f / (1 + xi**2)
    rest, swing = nu - k, np.cosh(times)
    expected = rest + (height - rest) * swing - forced * xi * np.sinh(times) + forced * np.sin(xi * times)
    ys = states((nu, 0.0, 0.4, 0.2, k, f, xi), (height, 0.0, 0.0, 0.0), times)
    assert expected[-1] > 0
    assert np.all(ys[1:, 2] < 0)
    np.testing.assert_allclose(ys[:, 0], expected, rtol=0, atol=1e-14)


@pytest.mark.parametrize("mu", [0.05, 0.3])
def test_energy_is_kept_through_many_crossings(mu):
    x = (0.2, mu, 0.4, 0.0, 0.0, 0.0, 2.0)
    p = parameters(x)
    ys = states(x, (0.08, 0.1, 0.0, 0.0), np.linspace(0.0, 400.0, SAMPLES))
    assert np.sum(np.diff(np.sign(ys[:, 0])) != 0) > 50
    energy = jax.vmap(lambda y: Linear(p).energy(y, mu, 0.4))(jnp.asarray(ys))
    np.testing.assert_allclose(energy, energy[0], rtol=1e-11)


@pytest.mark.parametrize("x", [STILL.x, (*HUNG[3].x, 0.8)], ids=["rattling", "impacts"])
def test_motion_is_its_own_mirror_image_half_a_forcing_period_later(x):
    y0 = np.array([0.05, -0.1, 0.1, 0.2])
    mirrored = states(x, -y0, clock(x, 6, begin=np.pi / x[6]))
    np.testing.assert_allclose(mirrored, -states(x, y0, clock(x, 6)), rtol=0, atol=1e-11)


def test_motion_does_not_depend_on_where_it_is_sampled():
    x, y0 = HUNG[0].x, (0.02, 0.0, 0.0, 0.0)
    dense = states(x, y0, clock(x, 10))
    sparse = np.concatenate([clock(x, 10)[::10], clock(x, 400)[21:201]])
    np.testing.assert_allclose(states(x, y0, sparse)[:21], dense[::10], rtol=0, atol=1e-12)


def test_a_motion_reaches_every_horizon_in_a_few_events():
    # After an event at t, t + (horizon - t) may round below the horizon: this once waited for ever.
    p = parameters((0.25, 0.0, 0.2, 0.1, 0.05, 0.377, 2.67))
    y0, few = np.array([0.2999, 0.0, 0.0, 0.0]), Piecewise(max_events=20)
    for horizon in np.random.default_rng(8).uniform(0.15, 0.35, 500):
        assert simulate(p, y0, np.array([0.0, horizon]), model=few).status == Status.rocking


def test_watching_the_bob_changes_nothing_about_the_motion():
    # From rest the bob's rate, and the rate of that, vanish: its direction is not their sign.
    for frequency in (2.35, 2.6500000000000004, 3.7):
        motion = Harmonic(amplitude=0.015, frequency=frequency)
        p = as_arrays(dataclasses.replace(paper_scene(), motion=motion).parameters())
        # Following until the motion repeats watches the bob, sampling does not.
        watched = settle_all(p, np.zeros((1, 4)), model=Piecewise(max_periods=1, max_events=100)).y[0]
        unwatched = simulate(p, np.zeros(4), np.array([0.0, float(p.period)])).ys[-1]
        np.testing.assert_allclose(watched, unwatched, rtol=0, atol=1e-13)


def test_an_impact_slows_the_block_and_kicks_the_bob_across_its_rod():
    lam, e, fall = 0.8, 0.7, 0.05
    x = (0.2, 0.1, lam, 0.1, 0.05, 0.3, 3.0, e)
    before = np.array([1e-9, 0.1, -fall, 0.2])
    after = states(x, before, np.linspace(0.0, 4e-8, SAMPLES))[-1]
    assert after[2] == pytest.approx(-e * fall, rel=1e-6)
    # The rod pulls along itself only, so the bob keeps its speed across it, lam psi' - 2 phi'.
    assert lam * after[3] - 2 * after[2] == pytest.approx(lam * before[3] - 2 * before[2], rel=1e-6)


# The bare block


@pytest.mark.parametrize("case", BARE, ids=named)
def test_a_massless_bob_cannot_be_felt_whatever_its_rod_and_hinge(case):
    for lam, zeta in ((0.4, 0.0), (1.5, 0.6), (0.1, 1.0), (0.7, 2.5)):
        x = (*case.x[:2], lam, zeta, *case.x[4:])
        answer = exact(x, case.y0)
        assert answer.status == "rocking"
        assert answer.amplitude == pytest.approx(exact(case.x, case.y0).amplitude, rel=1e-13)
        np.testing.assert_allclose(answer.slopes[0, 2:4], 0.0, atol=1e-9)


def test_a_light_bob_is_nearly_no_bob():
    bare = exact(BARE[0].x, BARE[0].y0)
    for mu in (1e-6, 1e-9, 1e-12):
        x = (BARE[0].x[0], mu, *BARE[0].x[2:])
        answer = exact(x, BARE[0].y0)
        assert answer.amplitude - bare.amplitude == pytest.approx(bare.slopes[0, 1] * mu, rel=1e-4, abs=1e-15)


# Settling


@pytest.mark.parametrize(
    ("x", "y0", "periods"),
    [(HUNG[0].x, REST, 1), (BARE[1].x, BARE[1].y0, 1), (PERIOD_THREE, REST, 3)],
    ids=["hung", "bare", "period three"],
)
def test_settled_state_returns_after_its_periods_and_not_before(x, y0, periods):
    answer = exact(x, y0)
    assert answer.steady.periods == periods
    felt = [0, 2] if x[1] == 0 else [0, 1, 2, 3]
    ys = states(x, answer.steady.state, clock(x, 4 * periods))[:, felt]
    np.testing.assert_allclose(ys[::50], np.tile(ys[0], (5, 1)), rtol=0, atol=1e-11)
    if periods > 1:
        assert np.abs(after_one_period(x, answer.steady.state)[felt] - ys[0]).max() > 1e-3


@pytest.mark.parametrize("case", MOVING, ids=named)
def test_multiplier_is_that_of_the_map_over_one_period(case):
    answer = exact(case.x, case.y0)
    felt = [0, 2] if case.x[1] == 0 else [0, 1, 2, 3]
    state = np.asarray(answer.steady.state)
    columns = [differences(lambda y: after_one_period(case.x, y), state, i, share=1e-3)[felt] for i in felt]
    largest = np.abs(np.linalg.eigvals(np.array(columns).T)).max()
    assert answer.steady.multiplier == pytest.approx(largest, rel=1e-8)


@pytest.mark.parametrize("x", [HUNG[3].x, PERIOD_THREE], ids=["period one", "period three"])
def test_the_lyapunov_exponent_of_an_orbit_is_the_rate_of_its_multiplier(x):
    steady = exact(x).steady
    duration = int(steady.periods) * 2.0 * np.pi / x[6]
    assert float(steady.lyapunov) == pytest.approx(np.log(float(steady.multiplier)) / duration, rel=1e-12)
    # A start a little off comes closer at that rate.
    y0, y1 = np.asarray(steady.state), np.asarray(steady.state) + 1e-6 * np.array([1.0, 0.0, 0.0, 0.0])
    cycles = 12
    apart = [
        np.diff([states(x, y, np.linspace(0, n * duration, SAMPLES))[-1] for y in (y0, y1)], axis=0)
        for n in (4, 4 + cycles)
    ]
    rate = np.log(np.linalg.norm(apart[1]) / np.linalg.norm(apart[0])) / (cycles * duration)
    assert rate == pytest.approx(float(steady.lyapunov), abs=0.05)


def separation(x, periods):
    """The rate at which two runs of values part, brought back to 1e-8 of each other every period."""
    y = states(x, REST, clock(x, 500))[-1]
    other, parted = y + 1e-8 * np.array([1.0, 0.0, 0.0, 0.0]), 0.0
    for _ in range(periods):
        y, ahead = after_one_period(x, y), after_one_period(x, other)
        size = np.linalg.norm(ahead - y)
        parted += np.log(size / 1e-8)
        other = y + 1e-8 / size * (ahead - y)
    return parted / (periods * 2.0 * np.pi / x[6])


def test_a_chaotic_motion_is_aperiodic_with_the_rate_at_which_neighbours_part():
    answer = exact(CHAOTIC)
    assert answer.status == "aperiodic"
    # Both are averages over a hundred periods of one chaotic motion.
    assert float(answer.steady.lyapunov) == pytest.approx(separation(CHAOTIC, 100), rel=0.3)
    assert np.all(np.isnan(answer.slopes))
    assert np.isnan(answer.steady.multiplier)
    # The amplitude is the largest of the hundred periods, not of the last one.
    after = states(CHAOTIC, answer.steady.state, clock(CHAOTIC, 1))
    assert np.max(np.abs(after[:, 0])) < answer.amplitude


@pytest.mark.mends("a block at rest under a bob that settles was called sticking, with an amplitude of zero")
@pytest.mark.parametrize("mu", [0.197, 0.1972, 0.2])
def test_the_papers_block_rests_under_a_pendulum_that_keeps_it_down(mu):
    bare = paper_scene().parameters()
    x = (bare.nu, mu, 1.2, 0.1, bare.k, bare.f, bare.xi)
    assert uplift(parameters(x)).margin > 0.0
    answer = exact(x)
    assert answer.status == "rest"
    assert answer.amplitude == 0.0
    np.testing.assert_array_equal(answer.slopes[0], 0.0)
    # From its start to long after the bob has settled.
    late = states(x, REST, np.linspace(0.0, 60.0, SAMPLES) * 2.0 * np.pi / x[6])
    np.testing.assert_array_equal(late[late.shape[0] // 2 :, 0], 0.0)


@pytest.mark.mends("a block at rest under a bob that settles was called sticking, with an amplitude of zero")
def test_no_motion_with_an_amplitude_of_zero_is_called_moving():
    """Next to the limit of uplift the short way to an orbit must agree with following to the end."""
    rng, n = np.random.default_rng(3), 12_000
    low, high = [0.1, 0.02, 0.1, -2.5, 0.0, 0.05, 0.8, 0.5], [0.35, 0.6, 2.0, -0.3, 0.1, 0.6, 6.0, 1.0]
    x = rng.uniform(low, high, (n, 8)).T
    x[3], x[4] = 10.0 ** x[3], rng.choice([0.0, 0.02, 0.05, 0.1], n)
    x = x[:, np.abs(np.asarray(uplift(parameters(jnp.asarray(x))).margin)) < 0.02]
    p, start = parameters(jnp.asarray(x)), np.zeros((x.shape[1], 4))
    short, long = settle_all(p, start), settle_all(p, start, model=Piecewise(tolerance=1e-11))
    names, others = names_of(short.status), names_of(long.status)
    moving = np.isin(names, ("rocking", "sticking"))
    assert np.all(np.asarray(short.amplitude)[moving] > 0.0)
    rest = (names == "rest") | (others == "rest")
    assert np.sum(rest) > 40
    known = rest & (others != "not_settled")
    np.testing.assert_array_equal(names[known], others[known])


@pytest.mark.mends("a block that never moves was called sticking where its bob repeats itself")
@pytest.mark.parametrize(("leans", "known"), [(0.0, "rest"), (0.02, "held")])
def test_a_block_that_never_moves_is_not_sticking(leans, known):
    # The bob's own swing has twice the period of the forcing, psi = forced sin(xi tau) + own cos(xi tau/2),
    # and the two never pull their most at once: a bound by the sum of both proves nothing.
    nu, mu, lam, f = 0.2, 0.1, 0.4, 0.14
    inertia = lam * 0.75 / (1.0 + nu**2)
    xi, forced = 2.0 / np.sqrt(inertia), f / (1.0 - 4.0)
    size = f + 2.0 * mu * forced
    own, theta = size / (2.0 * mu), np.linspace(0.0, 2.0 * np.pi, 10_001)
    assert np.max(np.abs(size * np.sin(2.0 * theta) + size * np.cos(theta))) < 1.77 * size
    lever, weight = (1.0 + 2.0 * mu) * leans - (1.0 + mu) * nu, (1.0 + mu) * nu
    k = 1.8 * size + (abs(lever) if leans else -weight)
    y0 = (leans, own, 0.0, forced * xi)
    settled = settle_all(parameters((nu, mu, lam, 0.0, k, f, xi)), np.array([y0]))
    assert names_of(settled.status)[0] == known
    assert settled.amplitude[0] == leans


def test_a_slow_decay_is_taken_to_its_orbit():
    answer = exact(SLOW)
    assert answer.status == "rocking"
    assert 0.98 < float(answer.steady.multiplier) < 1.0
    assert int(answer.steady.elapsed) < 500
    # The orbit repeats itself when it is followed from its own state.
    again = exact(SLOW, answer.steady.state)
    np.testing.assert_allclose(again.steady.amplitude, answer.steady.amplitude, rtol=1e-9)


@pytest.mark.parametrize("x", [HUNG[0].x, PERIOD_THREE], ids=["period one", "period three"])
def test_the_settled_state_has_the_gradient_of_differences(x):
    answer = exact(x)
    found = answer.slopes[2:]

    def state(y):
        """On the same of the periods of an orbit or of its mirror image, whichever was met first."""
        steady = exact(y, answer.steady.state).steady
        halves = np.arange(SAMPLES)
        visited = states(y, steady.state, halves * np.pi / y[6]) * (-1.0) ** halves[:, None]
        visited = visited[: 2 * int(steady.periods)]
        return min(visited, key=lambda v: np.linalg.norm(v - answer.steady.state))

    for i in range(7):
        expected = differences(state, x, i, share=1e-3)
        np.testing.assert_allclose(found[:, i], expected, rtol=0, atol=1e-5 * np.abs(found).max())


def test_derivatives_that_are_not_known_are_refused():
    @jax.jit
    @jax.jacfwd
    def slopes(x):
        steady = steady_state(parameters(x))
        return jnp.stack([steady.multiplier, steady.lyapunov])

    assert np.all(np.isnan(slopes(np.array(HUNG[3].x))))


@pytest.mark.mends("the derivative of the estimate was zero")
def test_an_estimate_that_nobody_made_has_no_derivative():
    def estimate(mu):
        return jnp.asarray(steady_state(parameters((0.25, mu, *HUNG[0].x[2:]))).estimate)

    assert np.isnan(jax.grad(estimate)(0.05))


@pytest.mark.mends("second derivatives raised an error of the compiled code's interface")
def test_second_derivatives_of_a_trajectory_are_refused():
    def end(x):
        return simulate(parameters((*x, *HUNG[0].x[2:])), np.zeros(4), clock(HUNG[0].x, 2)).ys[-1, 0]

    assert np.all(np.isnan(jax.hessian(end)(jnp.array(HUNG[0].x[:2]))))


def test_a_trajectory_after_an_overturning_has_no_derivative():
    x, y0 = OVERTURNING
    times = clock(x, 20)

    @jax.jit
    @jax.jacrev
    def ends(x):
        return simulate(parameters(x), np.array(y0), times).ys[jnp.array([3, -1])]

    slopes = ends(np.array(x))
    assert np.all(np.isfinite(slopes[0]))
    assert np.all(np.isnan(slopes[1]))


def repelling_orbit():
    """The state on the symmetric orbit at UNSTABLE, followed from where the orbit attracts."""
    x, _, _ = UNSTABLE
    state = np.asarray(exact(BARE[0].x, BARE[0].y0).steady.state)[[0, 2]]
    for xi in np.linspace(1.5, x[6], 11):
        at = (*x[:6], xi)

        def residual(s, at=at):
            return after_one_period(at, (s[0], 0.0, s[1], 0.0))[[0, 2]] - s

        state = fsolve(residual, state, xtol=1e-13)
    return state[0], 0.0, state[1], 0.0


def test_a_motion_on_a_repelling_orbit_is_called_unstable_and_has_no_gradient():
    x, amplitude, half = UNSTABLE
    answer = exact(x, repelling_orbit())
    assert answer.status == "unstable"
    assert answer.amplitude == pytest.approx(amplitude, abs=5e-7)
    assert answer.steady.multiplier == pytest.approx(half**2, abs=2e-3)
    assert np.all(np.isnan(answer.slopes))


def test_an_overturning_block_has_no_finite_size_and_no_gradient():
    answer = exact(*OVERTURNING)
    assert answer.status == "overturned"
    assert answer.amplitude == answer.stroke == np.inf
    assert np.all(np.isnan(answer.slopes))


def test_a_block_started_beyond_its_balance_overturns():
    x = (0.25, 0.0, 0.4, 0.3, 0.0, 0.01, 2.67)
    assert exact(x, (0.27, 0.0, 0.0, 0.0)).status == "overturned"
    assert exact(x, (0.15, 0.0, 0.0, 0.0)).status != "overturned"


def test_an_undamped_bob_that_rings_on_is_not_settled_and_has_no_gradient():
    answer = exact(*RINGING)
    assert answer.status == "not_settled"
    assert answer.steady.elapsed == Piecewise().max_periods
    assert np.isfinite(answer.amplitude)
    assert np.all(np.isnan(answer.slopes))


def test_a_resting_block_has_zero_amplitude_and_zero_gradient_in_all_parameters():
    answer = exact(STILL.x)
    assert answer.status == "rest"
    assert answer.amplitude == 0.0
    np.testing.assert_array_equal(answer.slopes[0], 0.0)
    assert np.all(answer.slopes[1, [2, 3, 5, 6]] != 0.0)


def test_a_bob_that_hangs_still_has_the_multiplier_of_its_decay():
    # Nothing shakes: the bob's rate, which is watched for its turns, is zero throughout.
    nu, mu, lam, zeta, xi = 0.1, 0.4, 1.1, 0.1, 5.8
    answer = exact((nu, mu, lam, zeta, 0.3, 0.0, xi), (0.0, -0.02, 0.0, 0.03))
    assert answer.status == "rest"
    rate = zeta / np.sqrt(lam * 0.75 / (1.0 + nu**2))
    assert float(answer.steady.multiplier) == pytest.approx(np.exp(-rate * 2.0 * np.pi / xi), rel=1e-9)
    np.testing.assert_array_equal(answer.slopes[0], 0.0)


def test_a_block_that_never_lifts_is_answered_without_a_simulation():
    x = (*STILL.x[:5], 0.05, STILL.x[6])
    answer = exact(x)
    assert answer.status == "rest"
    assert int(answer.steady.elapsed) == 0
    # lam rho psi'' + hinge psi' + psi = f sin(xi tau).
    nu, _, lam, zeta, _, f, xi = x
    inertia = lam * 0.75 / (1.0 + nu**2)
    response = f / (1.0 - inertia * xi**2 + 2j * zeta * np.sqrt(inertia) * xi)
    assert answer.stroke == pytest.approx(abs(response), rel=1e-12)
    np.testing.assert_allclose(answer.steady.state, [0.0, response.imag, 0.0, xi * response.real], atol=1e-15)
    assert int(exact(STILL.x).steady.elapsed) > 0


def test_a_block_at_rest_under_an_undamped_bob_has_zero_gradient_too():
    answer = exact(RESTING_UNDAMPED)
    # That of the stroke does not exist, and does not spoil it in reverse mode.
    assert answer.status == "rest"
    np.testing.assert_array_equal(answer.slopes[0], 0.0)
    assert np.all(np.isnan(answer.slopes[1]))


def test_an_undamped_bob_under_a_resting_block_has_the_reach_of_its_two_swings():
    # lam rho psi'' + psi = f sin(xi tau) from rest: two swings whose peaks meet sooner or later.
    nu, _, lam, _, _, f, xi = RESTING_UNDAMPED
    ratio = xi * np.sqrt(lam * 0.75 / (1 + nu**2))
    assert exact(RESTING_UNDAMPED).stroke == pytest.approx(f / abs(1 - ratio**2) * (1 + ratio), rel=0.1)


def test_a_batch_gives_each_design_what_it_gets_alone():
    designs = [HUNG[0].x, STILL.x, OVERTURNING[0], HUNG[3].x, BARE[0].x]
    starts = [*[REST] * 4, BARE[0].y0]
    batch = jax.jit(jax.vmap(lambda x, y0: steady_state(parameters(x), y0=y0)))
    together = batch(np.array(designs), np.array(starts))
    for i, alone in enumerate(exact(x, y0) for x, y0 in zip(designs, starts, strict=True)):
        assert status_name(jax.tree.map(lambda a, i=i: a[i], together.status)) == alone.status
        assert together.amplitude[i] == pytest.approx(alone.amplitude, rel=1e-13)
        assert together.stroke[i] == pytest.approx(alone.stroke, rel=1e-12)
        assert together.elapsed[i] == alone.steady.elapsed


def test_too_few_events_are_reported_and_leave_no_numbers():
    motion = simulate(parameters(HUNG[0].x), np.zeros(4), clock(HUNG[0].x, 30), model=Piecewise(max_events=1))
    assert motion.status == Status.event_bound
    assert np.all(np.isnan(motion.ys[-1]))


def test_an_overturned_trajectory_says_so_and_ends_in_nan():
    x, y0 = OVERTURNING
    motion = simulate(parameters(x), np.array(y0), clock(x, 20))
    assert motion.status == Status.overturned
    assert np.all(np.isfinite(motion.ys[:20]))
    assert np.all(np.isnan(motion.ys[-1]))
