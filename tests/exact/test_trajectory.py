"""States of motions under a harmonic: to 50 digits, by the event loop, late, and with derivatives."""

import jax
import jax.numpy as jnp
import numpy as np
import pytest
from scipy.optimize import fsolve

from tests.reference import HUNG, OVERTURNING, REST, STILL, EventDriven, along, differences, exact, parameters
from tests.truth import load
from tpd import Parameters, Piecewise, Status, simulate, status_name
from tpd.theory.equations import Linear

ROWS = [r for r in load("harmonic") if r["what"] == "transient"]
REACH = 1e-11
FOLLOW = jax.jit(lambda x, y0, times: simulate(parameters(x), y0, times, model=Piecewise(max_events=4000)))
SAMPLES = 201
"""Of most trajectories here, so that one compilation serves them all."""
STICKING = (0.19, 0.09, 0.5, 0.56, 0.05, 0.27, 3.4, 0.8)
"""Attracting, held for a part of every period; the largest multiplier is 0.18."""


def full(x):
    return np.array([*x, *[1.0] * (8 - len(x))])


def states(x, y0, times):
    motion = FOLLOW(full(x), np.asarray(y0, dtype=float), times)
    assert status_name(motion.status) == "rocking"
    return np.asarray(motion.ys)


def clock(x, periods, begin=0.0):
    """Times that cover so many forcing periods."""
    return begin + np.linspace(0.0, periods * 2.0 * np.pi / x[6], SAMPLES)


def scales(x):
    rate = max(1.0, x[6])
    return x[0] * np.array([1.0, 1.0, rate, rate])


def test_the_table_covers_every_mode_and_kind_of_scene():
    assert len(ROWS) >= 45
    assert {m for r in ROWS for m in r["modes"]} == {"slip", "stick", "rest"}
    assert {r["parameters"][7] for r in ROWS} >= {0.0, 0.5, 0.8, 1.0}


@pytest.mark.parametrize("row", ROWS, ids=lambda row: row["name"])
def test_a_transient_ends_where_fifty_digits_end(row):
    x = np.array(row["parameters"])
    times = np.linspace(0.0, row["periods"] * 2.0 * np.pi / x[6], SAMPLES)
    end = np.array([float(v) for v in row["end"]])
    error = np.abs(states(x, row["y0"], times)[-1] - end) / scales(x)
    assert error[[0, 2] if x[1] == 0 else slice(None)].max() < REACH


def test_motions_are_those_of_the_event_loop_over_the_whole_box():
    rng, compared = np.random.default_rng(5), 0
    for _ in range(16):
        x = np.array([0.05, 0.0, 0.05, 0.0, 0.0, 0.0, 0.3, 0.3]) + rng.random(8) * [
            *(0.45, 0.5, 2.0, 1.0, 0.3, 0.8, 5.7, 0.7)
        ]
        # No bob, no damping, no friction and no impact loss are cases of their own.
        for column, edge in ((1, 0.0), (3, 0.0), (4, 0.0), (7, 1.0)):
            x[column] = edge if rng.random() < 0.25 else x[column]
        y0 = (rng.random() < 0.5) * rng.normal(size=4) * [0.3 * x[0], 0.2, 0.3 * x[0], 0.2]
        times = np.linspace(0.0, 4.0 * np.pi / x[6], SAMPLES)
        ours = FOLLOW(x, y0, times)
        expected = EventDriven(x).run(y0, times[::25])
        if status_name(ours.status) == "overturned" or len(expected) < 9:
            continue
        # Each of many impacts passes rounding on, larger by what the motion amplifies.
        near = np.asarray(FOLLOW(x, y0 + 1e-11 * (y0 != 0.0), times).ys)
        error = 1e-8 + 100.0 * np.abs(near - ours.ys).max()
        np.testing.assert_allclose(ours.ys[::25], expected, rtol=0, atol=error)
        compared += error < 1e-6
    assert compared > 6


def test_a_free_swing_returns_after_the_period_of_its_height():
    # (10) and (11).
    nu, height = 0.2, 0.15
    x, period = (nu, 0.0, 0.4, 0.2, 0.0, 0.0, 2.0), 4 * np.arccosh(nu / (nu - height))
    times = np.linspace(0.0, 9.7 * period, SAMPLES)
    late = (times + period / 4) % (period / 2) - period / 4
    side = np.where((times + period / 4) % period < period / 2, 1.0, -1.0)
    phi = states(x, (height, 0.0, 0.0, 0.0), times)[:, 0]
    np.testing.assert_allclose(phi, side * (nu + (height - nu) * np.cosh(late)), rtol=0, atol=1e-12)


def test_energy_stays_through_ten_thousand_crossings():
    # f = k = zeta = 0, e = 1: the linear model conserves it.
    x = (0.2, 0.3, 0.4, 0.0, 0.0, 0.0, 2.0, 1.0)
    p, y0 = parameters(x), jnp.array([0.05, 0.1, 0.0, 0.0])

    @jax.jit
    def many(y0):
        def leg(y, _):
            ys = simulate(p, y, jnp.array([0.0, 5.0 * np.pi])).ys
            return ys[-1], Linear(p).energy(ys[-1], p.mu, p.lam)

        return jax.lax.scan(leg, y0, None, length=2600)[1]

    energy = np.asarray(many(y0)) / float(Linear(p).energy(y0, p.mu, p.lam)) - 1.0
    crossings = np.sum(np.diff(np.sign(states(x, y0, np.linspace(0.0, 50.0, SAMPLES))[:, 0])) != 0)
    assert crossings * 2600 * 5.0 * np.pi / 50.0 > 1e4
    assert np.abs(energy).max() < 1e-11
    assert abs(np.polyfit(np.arange(energy.size), energy, 1)[0] * energy.size) < 1e-11


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
    for horizon in np.random.default_rng(8).uniform(0.15, 0.35, 200):
        assert simulate(p, y0, np.array([0.0, horizon]), model=few).status == Status.rocking


def test_too_few_events_are_reported_and_leave_no_numbers():
    motion = simulate(parameters(HUNG[0].x), np.zeros(4), clock(HUNG[0].x, 30), model=Piecewise(max_events=1))
    assert motion.status == Status.event_bound
    assert np.all(np.isnan(motion.ys[-1]))


def test_an_overturned_trajectory_says_so_and_has_neither_states_nor_derivatives_after_it():
    ys, slopes, status = along(OVERTURNING, REST, clock(OVERTURNING, 20))
    assert status == "overturned"
    for numbers in (ys, slopes):
        assert np.all(np.isfinite(numbers[:20]))
        assert np.all(np.isnan(numbers[-1]))


def test_a_sticking_orbit_is_found_again_after_a_thousand_periods():
    for samples in (2, 1001):
        times = np.linspace(0.0, 1000.0, samples) * 2.0 * np.pi / STICKING[6]
        ys = states(STICKING, np.zeros(4), times)
        np.testing.assert_allclose(ys[-1], exact(STICKING).steady.state, rtol=0, atol=1e-9)


@pytest.mark.parametrize("share", [0.0, 0.37])
def test_a_period_that_begins_late_is_the_first_one(share):
    # Times of N periods have an error of the last digit of N, and rates of the order of one turn it into one
    # of the state.
    y0, period = exact(STICKING).steady.state, 2.0 * np.pi / STICKING[6]
    first = states(STICKING, y0, (share + np.array([0.0, 0.4, 1.0])) * period)
    for count in (1, 100, 10_000, 1_000_000):
        ys = states(STICKING, y0, (count + share + np.array([0.0, 0.4, 1.0])) * period)
        np.testing.assert_allclose(ys, first, rtol=0, atol=1e-13 + 1e-15 * count)


@pytest.mark.parametrize("count", [0, 300])
def test_states_have_the_derivatives_of_differences_also_late(count):
    rho = 0.75 / (1.0 + STICKING[0] ** 2)
    times = (count + 0.37 + np.array([0.0, 1.4, 2.3])) * 2.0 * np.pi / STICKING[6]
    point = np.array([*STICKING[:7], rho, STICKING[7], *exact(STICKING).steady.state, times[0], times[-1]])

    @jax.jit
    def end(z):
        names = ("nu", "mu", "lam", "zeta", "k", "f", "xi", "rho", "e")
        p = Parameters(**dict(zip(names, z[:9], strict=True)))
        return simulate(p, z[9:13], jnp.asarray(times).at[0].set(z[13]).at[-1].set(z[14])).ys[1:]

    slopes = jax.jit(jax.jacfwd(end))(point)
    for i in range(15):
        share = 1e-4 / (1.0 + count) if i < 9 else 1e-4 / max(abs(point[i]), 1.0)
        expected = differences(end, point, i, share=share)
        reach = 1e-6 * (1.0 + count) * (1.0 + np.abs(expected).max())
        np.testing.assert_allclose(slopes[..., i], expected, rtol=1e-5, atol=reach)


@pytest.mark.mends("second derivatives raised an error of the compiled code's interface")
def test_second_derivatives_are_refused():
    def end(x):
        return simulate(parameters((*x, *HUNG[0].x[2:])), np.zeros(4), clock(HUNG[0].x, 2)).ys[-1, 0]

    assert np.all(np.isnan(jax.hessian(end)(jnp.array(HUNG[0].x[:2]))))


def tossed():
    """A bare block falling towards its base while the forcing turns it: parameters, the time of the start,
    the speed with which it touches its base and no more, and when it does."""
    nu, k, f, xi, tilt = 0.2, 0.03, 0.7, 3.0, 0.05
    begin = (1.5 * np.pi - 1.2) / xi

    # phi'' - phi = k - nu - f sin(xi tau) while it falls.
    def fall(v, s):
        def forced(tau):
            share = f / (1.0 + xi**2)
            return nu - k + share * np.sin(xi * tau), xi * share * np.cos(xi * tau)

        (phi0, rate0), (phi, rate) = forced(begin), forced(begin + s)
        a, b = tilt - phi0, -v - rate0
        return a * np.cosh(s) + b * np.sinh(s) + phi, a * np.sinh(s) + b * np.cosh(s) + rate

    v, s = fsolve(lambda u: fall(*u), (0.25, 0.4), xtol=1e-14)
    assert np.abs(fall(v, s)).max() < 1e-14
    return np.array((nu, 0.0, 0.4, 0.2, k, f, xi, 1.0)), begin, float(v), float(s)


def test_past_a_touch_of_the_base_the_derivative_of_the_motion_grows_as_the_inverse_root():
    x, begin, v, touch = tossed()
    times = begin + np.linspace(0.0, 1.3 * touch, SAMPLES)

    def slope(distance):
        return abs(along(x, (0.05, 0.0, -v * (1.0 + distance), 0.0), times)[1][-1, 2, 2])

    distances = 10.0 ** np.linspace(-9.0, -3.0, 7)
    short, past = ([slope(s * d) for d in distances] for s in (-1.0, 1.0))
    assert np.ptp(short) < 1e-2 * short[0]
    assert np.polyfit(np.log(distances), np.log(past), 1)[0] == pytest.approx(-0.5, abs=0.02)


def test_a_free_block_let_go_next_to_its_balance_falls_after_the_logarithm_of_the_distance():
    nu = 0.2
    x = (nu, 0.0, 0.4, 0.2, 0.0, 0.0, 1.0, 1.0)
    for distance in (1e-3, 1e-6, 1e-9):
        back = np.arccosh(1.0 / distance)
        times = np.linspace(0.0, back * (1.0 + 1e-6), SAMPLES)
        ys, slopes, status = along(x, (nu * (1.0 - distance), 0.0, 0.0, 0.0), times)
        assert status == "rocking"
        assert ys[-2, 0] > 0.0 > ys[-1, 0]
        # What a start is off by has grown as much.
        assert slopes[-2, 0, 0] == pytest.approx(np.cosh(times[-2]), rel=1e-6)
        late = along(x, (nu * (1.0 + distance), 0.0, 0.0, 0.0), np.linspace(0.0, 2.0 * back, SAMPLES))
        assert late[2] == "overturned"
