"""The job of a design: it asks the same question again, or says in one sentence what a file cannot say."""

import dataclasses
import tomllib

import numpy as np
import pytest

import tpd
from tests import designs
from tpd import limits
from tpd.design.ground.optimise import ground_problem
from tpd.design.job import job_of
from tpd.design.problem import Problem
from tpd.design.reading import job_of_design
from tpd.models.piecewise import Piecewise

SCENE = tpd.Scene(
    tpd.Block(width=0.2, height=0.9, mass=60.0, restitution=0.9, cavity_width=0.15),
    tpd.Harmonic(amplitude=0.03, frequency=2.0),
)
BAND = tpd.Conditions.band(SCENE, 1.5, 2.5, 3) * tpd.Conditions.amplitudes(1.0, 1.5)
CASES = {
    "defaults": {},
    "band": {"conditions": BAND, "risk": tpd.Risk.cvar(0.25), "seed": 4},
    "scatter": {"conditions": BAND * tpd.Conditions.scatter(8, 4, friction=0.1, mass=0.05), "seed": 4},
    "sequential": {"method": tpd.Sequential(searches=3, steps=5), "starts": tpd.Starts.rest()},
    "exact orbits": {"method": tpd.Descent("rmsprop", model=Piecewise(), tolerance=0.02)},
    "limits": {"limits": (limits.Stroke(0.3), limits.Room(tpd.limits.Bob(density=2000.0)), limits.Mass(5.0))},
    "point": {"conditions": tpd.Conditions(), "limits": limits.POINT_BOB},
    "space": {"space": tpd.DesignSpace(mass_ratio=(0.02, 0.1), damping_ratio=(0.1, 0.4))},
    "worth": {
        "worth": limits.Worth(at_least=0.2, strikes=0.05),
        "ensemble": tpd.Ensemble(size=64, ramps=(1.0,)),
    },
}


def answer(**asked):
    """A design with the question of a scene."""
    found = Problem.of(asked.pop("scene", SCENE), **asked)
    fields = {name: getattr(found, name) for name in found.inputs}
    return designs.single(**fields)


@pytest.mark.parametrize("asked", CASES.values(), ids=CASES)
def test_the_job_of_a_design_asks_its_question(asked):
    scene = SCENE
    if "friction" in str(asked.get("conditions", "")):
        scene = tpd.Scene(dataclasses.replace(SCENE.block, friction=0.05), SCENE.motion)
    design = answer(scene=scene, **asked)
    job = job_of_design(design)
    assert job_of(tomllib.loads(job.toml)) == job
    again = answer(scene=job.scene, **job.settings)
    for name in ("scene", "space", "starts", "risk", "limits", "worth", "ensemble", "seed"):
        assert getattr(again, name) == getattr(design, name), name
    assert repr(again.method) == repr(design.method)
    np.testing.assert_array_equal(again.conditions.factor_rows(), design.conditions.factor_rows())


def test_the_job_of_a_design_on_built_in_records_names_them():
    records = [tpd.records.el_centro()]
    held = {"others": [tpd.records.loma_prieta()]}
    conditions = tpd.Conditions.records(records, (2.0, 3.0), intensity="pga")
    given = {"risk": None, "limits": None, "worth": None, "ensemble": None, "seed": 3}
    asked = ground_problem(SCENE, conditions, None, held_out=held, method=tpd.GroundSearch(steps=3), **given)
    job = job_of_design(asked)
    assert job.tables["motion"] == {
        "kind": "records",
        "records": ["el-centro"],
        "scales": [2.0, 3.0],
        "intensity": "pga",
        "held_out": ["loma-prieta"],
    }
    assert (job.space, job.method, job.limits) == (asked.space, asked.method, asked.limits)


@dataclasses.dataclass(frozen=True)
class Own(limits.Limit):
    name = "own"

    def sizes(self, e, g):
        return ()


@pytest.mark.parametrize(
    ("asked", "sentence"),
    [
        ({"limits": (limits.Stroke(), Own())}, "a job file cannot say the limit `own`, which exists only in"),
        (
            {"conditions": tpd.Conditions({"amplitude": np.array([1.0, 1.2])}, ("mine",))},
            "a job file cannot say the conditions of this design: it has bands, amplitudes and scatter, and",
        ),
    ],
)
def test_what_no_file_can_say_is_refused(asked, sentence):
    with pytest.raises(ValueError, match=sentence):
        job_of_design(answer(**asked))


def test_motions_that_exist_only_in_python_are_refused():
    record = tpd.Record(np.sin(np.arange(100) / 5.0), 0.01)
    given = {"risk": None, "limits": None, "worth": None, "ensemble": None, "seed": 0, "method": None}
    conditions = tpd.Conditions.records([record], (2.0,))
    asked = ground_problem(SCENE, conditions, None, held_out=0.0, **given)
    with pytest.raises(ValueError, match="a job file cannot say motions that exist only in Python"):
        job_of_design(asked)
