"""Paired runs in the verification: strikes, other models of the losses, and every reason that they give."""

import dataclasses

import numpy as np
import pytest

import tpd
from tests import designs
from tests.answers.test_paired import runs
from tests.design.conftest import BAND, SCENE
from tpd.answers.paired import Verdict, benefit_of
from tpd.design.by_runs import PairedRuns, loss_models, reasons_by_runs, strikes_of
from tpd.design.criteria import Worth
from tpd.design.verified import ReasonKind, Step
from tpd.scene.bob import Bob
from tpd.theory import equivalent_friction

NU = float(SCENE.block.slenderness)
HUNG = tpd.Pendulum(mass=0.5, length=0.1, damping_ratio=0.1)


def peaks(tilt, stroke, lost=()) -> Verdict:
    """Runs with these largest tilts and bob angles (rad); some overturn."""
    tilt, stroke = np.array(tilt, dtype=float), np.array(stroke, dtype=float)
    tilt[list(lost)] = stroke[list(lost)] = np.inf
    found = runs(np.where(np.isinf(tilt), np.inf, 0.1))
    return Verdict(hung=dataclasses.replace(found, peak=tilt, peak_stroke=stroke), bare=found)


def test_a_bob_strikes_where_the_sum_of_both_angles_reaches_a_wall():
    bob, block = Bob(), SCENE.block
    room = 0.5 * block.width - float(bob.radius(HUNG.mass))
    angle = np.arcsin(room / HUNG.length)
    found = peaks([0.1, 0.1, 0.1, 0.0], [angle - 0.101, angle - 0.099, 0.0, angle + 1e-6])
    assert strikes_of(found, HUNG, block, bob) == 0.5
    narrow = dataclasses.replace(block, cavity_width=0.08)
    assert strikes_of(found, HUNG, narrow, bob) == 0.75
    assert strikes_of(found, HUNG, block, Bob(shape="cylinder", density=1000.0, aspect=0.2)) > 0.5


def test_runs_that_overturn_do_not_count_as_strikes():
    far = [0.1] * 4, [3.0, 0.0, 0.0, 3.0]
    assert strikes_of(peaks(*far, lost=[0]), HUNG, SCENE.block, Bob()) == pytest.approx(1 / 3)
    assert strikes_of(peaks(*far, lost=range(4)), HUNG, SCENE.block, Bob()) == 0.0


@pytest.mark.mends("a verdict hung on runs without an answer, which counted as overturned or as standing")
def test_a_verdict_that_hangs_on_runs_without_an_answer_is_refused():
    """Forty pairs show a benefit; ten more have no answer, and the block might overturn in all of them."""
    kinds, reasons = judged([0.1] * 40 + [np.nan] * 10, [0.3] * 50)
    assert [kind.name for kind in kinds] == ["undecided"]
    assert str(reasons[0]) == (
        "by the paired runs of the nonlinear equations 10 of 50 cases have no answer, and the verdict hangs "
        "on it"
    )
    # One such run changes no verdict, whichever way it ends, and neither do ten beside a refusal.
    assert judged([0.1] * 49 + [np.nan], [0.3] * 50, strikes=np.nan)[0] == ()
    kinds, _ = judged([0.5] * 190 + [np.nan] * 10, [0.3] * 200)
    assert ReasonKind.undecided not in kinds
    assert ReasonKind.too_little_benefit in kinds


def test_a_run_without_an_answer_strikes_nothing_but_might_have():
    far = peaks([0.1] * 4, [3.0, 0.0, 0.0, 3.0])
    unknown = dataclasses.replace(far.hung, status=np.array(["event_bound", "rocking", "rocking", "rocking"]))
    assert strikes_of(Verdict(hung=unknown, bare=far.bare), HUNG, SCENE.block, Bob()) == pytest.approx(1 / 3)
    kinds, _ = judged([0.1] * 49 + [np.nan], [0.3] * 50, strikes=0.0)
    assert kinds == (ReasonKind.undecided,)


def test_models_of_the_losses_of_a_block_with_friction():
    """A block of friction alone gets Housner's impacts beside it."""
    models = loss_models(SCENE)
    friction, impacts, both = models.values()
    assert list(models) == ["friction", "impacts", "friction and impacts"]
    k = SCENE.block.friction
    assert (friction.friction, friction.restitution) == (k, None)
    assert (impacts.friction, impacts.restitution) == (0.0, "housner")
    assert (both.friction, both.restitution) == (k, "housner")
    assert friction == SCENE.block


@pytest.mark.parametrize("e", [0.9, "housner"])
def test_models_of_the_losses_of_a_block_with_impacts(e):
    """A friction that loses as much as the impacts at a usual tilt."""
    block = dataclasses.replace(SCENE.block, restitution=e, friction=0.0)
    scene = dataclasses.replace(SCENE, block=block)
    models = loss_models(scene)
    p = scene.parameters()
    k = float(equivalent_friction(p, p.nu / 3.0))
    assert k > 0.0
    assert models["friction"].friction == pytest.approx(k, rel=1e-12)
    assert models["friction"].restitution is None
    assert (models["impacts"].friction, models["impacts"].restitution) == (0.0, e)
    assert models["friction and impacts"].friction == pytest.approx(k, rel=1e-12)
    assert models["friction and impacts"].restitution == e
    with_both = dataclasses.replace(block, friction=0.03)
    models = loss_models(dataclasses.replace(SCENE, block=with_both))
    assert {m.friction for m in models.values()} == {0.03, 0.0}


def test_a_block_that_loses_nothing_at_impacts_keeps_its_friction():
    block = dataclasses.replace(SCENE.block, restitution=1.0, friction=0.0)
    models = loss_models(dataclasses.replace(SCENE, block=block))
    assert [m.friction for m in models.values()] == [0.0, 0.0, 0.0]


def judged(hung, bare, worth=None, condition=None, strikes=0.0):
    """Kinds of the reasons against runs of these settled tilts over nu, and the reasons."""
    worth = Worth() if worth is None else worth
    condition = np.zeros(len(hung), int) if condition is None else condition
    found = Verdict(hung=runs(hung), bare=runs(bare))
    gain = benefit_of(found, NU, condition, worth.worse)
    v = designs.verified(paired=found, benefit=gain, strikes=strikes)
    reasons = reasons_by_runs(v, worth, BAND)
    assert all(reason.step is Step.benefit and str(reason) for reason in reasons)
    return tuple(reason.kind for reason in reasons), reasons


def test_a_design_that_helps_has_no_reason_against_it():
    assert judged([0.1] * 20, [0.3] * 20)[0] == ()
    assert judged([0.28] * 20, [0.3] * 20, Worth(at_least=0.05))[0] == ()


def test_too_little_benefit():
    kinds, (reason,) = judged([0.28] * 20, [0.3] * 20)
    assert kinds == (ReasonKind.too_little_benefit,)
    assert reason.value == pytest.approx(1.0 - 0.28 / 0.3)
    assert (reason.reference, reason.low) == (0.1, pytest.approx(reason.value))


def test_a_benefit_that_may_be_luck_is_too_little():
    rng = np.random.default_rng(0)
    bare = rng.uniform(0.1, 0.9, 8)
    kinds, (reason,) = judged(rng.permutation(0.8 * bare), bare)
    assert kinds == (ReasonKind.too_little_benefit,)
    assert reason.value > 0.1
    assert reason.low <= 0.0


def test_more_runs_that_overturn():
    kinds, reasons = judged([np.inf] * 8 + [0.0] * 32, [0.5] * 39 + [np.inf])
    assert kinds == (ReasonKind.overturns_more,)
    assert (reasons[0].value, reasons[0].reference, reasons[0].total) == (8.0, 1.0, 40)


def test_strikes():
    kinds, reasons = judged([0.1] * 20, [0.3] * 20, strikes=0.05)
    assert kinds == (ReasonKind.strikes,)
    assert (reasons[0].value, reasons[0].reference) == (0.05, 0.01)
    assert judged([0.1] * 20, [0.3] * 20, Worth(strikes=0.05), strikes=0.05)[0] == ()
    assert judged([0.1] * 20, [0.3] * 20, strikes=np.nan)[0] == (), "no room is asked for"


def test_fewer_runs_at_rest():
    kinds, reasons = judged([0.01] * 10 + [0.1] * 10, [0.0] * 10 + [0.5] * 10)
    assert kinds == (ReasonKind.rests_less,)
    assert (reasons[0].value, reasons[0].reference, reasons[0].total) == (0.0, 10.0, 20)


def test_a_worse_condition_is_named_and_the_others_are_counted():
    condition = np.arange(40) % 4
    hung = np.array([0.1, 0.25, 0.4, 0.1])[condition]
    bare = np.array([0.5, 0.2, 0.3, 0.5])[condition]
    kinds, (reason,) = judged(hung, bare, condition=condition)
    assert kinds == (ReasonKind.worse_condition,)
    assert reason.condition == BAND.label(2)
    assert (reason.value, reason.reference) == (pytest.approx(0.4), pytest.approx(0.3))
    assert reason.total == 2
    assert judged(hung, bare, Worth(worse=0.4), condition)[0] == ()


def test_runs_are_those_of_the_nonlinear_equations_and_the_bare_block_is_followed_once():
    events, conditions = [], tpd.Conditions.band(SCENE, 2.4, 2.6, 2)
    ensemble, worth = tpd.Ensemble(size=64, periods=20, seed=3), Worth(runs=12)
    made = PairedRuns(SCENE, conditions, ensemble, worth, lambda *e: events.append(e))
    found, gain = made.of(HUNG)
    assert found.equations == "nonlinear"
    assert len(found.hung.status) == gain.runs == 12
    alone = tpd.verdict(SCENE, HUNG, ensemble=made.ensemble, conditions=conditions, equations="nonlinear")
    np.testing.assert_array_equal(alone.hung.amplitude, found.hung.amplitude)
    np.testing.assert_array_equal(alone.bare.amplitude, found.bare.amplitude)
    assert made.of(HUNG)[0].bare is found.bare
    assert {stage for stage, *_ in events} == {"paired runs"}
    assert len(gain.by_condition[0]) == 2


def test_other_losses_are_answered_by_runs_of_their_own_scenes():
    made = PairedRuns(SCENE, tpd.Conditions(), tpd.Ensemble(size=8, periods=20), Worth(), None)
    cases = made.under_other_losses(HUNG)
    assert [case.name for case in cases] == ["friction", "impacts", "friction and impacts"]
    assert [case.velocity_ratio < 1.0 for case in cases] == [False, True, True]
    assert [case.friction for case in cases] == [SCENE.block.friction, 0.0, SCENE.block.friction]
    # The first is the scene itself.
    assert cases[0].benefit.value == made.of(HUNG)[1].value
    assert cases[0].benefit.value != cases[1].benefit.value
