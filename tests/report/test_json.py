"""design.json: described by its schema, sorted, complete, and without infinities."""

import dataclasses
import json
from importlib import resources

import jsonschema
import pytest

from tests.report.conftest import DESIGNS, LITTLE, against, details, ground, harmonic, json_text
from tpd.design.as_built import Details
from tpd.design.job import job_of
from tpd.design.reasons import DesignStatus
from tpd.design.stored_design import VERSION
from tpd.report.json import as_json
from tpd.report.summary import summary, verdict

SCHEMA = json.loads(resources.files("tpd.report").joinpath("design.schema.json").read_text())
VALIDATOR = jsonschema.Draft202012Validator(SCHEMA)
JOB = {"search": {"seed": 0}}


def written(design, about=None) -> dict:
    return json.loads(json_text(design, JOB, about))


@pytest.mark.parametrize("kind", DESIGNS)
def test_the_json_of_every_design_matches_the_schema(kind):
    VALIDATOR.check_schema(SCHEMA)
    content, design = written(DESIGNS[kind](), details(kind)), DESIGNS[kind]()
    VALIDATOR.validate(content)
    assert list(content) == sorted(content)
    assert content["version"] == VERSION
    assert (content["status"], content["job"]) == (design.status.name, job_of(JOB).tables)
    VALIDATOR.validate(json.loads(as_json(design, Details(), summary(design, Details()))) | {"job": None})
    assert content["verdict"] == verdict(design, details(kind)).text
    assert content["pendulum"] == (design.pendulum and dataclasses.asdict(design.pendulum))
    assert content["reasons"] == list(design.refusals)
    assert content["runs"]["benefit"]["mean"] == design.runs.benefit.mean
    assert len(content["validated"]) == len(design.validated)
    assert content["records"]["files"] == [] or "earthquake" in content["records"]["files"][0]


def test_a_design_without_runs_matches_the_schema():
    calm = dataclasses.replace(
        harmonic(), status=DesignStatus.no_uplift, validated=(), trials=None, search=None
    )
    VALIDATOR.validate(written(calm))


def test_the_schema_rejects_wrong_versions_types_and_keys():
    sound = written(harmonic(), details())
    wrong = {"version": VERSION - 1, "pendulum": {"mass": 1.0}, "status": "good", "seed": "large", "more": 1}
    for key, value in wrong.items():
        assert not VALIDATOR.is_valid(sound | {key: value}), key


def test_json_states_infinities_with_sign_and_reasons_as_sentences():
    # The motions that are held out are of one earthquake: the interval of the benefit has no ends.
    benefit = written(ground())["runs"]["benefit"]
    assert (benefit["low"], benefit["high"]) == ("-infinite", "infinite")
    (reason,) = written(against(LITTLE))["validated"][0]["reasons"]
    assert (reason["kind"], reason["sentence"]) == ("too_little_benefit", str(LITTLE))
    assert "infinite" in written(harmonic())["without_pendulum"]["settled_tilt"]
