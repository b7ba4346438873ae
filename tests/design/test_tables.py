"""The schema of the job file, and every key of it."""

import dataclasses
import json

import jsonschema
import pytest

from tests.design.test_job import refusal
from tpd import limits
from tpd.answers.ensemble import Ensemble
from tpd.design import job as jobs
from tpd.design.settings import Descent
from tpd.design.space import DesignSpace
from tpd.design.tables import SCHEMA, TABLES, json_schema
from tpd.limits import Requirements
from tpd.scene.bob import Bob
from tpd.scene.conditions import FACTORS
from tpd.scene.scene import Block


def test_every_field_of_the_classes_is_a_key_with_equal_default():
    tables = {
        "block": Block,
        "bob": Bob,
        "space": DesignSpace,
        "requirements": Requirements,
        "ensemble": Ensemble,
    }
    for table, kind in tables.items():
        for f in filter(lambda f: f.init, dataclasses.fields(kind)):
            key = TABLES["frame"]["width"] if f.name == "frame_width" else TABLES[table][f.name]
            # Without a block the losses are those of the paper's.
            default = None if f.name in ("friction", "restitution") and kind is Block else f.default
            assert default in (key.default, dataclasses.MISSING), f.name
    assert set(TABLES["scatter"]) == set(FACTORS)
    assert {f.name for f in dataclasses.fields(Descent)} < set(TABLES["search"])


def test_every_limit_has_a_key_in_the_job_file():
    assert list(TABLES["limits"]) == [kind.name for kind in limits.LIMIT_KINDS]
    for kind in limits.LIMIT_KINDS:
        given = True if kind is limits.Clearance else 0.125
        (found,) = (x for x in jobs.job_of({"limits": {kind.name: given}}).limits if isinstance(x, kind))
        assert found == (kind() if kind is limits.Clearance else kind(0.125))
        off = jobs.job_of({"limits": {kind.name: False}})
        assert not any(isinstance(x, kind) for x in off.limits)


def test_the_published_schema_is_current():
    published = SCHEMA.read_text(encoding="utf-8")
    assert published == json_schema(), "run: python -m tpd.design.tables"


def test_the_published_schema_rejects_what_the_reader_rejects():
    validator = jsonschema.Draft202012Validator(json.loads(json_schema()))
    for given in (
        {"blok": {}},
        {"block": {"widht": 1.0}},
        {"block": {"width": "wide"}},
        {"search": {"seed": 1.5}},
    ):
        assert not validator.is_valid(given)
        with pytest.raises(ValueError, match=r"there is no|must be"):
            jobs.job_of(given)


WRONG = [None, True, False, -1, 0, 3, 2**40, -0.5, 1e-12, 1e300, float("nan"), float("inf"), "", "x", "3"]
WRONG += [[], [1.0], [2.0, 1.0], [1.0, 1.0, 1.0], ["a", "b"], [True, False], {}, {"a": 1}, [[1.0, 2.0]]]


@pytest.mark.parametrize("table", list(TABLES))
def test_any_value_of_a_key_gives_a_job_or_one_sentence(table):
    for key in TABLES[table]:
        for value in WRONG:
            said = refusal({table: {key: value}})
            assert said is None or "\n" not in said
            assert said is None or key in said or f"`{table}." in said, (key, value, said)
