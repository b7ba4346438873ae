"""The verification: every step's reasons, from motions that are given to it, and the order of designs."""

import copy
import dataclasses
from types import SimpleNamespace

import numpy as np
import pytest
from tpd.design.by_runs import JUDGES
from tpd.design.result import DesignStatus
from tpd.design.survey import ON_THE_WAY, Survey
from tpd.design.verified import Reason, ReasonKind, Step
from tpd.design.verify import Verification, motions_from_rest, nearest_of, polished

import tpd
from tests import designs as designs_by_hand
from tests.design.conftest import ANY_WORTH, BAND, FEW_STEPS, SCENE
from tests.design.test_orbits import GOOD, orbits
from tpd.answers.ensemble import outcomes
from tpd.design import optimise, verify
from tpd.design.problem import Problem
from tpd.scene.parameters import as_arrays
from tpd.scene.status import SETTLED

RUNS = tpd.Ensemble(size=16, periods=30, seed=0)
ALONE = tpd.Conditions()
LIGHT = np.array([0.01, 0.26, 0.35])
RATIOS = "mass_ratio", "length_ratio", "damping_ratio"


def problem(objective) -> Problem:
    """Question with the objective of a search."""
    asked = {"conditions": objective.conditions, "limits": objective.limits}
    return Problem.of(SCENE, objective.space, method=FEW_STEPS, ensemble=RUNS, worth=ANY_WORTH, **asked)


def verification(objective) -> Verification:
    return Verification(problem(objective), None)


class Refusing(Verification):
    """Refuses the first designs that come to the paired runs, and no other there."""

    refusals = 1

    def by_runs(self, v):
        found = Reason(step=Step.benefit, kind=ReasonKind.too_little_benefit)
        refused = len(self.verified) < self.refusals
        return dataclasses.replace(super().by_runs(v), reasons=(found,) if refused else ())


@pytest.fixture(scope="module")
def judged(search):
    """A verification that refuses the best end of a search, and what it says to that and to other designs."""
    stern = Refusing(problem(search[0]), None)
    stern.verified.append(stern.at_once(search[1].confirmed[0]))
    met = np.concatenate([search[1].confirmed, search[1].passed[:8]])
    return stern, stern.best_of_survey(surveyed(met, np.linspace(0.1, 0.2, len(met))))


@pytest.fixture(scope="module")
def alone():
    """Verification under one condition, with a limit on the stroke."""
    return verification(orbits(conditions=ALONE, limits=(tpd.limits.Stroke(0.5),)))


@pytest.fixture(scope="module")
def v(judged):
    """Design that passed, under the band of frequencies."""
    return judged[0].verified[-1]


def with_exact(v, **changed):
    return dataclasses.replace(v, exact=dataclasses.replace(v.exact, **changed), reasons=())


def test_after_a_refusal_other_designs_are_verified(judged, search):
    stern, status = judged
    best, *others = stern.verified
    winner = others[-1]
    assert status is DesignStatus.found
    assert best.value == pytest.approx(search[1].end_values.min(), rel=1e-9)
    assert best.reasons[0].step is Step.benefit
    assert winner.reasons == ()
    assert best.value < winner.value < stern.bare.value
    assert len({tuple(x.design) for x in stern.verified}) == len(others) + 1
    assert best.paired.bare is winner.paired.bare is stern.bare.paired
    assert best.benefit.runs == RUNS.size
    assert np.isnan(best.strikes), "there is no limit on the room"
    assert len(winner.rest.bare) == len(BAND)


@pytest.mark.parametrize(("lost", "of", "refused"), [(8, 8, True), (2, 8, False), (1, 1, True)])
def test_more_overturnings_from_rest_speak_against_a_design(v, alone, lost, of, refused):
    checked = copy.copy(alone)
    exact = dataclasses.replace(checked.bare.exact, status=np.full(of, "rocking"))
    checked.bare = dataclasses.replace(checked.bare, exact=exact)
    falls = np.array(["overturned"] * lost + ["rocking"] * (of - lost))
    reasons = checked.by_events(with_exact(v, status=falls)).reasons
    more = {"value": float(lost), "reference": 0.0, "total": of}
    assert reasons == ((Reason(step=Step.exact, kind=ReasonKind.overturns_more, **more),) if refused else ())


def by_rest(checked, v, severity, bare, monkeypatch, stroke=-0.5, **excess):
    """Reasons against a design with these motions from rest."""
    found = surveyed([v.design], [severity], bare=bare, stroke=stroke, **excess)
    monkeypatch.setattr(verify, "followed", lambda *_, **how: found if how["rtol"] < 1e-7 else None)
    met = checked.by_rest(v)
    assert met.rest is found
    assert all(reason.step is Step.nonlinear for reason in met.reasons)
    return met.reasons


def test_of_several_conditions_single_motions_decide_on_limits_only(judged, v, monkeypatch):
    stern, lost = judged[0], ([1.0, 0.1, 1.0], [0.1, 0.1, 1.0])
    assert by_rest(stern, v, *lost, monkeypatch) == (), "the paired runs count"
    (reason,) = by_rest(stern, v, *lost, monkeypatch, stroke=0.2)
    assert (reason.kind, reason.limit) == (ReasonKind.breaks_limit, "stroke")
    assert reason.value == pytest.approx(1.2)
    assert by_rest(stern, v, *lost, monkeypatch, stroke=1e-12, reserve=0.5) == (), "rounding, and no motion"


def test_under_one_condition_the_block_must_rock_less(alone, v, monkeypatch):
    cases = {
        (0.01, 0.08, -0.5): [],
        (0.0, 0.0, -0.5): [],
        (0.08, 0.08, -0.5): ["rocks_more"],
        (1.0, 0.08, -0.5): ["overturns"],
        (1.0, 1.0, -0.5): ["rocks_more"],
        (0.09, 0.08, 0.2): ["breaks_limit", "rocks_more"],
    }
    for (hung, bare, stroke), kinds in cases.items():
        reasons = by_rest(alone, v, [hung], [bare], monkeypatch, stroke)
        assert [reason.kind.name for reason in reasons] == kinds


def test_the_room_is_asked_for_from_rest_as_well(v):
    room = verification(orbits(limits=(tpd.limits.Offset(0.02), tpd.limits.Room())))
    heavy = dataclasses.replace(v, **dict(zip(RATIOS, GOOD[0], strict=True)))
    assert {reason.limit for reason in room.by_rest(heavy).reasons} >= {"offset", "room", "thickness"}
    light = dict(zip(RATIOS, LIGHT, strict=True))
    assert "thickness" not in [r.limit for r in room.by_rest(dataclasses.replace(v, **light)).reasons]


def test_of_many_conditions_a_choice_is_followed_from_rest_and_calm_ones_need_no_pendulum(base):
    wide = verification(orbits(conditions=tpd.Conditions.band(SCENE, 2.0, 3.5, 30)))
    assert (len(wide.few.conditions), len(wide.objective.conditions)) == (24, 30)
    # The shaking is below the friction: no orbit attracts either.
    calm = verification(orbits(conditions=tpd.Conditions.amplitudes(0.03, 0.06)))
    assert calm.bare_rests
    assert not base.bare_rests


def surveyed(designs, severity, bare=(0.5, 0.5, 0.5, 0.5, 0.5), stroke=-0.5, **excess) -> Survey:
    """Designs of a severity each, or one under every condition."""
    ones = np.ones((len(designs), len(bare)))
    excess = {name: x * ones[:, 0] for name, x in {"stroke": stroke, **excess}.items()}
    severity = np.array(severity).reshape(len(designs), -1) * ones
    found = {"designs": np.array(designs), "severity": severity, "bare": np.array(bare)}
    return Survey(**found, excess=excess, equations="nonlinear")


SPREAD = [[0.05 + 0.03 * i, 0.2 + 0.2 * i, 0.1 + 0.05 * i] for i in range(4)]


class Scripted(Verification):
    """Refuses the first designs by a reason of a kind, without following them, and the first that fresh runs
    judge."""

    def at_once(self, design):
        reason = Reason(step=Step.benefit, kind=self.kind)
        ratios = dict(zip(RATIOS, design.tolist(), strict=True))
        refused = len(self.verified) < self.refusals
        return designs_by_hand.verified(**ratios, reasons=(reason,) if refused else ())

    def by_fresh_runs(self, v):
        reason = Reason(step=Step.benefit, kind=ReasonKind.too_little_benefit)
        reasons = (reason,) if len(self.verified) <= self.unlucky else ()
        return dataclasses.replace(v, chosen_by=v.benefit, reasons=reasons)


@pytest.fixture(scope="module")
def base(search):
    return verification(search[0])


def scripted(base, refusals=0, kind=ReasonKind.too_little_benefit, unlucky=0) -> Scripted:
    made = Scripted.__new__(Scripted)
    vars(made).update(vars(base), verified=[], refusals=refusals, kind=kind, unlucky=unlucky)
    return made


def test_the_designs_of_a_survey_are_verified_until_one_passes(base):
    stern = scripted(base, 1)
    assert stern.best_of_survey(surveyed(SPREAD, [0.1, 0.2, 0.3, 0.4])) is DesignStatus.found
    assert [v.design.tolist() for v in stern.verified] == [pytest.approx(x) for x in SPREAD[:2]]
    assert {v.source for v in stern.verified} == {"survey"}
    stern = scripted(base, 100)
    many = [[0.02 + 0.01 * i, 0.2 + 0.1 * i, 0.1] for i in range(12)]
    assert stern.best_of_survey(surveyed(many, [0.1] * 12)) is DesignStatus.refused
    assert len(stern.verified) == verify.VERIFIED
    # Neighbours of a refused design are passed over.
    stern, near = scripted(base, 100), [SPREAD[0], [x + 1e-4 for x in SPREAD[0]], SPREAD[1]]
    stern.best_of_survey(surveyed(near, [0.1, 0.15, 0.2]))
    assert [v.mass_ratio for v in stern.verified] == [SPREAD[0][0], SPREAD[1][0]]


def test_what_a_verification_finds_orders_what_is_verified_next(base):
    """The surfaces through the trials learn of the runs that refused a design."""
    stern, met = scripted(base, 1, ReasonKind.strikes), []
    found = surveyed(SPREAD, [0.1, 0.2, 0.3, 0.4])

    def add(some, tried):
        met.append((some.designs.tolist(), tried[0].severity))

    def order(of):
        assert of is found
        return np.array([0, 3, 1, 2] if met else [0, 1, 2, 3])

    stern.refinement = SimpleNamespace(add=add, order=order, sure=0.5)
    assert stern.best_of_survey(found) is DesignStatus.found
    assert [v.design.tolist() for v in stern.verified] == [pytest.approx(SPREAD[i]) for i in (0, 3)]
    ((designs, severity),) = met
    assert designs == [SPREAD[0]]
    assert 0.0 < severity < 1.0
    assert stern.refinement.sure == pytest.approx(0.7), "the next must be surer"


@pytest.mark.parametrize(
    ("room", "second"), [([-0.1, -0.105, -0.13, -0.2], 2), ([-0.1, -0.1, -0.1, -0.11], 1)]
)
def test_after_strikes_in_the_runs_that_judge_the_next_keeps_further_from_the_walls(base, room, second):
    stern = scripted(base, 0)
    found = surveyed(SPREAD, [0.1, 0.2, 0.3, 0.4], **{ON_THE_WAY: room})
    stern.best_of_survey(found)
    struck = {"strikes": 0.02, "chosen_by": stern.verified[0].benefit}
    stern.verified[0] = dataclasses.replace(stern.verified[0], **struck)
    assert stern.best_of_survey(found) is DesignStatus.found
    assert [v.design.tolist() for v in stern.verified] == [pytest.approx(SPREAD[i]) for i in (0, second)]


@pytest.mark.parametrize("case", [(0, 1, "found"), (2, 3, "found"), (9, 3, "refused")])
def test_after_a_refusal_by_fresh_runs_up_to_two_more_are_judged(base, search, monkeypatch, case):
    unlucky, count, status = case
    stern = scripted(base, unlucky=unlucky)
    stern.fresh = SimpleNamespace(under_other_losses=lambda pendulum: ())
    both = (surveyed(SPREAD, [0.1, 0.2, 0.3, 0.4]),) * 2
    monkeypatch.setattr(verify, "refine", lambda found, *_: (found, None))
    monkeypatch.setattr(optimise, "survey", lambda *_: both)
    found = optimise.Found(stern, search[1])
    optimise._verify(problem(search[0]), found, None)
    assert found.status.name == status
    assert [v.mass_ratio for v in stern.verified] == [pytest.approx(x[0]) for x in SPREAD[:count]]
    assert [bool(v.reasons) for v in stern.verified] == [i < unlucky for i in range(count)]
    assert len(found.surveys) == 2


def test_trial_runs_are_those_of_no_other_step(base, monkeypatch):
    """Each design has seeds of its own, and an order of the conditions."""
    asked, shares = [], []

    def scripted(found, space, run, still, follow, strikes, rests, seed, progress):
        for i in range(3):
            tried = run(found.designs[0], i)
            assert 0.0 <= tried.severity <= 1.0
            assert len(tried.reach) == 0, "without walls"
        assert still(found.designs).tolist() == [False, True, True, True], "too little reserve"
        assert follow(found.designs[:1]).equations == "nonlinear"
        assert strikes == ANY_WORTH.allowed
        assert rests == pytest.approx(0.9 * shares[0])
        return found, None

    def counted(scene, pendulum=None, *, ensemble, conditions, equations):
        found = outcomes(scene, pendulum, ensemble=ensemble, conditions=conditions, equations=equations)
        size = RUNS.size if pendulum else 8 * RUNS.size
        assert (equations, ensemble.periods, ensemble.size) == ("nonlinear", RUNS.periods, size)
        if pendulum is None:
            shares.append(found.at_rest.value)
        else:
            asked.append((ensemble.seed, tuple(conditions.factors["frequency"])))
        return found

    helps = surveyed(SPREAD, [0.1, 0.2, 0.3, 0.4])
    for name, value in (("refine", scripted), ("outcomes", counted), ("_FEW", -1)):
        monkeypatch.setattr(verify, name, value)
    base.refined(helps)
    seeds, orders = zip(*asked, strict=True)
    assert len({*seeds, RUNS.seed, RUNS.seed + JUDGES}) == 5
    assert {tuple(sorted(order)) for order in orders} == {tuple(sorted(BAND.factors["frequency"]))}
    assert len(set(orders)) > 1
    monkeypatch.setattr(verify, "_FEW", 128)
    monkeypatch.setattr(verify, "refine", lambda *args: (asked.append(args[6]) or args[0], None))
    base.refined(helps)
    assert asked.pop() == 0.0, "of a few runs that rest no trial has any"
    none = surveyed(SPREAD, [0.9, 0.9, 0.9, 0.9])
    assert base.refined(none) is none, "no run where nothing helps"


def test_a_design_of_a_survey_keeps_to_limits_that_no_motion_from_rest_shows(base, search):
    made = scripted(base, 100)
    # The reserve is at most about one, so that no rocking design has twenty of it.
    limits = (tpd.limits.Stroke(1.5), tpd.limits.Reserve(20.0))
    made.objective = dataclasses.replace(search[0], limits=limits)
    e = made.objective.evaluate(np.array(SPREAD[:1]))
    (reason,) = made._broken_in_closed_form(e)
    assert (reason.step, reason.kind, reason.limit) == (Step.exact, ReasonKind.breaks_limit, "reserve")
    made.objective = dataclasses.replace(search[0], limits=(tpd.limits.Stroke(1e-3),))
    assert made._broken_in_closed_form(e) == [], "motions from rest are asked about the stroke elsewhere"


@pytest.mark.mends("the status was 'none rocks less' where the verified design was refused for its strikes")
def test_where_no_design_of_a_survey_helps_the_best_one_says_why(base):
    stern = scripted(base, 100, ReasonKind.strikes)
    found = surveyed(SPREAD[:2], [0.6, 0.7])
    assert stern.best_of_survey(found) is DesignStatus.refused
    assert [reason.kind for reason in stern.verified[0].reasons] == [ReasonKind.strikes]
    assert len(stern.verified) == 1


@pytest.mark.mends("a rod as long as the block was offered with its bob below the floor")
def test_the_bob_hangs_above_the_floor(search):
    made = verification(orbits(limits=(tpd.limits.Room(),)))
    long, short = np.array([0.05, 1.95, 0.2]), np.array([0.05, 1.0, 0.2])
    for design, broken in ((long, ["rod and bob within the height"]), (short, [])):
        known = {"exact": made.bare.exact, "evaluation": made.objective.evaluate(design[None])}
        given = designs_by_hand.verified(**dict(zip(RATIOS, design, strict=True)), **known)
        reasons = made.by_events(given).reasons
        assert [r.limit for r in reasons if r.limit.startswith("rod")] == broken


def test_where_no_design_keeps_to_the_limits_none_is_verified_and_the_nearest_is_told(base, search):
    stern = scripted(base)
    found = surveyed(SPREAD[:2], [0.1, 0.1], **{ON_THE_WAY: [0.1, 0.2]})
    found.excess["stroke"][0] = 0.3
    assert stern.best_of_survey(found) is DesignStatus.none_feasible
    assert stern.verified == []
    best = nearest_of(found)
    assert best.design.tolist() == SPREAD[0]
    assert {(r.step, r.kind) for r in best.broken} == {(Step.nonlinear, ReasonKind.breaks_limit)}
    assert [r.limit for r in best.broken] == ["stroke", ON_THE_WAY], "the largest excess comes first"
    assert [r.value for r in best.broken] == [pytest.approx(1.3), pytest.approx(1.1)]


P = as_arrays(SCENE.parameters())


@pytest.fixture(scope="module")
def motions():
    return motions_from_rest(P, GOOD[0], BAND, 100)


def test_motions_are_those_of_the_steady_state(motions):
    sharp = polished(P, GOOD[0], BAND, motions)
    for i, factor in enumerate(BAND.column("frequency")):
        motion = dataclasses.replace(SCENE.motion, frequency=SCENE.motion.frequency * factor)
        scene = dataclasses.replace(SCENE, motion=motion)
        hung = scene.pendulum(mass_ratio=GOOD[0, 0], length_ratio=GOOD[0, 1], damping_ratio=GOOD[0, 2])
        s = tpd.steady_state(scene.parameters(hung))
        assert sharp.status[i] == tpd.status_name(s.status)
        assert sharp.amplitude[i] == pytest.approx(float(s.amplitude), rel=1e-12)
        assert sharp.stroke[i] == pytest.approx(float(s.stroke), rel=1e-12)
        assert sharp.multiplier[i] == pytest.approx(float(s.multiplier), rel=1e-9, nan_ok=True)
    settled = np.isin(sharp.status, SETTLED)
    np.testing.assert_allclose(motions.amplitude[settled], sharp.amplitude[settled], rtol=1e-4)
    assert np.all(motions.peak >= 0.999 * motions.amplitude)
    assert np.isnan(motions.multiplier).all()
    many = tpd.Conditions.scatter(33, friction=0.1)
    assert polished(P, GOOD[0], many, motions) is motions, "of too many conditions none is"


def test_an_overturning_block_has_no_amplitude():
    hard = tpd.Conditions.amplitudes(1.0, 6.0)
    motions = motions_from_rest(P, np.array([0.0, 0.3, 0.1]), hard, 100)
    for m in (motions, polished(P, np.array([0.0, 0.3, 0.1]), hard, motions)):
        assert m.status.tolist() == ["rocking", "overturned"]
        assert m.amplitude[0] == pytest.approx(0.0833335, abs=1e-4)
        assert m.amplitude[1] == m.stroke[1] == m.peak[1] == np.inf
