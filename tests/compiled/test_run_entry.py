"""Runs of both equations through the one entrance: against the event loop of SciPy, and by hand."""

import dataclasses

import numpy as np
import pytest

import tpd
from tests.reference import NAMES, WITH, EventDriven, exact, parameters, settled
from tpd.compiled import custom_call, run_entry
from tpd.compiled.calling import RUNS
from tpd.compiled.columns import STEADY
from tpd.compiled.rows import row_of
from tpd.compiled.simulate import GroundForcing, accuracy, follow
from tpd.core import files
from tpd.scene.parameters import as_arrays
from tpd.scene.status import names_of

LINEAR, NONLINEAR = tpd.Terms.linear, tpd.Terms.nonlinear
both_equations = pytest.mark.parametrize("terms", [LINEAR, NONLINEAR])


def scenes(kind, count, seed=4):
    """Random parameters and starts, friction from none to that which holds a leaning block."""
    u = np.random.default_rng(seed).random((count, 12))
    nu, pendulum, lossy = 0.1 + 0.25 * u[:, 0], kind.startswith("hung"), kind.endswith("impacts")
    p = tpd.Parameters(
        nu=nu,
        mu=(0.02 + 0.3 * u[:, 1]) * pendulum,
        lam=0.2 + 1.3 * u[:, 2],
        zeta=(0.05 + 0.3 * u[:, 3]) * (u[:, 3] > 0.2),
        k=nu * u[:, 4] ** 2 * (0.3 if lossy else 1.0) * (u[:, 4] > 0.2),
        f=nu * (0.4 + (1.2 if pendulum else 2.0) * u[:, 5]),
        xi=1.0 + 6.0 * u[:, 6],
        e=0.6 + 0.35 * u[:, 7] if lossy else np.ones(count),
    )
    reach = np.stack([0.6 * nu, 0.3 + 0.0 * nu, 0.3 * nu, 0.3 + 0.0 * nu], axis=1)
    return p, (2.0 * u[:, 8:12] - 1.0) * reach


@both_equations
@pytest.mark.parametrize("kind", ["hung", "bare", "impacts", "hung impacts"])
def test_random_motions_equal_the_event_loop(kind, terms):
    p, y0 = scenes(kind, 8)
    found = settled(terms, p, y0, periods=3, rtol=1e-11)
    kinds, compared = set(), 0
    for i in np.flatnonzero(found.elapsed == 3):
        x = [float(np.broadcast_to(getattr(p, name), 8)[i]) for name in NAMES]
        loop = EventDriven(x, nonlinear=terms is NONLINEAR)
        quiet = 1e-4 if terms is NONLINEAR else 2e-7
        expected = loop.run(y0[i], np.array([0.0, 6.0 * np.pi / x[6]]), quiet=quiet)
        if len(expected) < 2:
            continue
        felt = slice(None) if kind.startswith("hung") else slice(None, None, 2)
        # What is left out at the end of a rattle is of the square of its speed.
        np.testing.assert_allclose(found.state[i, felt], expected[-1, felt], rtol=0, atol=1e-6)
        kinds |= set(loop.kinds)
        compared += 1
    assert compared >= 3
    assert kinds >= {"slip"}


@both_equations
@pytest.mark.parametrize("ramp", [0.2, 1.25, 2.0])
def test_motions_under_growing_excitation_equal_the_event_loop(ramp, terms):
    x = [0.25, 0.2, 0.8, 0.1, 0.05, 0.5, 3.5, 1.0]
    p, period = parameters(x), 2.0 * np.pi / 3.5
    begin, y0 = (
        np.array([0.0, 0.3, 0.9]) * period,
        0.1 * np.array([[0.2, 0, 0, 0], [0, 1, 0, 0], [-1, 0, 1, 0]]),
    )
    found = settled(terms, p, y0, periods=3, rtol=1e-11, begin=begin, ramp=ramp)
    for i in range(3):
        loop = EventDriven(x, growth=ramp * period, nonlinear=terms is NONLINEAR)
        expected = loop.run(y0[i], np.array([begin[i], 3 * period]), quiet=1e-4)
        np.testing.assert_allclose(found.state[i], expected[-1], rtol=0, atol=1e-7)


@both_equations
def test_the_steady_state_entry_agrees_with_a_settled_simulation(terms):
    p, steady, limits = as_arrays(parameters(WITH[3].x)), np.zeros(1, STEADY), accuracy(terms, 1e-10)
    limits |= {"periods": 500, "events": 500, "rest_rate": 2e-7, "tolerance": 1e-8, "lyapunov_periods": 100}
    row = row_of(p)[None].copy()
    run_entry.run(0, 1, np.array([RUNS.settings("STEADY_STATE", **limits)]), row, np.zeros((1, 4)), steady)
    found = settled(terms, p, np.zeros((1, 4)), tolerance=1e-8, rtol=1e-10)
    assert int(steady["elapsed"][0]) == int(found.elapsed[0])
    assert float(found.settled_tilt[0]) == pytest.approx(float(steady["amplitude"][0]), rel=1e-7)
    if terms is LINEAR:
        assert float(steady["amplitude"][0]) == pytest.approx(exact(WITH[3].x).amplitude, rel=1e-12)


def test_code_that_cannot_be_cached_is_compiled(monkeypatch):
    def cfunc(*_, cache=False, **__):
        if cache:
            raise RuntimeError("cannot cache function: no locator available")
        return lambda function: (function, "compiled")

    monkeypatch.setattr(custom_call.numba, "cfunc", cfunc)
    monkeypatch.setattr(files, "_WARNINGS", set())
    with pytest.warns(UserWarning, match="every run compiles it: cannot cache function"):
        assert custom_call.entrance(run_entry._run)[1] == "compiled"


@both_equations
def test_a_growing_swing_can_lift_the_block_after_many_periods(terms):
    # In resonance almost without damping the bob grows by 3e-5 rad in a period, and lifts at 0.045 rad.
    nu, mu, lam = 0.03, 0.5, 1.0
    xi = 1.0 / np.sqrt(lam * 0.75 / (1.0 + nu**2))
    p = tpd.Parameters(nu=nu, mu=mu, lam=lam, zeta=1e-5, k=0.0, f=9e-6, xi=xi, e=0.9)
    for periods, lifts in ((100, False), (2500, True)):
        found = settled(terms, p, np.zeros((1, 4)), periods=periods)
        assert names_of(found.status)[0] == "not_settled"
        assert (found.tilt[0] > 0.0) == lifts
    assert found.swing[0] > 0.045
    # A little off resonance the bob cannot lift the block, but grows for hundreds of periods.
    found = settled(terms, dataclasses.replace(p, xi=0.9995 * xi), np.zeros((1, 4)), periods=3000)
    assert names_of(found.status)[0] == "rest"
    # f / (1 - .9995^2), and 1 + exp(-.01 pi / .5) times as much in between: (4) detunes the bob a little.
    expected = (0.01745, 0.009002) if terms is LINEAR else (0.0178, 0.00909)
    assert (found.swing[0], found.settled_swing[0]) == pytest.approx(
        expected, rel=1e-3 if terms is LINEAR else 0.01
    )


@both_equations
@pytest.mark.parametrize("side", [1.0, -1.0])
@pytest.mark.parametrize(
    ("speed", "span", "quiet"), [(3e-3, 0.009, 0.02), (1e-2, 1.0, 1e-6)], ids=["one impact", "rattle"]
)
def test_impacts_that_end_in_rest_change_the_swing_rate(side, speed, span, quiet, terms):
    x = [0.3, 0.1, 0.5, 0.1, 0.0, 1e-9, 1.0, 0.6]
    y0 = np.array([side * 1e-12, 0.5, -side * speed, 0.0])
    loop = EventDriven(x, nonlinear=terms is NONLINEAR)
    expected = loop.run(y0, np.array([0.0, span + 0.001]), quiet=quiet)[-1]
    still = GroundForcing([np.zeros((1, 4))], span)
    found = follow(terms, row_of(parameters([*x[:6], 0.001, x[7]])), still, y0=y0, rest_rate=quiet)
    assert found.state[2] == 0.0
    assert loop.kinds[-1] == "rest"
    assert (found.impacts == 1) == (span < 0.01)
    np.testing.assert_allclose(found.state, expected, rtol=0.0, atol=1e-8)
