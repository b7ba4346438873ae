"""`tpd.read_design`: bit for bit, or one sentence on what is missing."""

import dataclasses
import json
import math
import re

import numpy as np
import pytest

import tpd
from tests import designs
from tests.report.conftest import json_text
from tpd.design.as_built import Details, build_of
from tpd.design.design import Design
from tpd.design.harmonic import HarmonicProblem
from tpd.design.reasons import DesignStatus
from tpd.design.stored_design import VERSION, StoredDesign, read_design
from tpd.design.validate import Validation

BLOCK = tpd.Block(
    width=0.1 + 0.2,
    height=1.1 / 0.9,
    mass=100.0 / 3.0,
    restitution="housner",
    cavity_width=0.2 + 1e-16,
    effective_width=1.0 / 1.1,
)
MOTION = tpd.Harmonic(amplitude=0.1 / 7.0, frequency=math.pi)
PENDULUM = tpd.Pendulum(mass=1.0 / 3.0, length=0.1 + 0.2, damping_ratio=0.3 - 0.1)
LIMITS = (tpd.limits.Stroke(1.0 / 3.0), tpd.limits.Clearance(), tpd.limits.Worsening(0.1 + 0.2))
SCENE = tpd.Scene(BLOCK, MOTION, 9.8 + 0.1 / 3.0)
JOB = {
    "block": {k: v for k, v in vars(BLOCK).items() if v is not None},
    "excitation": vars(MOTION),
    "site": {"gravity": SCENE.gravity},
    "space": {"mass_ratio": [0.01, 0.1 + 0.2], "damping_ratio": [0.05, 0.4]},
    "limits": {"stroke": 1.0 / 3.0, "worsening": 0.1 + 0.2, "reserve": False},
    "conditions": {"amplitudes": [0.1 + 0.2]},
    "search": {"seed": 3},
}


@pytest.fixture(scope="module")
def design():
    """A design of numbers that need all their digits."""
    conditions = tpd.Conditions(factors={"frequency": np.array([0.1 + 0.2])}, description=("one",))
    given = {"conditions": conditions, "limits": LIMITS, "risk": tpd.Risk.cvar(1.0 / 3.0)}
    problem = HarmonicProblem.of(SCENE, **given)
    runs = designs.paired([0.1, 0.2, 0.3], [0.3, 0.4, 0.5], design=problem.ratios(PENDULUM))
    found = {
        "design": problem.ratios(PENDULUM),
        "pendulum": PENDULUM,
        "exact": None,
        "over_limit": 0.0,
        "measure": "tilt",
        "reasons": (),
        "status": DesignStatus.recommended,
    }
    found |= {"deciding_runs": runs, "reported_runs": None}
    return Design(problem=problem, status=DesignStatus.recommended, validated=(Validation(**found),))


@pytest.fixture
def damaged(design, tmp_path):
    """Read a report of which one key is changed; a value that is absent takes the key away."""
    whole = json.loads(json_text(design, JOB, Details(build=build_of(design))))

    def read(**changes) -> StoredDesign:
        content = {k: v for k, v in (whole | changes).items() if v is not ...}
        (tmp_path / "design.json").write_text(json.dumps(content))
        return tpd.read_design(tmp_path)

    return read


def test_a_stored_design_is_read_back_unchanged(design, damaged, tmp_path):
    found = damaged()
    for name in ("pendulum", "status"):
        assert getattr(found, name) == getattr(design, name), name
    for name in ("scene", "limits"):
        assert getattr(found.job, name) == getattr(design.problem, name), name
    assert found.job.seed == 3
    assert found.job.space == tpd.DesignSpace(mass_ratio=(0.01, 0.1 + 0.2), damping_ratio=(0.05, 0.4))
    np.testing.assert_array_equal(found.job.conditions.factors["amplitude"], [0.1 + 0.2])
    assert found.content["benefit"]["mean"] == design.benefit.mean
    assert found.content["versions"]["tpd"] == tpd.__version__
    assert found.path == tmp_path / "design.json"
    assert tpd.read_design(str(found.path)).job.scene == design.scene
    assert str(found).splitlines()[0] == "Stored design: recommended"
    assert dataclasses.is_dataclass(found)
    assert damaged(pendulum=None).pendulum is None
    assert damaged(of_an_earlier_time=[1.0]).status == found.status, "what is not read may be there"


@pytest.mark.parametrize(
    ("changes", "sentence"),
    [
        ({"version": 4}, f"must be of version {VERSION}, but is of 4: run the job again"),
        ({"pendulum": ...}, "is not a design: it has no `pendulum`"),
        ({"job": ...}, "is not the design of a report: it has no `job`"),
        ({"status": "good"}, "`status` must be one of recommended, not_to_be_built, tuned_only, too_few"),
        ({"pendulum": [1.0]}, "`pendulum` must be a table, but is [1.0]"),
        (
            {"job": {"limits": {"strokes": 1.0}}},
            "there is no key `strokes` in [limits]; did you mean `stroke`?",
        ),
        ({"job": {"excitation": 1.0}}, "`excitation` must be a table, but is 1.0"),
        ({"job": {"site": {"gravity": 0.0}}}, "[site] `gravity` must be positive and finite, but is 0"),
    ],
)
def test_a_damaged_design_file_is_rejected_in_one_sentence(damaged, changes, sentence):
    with pytest.raises(ValueError, match=re.escape(sentence)) as refusal:
        damaged(**changes)
    assert "design.json" in str(refusal.value)
    assert "\n" not in str(refusal.value)


def test_a_tilde_in_the_path_of_a_design_is_the_home_folder(tmp_path, monkeypatch):
    monkeypatch.setenv("HOME", str(tmp_path))
    for path in ("~/design", "~/design/design.json"):
        with pytest.raises(ValueError, match=f"cannot read {tmp_path}/design"):
            read_design(path)
    with pytest.raises(ValueError, match=r"cannot read xxx.*: File name too long"):
        read_design("x" * 300)
