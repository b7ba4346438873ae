"""The atlas of failures: in every regime where a method loses its footing, how that shows and what is told.

`tests.atlas` lists the regimes with all their tests; here are those that no other module has.
`python -m tests.benchmarks.guards` takes the guards away one by one and sees these tests fail.
"""

from __future__ import annotations

import ast
import functools
import subprocess
import sys
from pathlib import Path
from types import SimpleNamespace
from typing import Any

import equinox as eqx
import jax
import jax.numpy as jnp
import numpy as np
import pytest
from scipy.optimize import fsolve

from tests.answers.test_bifurcations import BARE as FOLDING
from tests.answers.test_bifurcations import HELD, TOUCHING, Kind, lost
from tests.answers.test_periodic_orbit import carried, near
from tests.answers.test_symmetric_orbits import among
from tests.answers.test_symmetric_orbits import solve as orbits
from tests.atlas import REGIMES
from tests.models.test_segmented import nonlinear
from tests.reference import (
    BARE,
    HUNG,
    OVERTURNING,
    STILL,
    UNSTABLE,
    along,
    assert_overturned,
    differences,
    exact,
    parameters,
    smoothed,
    solver,
)
from tpd import Block, Harmonic, Pendulum, Piecewise, Scene, Smoothed, Status, Terms, status_name
from tpd.answers.period_map import Orbit
from tpd.answers.steady_state import _verdict
from tpd.exact import repetition, steady
from tpd.exact.symmetric_orbit_kernel import _status
from tpd.exact.terms import LANDING, STATUSES
from tpd.models import compiled_linear
from tpd.models.multiple_shooting import Events, events
from tpd.models.settling import scale_of
from tpd.scene.parameters import as_arrays
from tpd.scene.status import SETTLED, index_of, names_of
from tpd.theory.equations import smoothed_rates

NU, MU, LAM, ZETA, K, F, XI, E = range(8)
CHAOTIC = (0.321, 0.205, 0.096, 0.047, 0.087, 0.347, 2.803, 1.0)
SAMPLES = 201
"""Of every trajectory here, so that one compilation serves them all."""


def moved(x: Any, i: int, value: float) -> np.ndarray:
    """All eight parameters, one of them changed."""
    out = np.ones(8)
    out[: len(x)] = x
    out[i] = value
    return out


def power(distances: np.ndarray, values: np.ndarray) -> float:
    """The exponent of a power law."""
    return float(np.polyfit(np.log(distances), np.log(values), 1)[0])


def test_every_test_of_the_table_exists():
    root = Path(__file__).parents[1]
    for regime in REGIMES:
        assert regime.tests, regime.name
        for test in regime.tests:
            path, name = test.split("::")
            tree = ast.parse((root / path).read_text(encoding="utf-8"))
            assert name in {f.name for f in ast.walk(tree) if isinstance(f, ast.FunctionDef)}, test


# Saddle-node fold


def test_at_a_fold_the_gradient_grows_as_the_inverse_root_over_six_decades():
    b, distances = lost(Kind.fold), 10.0 ** np.linspace(-9.0, -3.0, 13)
    o = among(FOLDING, "f", b.value * (1.0 + distances))
    for j, sign in ((0, 1.0), (1, -1.0)):
        slopes = sign * o.slopes[:, j, 0, F]
        assert power(distances, slopes) == pytest.approx(-0.5, abs=0.005)
        # It is that of the root: twice the distance times the slope is how far the amplitude has come.
        come = sign * (o.amplitude[:, j] - b.amplitude)
        np.testing.assert_allclose(2.0 * distances * b.value * slopes, come, rtol=2e-2)


def test_next_to_a_fold_the_gradient_is_refused_by_name():
    b = lost(Kind.fold)
    x = moved(FOLDING, F, b.value * (1.0 + 5e-14))
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


@pytest.mark.parametrize(
    ("half", "dent", "status"),
    [
        (0.5, 1.0, "rocking"),
        (1.5, 1.0, "unstable"),
        (1.0 - 1e-7, 1.0, "near_fold"),
        (1.0 - 1e-5, 1.0, "rocking"),
        (0.5, 1e-8, "grazing"),
        (0.5, 1e-6, "rocking"),
    ],
)
def test_an_orbit_about_to_be_lost_has_a_name(half, dent, status):
    named = _status.py_func(SimpleNamespace(k=0.05, e=1.0, mu=0.1, zeta=0.1), half, abs(1.0 - half), dent)
    assert STATUSES[named] == status


# Breaking of symmetry

LEANING = (*UNSTABLE[0], 1.0)


def test_the_symmetric_orbit_loses_its_stability_and_keeps_its_gradient_where_symmetry_breaks():
    b, distances = lost(Kind.symmetry_breaking), 10.0 ** np.linspace(-7.0, -3.0, 9)
    below, above = (among(LEANING, "xi", b.value * (1.0 + s * distances)) for s in (-1.0, 1.0))
    assert set(below.status[:, 0]) == {"unstable"}
    assert set(above.status[:, 0]) == {"rocking"}
    for o, sign in ((below, -1.0), (above, 1.0)):
        assert power(distances, sign * o.symmetry[:, 0]) == pytest.approx(1.0, abs=0.01)
        assert np.all(np.abs(np.abs(o.multipliers[:, 0]).max(axis=1) - 1.0) < 50.0 * distances)
    np.testing.assert_allclose(below.slopes[0, 0, :6], above.slopes[0, 0, :6], rtol=1e-4, atol=1e-5)


def test_beyond_the_breaking_steady_state_refuses_the_symmetric_orbit():
    x = moved(LEANING, XI, lost(Kind.symmetry_breaking).value * 0.98)
    answer = exact(x, orbits([x]).state[0, 0])
    assert answer.status == "unstable"
    assert np.isfinite(answer.amplitude)
    assert np.all(np.isnan(answer.slopes))


def test_beyond_the_breaking_the_motion_leans_as_the_root_and_its_gradient_grows_as_the_inverse():
    b, distances = lost(Kind.symmetry_breaking), 10.0 ** np.linspace(-2.0, -4.5, 6)
    straight = among(LEANING, "xi", b.value * (1.0 - distances))
    lean, leans, slopes = 0.01 * straight.state[0, 0], [], []
    for i, distance in enumerate(distances):
        answer = exact(moved(LEANING, XI, b.value * (1.0 - distance)), straight.state[i, 0] + lean)
        assert answer.status == "rocking"
        assert not bool(answer.steady.symmetric)
        leans.append(answer.amplitude - straight.amplitude[i, 0])
        slopes.append(straight.slopes[i, 0, 0, XI] - answer.slopes[0, XI])
        lean = (np.asarray(answer.steady.state) - straight.state[i, 0]) * 10.0**-0.25
    assert power(distances[2:], np.array(leans)[2:]) == pytest.approx(0.5, abs=0.02)
    assert power(distances[2:], np.array(slopes)[2:]) == pytest.approx(-0.5, abs=0.02)


def test_a_motion_that_leans_is_not_called_symmetric():
    lopsided = (0.19, 0.04, 0.58, 0.1, 0.09, 0.43, 1.66, 0.81)
    answer = exact(lopsided, (-0.0117, 0.66787, 0.26387, -0.93402))
    assert answer.status == "rocking"
    assert int(answer.steady.periods) == 1
    assert not bool(answer.steady.symmetric)
    assert bool(exact(BARE[0].x, BARE[0].y0).steady.symmetric)


# Grazing


def tossed() -> tuple[np.ndarray, float, float, float]:
    """A bare block falling towards its base while the forcing turns it: parameters, the time of the start,
    the speed with which it touches its base and no more, and when it does."""
    nu, k, f, xi, tilt = 0.2, 0.03, 0.7, 3.0, 0.05
    begin = (1.5 * np.pi - 1.2) / xi

    # phi'' - phi = k - nu - f sin(xi tau) while it falls.
    def fall(v: float, s: float) -> tuple[float, float]:
        def forced(tau: float) -> tuple[float, float]:
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

    def slope(distance: float) -> float:
        _, slopes, _ = along(x, (0.05, 0.0, -v * (1.0 + distance), 0.0), times)
        return abs(slopes[-1, 2, 2])

    distances = 10.0 ** np.linspace(-9.0, -3.0, 7)
    short = [slope(-d) for d in distances]
    assert np.ptp(short) < 1e-2 * short[0]
    past = np.array([slope(d) for d in distances])
    assert power(distances, past) == pytest.approx(-0.5, abs=0.02)


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


USUAL = {"transversality": 1.0, "residual": 0.0, "multiplier": 0.5, "to_fold": 0.5}
"""Of a motion that repeats, when all is in order."""


def by_compiled_rules(transversality, residual, multiplier, to_fold, separation=np.nan):
    code = steady.verdict.py_func(
        repetition.ROCKING, residual, separation, multiplier, to_fold, transversality, False
    )
    return steady.STATUSES[code]


def by_traced_rules(transversality, residual, multiplier, to_fold):
    y, sizes, one = np.array([0.05, 0.1, 0.0, 0.2]), np.array([0.1, 0.2]), np.asarray(1.0)
    met = np.asarray(transversality), one, np.asarray(True)
    orbit = Orbit(y, np.asarray(residual), y, sizes, np.zeros((6, 9)), np.zeros((6, 4)), *met)
    code = _verdict(index_of("rocking"), orbit, np.asarray(multiplier), np.asarray(False), to_fold, 0.0)
    return names_of(jax.tree.unflatten(jax.tree.structure(Status.failed), [code]))


@pytest.mark.parametrize("rules", [by_compiled_rules, by_traced_rules], ids=["compiled", "traced"])
@pytest.mark.parametrize(
    ("what", "status"),
    [
        ({}, "rocking"),
        ({"transversality": 1e-8}, "grazing"),
        ({"transversality": 1e-6}, "rocking"),
        ({"to_fold": 1e-6}, "near_fold"),
        ({"to_fold": 1e-5}, "rocking"),
        ({"multiplier": 1.001}, "unstable"),
        ({"residual": 1e-7}, "not_settled"),
        ({"residual": np.nan}, "not_settled"),
    ],
)
def test_the_verdict_has_a_name_for_each_loss(rules, what, status):
    assert rules(**{**USUAL, **what}) == status


def test_motions_that_part_from_their_neighbours_are_aperiodic():
    assert by_compiled_rules(**USUAL, separation=0.1) == "aperiodic"


# Sticking and rattling


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


def test_a_block_that_friction_holds_for_a_while_is_called_sticking():
    start = (0.034, 0.1, 0.0, 0.0)
    assert exact(moved(HELD, F, 0.322), start).status == "sticking"
    assert exact(moved(HELD, F, 0.33), start).status == "rocking"


def hops(x: Any, tilt: float, quiet: float) -> int:
    """Impacts of a block let go at a tilt until it is captured at rest, below a speed in units of nu."""
    p = parameters(x)
    numbers = np.array([*x[:7], p.inertia_ratio, p.velocity_ratio])
    found = events(numbers, np.array([tilt, 0.0, 0.0, 0.0]), 4, 256, quiet)
    assert isinstance(found, Events)
    assert found.resting
    return int(np.sum(found.endings == LANDING))


def test_the_hops_of_a_rattle_grow_as_the_logarithm_of_the_capture_speed():
    nu, e, tilt = 0.2, 0.8, 0.01
    x = (nu, 0.0, 0.4, 0.2, 0.0, 0.0, 1.0, e)
    # Without friction every hop lands as fast as it began: speeds fall by e.
    fastest = np.sqrt(2.0 * nu * tilt - tilt**2)
    for quiet in (1e-2, 1e-4, 1e-6, 2e-7):
        assert hops(x, tilt, quiet) == 1 + np.ceil(np.log(quiet * nu / fastest) / np.log(e))


def test_friction_ends_a_rattle_without_impact_loss_as_fast_as_its_ratio_says():
    nu, k = 0.2, 0.05
    x = (nu, 0.0, 0.4, 0.2, k, 0.0, 1.0, 1.0)
    # Up against weight and friction, down against weight less friction.
    ratio = np.sqrt((nu - k) / (nu + k))
    more = hops(x, 0.01, 1e-7) - hops(x, 0.01, 1e-3)
    assert more == pytest.approx(np.log(1e-4) / np.log(ratio), abs=1.0)


@jax.jit
def _after(x: jax.Array, y0: jax.Array, span: jax.Array, quiet: jax.Array) -> tuple:
    times = jnp.stack([jnp.zeros_like(span), span])
    ys, status = compiled_linear.trajectory(parameters(x), y0, times, 4000, quiet / x[NU])
    return ys[-1], status == Status.event_bound


def test_what_capture_leaves_out_is_below_the_square_of_its_speed():
    x, y0 = np.array((0.2, 0.2, 0.5, 0.1, 0.02, 0.05, 2.0, 0.8)), np.array([0.02, 0.05, 0.0, 0.0])
    speeds, span, ends = 0.2 * 10.0 ** -np.linspace(1.0, 4.0, 25), np.array(10.0), []
    for quiet in (*speeds, 2e-8):
        ends.append(np.asarray(_after(x, y0, span, np.array(quiet))[0]))
        assert ends[-1][0] == ends[-1][2] == 0.0
    apart = np.linalg.norm(np.array(ends[:-1]) - ends[-1], axis=1)
    assert np.all(apart < speeds**2)
    # Here even its third power: the bob follows the rod, which is back where it was after every hop.
    assert np.all(apart < 50.0 * speeds**3)
    assert power(speeds[[0, 9, 17]], apart[[0, 9, 17]]) == pytest.approx(3.0, abs=0.2)
    # A threshold near rounding is met, or the bound on the steps ends the motion.
    y, exhausted = _after(x, y0, span, np.array(1e-11))
    assert bool(exhausted) or y[0] == y[2] == 0.0


# Motion that does not repeat


def test_the_gradient_through_a_chaotic_simulation_grows_at_the_reported_rate():
    answer = exact(CHAOTIC)
    assert answer.status == "aperiodic"
    assert np.all(np.isnan(answer.slopes))
    # Over the hundred periods after those that were followed, as in the report.
    p, period = as_arrays(parameters(CHAOTIC)), 2.0 * np.pi / CHAOTIC[XI]
    settled = eqx.filter_jit(Piecewise().settle)(p, jnp.zeros(4))
    assert status_name(settled.status) == "not_settled"
    times, scale, rates = np.arange(SAMPLES) * period, np.asarray(scale_of(p)), []
    # Rounding alone makes another motion of each start within the hundred periods, and over so few the rate
    # scatters by a tenth.
    for more in 1.0 + 0.05 * np.random.default_rng(0).normal(size=(8, 4)):
        _, slopes, status = along(CHAOTIC, np.asarray(settled.y) * more, times)
        assert status == "rocking"
        sizes = np.linalg.norm(slopes @ scale / scale, axis=1)[:101]
        assert sizes[-1] > 1e13
        rates.append(np.log(sizes[-1] / sizes[0]) / times[100])
    assert np.std(rates) < 0.15 * np.mean(rates)
    assert np.mean(rates) == pytest.approx(float(answer.steady.lyapunov), abs=2.0 * np.std(rates))


def test_shooting_has_the_gradient_of_an_orbit_inside_chaos_where_simulation_loses_it():
    o = orbits([CHAOTIC])
    i = list(o.status[0]).index("unstable")
    orbit = near(CHAOTIC, o.state[0, i])
    assert status_name(orbit.status) == "unstable"
    answer = carried(CHAOTIC, orbit)
    assert np.abs(answer.slopes[0]).max() < 10.0
    np.testing.assert_allclose(answer.slopes[0], o.slopes[0, i, 0], rtol=1e-8, atol=1e-9)
    multiplier = np.abs(o.multipliers[0, i]).max()
    assert multiplier > 1.1
    periods = np.arange(SAMPLES) * 2.0 * np.pi / CHAOTIC[XI]
    _, slopes, _ = along(CHAOTIC, o.state[0, i], periods)
    sizes = np.linalg.norm(slopes, axis=(1, 2))
    assert sizes[100] > 1e5
    rate = np.polyfit(np.arange(20, 101), np.log(sizes[20:101]), 1)[0]
    assert rate == pytest.approx(np.log(multiplier), rel=0.02)


@pytest.mark.slow
def test_the_rates_agree_over_two_thousand_periods():
    answer = solver(Piecewise(lyapunov_periods=2000), 8)(CHAOTIC)
    y, times = answer.steady.state, np.arange(SAMPLES) * 2.0 * np.pi / CHAOTIC[XI]
    rates = []
    for _ in range(10):
        ys, slopes, _ = along(CHAOTIC, y, times)
        sizes = np.linalg.norm(slopes, axis=(1, 2))
        rates.append(np.polyfit(times[20:], np.log(sizes[20:]), 1)[0])
        y = ys[-1]
    assert np.mean(rates) == pytest.approx(float(answer.steady.lyapunov), rel=0.05)


# Overturning


def test_an_overturning_has_a_status_and_no_gradient():
    assert_overturned(exact(OVERTURNING))


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
        _, _, status = along(x, (nu * (1.0 + distance), 0.0, 0.0, 0.0), np.linspace(0.0, 2.0 * back, SAMPLES))
        assert status == "overturned"


def boundary(solve: Any, x: Any, low: float, high: float, steps: int) -> list:
    """Answers from starts that close in on the tilt from which the block overturns."""
    answers = []
    for _ in range(steps):
        tilt = 0.5 * (low + high)
        answers.append(solve(x, (tilt, 0.0, 0.0, 0.0)))
        low, high = (low, tilt) if answers[-1].status == "overturned" else (tilt, high)
    return answers


def assert_named(answers: list, amplitude: float, saddle: float, rtol: float) -> None:
    """Every one is the attractor with its gradient, or rest, or lost, or the saddle in between, refused."""
    assert {a.status for a in answers} == {"rocking", "rest", "overturned", "unstable"}
    for a in answers:
        size = {"rocking": amplitude, "rest": 0.0, "overturned": np.inf, "unstable": saddle}[a.status]
        assert a.amplitude == pytest.approx(size, rel=rtol)
        assert np.all(np.isfinite(a.slopes[0])) == (a.status in SETTLED)


def test_starts_that_all_but_overturn_have_the_attractor_s_answer_or_a_name():
    answers = boundary(exact, BARE[1].x, 0.16, 0.3, 50)
    saddle = next(a.amplitude for a in answers if a.status == "unstable")
    assert saddle > 0.2
    assert_named(answers, BARE[1].amplitude, saddle, 1e-6)


@pytest.mark.slow
@pytest.mark.parametrize("solve", [smoothed, nonlinear], ids=["smoothed", "segmented"])
def test_the_same_of_the_integrated_models(solve):
    answers = boundary(solve, BARE[1].x, 0.16, 0.3, 24)
    sizes = {a.status: a.amplitude for a in answers}
    assert_named(answers, sizes["rocking"], sizes["unstable"], 1e-8)
    assert sizes["rocking"] == pytest.approx(BARE[1].amplitude, rel=0.01)


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


def test_resonance_without_damping_to_the_last_digit_is_told():
    # 1 - lam rho xi^2 is zero.
    for mu in (0.0, 0.1):
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


def fast_limit(nu: float, k: float, f: float) -> float:
    """What xi^2 times the amplitude of a bare block tends to as xi grows: u = xi^2 phi obeys u'' = k - nu -
    f sin(theta + gamma) from the turn on, and 2 nu more after u = 0."""

    def conditions(unknown: np.ndarray) -> list[float]:
        top, crossing, gamma = unknown

        def u(theta: float) -> float:
            bend = 0.5 * (k - nu) * theta**2 + nu * max(theta - crossing, 0.0) ** 2
            return top + bend + f * (np.sin(theta + gamma) - np.sin(gamma) - theta * np.cos(gamma))

        turning = (k - nu) * np.pi + 2.0 * nu * (np.pi - crossing) - 2.0 * f * np.cos(gamma)
        return [u(crossing), u(np.pi) + top, turning]

    return float(fsolve(conditions, (0.74, 1.4, 1.2), xtol=1e-13)[0])


def test_under_fast_shaking_the_amplitude_is_that_of_a_block_that_nothing_topples():
    nu, k, f = 0.2, 0.05, 0.5
    limit = fast_limit(nu, k, f)
    rates = np.array([10.0, 30.0, 100.0, 300.0])
    o = among((nu, 0.0, 0.4, 0.2, k, f, 1.0, 1.0), "xi", rates)
    assert set(o.status[:, 0]) == {"rocking"}
    apart = np.abs(o.amplitude[:, 0] * rates**2 / limit - 1.0)
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


@pytest.mark.slow
def test_the_sharpest_smoothing_is_right_or_told_to_be_too_much():
    case = HUNG[3]
    for sharpness in (1e-4, 1e-5, 1e-6):
        answer = solver(Smoothed(sharpness=sharpness), 7)(case.x)
        if answer.status in SETTLED:
            assert answer.amplitude == pytest.approx(case.amplitude, rel=max(0.1 * sharpness, 1e-7))
        else:
            assert answer.status in ("event_bound", "not_settled", "failed")
            assert np.all(np.isnan(answer.slopes))


# Smoothed impacts

FOLDED, FOLD_F = (0.2, 0.1, 0.5, 0.2, 0.0, 0.3, 4.0, 0.8), 0.07207467768307578
"""A scene with impacts, and the forcing at which its symmetric orbits fold, by `bifurcations`."""


@pytest.mark.parametrize("e", [0.5, 0.8, 0.95])
def test_with_smoothed_impacts_rest_and_overturning_are_those_of_the_exact_model(e):
    still, large = (*STILL.x, e), (0.25, 0.1, 0.2, 0.1, 0.0, 1.6, 2.67, e)
    answer = smoothed(still)
    assert answer.status == exact(still).status == "rest"
    assert answer.amplitude == 0.0
    np.testing.assert_array_equal(answer.slopes[0], 0.0)
    assert_overturned(exact(large))
    assert_overturned(smoothed(large))


def test_smoothed_impacts_pass_the_onset_of_sticking_and_do_not_name_it():
    b, shares = lost(Kind.sticking), np.array([-1e-2, -1e-3, 1e-3, 1e-2])
    state = among(HELD, "f", b.value * (1.0 + shares[2:3])).state[0, 0]
    for share in shares:
        x = moved(HELD, F, b.value * (1.0 + share))
        found, expected = smoothed(x, state), exact(x, state)
        assert found.status == "rocking"
        assert expected.status == ("rocking" if share > 0 else "sticking")
        assert found.amplitude == pytest.approx(expected.amplitude, rel=3e-3)
        of = [NU, MU, LAM, ZETA, F]
        scale = np.abs(expected.slopes[0, of]).max()
        np.testing.assert_allclose(found.slopes[0, of], expected.slopes[0, of], rtol=0, atol=1e-2 * scale)


def test_smoothed_impacts_of_a_block_that_all_but_stops_are_not_called_settled():
    x = (0.2, 0.1, 0.4, 0.2, 0.0, 0.25, 4.0, 0.5)
    answer = smoothed(x)
    assert exact(x).status == "sticking"
    assert answer.status in ("not_settled", "unstable")
    assert np.all(np.isnan(answer.slopes))


def smoothed_fold(coarser: float) -> float:
    """The least forcing with rocking in `FOLDED`, by the smoothed model, closing in on it by halving; what is
    met on the way has a gradient or a name."""
    low, high = 0.8 * FOLD_F, 1.05 * FOLD_F
    state = smoothed(moved(FOLDED, F, high), (0.02, 0.0, 0.0, 0.0), coarser).steady.state
    met = set()
    for _ in range(20):
        f = 0.5 * (low + high)
        answer = smoothed(moved(FOLDED, F, f), state, coarser)
        met.add(answer.status)
        assert np.all(np.isfinite(answer.slopes[0])) == (answer.status in SETTLED)
        if answer.status == "rocking":
            high, state = f, answer.steady.state
        else:
            low = f
    assert {"rocking", "rest"} <= met <= {"rocking", "rest", "not_settled", "near_fold", "unstable"}
    return high


def test_with_smoothed_impacts_a_fold_is_beside_the_exact_one_in_proportion_to_the_width():
    assert among(FOLDED, "f", FOLD_F * (1.0 + np.array([1e-9]))).status[0, 0] == "rocking"
    assert among(FOLDED, "f", FOLD_F * (1.0 - np.array([1e-9]))).status[0, 0] == "no_orbit"
    near, far = (smoothed_fold(coarser) / FOLD_F - 1.0 for coarser in (1.0, 4.0))
    assert near == pytest.approx(-1.35e-3, rel=0.01)
    assert far == pytest.approx(4.0 * near, rel=0.01)


def test_from_a_grazing_orbit_smoothed_impacts_lead_to_the_one_that_attracts():
    b = lost(Kind.grazing)
    for distance in (1e-2, 1e-5, 1e-8):
        f = b.value * (1.0 - distance)
        o = among(TOUCHING, "f", np.array([f]))
        assert o.status[0, 1] in ("unstable", "grazing")
        answer = smoothed(moved(TOUCHING, F, f), o.state[0, 1])
        assert answer.status == o.status[0, 0] == "rocking"
        assert answer.amplitude == pytest.approx(o.amplitude[0, 0], rel=1e-4)
        np.testing.assert_allclose(answer.slopes[0, :8], o.slopes[0, 0, 0, :8], rtol=5e-3, atol=1e-5)


@pytest.mark.parametrize(("e", "most"), [(0.5, 5e-4), (0.2, 4e-3), (0.1, 1.2e-2)])
def test_the_bias_of_smoothed_impacts_grows_as_e_falls(e, most):
    x = moved(FOLDED, E, e)
    off = smoothed(x).amplitude / exact(x).amplitude - 1.0
    assert 0.7 * most < off < most


@pytest.mark.parametrize("case", HUNG[:2], ids=lambda case: case.name)
@pytest.mark.parametrize("e", [0.5, 0.8])
def test_smoothed_impacts_too_sharp_to_be_met_by_every_step_are_right_or_told(case, e):
    # Steps that pass over an impact's layer lose no energy there.
    for coarser in (0.01, 0.005):
        answer = smoothed((*case.x, e), coarser=coarser)
        if answer.status in SETTLED:
            assert answer.amplitude == pytest.approx(exact((*case.x, e)).amplitude, rel=1e-4)
        else:
            assert answer.status in ("not_settled", "unstable", "event_bound", "overturned")
            assert np.all(np.isnan(answer.slopes))


@pytest.mark.parametrize("e", [0.0, -0.1])
def test_a_traced_ratio_that_has_no_smoothed_impact_is_told(e):
    answer = smoothed(moved(FOLDED, E, e))
    assert answer.status == "event_bound"
    assert np.all(np.isnan(answer.slopes))


def test_the_smoothed_equations_4_have_no_number_with_impacts():
    y = jnp.array([1e-3, 0.1, 0.2, 0.0])

    @jax.jit
    def rates(e: jax.Array) -> jax.Array:
        p = parameters((*HUNG[0].x, e))
        return smoothed_rates(p, *Smoothed().widths(p), Terms.nonlinear)(jnp.zeros(()), y, None)

    assert np.all(np.isfinite(rates(1.0)))
    assert np.isnan(rates(0.9)[2])


# Numbers of 32 bits, and scales

IN_32_BITS = """
import numpy as np, tpd
from tpd.answers.bifurcations import bifurcations
from tpd.answers.ensemble import outcomes
from tpd.answers.sweep import sweep
from tpd.theory import *
scene, pendulum = tpd.paper_scene(), tpd.Pendulum(mass=1.6, length=0.12, damping_ratio=0.1)
p, values = scene.parameters(pendulum), np.linspace(0.3, 0.4, 9)
band, y0 = (2.0, 3.5), np.zeros(4)
calls = {
    "steady_state": lambda: tpd.steady_state(p),
    "Auto": lambda: tpd.steady_state(p, model=tpd.Auto()),
    "simulate": lambda: tpd.simulate(p, y0, np.array([0.0, 1.0])),
    "symmetric_orbits": lambda: tpd.symmetric_orbits(p),
    "periodic_orbit": lambda: tpd.periodic_orbit(p, y0),
    "sweep": lambda: sweep(p, "f", values),
    "bifurcations": lambda: bifurcations(p, "f", 0.3, 0.4),
    "branches": lambda: tpd.branches(p, "f", 0.3, 0.4),
    "design_map": lambda: tpd.design_map(p, ("mu", values), ("lam", values)),
    "attractors": lambda: tpd.attractors(p, starts=tpd.Starts(size=4, seed=0)),
    "optimise": lambda: tpd.optimise(scene, tpd.DesignSpace()),
    "optimise over a band": lambda: tpd.optimise(scene, conditions=tpd.Conditions.band(scene, *band)),
    "verdict": lambda: tpd.verdict(scene, pendulum, ensemble=tpd.Ensemble(seed=0)),
    "outcomes": lambda: outcomes(scene, pendulum, ensemble=tpd.Ensemble(seed=0)),
    "check": lambda: tpd.check(scene, pendulum, stroke=0.5),
    "settled_response": lambda: tpd.settled_response(scene, "frequency", np.array(band)),
    "uplift": lambda: uplift(p),
    "one_harmonic": lambda: one_harmonic(p),
    "one_harmonic_branches": lambda: one_harmonic_branches(p),
    "neglected_harmonics": lambda: neglected_harmonics(p),
    "parametric_branches": lambda: parametric_branches(p),
    "free_motion": lambda: free_motion(p),
    "equivalent_friction": lambda: equivalent_friction(p, 0.05),
}
for name, call in calls.items():
    try:
        call()
    except RuntimeError as error:
        assert str(error).startswith("tpd needs 64-bit floats, but JAX is in 32-bit mode"), (name, error)
    else:
        raise AssertionError(name + " answers in 32 bits")
print("refused", len(calls))
"""


def test_in_32_bits_every_call_refuses_by_name():
    done = subprocess.run([sys.executable, "-c", IN_32_BITS], capture_output=True, text=True)
    assert done.returncode == 0, done.stderr[-2000:]
    assert done.stdout.startswith("refused 23")


def scene(size: float, mass: float) -> tuple[Scene, Pendulum]:
    """The paper's block and its shaking, `size` times as large and shaken that much slower."""
    block = Block(width=0.1 * size, height=0.4 * size, mass=mass, friction=0.05)
    motion = Harmonic(amplitude=0.015 * size, frequency=2.5 / np.sqrt(size))
    return Scene(block, motion), Pendulum(mass=0.05 * mass, length=0.04 * size, damping_ratio=0.1)


@functools.cache
def dimensionless(size: float, mass: float) -> tuple[float, ...]:
    at, pendulum = scene(size, mass)
    p = at.parameters(pendulum)
    return tuple(float(getattr(p, n)) for n in ("nu", "mu", "lam", "zeta", "k", "f", "xi", "e"))


@pytest.mark.parametrize("height", [1e-3, 1e-1, 1e3], ids="{:g} m".format)
@pytest.mark.parametrize("density", [20.0, 4e5], ids="{:g} kg per m3".format)
def test_neither_millimetres_nor_kilometres_change_a_dimensionless_answer(height, density):
    x = dimensionless(height / 0.4, density * height**3 / 16.0)
    usual = dimensionless(1.0, 16.2)
    np.testing.assert_allclose(x, usual, rtol=1e-14)
    answer, expected = exact(x), exact(usual)
    assert answer.status == expected.status == "rocking"
    assert answer.amplitude == pytest.approx(expected.amplitude, rel=1e-11)
    np.testing.assert_allclose(answer.slopes[0], expected.slopes[0], rtol=1e-8, atol=1e-10)
