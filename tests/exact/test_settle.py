"""How a motion settles: what it is called, after how long, and that the short way to an orbit is right."""

import dataclasses

import jax
import jax.numpy as jnp
import numpy as np
import pytest

from tests.exact.test_trajectory import SAMPLES, clock, states
from tests.reference import REST, SLOW, STILL, exact, parameters
from tpd import Harmonic, Parameters, Piecewise, Status, paper_scene, simulate
from tpd.exact.terms import LANDING
from tpd.models import compiled_linear
from tpd.models.multiple_shooting import Events, events
from tpd.models.rows import settle_all
from tpd.scene.parameters import as_arrays
from tpd.scene.status import names_of
from tpd.theory import uplift


def test_watching_the_bob_changes_nothing_about_the_motion():
    # From rest the bob's rate, and the rate of that, vanish: its direction is not their sign.
    for frequency in (2.35, 2.6500000000000004, 3.7):
        motion = Harmonic(amplitude=0.015, frequency=frequency)
        p = as_arrays(dataclasses.replace(paper_scene(), motion=motion).parameters())
        # Following until the motion repeats watches the bob, sampling does not.
        watched = settle_all(p, np.zeros((1, 4)), model=Piecewise(max_periods=1, max_events=100)).y[0]
        unwatched = simulate(p, np.zeros(4), np.array([0.0, float(p.period)])).ys[-1]
        np.testing.assert_allclose(watched, unwatched, rtol=0, atol=1e-13)


@pytest.mark.mends("a block at rest under a bob that settles was called sticking, with an amplitude of zero")
@pytest.mark.parametrize("mu", [0.197, 0.1972, 0.2])
def test_the_papers_block_rests_under_a_pendulum_that_keeps_it_down(mu):
    bare = paper_scene().parameters()
    x = (bare.nu, mu, 1.2, 0.1, bare.k, bare.f, bare.xi)
    assert uplift(parameters(x)).margin > 0.0
    answer = exact(x)
    assert (answer.status, answer.amplitude) == ("rest", 0.0)
    np.testing.assert_array_equal(answer.slopes[0], 0.0)
    # From its start to long after the bob has settled.
    late = states(x, REST, clock(x, 60.0))
    np.testing.assert_array_equal(late[SAMPLES // 2 :, 0], 0.0)


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
    own = size / (2.0 * mu)
    lever, weight = (1.0 + 2.0 * mu) * leans - (1.0 + mu) * nu, (1.0 + mu) * nu
    k = 1.8 * size + (abs(lever) if leans else -weight)
    y0 = (leans, own, 0.0, forced * xi)
    settled = settle_all(parameters((nu, mu, lam, 0.0, k, f, xi)), np.array([y0]))
    assert names_of(settled.status)[0] == known
    assert settled.amplitude[0] == leans


def test_no_settled_motion_loses_its_status_to_the_short_way():
    """A motion that is taken to its orbit early ends where one that is followed to the end does."""
    rng, n = np.random.default_rng(7), 600
    u, corner = rng.random((n, 9)), rng.random((n, 9)) < 0.25
    x = np.array([0.05, 0.0, 0.05, 0.0, 0.0, 0.0, 0.3, 0.4, 0.3]) + u * [
        *(0.45, 0.5, 2.0, 1.0, 0.3, 0.8, 5.7, 0.55, 0.7)
    ]
    # No bob, no damping, no friction and no impact loss are cases of their own.
    for column, edge in ((1, 0.0), (3, 0.0), (4, 0.0), (8, 1.0)):
        x[corner[:, column], column] = edge
    y = rng.normal(size=(n, 4)) * np.stack([0.3 * x[:, 0], np.full(n, 0.2)] * 2, axis=1)
    y[::2] = 0.0
    names = ("nu", "mu", "lam", "zeta", "k", "f", "xi", "rho", "e")
    p = Parameters(**dict(zip(names, jnp.asarray(x.T), strict=True)))
    short = settle_all(p, y, model=Piecewise(max_periods=400))
    long = settle_all(p, y, model=Piecewise(max_periods=1500, tolerance=1e-11))
    names, others = names_of(short.status), names_of(long.status)
    moved = np.isin(others, ("rocking", "sticking"))
    both = np.isin(names, ("rocking", "sticking")) & moved & (x[:, 1] > 0.0)
    assert np.sum(both) > 60
    np.testing.assert_array_equal(short.periods[both], long.periods[both])
    for size in ("amplitude", "stroke", "peak", "peak_stroke"):
        ours, theirs = (np.asarray(getattr(s, size))[both] for s in (short, long))
        np.testing.assert_allclose(ours, theirs, rtol=5e-4, atol=1e-6)
    assert not np.any(moved & np.isin(names, ("rest", "overturned")))


def test_a_slow_decay_is_taken_to_its_orbit():
    answer = exact(SLOW)
    assert answer.status == "rocking"
    assert 0.98 < float(answer.steady.multiplier) < 1.0
    assert int(answer.steady.elapsed) < 500
    # The orbit repeats itself when it is followed from its own state.
    again = exact(SLOW, answer.steady.state)
    np.testing.assert_allclose(again.steady.amplitude, answer.steady.amplitude, rtol=1e-9)


def test_an_undamped_bob_that_rings_on_is_not_settled_and_has_no_gradient():
    # As the still case, but nothing damps the bob, which keeps rattling the block for ever.
    answer = exact((0.2, 0.1, 0.4, 0.0, 0.03, 0.25, 4.0))
    assert answer.status == "not_settled"
    assert answer.steady.elapsed == Piecewise().max_periods
    assert np.isfinite(answer.amplitude)
    assert np.all(np.isnan(answer.slopes))


def test_a_block_that_never_lifts_is_answered_without_a_simulation():
    x = (*STILL.x[:5], 0.05, STILL.x[6])
    answer = exact(x)
    assert answer.status == "rest"
    assert int(answer.steady.elapsed) == 0 < int(exact(STILL.x).steady.elapsed)
    # lam rho psi'' + hinge psi' + psi = f sin(xi tau).
    nu, _, lam, zeta, _, f, xi = x
    inertia = lam * 0.75 / (1.0 + nu**2)
    response = f / (1.0 - inertia * xi**2 + 2j * zeta * np.sqrt(inertia) * xi)
    assert answer.stroke == pytest.approx(abs(response), rel=1e-12)
    np.testing.assert_allclose(answer.steady.state, [0.0, response.imag, 0.0, xi * response.real], atol=1e-15)


def test_a_block_that_friction_holds_for_a_while_is_called_sticking():
    held, start = (0.217, 0.436, 0.754, 0.718, 0.122, 0.322, 2.344, 0.575), (0.034, 0.1, 0.0, 0.0)
    assert exact(held, start).status == "sticking"
    assert exact((*held[:5], 0.33, *held[6:]), start).status == "rocking"


def hops(x, tilt, quiet):
    """Impacts of a block let go at a tilt until it is captured at rest, below a speed in units of nu."""
    p = parameters(x)
    numbers = np.array([*x[:7], p.inertia_ratio, p.velocity_ratio])
    found = events(numbers, np.array([tilt, 0.0, 0.0, 0.0]), 4, 256, quiet)
    assert isinstance(found, Events)
    assert found.resting
    return int(np.sum(found.endings == LANDING))


def test_the_hops_of_a_rattle_grow_as_the_logarithm_of_the_capture_speed():
    nu, e, tilt = 0.2, 0.8, 0.01
    # Without friction every hop lands as fast as it began: speeds fall by e.
    fastest = np.sqrt(2.0 * nu * tilt - tilt**2)
    for quiet in (1e-2, 1e-4, 1e-6, 2e-7):
        expected = 1 + np.ceil(np.log(quiet * nu / fastest) / np.log(e))
        assert hops((nu, 0.0, 0.4, 0.2, 0.0, 0.0, 1.0, e), tilt, quiet) == expected


def test_friction_ends_a_rattle_without_impact_loss_as_fast_as_its_ratio_says():
    nu, k = 0.2, 0.05
    x = (nu, 0.0, 0.4, 0.2, k, 0.0, 1.0, 1.0)
    # Up against weight and friction, down against weight less friction.
    ratio = np.sqrt((nu - k) / (nu + k))
    more = hops(x, 0.01, 1e-7) - hops(x, 0.01, 1e-3)
    assert more == pytest.approx(np.log(1e-4) / np.log(ratio), abs=1.0)


@jax.jit
def after(x, y0, span, quiet):
    """The state after a time, and whether the bound on events was met; `quiet` is the capture speed."""
    times = jnp.stack([jnp.zeros_like(span), span])
    ys, status = compiled_linear.trajectory(parameters(x), y0, times, 4000, quiet / x[0])
    return ys[-1], status == Status.event_bound


def test_what_capture_leaves_out_is_below_the_square_of_its_speed():
    x, y0 = np.array((0.2, 0.2, 0.5, 0.1, 0.02, 0.05, 2.0, 0.8)), np.array([0.02, 0.05, 0.0, 0.0])
    speeds, span, ends = 0.2 * 10.0 ** -np.linspace(1.0, 4.0, 25), np.array(10.0), []
    for quiet in (*speeds, 2e-8):
        ends.append(np.asarray(after(x, y0, span, np.array(quiet))[0]))
        assert ends[-1][0] == ends[-1][2] == 0.0
    apart = np.linalg.norm(np.array(ends[:-1]) - ends[-1], axis=1)
    assert np.all(apart < speeds**2)
    # Here even its third power: the bob follows the rod, which is back where it was after every hop.
    assert np.all(apart < 50.0 * speeds**3)
    # A threshold near rounding is met, or the bound on the steps ends the motion.
    y, exhausted = after(x, y0, span, np.array(1e-11))
    assert bool(exhausted) or y[0] == y[2] == 0.0
