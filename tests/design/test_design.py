"""The answer: what is offered, what came nearest, and its text."""

import dataclasses

import numpy as np
import pytest

import tpd
from tests.designs import NoisyProblem
from tpd.answers.statistics import Interval, quantile_of
from tpd.design.optimise import solve_problem
from tpd.design.reasons import DesignStatus, Reason, ReasonKind


def test_a_recommended_design_has_a_pendulum_and_its_validation_runs(harmonic):
    best = harmonic.best
    assert best is harmonic.validated[-1]
    assert harmonic.runs is best.reported_runs
    assert harmonic.benefit == best.reported_runs.benefit
    assert harmonic.risks == pytest.approx(best.reported_runs.severity.mean(axis=1))
    np.testing.assert_array_equal(harmonic.nearest, best.design)
    assert (harmonic.refusals, harmonic.best.is_harmful) == ((), False)
    assert len(harmonic.rod_angle) == best.reported_runs.with_pendulum.stands.sum()
    assert 0.0 < harmonic.swing < 0.5 == harmonic.stroke_limit
    lines = str(harmonic).splitlines()
    assert lines[0] == harmonic.verdict
    assert [line.split()[0] for line in lines[1:]] == ["pendulum", "benefit"]


def test_utilisation_is_the_quantile_that_the_allowed_share_of_runs_exceeds(harmonic, ground):
    runs = ground.problem.sizes_in_runs(ground.best.design, ground.best.own_runs)["stroke"]
    assert np.mean(runs > ground.usage["stroke"]) <= ground.problem.allowed
    assert np.mean(runs >= ground.usage["stroke"]) > ground.problem.allowed
    best = harmonic.best
    assert list(harmonic.problem.sizes_in_runs(best.design, best.reported_runs.with_pendulum)) == ["stroke"]
    size = harmonic.problem.fixed_sizes(best.design[None])["reserve"][0]
    assert harmonic.usage["reserve"] == 0.05 / (0.05 * (2.0 - size))


def test_the_best_rejected_design_has_the_smallest_violation(rejected):
    misses = [sum(r.shortfall for r in v.reasons) for v in rejected.validated]
    assert rejected.best is rejected.validated[int(np.argmin(misses))]
    assert rejected.runs is rejected.best.deciding_runs
    assert np.isnan(rejected.risks[0])
    assert rejected.risks[1] == pytest.approx(rejected.runs.severity[1].mean())
    assert (rejected.swing, rejected.equivalent) == (0.0, None)
    assert str(rejected).startswith("NOT RECOMMENDED: the mean tilt falls by ")
    # A design that was rejected before any run comes after those with runs, and a danger weighs its size.
    early = dataclasses.replace(rejected.validated[0], deciding_runs=None, reported_runs=None, reasons=())
    wall = Reason(kind=ReasonKind.touches_wall, limit="clearance", value=1.0, reference=0.01)
    far = dataclasses.replace(rejected.validated[0], reasons=(wall,))
    near = dataclasses.replace(rejected.validated[0])
    shown = dataclasses.replace(rejected, validated=(early, far, near))
    assert shown.best is near
    assert dataclasses.replace(rejected, validated=(far, early)).best.is_harmful


def test_a_design_without_a_pendulum_has_no_numbers():
    found = solve_problem(NoisyProblem.of(calm=True))
    assert (found.pendulum, found.best, found.runs, found.benefit, found.nearest) == (None,) * 5
    assert (found.refusals, found.usage, found.is_danger, found.swing) == ((), {}, False, 0.0)
    assert np.isnan(found.risks).all()
    assert str(found) == found.verdict == found.problem.needless


class Swings(NoisyProblem):
    """In runs of the nonlinear model the bob swings by further 110 %."""

    def trial_runs(self, design, seed, equations="linear"):
        runs, more = super().trial_runs(design, seed, equations), 2.1 if equations == "nonlinear" else 1.0
        return dataclasses.replace(runs, swing=more * runs.swing, settled_swing=more * runs.settled_swing)


def test_a_pendulum_far_beyond_a_limit_is_not_validated():
    """The trials alone keep the limit, and all compared designs exceed it by more than 5 %."""
    found = solve_problem(Swings(**NoisyProblem.of().inputs))
    assert (found.status, found.validated) == (DesignStatus.none_feasible, ())
    assert not found.is_danger
    assert found.verdict.startswith("NOT RECOMMENDED: the design exceeds the limit on stroke: 0.")
    assert found.verdict.endswith(" rad, but at most 0.5 is allowed.")


def test_a_design_without_validation_records_claims_no_benefit(ground):
    tuned = dataclasses.replace(ground, status=DesignStatus.tuned_only)
    assert tuned.pendulum is not None
    assert tuned.benefit is None
    assert isinstance(ground.benefit, Interval)
    few = dataclasses.replace(ground, status=DesignStatus.too_few)
    assert (few.pendulum, few.benefit) == (None, None)
    assert ground.swing == quantile_of(ground.rod_angle, 0.9)


def test_the_arguments_of_a_design_define_an_equal_problem(harmonic, ground):
    space = tpd.DesignSpace(mass_ratio=(0.01, 0.05))
    again = harmonic.problem.inputs | {"space": space}
    assert (again["space"], again["seed"], again["limits"]) == (space, 0, harmonic.problem.limits)
    assert set(harmonic.problem.inputs) - set(ground.problem.inputs) == {"starts", "objective"}
    assert set(ground.problem.inputs) - set(harmonic.problem.inputs) == {"validation_share"}
    assert harmonic.exact_motions == (harmonic.problem.without_pendulum, harmonic.best.exact)
    assert ground.exact_motions == ()


def test_a_rejection_lists_the_inputs_that_could_change_it():
    fixed = tpd.DesignSpace(mass_ratio=(0.01, 0.2), damping_ratio=0.1)
    found = solve_problem(NoisyProblem.of(space=fixed, limits=(tpd.limits.Stroke(0.1),)))
    assert found.pendulum is None
    assert "limit on stroke" in found.remedy
    assert "fixed damping ratio" in found.remedy
    assert found.remedy in str(found)
    assert all(bound in found.remedy for bound in found.at_bounds)
    # A bound is named by its own value, and not by the value of a design near it.
    ends = found.space.ends.ravel().tolist()
    assert all(float(bound.split(", ")[1].split()[0]) in ends for bound in found.at_bounds)
    assert solve_problem(NoisyProblem.of(limits=())).remedy == ""
    assert solve_problem(NoisyProblem.of(calm=True)).remedy == ""
