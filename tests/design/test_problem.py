"""What all problems share: ratios and sizes of a pendulum, the space within a limit on the mass, checks, and
the job that states a problem."""

import dataclasses

import numpy as np
import pytest

import tpd
from tests.designs import RATIOS, SCENE, NoisyProblem, outcomes, with_block
from tpd.design.job import job_of
from tpd.design.optimise import problem_of
from tpd.design.problem import within_mass
from tpd.design.reasons import DesignStatus
from tpd.design.space import check_moves, check_scatter


def test_the_pendulum_of_a_design_has_its_ratios():
    problem = NoisyProblem.of()
    with_it = problem.pendulum(np.array(RATIOS))
    assert with_it == SCENE.pendulum(mass_ratio=0.1, length_ratio=0.6, damping_ratio=0.1)
    np.testing.assert_allclose(problem.ratios(with_it), RATIOS, rtol=1e-15)
    assert problem.inputs["scene"] is SCENE


def test_a_limit_on_the_mass_narrows_the_space():
    space = tpd.DesignSpace()
    found = within_mass(space, SCENE.block, (tpd.limits.Mass(0.8112),))
    np.testing.assert_allclose(found.mass_ratio, (0.01, 0.05))
    assert within_mass(space, SCENE.block, (tpd.limits.Mass(100.0),)) == space
    assert within_mass(space, SCENE.block, ()) is space
    fixed = tpd.DesignSpace(mass_ratio=0.05)
    assert within_mass(fixed, SCENE.block, (tpd.limits.Mass(1.0),)) is fixed
    with pytest.raises(ValueError, match=r"the limit `mass` must be above the smallest .* but is 0\.1 kg"):
        within_mass(space, SCENE.block, (tpd.limits.Mass(0.1),))
    with pytest.raises(ValueError, match=r"the limit `mass` must be above the smallest .* but is 0\.8 kg"):
        within_mass(fixed, SCENE.block, (tpd.limits.Mass(0.8),))


def test_excitations_and_scatter_out_of_range_are_rejected():
    still = dataclasses.replace(SCENE, excitation=tpd.Harmonic(amplitude=0.0, frequency=2.5))
    with pytest.raises(ValueError, match="`amplitude` must be above 0 in a search, but is 0"):
        check_moves(still, tpd.Conditions())
    with pytest.raises(ValueError, match=r"1\.5 m at 2\.5 Hz, whose .* be at most 10 g, but is 37\.7 g"):
        check_moves(SCENE, tpd.Conditions.amplitudes(1.0, 100.0))
    smooth = with_block(SCENE, friction=0.0)
    with pytest.raises(ValueError, match="`friction` cannot vary by a share of itself, because it is 0"):
        check_scatter(smooth, ["friction"])
    with pytest.raises(ValueError, match="`damping` cannot vary"):
        check_scatter(SCENE, ["damping"], tpd.DesignSpace(damping_ratio=0.0))
    with pytest.raises(ValueError, match="`restitution` can vary only if it is a number"):
        check_scatter(SCENE, ["restitution"])


def test_a_problem_keeps_the_job_that_states_it():
    job = job_of({"limits": {"stroke": 0.4}, "search": {"seed": 3}})
    problem = problem_of(job)
    assert problem.job is job
    assert (problem.scene, problem.limits, problem.seed) == (job.scene, job.limits, 3)
    assert problem_of(job.scene, **job.settings).job is None
    assert "job" not in problem.inputs
    for more in ({"seed": 0}, {"conditions": tpd.Conditions()}, {"space": tpd.DesignSpace()}):
        with pytest.raises(ValueError, match=rf"a job states all arguments, but `{min(more)}` is given as"):
            tpd.optimise(job, **more)


def test_the_share_of_runs_over_a_limit_is_unknown_without_surviving_runs():
    problem, fallen = NoisyProblem.of(), outcomes([np.inf] * 4)
    assert np.isnan(problem.over_limit(np.array(RATIOS), fallen)[0])
    assert problem.over_limit(np.array(RATIOS), outcomes([0.1] * 4, [0.1, 0.6, 0.1, 0.1])) == (0.25, "stroke")
    assert NoisyProblem.of(limits=()).over_limit(np.array(RATIOS), fallen) == (0.0, "")


@pytest.mark.parametrize(("reduce", "by"), [("tilt", ", by the mean tilt"), ("overturning", ""), (None, "")])
def test_the_headline_names_the_mean_tilt_where_it_decides(reduce, by):
    problem = NoisyProblem.of(requirements=tpd.limits.Requirements(reduce=reduce))
    head = problem.headline(DesignStatus.recommended, ())
    assert head == (
        f"RECOMMENDED for noise{by}, because the search considered only one excitation and assumed a bob "
        "without size and no walls. This is not a safety assessment."
    )
    assert "by the mean tilt" not in problem.headline(DesignStatus.not_recommended, ("x",))
