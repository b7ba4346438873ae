"""design.json: described by its schema, sorted, complete, and free of infinities."""

import dataclasses
import json
from importlib import resources

import jsonschema
import numpy as np
import pytest

from tests import designs
from tpd.design.result import DesignStatus, Nearest
from tpd.report.json import as_json

SCHEMA = json.loads(resources.files("tpd.report").joinpath("design.schema.json").read_text())
JOB = {"block": {"width": 0.1}, "search": {"seed": 3}}


def written(design, study) -> dict:
    return json.loads(as_json(design, study, JOB))


NEAREST = Nearest(design=np.array(designs.RATIOS), broken=(designs.REASON,))
EMPTY = {"pendulum": None, "verified": ()}
CASES = {
    "one condition": (designs.single(), designs.study()),
    "a neighbourhood": (designs.around(), designs.study()),
    "a band": (designs.band(), designs.study(responses=None, front=designs.front())),
    "refused": (designs.refused(), designs.study()),
    "none": (designs.single(status=DesignStatus.none_feasible, nearest=NEAREST, **EMPTY), designs.study()),
}


def test_every_design_is_what_the_schema_says_and_other_content_is_refused():
    jsonschema.Draft202012Validator.check_schema(SCHEMA)
    validator = jsonschema.Draft202012Validator(SCHEMA)
    for case in CASES.values():
        validator.validate(written(*case))
    sound = written(*CASES["one condition"])
    wrong = {"version": 2, "pendulum": {"mass": 1.0}, "status": "good", "seed": "large", "more": 1}
    for key, value in wrong.items():
        assert not validator.is_valid(sound | {key: value}), key


def test_the_content_is_sorted_complete_and_exact():
    design, study = CASES["one condition"]
    content = written(design, study)
    assert list(content) == sorted(content)
    assert content["version"] == 8
    assert content["pendulum"] == dataclasses.asdict(designs.HUNG)
    assert content["details"]["parameters"]["mu"] == pytest.approx(0.1)
    assert content["seed"] == 3
    assert content["job"] == JOB
    assert {"python", "tpd", "jax", "diffrax", "optax"} <= set(content["versions"])
    assert content["details"]["verified"][0]["exact"]["amplitude"] == [0.04]
    assert content["details"]["responses"][1]["amplitude"] == study.responses[1].amplitude.tolist()
    assert content["notes"][0]["severity"] == "danger"


def test_infinities_and_reasons_are_words():
    content = written(*CASES["a band"])
    assert content["details"]["bare"]["exact"]["amplitude"][0] == "infinite"
    assert content["details"]["verified"][0]["reasons"][0]["kind"] == "breaks_limit"
    assert content["details"]["verified"][0]["reasons"][0]["sentence"] == str(designs.REASON)
    assert content["details"]["verified"][1]["evaluation"]["kind"][-1] == "rest"


def test_what_is_asked_of_the_benefit_and_what_paired_runs_say_stand_beside_each_other():
    content = written(*CASES["a neighbourhood"])
    details = content["details"]
    assert content["worth"] == {"at_least": 0.1, "worse": 0.05, "strikes": 0.01, "runs": 40}
    assert content["limits"]["room"] == {"shape": "ball", "density": 7850.0, "aspect": 2.0}
    (offered,) = details["verified"]
    benefit = offered["benefit"]
    # 2 of 40 runs overturn and 38 tilt 0.05 rad of 0.25, in place of 20 and 20 at 0.1 rad.
    assert benefit["value"] == pytest.approx(1.0 - (2 + 38 * 0.2) / (20 + 20 * 0.4))
    assert benefit["low"] < benefit["value"] < benefit["high"]
    names = [change["name"] for change in benefit["changes"]]
    assert names == ["mean severity", "median severity", "worst severity", "overturned", "at rest"]
    assert [len(benefit["by_condition"][key]) for key in ("with", "without")] == [10, 10]
    assert (offered["paired"]["worse"], offered["paired"]["better"]) == (0, 18)
    assert offered["paired"]["with"]["equations"] == "nonlinear"
    friction, impacts = details["losses"]
    assert (friction["name"], impacts["name"]) == ("friction", "impacts")
    assert (impacts["benefit"]["value"], impacts["overturned"]["value"]) == (0.0, 0.5)
    assert details["search"]["mismatch"] == [[2e-6, 3e-5], ["infinite", 0.0]]
    assert details["search"]["lost"] == [0, 4]
    # Motions from rest, of the design and of the bare block.
    assert (offered["rest"]["severity"], offered["rest"]["bare"]) == ([0.3] * 10, [0.4] * 10)
    assert written(*CASES["refused"])["details"]["verified"][-1]["rest"] is None


def test_surveys_are_counts_and_best_designs():
    linear, nonlinear = written(*CASES["a neighbourhood"])["details"]["surveys"]
    assert (linear["equations"], nonlinear["equations"]) == ("linear", "nonlinear")
    # One strikes on the way, and one overturns the block under all conditions.
    assert (linear["designs"], linear["keep_to_limits"], linear["better_than_bare"]) == (4, 2, 2)
    assert linear["broken"] == {"stroke": 0, "room": 0, "room on the way": 1}
    assert linear["best"]["design"] == list(designs.RATIOS)
    assert linear["best_without"]["room on the way"]["design"] == [0.2, 0.8, 0.1]
    assert linear["best_without"]["room on the way"]["excess"]["room on the way"] == pytest.approx(0.4)
    assert linear["severity_without"] == [0.4] * 10
