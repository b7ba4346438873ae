"""design.json: described by its schema, sorted, complete, and free of infinities."""

import dataclasses
import json
from importlib import resources

import jsonschema
import numpy as np
import pytest

from tests import designs
from tpd.design.result import DesignStatus, Nearest
from tpd.design.study import Study
from tpd.report.json import as_json

SCHEMA = json.loads(resources.files("tpd.report").joinpath("design.schema.json").read_text())
JOB = {"block": {"width": 0.1}, "search": {"seed": 3}}


def written(design, study) -> dict:
    return json.loads(as_json(design, study, JOB))


CASES = {
    "one condition": (designs.single(), designs.study()),
    "a band": (designs.band(), designs.study(responses=None, elasticities=None, front=designs.front())),
    "refused": (designs.refused(), designs.study(comparison=None)),
    "interrupted": (
        designs.single(status=DesignStatus.interrupted, pendulum=None, verified=()),
        Study(left_out=("the time histories",)),
    ),
    "none feasible": (
        designs.single(
            status=DesignStatus.none_feasible,
            pendulum=None,
            verified=(),
            nearest=Nearest(design=np.array(designs.RATIOS), broken=(designs.REASON,)),
        ),
        designs.study(),
    ),
}


@pytest.mark.parametrize("case", CASES)
def test_every_design_is_what_the_schema_says(case):
    content = written(*CASES[case])
    jsonschema.Draft202012Validator.check_schema(SCHEMA)
    jsonschema.validate(content, SCHEMA, cls=jsonschema.Draft202012Validator)


@pytest.mark.parametrize(
    ("key", "value"),
    [
        ("version", 1),
        ("pendulum", {"mass": 1.0}),
        ("status", "good"),
        ("amplitude_rad", "large"),
        ("more", 1),
    ],
)
def test_the_schema_refuses_other_content(key, value):
    content = written(*CASES["one condition"]) | {key: value}
    with pytest.raises(jsonschema.ValidationError):
        jsonschema.validate(content, SCHEMA)


def test_the_content_is_sorted_complete_and_exact():
    design, study = CASES["one condition"]
    content = written(design, study)
    assert list(content) == sorted(content)
    assert content["version"] == 2
    assert content["pendulum"] == dataclasses.asdict(designs.HUNG)
    assert content["parameters"]["mu"] == pytest.approx(0.1)
    assert content["seed"] == 3
    assert content["job"] == JOB
    assert {"python", "tpd", "jax", "diffrax", "optax"} <= set(content["versions"])
    assert content["verified"][0]["exact"]["amplitude"] == [0.04]
    assert content["study"]["responses"][1]["amplitude"] == study.responses[1].amplitude.tolist()
    assert content["notes"][0]["severity"] == "danger"


def test_infinities_and_reasons_are_words():
    content = written(*CASES["a band"])
    assert content["bare"]["exact"]["amplitude"][0] == "infinite"
    assert content["verified"][0]["reasons"][0]["kind"] == "breaks_limit"
    assert content["verified"][0]["reasons"][0]["sentence"] == str(designs.REASON)
    assert content["verified"][1]["evaluation"]["kind"][-1] == "rest"
