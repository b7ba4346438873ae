"""Which model answers, with what error and why; a design by all models."""

import functools
import re
from types import SimpleNamespace

import jax
import jax.numpy as jnp
import numpy as np
import pytest

from tests.reference import HUNG, NAMES, STILL, parameters
from tests.reference import exact as linear
from tpd import Auto, Block, Pendulum, Scene, Segmented, check, paper_scene, status_name, steady_state
from tpd.analysis.auto import dropped
from tpd.analysis.compare_models import RUNGS, objections

LOW = (*STILL.x[:5], 0.05, STILL.x[6])
"""Never lifts."""
LIFTS = (0.2, 0.1, 0.8, 0.2, 0.05, 0.45, 4.0)
SMALL = (0.02, 0.1, 0.8, 0.2, 0.004, 0.04, 4.0)
"""Lifts a little: small angles."""


@functools.cache
def chosen(x, tolerance=0.05, balance=False):
    return steady_state(parameters(x), model=Auto(tolerance=tolerance, balance=balance))


def test_a_block_that_never_lifts_is_answered_by_the_closed_form():
    found = chosen(LOW)
    assert found.rung == "uplift"
    assert status_name(found.status) == "rest"
    assert found.amplitude == 0.0
    assert 0.0 < float(found.estimate) < 0.05
    assert found.stroke == pytest.approx(linear(LOW).stroke, rel=1e-9)
    np.testing.assert_allclose(found.state, linear(LOW).steady.state, atol=1e-12)
    assert "of the moment that would lift the block is in reserve" in found.reason


def test_a_bob_that_swings_at_the_start_leaves_less_in_reserve():
    reserves = []
    for swing in (0.0, 0.01, 0.02):
        found = steady_state(parameters(LOW), model=Auto(), y0=jnp.array([0.0, swing, 0.0, 0.0]))
        assert found.rung == "uplift"
        (share,) = re.findall(r"(\S+)% of the moment that would lift the block is in reserve", found.reason)
        reserves.append(float(share))
    assert reserves[0] > reserves[1] > reserves[2] > 0.0


def test_a_tighter_tolerance_climbs_from_rung_to_rung():
    rungs = [chosen(SMALL, tolerance, balance=True).rung for tolerance in (0.5, 0.01, 1e-5)]
    assert rungs == ["one harmonic", "exact", "nonlinear"]
    assert chosen(SMALL, 0.5).rung == "exact"
    estimates = [float(chosen(SMALL, t, balance=True).estimate) for t in (0.5, 0.01)]
    assert estimates[0] > estimates[1] > 0.0


@pytest.mark.parametrize("x", [SMALL, LIFTS, HUNG[3].x], ids=["small", "lifts", "hung"])
def test_the_estimate_covers_the_true_error(x):
    truth = float(chosen(x, 1e-5).amplitude)
    assert chosen(x, 1e-5).rung == "nonlinear"
    for found in (chosen(x, 0.5), chosen(x, 0.5, balance=True)):
        assert found.rung in ("one harmonic", "exact")
        error = abs(float(found.amplitude) / truth - 1.0)
        assert error <= float(found.estimate) <= 0.5
        assert "within the tolerance 0.5" in found.reason


def test_the_exact_rung_is_the_exact_solution_and_the_top_one_the_nonlinear():
    low, top = chosen(HUNG[3].x, 0.5), chosen(HUNG[3].x, 1e-5)
    assert float(low.amplitude) == pytest.approx(HUNG[3].amplitude, rel=1e-9)
    assert float(top.amplitude) == pytest.approx(0.0659875, rel=1e-5)
    assert f"may be off by {float(low.estimate):.2g}" in top.reason


def test_a_linear_answer_that_is_none_is_not_trusted():
    x = (0.25, 0.1, 0.2, 0.1, 0.05, 0.6, 2.67)
    assert linear(x).status == "overturned"
    found = chosen(x)
    assert found.rung == "nonlinear"
    assert "the linear equations end overturned" in found.reason


def test_a_start_off_rest_is_not_left_to_the_balance():
    y0 = jnp.array([0.0, 1e-3, 0.0, 0.0])
    found = steady_state(parameters(SMALL), model=Auto(tolerance=0.5, balance=True), y0=y0)
    assert found.rung == "exact"


def test_the_nonlinear_equations_say_which_motion_a_start_reaches():
    p = parameters((0.3482, 0.2248, 0.6407, 0.4573, 0.0525, 0.3503, 4.9036))
    y0 = jnp.array([-0.1314, -0.0447, 0.0, 0.0])
    by_linear = steady_state(p, y0=y0)
    assert status_name(by_linear.status) == "rocking"
    found = steady_state(p, model=Auto(), y0=y0)
    assert status_name(found.status) == "rest"
    assert found.amplitude == 0.0
    assert found.rung == "nonlinear"
    assert "the linear equations end rocking, and the nonlinear ones reach another motion" in found.reason
    # On the linear motion itself the estimate holds: nothing else is asked.
    near = steady_state(p, model=Auto(), y0=by_linear.state)
    assert near.rung == "exact"
    assert float(near.amplitude) == pytest.approx(float(by_linear.amplitude), rel=1e-9)
    assert float(near.estimate) < 0.05


def test_what_is_dropped_falls_with_the_square_of_the_angles():
    shares = []
    for s in (1.0, 0.1, 0.01):
        x = np.array(HUNG[3].x) * np.array([s, 1, 1, 1, s, s, 1])
        answer, p = linear(x), parameters(x)
        slope = SimpleNamespace(**dict(zip(NAMES, answer.slopes[0], strict=False)))
        shares.append(float(dropped(p, answer.amplitude, answer.stroke, slope)))
    assert np.log10(shares[0] / shares[1]) == pytest.approx(2.0, abs=0.2)
    assert np.log10(shares[1] / shares[2]) == pytest.approx(2.0, abs=0.02)


def test_auto_needs_numbers():
    with pytest.raises(ValueError, match=r"`Auto` chooses by numbers: .* but is traced or batched"):
        jax.jit(lambda x: steady_state(parameters(x), model=Auto()).amplitude)(np.array(SMALL))
    with pytest.raises(ValueError, match=r"`tolerance` must be between 1e-05 and 1, but is 1\.5"):
        Auto(tolerance=1.5)
    with pytest.raises(ValueError, match="`tolerance` must be between 1e-05 and 1, but is 0"):
        Auto(tolerance=0.0)


# A design by all models

PENDULUM = Pendulum(mass=3.2448, length=0.2, damping_ratio=0.1)


def test_a_check_has_every_rung_asked_for_and_the_nonlinear_one():
    told = []
    quick = ("uplift", "exact")
    found = check(paper_scene(), PENDULUM, stroke=0.5, rungs=quick, progress=lambda *at: told.append(at))
    assert [r.name for r in found.rungs] == ["uplift", "exact", "nonlinear"]
    assert told == [("checking", i, 3) for i in (1, 2, 3)]
    p = paper_scene().parameters(PENDULUM)
    exact, top = steady_state(p), steady_state(p, model=Segmented())
    assert found.rungs[1].amplitude == float(exact.amplitude)
    assert found.rungs[1].status == status_name(exact.status) == "rest"
    assert found.top.status == status_name(top.status)
    assert found.top.stroke == pytest.approx(float(top.stroke), rel=1e-2)
    assert found.objections == ()
    assert all(r.seconds > 0 and r.neglects for r in found.rungs)
    lines = found.table().splitlines()
    assert len(lines) == 4
    assert lines[-1].startswith("nonlinear")
    assert "nothing of the paper's (4)" in lines[-1]


def test_what_does_not_hold_is_said():
    scene = paper_scene()
    resonant = scene.pendulum(mass_ratio=0.1, length_ratio=0.20964589, damping_ratio=0.1)
    found = check(scene, resonant, stroke=1.5, rungs=("exact",))
    assert found.rungs[0].status == "rocking"
    assert found.objections == ("by the nonlinear equations the motion ends overturned",)


def test_models_without_impact_loss_have_nothing_to_say_of_a_block_with_it():
    scene = Scene(Block(width=0.1, height=0.4, mass=16.0, restitution="housner"), paper_scene().motion)
    found = check(scene, None, rungs=RUNGS)
    assert {r.name for r in found.rungs if r.status == "no impacts"} == {
        "one harmonic",
        "smoothed",
        "parametric",
        "smoothed nonlinear",
    }
    assert all(np.isnan(r.amplitude) for r in found.rungs if r.status == "no impacts")
    exact = next(r for r in found.rungs if r.name == "exact")
    assert exact.status == "rocking"
    assert not np.isnan(found.top.amplitude)
    assert "no impacts" in found.table()


@pytest.mark.parametrize(
    ("told", "objection"),
    [
        ((0.05, 0.4, "rocking"), None),
        ((0.0, 0.4, "rest"), None),
        ((0.05, 0.6, "rocking"), r"the stroke is 0\.6 rad, above 0\.5"),
        ((0.09, 0.4, "rocking"), r"the block rocks 0\.09 rad, and 0\.08 without the pendulum"),
        ((np.inf, np.inf, "overturned"), "the motion ends overturned"),
    ],
)
def test_objections(told, objection):
    found = objections(*told, 0.5, 0.08)
    if objection is None:
        assert found == ()
    else:
        with pytest.raises(ValueError, match=objection):
            raise ValueError(*found)


def test_bad_input_is_refused():
    with pytest.raises(ValueError, match="`stroke` must be positive, but is 0"):
        check(paper_scene(), None, stroke=0.0)
    with pytest.raises(ValueError, match=r"`rungs` must be of uplift, .* but has guess"):
        check(paper_scene(), None, rungs=("guess",))
    assert RUNGS[0] == "uplift"
    assert RUNGS[-1] == "nonlinear"
