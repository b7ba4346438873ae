"""`tpd.Design.read`: all inputs and the pendulum bit for bit, and one sentence for a file that is damaged."""

import dataclasses
import json
import math
import re

import numpy as np
import pytest

import tpd
from tests import designs
from tpd.design.reading import StoredDesign
from tpd.report.json import as_json

BLOCK = tpd.Block(
    width=0.1 + 0.2, height=1.1 / 0.9, mass=100.0 / 3.0, restitution="housner", cavity_width=0.2 + 1e-16
)
MOTION = tpd.Harmonic(amplitude=0.1 / 7.0, frequency=math.pi)
HUNG = tpd.Pendulum(mass=1.0 / 3.0, length=0.1 + 0.2, damping_ratio=0.3 - 0.1)
LIMITS = (tpd.limits.Stroke(1.0 / 3.0), tpd.limits.Room(), tpd.limits.Worsening(0.1 + 0.2))
SCENE = tpd.Scene(BLOCK, MOTION, 9.8 + 0.1 / 3.0)
JOB = {
    "block": {k: v for k, v in vars(BLOCK).items() if v is not None},
    "motion": vars(MOTION),
    "site": {"gravity": SCENE.gravity},
    "space": {"mass_ratio": [0.01, 0.1 + 0.2], "damping_ratio": [0.05, 0.4]},
}


@pytest.fixture(scope="module")
def design():
    """A design of numbers that need all their digits."""
    factors = {"frequency": np.array([0.1 + 0.2])}
    conditions = tpd.Conditions(factors=factors, description=("one",))
    changes = {"scene": SCENE, "limits": LIMITS, "pendulum": HUNG, "risk": tpd.Risk.cvar(1.0 / 3.0)}
    return designs.single(conditions=conditions, **changes)


@pytest.fixture
def damaged(design, tmp_path):
    """Read a report of which one key is changed; a value that is absent takes the key away."""
    whole = json.loads(as_json(design, designs.study(), JOB))

    def read(**changes) -> StoredDesign:
        content = {k: v for k, v in (whole | changes).items() if v is not ...}
        (tmp_path / "design.json").write_text(json.dumps(content))
        return tpd.Design.read(tmp_path)

    return read


def test_what_is_read_is_what_was_written(design, damaged, tmp_path):
    found = damaged()
    for name in ("scene", "pendulum", "limits", "risk", "status", "seed", "stroke", "amplitude"):
        assert getattr(found, name) == getattr(design, name), name
    assert found.worth == dataclasses.replace(design.worth, strikes=0.01)
    assert found.amplitude_without == design.amplitude_without
    assert found.space == tpd.DesignSpace(mass_ratio=(0.01, 0.1 + 0.2), damping_ratio=(0.05, 0.4))
    np.testing.assert_array_equal(found.conditions.factors["frequency"], [0.1 + 0.2])
    assert found.conditions.description == ("one",)
    assert found.versions["tpd"] == tpd.__version__
    assert found.content["search"]["evaluations"] == design.search.evaluations
    assert found.path == tmp_path / "design.json"
    assert tpd.Design.read(str(found.path)).scene == design.scene
    assert str(found).splitlines()[0] == "Stored design: found"
    assert dataclasses.is_dataclass(found)


def test_infinite_amplitudes_and_no_pendulum_are_read(damaged):
    found = damaged(amplitude_rad="infinite", stroke_rad="nan", pendulum=None)
    assert found.amplitude == math.inf
    assert math.isnan(found.stroke)
    assert found.pendulum is None


@pytest.mark.parametrize(
    ("changes", "sentence"),
    [
        ({"version": 4}, "must be of version 7, but is of 4: run the job again"),
        ({"job": ...}, "is not a design: it has no `job` and `pendulum`"),
        ({"worth": ...}, "is not the design of a report: it has no `worth`"),
        ({"seed": "3"}, "`seed` must be a whole number, but is '3'"),
        ({"seed": True}, "`seed` must be a whole number, but is True"),
        ({"status": "good"}, "`status` must be one of found, tuned_only, too_few"),
        (
            {"amplitude_rad": "large"},
            '`amplitude_rad` must be a number, "infinite" or "nan", but is \'large\'',
        ),
        ({"pendulum": {"mass": 1.0, "length": -1.0, "damping_ratio": 0.1}}, "`length` must be positive"),
        ({"pendulum": [1.0]}, "`pendulum` must be a table, but is [1.0]"),
        ({"limits": {"strokes": 1.0}}, "`limits` has an unknown key `strokes`; allowed are stroke"),
        ({"limits": {"stroke": 3.0}}, "[limits.stroke] `stroke` must be at most 1.5708"),
        ({"limits": {"room": {"shape": "cube"}}}, "[limits.room] `shape` must be one of ball, cylinder"),
        ({"worth": {"at_least": 2.0}}, "[worth] `at_least` must be between 0 and 1, but is 2"),
        ({"risk": {"name": "worst"}}, "`risk` must have share, name, but has name"),
        ({"conditions": {"description": []}}, "it has no `conditions.factors`"),
        ({"conditions": {"factors": {}, "description": "one"}}, "`conditions.description` must be a list"),
        ({"job": {"block": {"widht": 1.0}}}, "`job.block` has an unknown key `widht`; allowed are width"),
        ({"job": {"block": {"width": -1.0}}}, "[job.block] `width` must be positive and finite, but is -1"),
        ({"job": {"motion": 1.0}}, "`job.motion` must be a table, but is 1.0"),
        ({"job": {"site": {"gravity": 0.0}}}, "`gravity` must be positive and finite, but is 0"),
    ],
)
def test_a_damaged_file_is_refused_in_one_sentence(damaged, changes, sentence):
    with pytest.raises(ValueError, match=re.escape(sentence)) as refusal:
        damaged(**changes)
    assert "design.json" in str(refusal.value)
    assert "\n" not in str(refusal.value)
