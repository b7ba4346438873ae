"""What all problems share: ratios and sizes of a pendulum, the space within a limit on the mass, checks, and
the job that poses a problem again."""

import dataclasses
import tomllib

import numpy as np
import pytest

import tpd
from tests.designs import RATIOS, SCENE, NoisyProblem, outcomes, with_block
from tpd import limits
from tpd.design.ground_motion import GroundMotionProblem
from tpd.design.harmonic import HarmonicProblem
from tpd.design.job import job_of
from tpd.design.problem import within_mass
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


ASKED = tpd.Scene(
    tpd.Block(width=0.2, height=0.9, mass=60.0, restitution=0.9, cavity_width=0.15),
    tpd.Harmonic(amplitude=0.03, frequency=2.0),
)
BAND = tpd.Conditions.band(ASKED, 1.5, 2.5, 3) * tpd.Conditions.amplitudes(1.0, 1.5)
CASES = {
    "scatter": {"conditions": BAND * tpd.Conditions.scatter(8, 4, friction=0.1, mass=0.05), "seed": 4},
    "from rest": {"method": tpd.Descent(searches=3, steps=5, model="piecewise"), "starts": tpd.Starts.rest()},
    "limits": {
        "limits": (limits.Stroke(0.3), limits.Clearance(tpd.limits.Bob(density=2000.0)), limits.Mass(5.0))
    },
    "point": {"conditions": tpd.Conditions(), "limits": limits.POINT_BOB},
    "space in SI units": {"space": tpd.DesignSpace(mass=(0.5, 2.0), length=(0.05, 0.3))},
    "requirements": {
        "requirements": limits.Requirements(at_least=0.2, reduce="tilt", wall_contacts=0.05),
        "ensemble": tpd.Ensemble(size=64, growth=(1.0,)),
    },
}


def answer(**asked):
    """Problem of a scene."""
    return HarmonicProblem.of(asked.pop("scene", ASKED), **asked)


@pytest.mark.parametrize("asked", CASES.values(), ids=CASES)
def test_the_job_of_a_design_describes_its_problem(asked):
    scene = ASKED
    if "friction" in str(asked.get("conditions", "")):
        scene = tpd.Scene(dataclasses.replace(ASKED.block, friction=0.05), ASKED.excitation)
    design = answer(scene=scene, **asked)
    job = design.job
    assert job_of(tomllib.loads(job.toml)) == job
    assert job.space.table == design.space.table
    again = answer(scene=job.scene, **job.settings)
    for name in (
        "scene",
        "space",
        "starts",
        "risk",
        "objective",
        "limits",
        "requirements",
        "ensemble",
        "seed",
    ):
        assert getattr(again, name) == getattr(design, name), name
    assert repr(again.method) == repr(design.method)
    np.testing.assert_array_equal(again.conditions.factor_rows(), design.conditions.factor_rows())


@dataclasses.dataclass(frozen=True)
class Own(limits.Limit):
    name = "own"

    def size(self, motion, design, geometry):
        return 0.0


@pytest.mark.parametrize(
    ("asked", "sentence"),
    [
        (
            {"limits": (limits.Stroke(), Own())},
            "a job file cannot describe the limit `own`, which exists only in",
        ),
        ({"method": tpd.Descent(model=tpd.Piecewise())}, "a job file cannot describe the model Piecewise"),
        (
            {"conditions": tpd.Conditions({"amplitude": np.array([1.0, 1.2])}, ("mine",))},
            "a job file cannot describe the conditions of this problem. It allows bands, amplitudes",
        ),
    ],
)
def test_settings_that_a_job_file_cannot_contain_are_rejected(asked, sentence):
    with pytest.raises(ValueError, match=sentence):
        _ = answer(**asked).job


def test_a_job_file_cannot_contain_records_made_in_python():
    record = tpd.Record(np.sin(np.arange(100) / 5.0), 0.01)
    conditions = tpd.Conditions.records([record], (2.0,))
    asked = GroundMotionProblem.of(ASKED, conditions, validation_share=0.0)
    with pytest.raises(ValueError, match="a job file cannot describe motions of Python"):
        _ = asked.job


def test_the_share_of_runs_over_a_limit_is_unknown_without_surviving_runs():
    problem, fallen = NoisyProblem.of(), outcomes([np.inf] * 4)
    assert np.isnan(problem.over_limit(np.array(RATIOS), fallen)[0])
    assert problem.over_limit(np.array(RATIOS), outcomes([0.1] * 4, [0.1, 0.6, 0.1, 0.1])) == (0.25, "stroke")
    assert NoisyProblem.of(limits=()).over_limit(np.array(RATIOS), fallen) == (0.0, "")
