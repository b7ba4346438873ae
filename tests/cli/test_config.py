"""The job file: defaults, the objects that it becomes, and that a written job is read back unchanged."""

import dataclasses
import json
import tomllib
from pathlib import Path

import jsonschema
import numpy as np
import pytest

import tpd
from tpd.analysis.attractors import Starts
from tpd.analysis.ensemble import Ensemble
from tpd.cli import config, schema
from tpd.core.bob import Bob
from tpd.core.conditions import FACTORS, Conditions
from tpd.core.scene import Block, Harmonic
from tpd.design import criteria
from tpd.design.criteria import DesignSpace, Worth
from tpd.design.methods import Descent
from tpd.models.piecewise import Piecewise
from tpd.models.smoothed import Smoothed

EXACTLY = {"conditions": {"exactly": True}}
BAND = {"conditions": {"band": [2.0, 3.0], "frequencies": 5}}
JOBS = {
    "default": {},
    "losses": {"block": {"restitution": "housner"}},
    "both losses": {"block": {"restitution": 0.9, "friction": 0.02}, "site": {"gravity": 3.7}},
    "not uniform": {
        "block": {"width": 2, "height": 10, "mass": 40e3, "radius_of_gyration": 3.0},
        "motion": {"amplitude": 0.3, "frequency": 0.5},
    },
    "named": {"project": {"name": 'Tower "A" in Jena'}},
    "shaken otherwise": {"motion": {"frequency": 3.0}},
    "bounds": {"space": {"damping_ratio": [0.05, 0.3], "mass_ratio": [0.01, 0.1]}, "search": {"seed": 7}},
    "band": BAND,
    "robust": {
        "conditions": {"band": [2.0, 3.5], "amplitudes": [0.8, 1.0, 1.2], "samples": 16},
        "scatter": {"friction": 0.2, "length": 0.02},
        "risk": {"measure": "cvar", "share": 0.2},
        "search": {"seed": 3},
    },
    "starts": {**BAND, "starts": {"kind": "rest"}},
    "descent for several": {
        **BAND,
        "search": {"method": "descent", "optimiser": "rmsprop", "tolerance": 0.05},
    },
    "sequential for one": {"search": {"method": "sequential", "searches": 2, "screening": 3, "steps": 4}},
    "models": {"search": {"model": "piecewise"}},
    "exactly": {"conditions": {"exactly": True}},
    "bob": {
        "block": {"width": 0.2, "height": 0.8, "mass": 60.0, "cavity_width": 0.15},
        "motion": {"amplitude": 0.03, "frequency": 2.0},
        "bob": {"shape": "cylinder", "density": 11340.0, "aspect": 1.5},
    },
    "without room": {"limits": {"room": False, "worsening": 0.2}},
    "worth": {"worth": {"at_least": 0.2, "worse": 0.0, "strikes": 0.05, "runs": 64}},
    "limits": {
        "limits": {
            "stroke": 0.4,
            "relative_stroke": 0.6,
            "tilt": 0.4,
            "mass": 2.0,
            "offset": 0.1,
            "room": True,
            "worsening": 0.1,
            "multiplier": 0.98,
            "reserve": 1e-5,
        },
        "conditions": {"amplitudes": [1.2]},
        "search": {"method": "sequential"},
    },
    "ensemble": {"ensemble": {"size": 64, "ramps": [1.0], "any_phase": False, "damping": 0.1}},
}


@pytest.mark.parametrize("given", JOBS.values(), ids=JOBS)
def test_a_job_that_is_written_is_read_back_as_the_same_job(given):
    job = config.job_of(given)
    assert config.job_of(tomllib.loads(config.dump(job))) == job
    assert config.job_of(json.loads(json.dumps(config.tables(job)))) == job
    assert config.dump(job).startswith("# Repeat this run: tpd optimise --scene")


@pytest.mark.parametrize("given", JOBS.values(), ids=JOBS)
def test_the_objects_of_a_job_that_is_read_back_are_the_same(given):
    job = config.job_of(given)
    again = config.job_of(config.tables(job))
    for name in ("scene", "space", "starts", "risk", "limits", "method", "ensemble", "worth", "seed"):
        assert getattr(again, name) == getattr(job, name), name
    np.testing.assert_array_equal(conditions(again).factor_rows(), conditions(job).factor_rows())


def conditions(job: config.Job) -> Conditions:
    """Conditions of a job; without any it is searched in the neighbourhood of its motion."""
    return Conditions.around(job.scene) if job.conditions is None else job.conditions


def test_jobs_that_differ_are_not_equal():
    jobs = [config.job_of(given) for given in JOBS.values()]
    assert all(a != b for i, a in enumerate(jobs) for b in jobs[:i])


def test_without_tables_the_job_is_that_of_the_papers_block():
    job = config.job_of({})
    assert job.scene == tpd.paper_scene()
    assert job.space == DesignSpace()
    assert job.conditions is None
    assert len(conditions(job)) == schema.NEIGHBOURHOOD == job.file.size
    assert job.starts == Starts.any()
    assert job.risk == criteria.Risk.worst()
    assert job.limits == criteria.DEFAULT_LIMITS == config.job_of(BAND).limits
    assert isinstance(job.method, Descent)
    assert (job.method.searches, job.method.screening, job.method.steps) == (16, 512, 40)
    assert job.ensemble == Ensemble()
    assert job.worth == Worth()
    assert job.seed == 0


def test_exactly_is_the_papers_setting_one_motion_and_a_point_bob():
    job = config.job_of(EXACTLY)
    assert len(conditions(job)) == 1
    assert job.starts == Starts.any()
    assert job.limits == (criteria.Stroke(), criteria.Reserve())
    assert isinstance(job.method, Descent)
    with pytest.raises(ValueError, match=r"`conditions.exactly` goes with one motion: no band"):
        config.job_of({"conditions": {"exactly": True, "band": [2, 3]}})


def test_the_bob_is_a_body_in_the_cavity():
    job = config.job_of(JOBS["bob"])
    assert job.scene.block.room == 0.15
    (room,) = (limit for limit in job.limits if isinstance(limit, criteria.Room))
    assert room.bob == Bob(shape="cylinder", density=11340.0, aspect=1.5)
    with pytest.raises(ValueError, match=r"`bob.aspect` goes with `bob.shape` cylinder"):
        config.job_of({"bob": {"aspect": 3.0}})
    without = config.job_of(JOBS["without room"]).limits
    assert not any(isinstance(limit, criteria.Room) for limit in without)
    assert criteria.Worsening(0.2) in without


def test_several_conditions_are_searched_by_descent_from_any_start():
    job = config.job_of(BAND)
    assert len(job.conditions) == 5
    assert job.starts == Starts.any()
    assert isinstance(job.method, Descent)


def test_conditions_are_each_frequency_with_each_amplitude_and_each_sample():
    job = config.job_of(JOBS["robust"])
    scene = tpd.paper_scene()
    expected = (
        Conditions.band(scene, 2.0, 3.5, 20)
        * Conditions.amplitudes(0.8, 1.0, 1.2)
        * Conditions.scatter(16, 3, friction=0.2, length=0.02)
    )
    assert len(job.conditions) == 20 * 3 * 16
    np.testing.assert_array_equal(job.conditions.factor_rows(), expected.factor_rows())
    assert job.risk == criteria.Risk.cvar(0.2)


def test_all_limits_hold_for_one_condition_too():
    job = config.job_of(JOBS["limits"])
    assert len(job.conditions) == 1
    assert job.limits == (
        criteria.Stroke(0.4),
        criteria.RelativeStroke(0.6),
        criteria.Tilt(0.4),
        criteria.Mass(2.0),
        criteria.Offset(0.1),
        criteria.Room(),
        criteria.Worsening(0.1),
        criteria.Multiplier(0.98),
        criteria.Reserve(1e-5),
    )


@pytest.mark.parametrize(
    ("starts", "expected"),
    [
        ({}, Starts.any()),
        ({"kind": "rest"}, Starts.rest()),
        ({"kind": "any"}, Starts.any()),
    ],
)
def test_starts(starts, expected):
    assert config.job_of({"starts": starts, "search": {"seed": 5}}).starts == expected


@pytest.mark.parametrize(
    ("block", "friction", "restitution"),
    [
        ({}, 0.05, None),
        ({"restitution": "housner"}, 0.0, "housner"),
        ({"restitution": 0.9, "friction": 0.02}, 0.02, 0.9),
        ({"friction": 0.1, "restitution": 1}, 0.1, 1.0),
    ],
)
def test_where_impacts_lose_energy_friction_is_zero(block, friction, restitution):
    job = config.job_of({"block": block, **EXACTLY})
    assert (job.scene.block.friction, job.scene.block.restitution) == (friction, restitution)
    assert job.method.model is None
    for name, model in (("smoothed", Smoothed), ("piecewise", Piecewise)):
        asked = config.job_of({"block": block, "search": {"model": name}, **EXACTLY})
        assert isinstance(asked.method.model, model)
        assert asked.starts == Starts.any()


def test_a_whole_number_is_taken_where_any_number_is_meant():
    motion = {"amplitude": 0.1, "frequency": 1.0}
    whole = {"block": {"width": 1, "height": 3, "mass": 900}, "motion": motion, "space": {"damping_ratio": 1}}
    block = {"width": 1.0, "height": 3.0, "mass": 900.0}
    job = config.job_of(whole)
    assert job == config.job_of({"block": block, "motion": motion, "space": {"damping_ratio": 1.0}})
    assert isinstance(config.tables(job)["block"]["width"], float)


def test_keys_without_effect_are_not_written():
    tables = config.tables(config.job_of(EXACTLY))
    assert "scatter" not in tables
    assert set(tables["conditions"]) == {"amplitudes", "exactly"}
    assert set(tables["bob"]) == {"shape", "density"}
    assert set(tables["starts"]) == {"kind"}
    assert "risk" not in tables
    assert set(config.tables(config.job_of(BAND))["risk"]) == {"measure"}
    assert tables["search"]["optimiser"] == "adam"
    sequential = config.tables(config.job_of({"search": {"method": "sequential"}}))
    assert not {"tolerance", "optimiser"} & set(sequential["search"])


@pytest.mark.parametrize(
    ("given", "over", "dropped"),
    [
        (
            BAND | {"risk": {"measure": "cvar", "share": 0.2}},
            {"risk": {"measure": "worst"}},
            ("risk", "share"),
        ),
        ({"search": {"model": "piecewise"}}, {"search": {"method": "sequential"}}, ("search", "model")),
        ({"search": {"tolerance": 0.02}}, {"search": {"method": "sequential"}}, ("search", "tolerance")),
        (EXACTLY, BAND, ("conditions", "exactly")),
        (
            {"search": {"method": "descent", "optimiser": "rmsprop"}},
            {"search": {"method": "sequential"}},
            ("search", "optimiser"),
        ),
    ],
)
def test_what_an_option_makes_pointless_in_a_file_is_dropped(given, over, dropped):
    table, key = dropped
    merged = config.merged(given, over)
    assert key not in merged[table]
    assert key in given[table]
    config.job_of(merged)


def test_what_is_pointless_in_the_file_itself_stays_an_error():
    merged = config.merged({"risk": {"share": 0.2}}, {"search": {"seed": 1}})
    with pytest.raises(
        ValueError, match=r"^`risk.share` goes with `risk.measure` cvar, which this job does not"
    ):
        config.job_of(merged)


def test_a_file_may_list_defaults_that_have_no_effect():
    listed = {
        "conditions": {"frequencies": 20, "samples": 64},
        "starts": {"kind": "any"},
        "risk": {"measure": "worst", "share": 0.1},
    }
    assert config.job_of(listed) == config.job_of({})


def test_a_file_may_leave_to_the_options_what_makes_it_whole():
    given, over = {"conditions": {"frequencies": 5}}, {"conditions": {"band": [2, 3]}}
    job = config.job_of(config.merged(given, over))
    assert len(job.conditions) == 5


# The schema


@pytest.mark.parametrize(
    ("table", "kind"),
    [
        ("block", Block),
        ("motion", Harmonic),
        ("bob", Bob),
        ("space", DesignSpace),
        ("worth", Worth),
        ("ensemble", Ensemble),
    ],
)
def test_a_table_has_the_fields_of_the_class_that_it_becomes(table, kind):
    assert set(schema.keys()[table]) == {f.name for f in dataclasses.fields(kind)}


def test_the_tables_of_limits_and_scatter_have_the_names_of_limits_and_factors():
    assert set(schema.keys()["limits"]) == {kind.name for kind in criteria.KINDS}
    assert set(schema.keys()["scatter"]) == set(FACTORS)


def test_the_published_schema_is_up_to_date():
    published = Path(schema.__file__).with_name("job.schema.json").read_text(encoding="utf-8")
    assert published == schema.json_schema(), "run: python -m tpd.cli.config > tpd/cli/job.schema.json"


@pytest.mark.parametrize("given", JOBS.values(), ids=JOBS)
def test_the_published_schema_takes_written_jobs(given):
    validator = jsonschema.Draft202012Validator(json.loads(schema.json_schema()))
    validator.validate(config.tables(config.job_of(given)))


def test_the_published_schema_refuses_what_the_reader_refuses():
    validator = jsonschema.Draft202012Validator(json.loads(schema.json_schema()))
    for given in (
        {"blok": {}},
        {"block": {"widht": 1.0}},
        {"block": {"width": -1.0}},
        {"search": {"seed": 1.5}},
    ):
        assert not validator.is_valid(given)
        with pytest.raises(ValueError, match=r"unknown|must be"):
            config.job_of(given)


WRONG = [None, True, False, -1, 0, 3, 2**40, -0.5, 1e-12, 1e300, float("nan"), float("inf"), "", "x", "3"]
WRONG += [[], [1.0], [2.0, 1.0], [1.0, 1.0, 1.0], ["a", "b"], [True, False], {}, {"a": 1}, [[1.0, 2.0]]]


@pytest.mark.parametrize("table", list(schema.keys()))
def test_whatever_a_key_is_the_answer_is_a_job_or_one_sentence(table):
    for key in schema.keys()[table]:
        for value in WRONG:
            said = refusal({table: {key: value}})
            assert said is None or "\n" not in said
            assert said is None or key in said, (key, value, said)


def refusal(given):
    """The sentence that refuses the tables, or None; any other exception is a failure."""
    try:
        config.job_of(given)
    except ValueError as error:
        return str(error)
    return None
