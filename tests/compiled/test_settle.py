"""How a motion settles: what it is called, after how long, and that the short way to an orbit is right."""

import jax
import jax.numpy as jnp
import numpy as np
import pytest
from scipy.integrate import solve_ivp

from tests.compiled.test_trajectory import SAMPLES, clock, states
from tests.reference import REST, SLOW, box, exact, parameters, settled
from tpd import Parameters, Status, paper_scene, steady_state
from tpd.compiled.rows import row_of
from tpd.compiled.simulate import GroundForcing, follow
from tpd.compiled.trajectories import trajectory
from tpd.scene.status import names_of
from tpd.theory import uplift
from tpd.theory.equations import Terms


def test_the_block_of_the_paper_rests_with_a_pendulum_that_prevents_uplift():
    without = paper_scene().parameters()
    x = (without.nu, 0.197, 1.2, 0.1, without.k, without.f, without.xi)
    assert uplift(parameters(x)).margin > 0.0
    answer = exact(x)
    assert (answer.status, answer.amplitude) == ("rest", 0.0)
    np.testing.assert_array_equal(answer.slopes[0], 0.0)
    # From its start to long after the bob has settled.
    late = states(x, REST, clock(x, 60.0))
    np.testing.assert_array_equal(late[SAMPLES // 2 :, 0], 0.0)


@pytest.mark.parametrize(("leans", "known"), [(0.0, "rest"), (0.02, "held")])
def test_a_block_that_never_moves_has_the_status_rest_or_held(leans, known):
    # The bob's own swing has twice the period of the forcing, psi = forced sin(xi tau) + own cos(xi tau/2),
    # and the two never pull their most at once: a bound by the sum of both proves nothing.
    nu, mu, lam, f = 0.2, 0.1, 0.4, 0.14
    inertia = lam * 0.75 / (1.0 + nu**2)
    xi, forced = 2.0 / np.sqrt(inertia), f / (1.0 - 4.0)
    size = f + 2.0 * mu * forced
    own = size / (2.0 * mu)
    lever, weight = (1.0 + 2.0 * mu) * leans - (1.0 + mu) * nu, (1.0 + mu) * nu
    k = 1.8 * size + (abs(lever) if leans else -weight)
    y0 = (leans, own, 0.0, forced * xi)
    found = settled(Terms.linear, parameters((nu, mu, lam, 0.0, k, f, xi)), np.array([y0]))
    assert names_of(found.status)[0] == known
    assert found.settled_tilt[0] == leans


def test_the_shortcut_to_an_orbit_gives_the_status_of_a_full_simulation():
    """A motion that is taken to its orbit early ends where one that is followed to the end does."""
    x, y = box(200, 11)
    p = parameters(x.T)
    short = settled(Terms.linear, p, y, periods=400)
    long = settled(Terms.linear, p, y, periods=1500, tolerance=1e-11)
    names, others = names_of(short.status), names_of(long.status)
    moved = np.isin(others, ("rocking", "sticking"))
    both = np.isin(names, ("rocking", "sticking")) & moved & (x[:, 1] > 0.0)
    assert np.sum(both) > 20
    np.testing.assert_array_equal(short.periods[both], long.periods[both])
    for size in ("settled_tilt", "settled_swing", "tilt", "swing"):
        ours, theirs = (np.asarray(getattr(s, size))[both] for s in (short, long))
        np.testing.assert_allclose(ours, theirs, rtol=5e-4, atol=1e-6)
    assert not np.any(moved & np.isin(names, ("rest", "overturned")))


def test_a_slowly_decaying_motion_is_moved_onto_its_orbit():
    answer = exact(SLOW)
    assert answer.status == "rocking"
    assert 0.98 < float(answer.steady.multiplier) < 1.0
    assert int(answer.steady.elapsed) < 500
    # The orbit repeats itself when it is followed from its own state.
    again = exact(SLOW, answer.steady.state)
    np.testing.assert_allclose(again.steady.amplitude, answer.steady.amplitude, rtol=1e-9)


def hops(x, tilt, quiet):
    """Impacts of a block let go at a tilt until it is captured at rest, below a speed in units of nu."""
    still = GroundForcing((np.zeros((1, 4)),), 4.0 * np.pi)
    start = np.array([tilt, 0.0, 0.0, 0.0])
    run = follow(Terms.linear, row_of(parameters(x)), still, y0=start, rest_rate=quiet)
    assert np.all(np.asarray(run.state)[[0, 2]] == 0.0)
    return int(run.impacts)


def test_a_very_overdamped_bob_settles_to_the_motion_of_a_smaller_tolerance():
    numbers = {"nu": 0.18659915, "mu": 0.01880935, "lam": 1.17302665, "zeta": 69.50670934, "k": 0.02775378}
    p = Parameters(**numbers, f=0.22147615, xi=2.48749265, rho=0.72475783, e=0.90762474, kappa=2.0)
    start = np.array([-0.00067411, 0.0, 0.0, 0.0])
    quick, slow = (settled(Terms.linear, p, start, tolerance=x, periods=1000) for x in (1e-6, 1e-10))
    # The change in a period falls below the tolerance long before the bob has settled.
    assert float(quick.settled_swing) == pytest.approx(float(slow.settled_swing), rel=0.01)


def test_the_number_of_impacts_of_a_rattle_is_logarithmic_in_the_capture_speed():
    nu, e, tilt = 0.2, 0.8, 0.01
    # Without friction every hop lands as fast as it began: speeds fall by e.
    fastest = np.sqrt(2.0 * nu * tilt - tilt**2)
    for quiet in (1e-2, 1e-4, 1e-6, 2e-7):
        expected = 1 + np.ceil(np.log(quiet * nu / fastest) / np.log(e))
        assert hops((nu, 0.0, 0.4, 0.2, 0.0, 0.0, 1.0, e), tilt, quiet) == expected


@jax.jit
def after(x, y0, span, quiet):
    """The state after a time, and whether the bound on events was met; `quiet` is the capture speed."""
    times = jnp.stack([jnp.zeros_like(span), span])
    ys, status = trajectory(Terms.linear, parameters(x), y0, times, events=4000, rest_rate=quiet / x[0])
    return ys[-1], status == Status.event_bound


def test_the_error_of_capture_is_below_the_square_of_its_speed():
    x, y0 = np.array((0.2, 0.2, 0.5, 0.1, 0.02, 0.05, 2.0, 0.8)), np.array([0.02, 0.05, 0.0, 0.0])
    speeds, span, ends = 0.2 * 10.0 ** -np.linspace(1.0, 4.0, 25), np.array(10.0), []
    for quiet in (*speeds, 2e-8):
        ends.append(np.asarray(after(x, y0, span, np.array(quiet))[0]))
        assert ends[-1][0] == ends[-1][2] == 0.0
    apart = np.linalg.norm(np.array(ends[:-1]) - ends[-1], axis=1)
    assert np.all(apart < speeds**2)
    # Here even its third power: the bob follows the rod, which is back where it was after every hop.
    assert np.all(apart < 50.0 * speeds**3)
    few = [0, 9, 17]
    assert np.polyfit(np.log(speeds[few]), np.log(apart[few]), 1)[0] == pytest.approx(3.0, abs=0.2)
    # A threshold near rounding is met, or the bound on the steps ends the motion.
    y, exhausted = after(x, y0, span, np.array(1e-11))
    assert bool(exhausted) or y[0] == y[2] == 0.0


def bob_alone(p, psi, rate, periods, nonlinear):
    """The largest |psi| of the bob under a block that does not move, and of the last period; by SciPy."""
    period, inertia, damping = p.period, p.lam * p.rho, p.hinge

    def rates(t, y):
        push, pull = p.f * np.sin(p.xi * t), y[0]
        if nonlinear:
            push, pull = push * np.cos(y[0]), np.sin(y[0])
        return [y[1], (push - pull - damping * y[1]) / inertia]

    turning = lambda t, y: y[1]  # noqa: E731
    step = 0.2 * min(1.0 / p.xi, np.sqrt(inertia))
    spans = {"t_span": (0.0, periods * period), "events": turning, "max_step": step}
    sol = solve_ivp(rates, y0=[psi, rate], method="DOP853", rtol=1e-10, atol=1e-13, **spans)
    angles, times = np.abs(sol.y_events[0][:, 0]), sol.t_events[0]
    return max(abs(psi), angles.max()), angles[times > (periods - 1.01) * period].max(initial=0.0)


@pytest.mark.parametrize("equations", [Terms.linear, Terms.nonlinear])
@pytest.mark.parametrize(
    ("p", "y0", "periods"),
    [
        # At rest from the start; the block sticks at a tilt under a bob that decays; hardly any damping.
        (Parameters(nu=0.3, mu=0.05, lam=0.5, zeta=0.02, k=0.05, f=0.2, xi=4.0, rho=0.7), REST, 300),
        (
            Parameters(nu=0.25, mu=0.05, lam=0.8, zeta=0.05, k=0.6, f=0.05, xi=40.0, rho=0.7, e=0.9),
            (0.05, 0.0, 0.0, 0.3),
            450,
        ),
        (Parameters(nu=0.3, mu=0.05, lam=0.5, zeta=0.005, k=0.0, f=0.02, xi=1.6, rho=0.7), REST, 400),
    ],
)
def test_the_swing_above_a_resting_or_held_block_equals_a_bob_alone(equations, p, y0, periods):
    found = settled(equations, p, np.array([y0]), periods=periods)
    peak, last = bob_alone(p, y0[1], y0[3], periods, equations is Terms.nonlinear)
    assert names_of(found.status)[0] == ("held" if y0[0] else "rest")
    assert found.settled_tilt[0] == found.tilt[0] == y0[0]
    assert found.swing[0] == pytest.approx(peak, rel=1e-5)
    # The settled bob in closed form, and under the block that sticks also its small angles of (4).
    known = float(uplift(p).swing)
    if equations is Terms.linear or y0[0]:
        assert found.settled_swing[0] == pytest.approx(
            known, rel=1e-12 if equations is Terms.linear else 1e-6
        )
    if not y0[0]:
        assert found.settled_swing[0] == pytest.approx(last, rel=2e-5)


def test_the_swing_of_a_periodic_undamped_bob_is_the_largest_of_its_period():
    # Three swings of the bob take two periods of the forcing, and never add up to the sum of the amplitudes.
    p = Parameters(
        nu=0.3, mu=0.05, lam=0.5, zeta=0.0, k=0.0, f=0.02, xi=2.0 / 3.0 / np.sqrt(0.5 * 0.7), rho=0.7
    )
    found = settled(Terms.linear, p, np.zeros((1, 4)))
    peak, _ = bob_alone(p, 0.0, 0.0, 6, nonlinear=False)
    assert names_of(found.status)[0] == "rest"
    assert [found.settled_swing[0], found.swing[0]] == pytest.approx([peak, peak], rel=1e-9)
    assert float(steady_state(p).swing) == pytest.approx(peak, rel=1e-9)


@pytest.mark.parametrize("ulps", [0, 1, -1, 10_000])
def test_an_undamped_resonant_bob_has_no_finite_swing(ulps):
    for mu in (0.0, 0.05):
        lam = 0.8
        p = Parameters(nu=0.25, mu=mu, lam=lam, zeta=0.0, k=0.05, f=0.1, xi=1.0)
        xi = float(1.0 / np.sqrt(lam * p.inertia_ratio)) * (1.0 + ulps * 2.2e-16)
        p = Parameters(nu=0.25, mu=mu, lam=lam, zeta=0.0, k=0.05, f=0.1, xi=xi)
        run, steady = settled(Terms.linear, p, np.zeros((1, 4))), steady_state(p)
        for swing in (run.settled_swing[0], run.swing[0], float(steady.swing)):
            assert not swing < 1e6, (mu, swing)
