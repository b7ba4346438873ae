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

    # Runs that overturn do not count.
    far = [0.1] * 4, [3.0, 0.0, 0.0, 3.0]
    assert strikes_of(peaks(*far, lost=[0]), HUNG, block, bob) == pytest.approx(1 / 3)
    assert strikes_of(peaks(*far, lost=range(4)), HUNG, block, bob) == 0.0


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


@pytest.mark.parametrize(
    ("hung", "bare", "more", "kind", "numbers"),
    [
        ([0.1] * 20, [0.3] * 20, {}, None, ()),
        ([0.27, 0.29] * 10, [0.3] * 20, {"worth": Worth(at_least=0.05)}, None, ()),
        ([0.27, 0.29] * 10, [0.3] * 20, {}, "too_little_benefit", (1.0 - 0.28 / 0.3, 0.1, 0)),
        ([np.inf] * 8 + [0.0] * 32, [0.5] * 39 + [np.inf], {}, "overturns_more", (8.0, 1.0, 40)),
        ([0.1] * 20, [0.3] * 20, {"strikes": 0.05}, "strikes", (0.05, 0.01, 0)),
        ([0.1] * 20, [0.3] * 20, {"strikes": 0.05, "worth": Worth(strikes=0.05)}, None, ()),
        ([0.1] * 20, [0.3] * 20, {"strikes": np.nan}, None, ()),
        ([0.1, 0.6] * 4, [0.6, 0.1] * 3 + [0.9] * 2, {}, "too_little_benefit", None),
        ([0.01] * 10 + [0.1] * 10, [0.0] * 10 + [0.5] * 10, {}, "rests_less", (0.0, 10.0, 20)),
    ],
)
def test_every_reason_and_its_numbers(hung, bare, more, kind, numbers):
    kinds, reasons = judged(hung, bare, **more)
    assert [k.name for k in kinds] == ([] if kind is None else [kind])
    for reason in reasons:
        if numbers is None:
            assert reason.low <= 0.0 < reason.reference < reason.value, "it may be luck"
        else:
            assert (reason.value, reason.reference, reason.total) == pytest.approx(numbers)


@pytest.mark.parametrize(
    ("e", "k", "friction", "impacts"),
    [
        (None, 0.05, 0.05, "housner"),
        (0.9, 0.0, None, 0.9),
        ("housner", 0.03, 0.03, "housner"),
        (1.0, 0.0, 0.0, 1.0),
    ],
)
def test_models_of_the_losses_have_those_of_the_block_or_as_large_ones(e, k, friction, impacts):
    """A block of friction alone gets Housner's impacts; one of impacts a friction that loses as much as they
    do at a usual tilt; one that loses nothing at impacts no friction."""
    scene = dataclasses.replace(SCENE, block=dataclasses.replace(SCENE.block, restitution=e, friction=k))
    p = scene.parameters()
    friction = float(equivalent_friction(p, p.nu / 3.0)) if friction is None else friction
    found = {name: (m.friction, m.restitution) for name, m in loss_models(scene).items()}
    assert found == {
        "friction": (pytest.approx(friction, rel=1e-12), None),
        "impacts": (0.0, impacts),
        "friction and impacts": (pytest.approx(friction, rel=1e-12), impacts),
    }


def test_a_worse_condition_is_named_and_the_others_are_counted():
    condition = np.arange(40) % 4
    hung = np.array([0.1, 0.25, 0.4, 0.1])[condition] * np.repeat(np.tile([0.98, 1.02], 5), 4)
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
