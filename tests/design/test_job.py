"""The job file: defaults, the objects that it becomes, and that a written job is read back unchanged."""

import json
import shlex
import tomllib
import warnings
from pathlib import Path

import jsonschema
import numpy as np
import pytest

import tpd
from tests.formats.synthetic import shaking
from tpd import limits
from tpd.answers.attractors import Starts
from tpd.answers.ensemble import Ensemble
from tpd.design import job as jobs
from tpd.design.ground_motion import GroundMotionProblem, motion_factors
from tpd.design.settings import Descent
from tpd.design.space import DesignSpace
from tpd.design.tables import SCHEMA
from tpd.limits import Requirements
from tpd.records import el_centro, loma_prieta
from tpd.scene.bob import Bob
from tpd.scene.conditions import Conditions
from tpd.scene.scene import Block

VALIDATOR = jsonschema.Draft202012Validator(json.loads(SCHEMA.read_text(encoding="utf-8")))
MAVROEIDIS = "mavroeidis-papageorgiou"
EXACTLY = {"conditions": {"exactly": True}}
RECORDS = {"records": ["el-centro", "loma-prieta"], "scales": [2.0, 3.0]}
BAND = {"conditions": {"band": [2.0, 3.0], "frequencies": 5}}
JOBS = {
    "losses": {"block": {"restitution": "housner"}},
    "both losses": {"block": {"restitution": 0.9, "friction": 0.02}, "site": {"gravity": 3.7}},
    "not uniform": {
        "block": {"width": 2, "height": 10, "mass": 40e3, "radius_of_gyration": 3.0},
        "excitation": {"amplitude": 0.3, "frequency": 0.5},
    },
    "bounds": {"space": {"damping_ratio": [0.05, 0.3], "mass_ratio": [0.01, 0.1]}, "search": {"seed": 7}},
    "robust": {
        "conditions": {"band": [2.0, 3.5], "amplitudes": [0.8, 1.0, 1.2], "samples": 16},
        "scatter": {"friction": 0.2, "length": 0.02},
        "search": {"seed": 3, "risk": "cvar", "risk_share": 0.2},
    },
    "starts": {**BAND, "starts": {"kind": "rest"}},
    "descent": {**BAND, "search": {"optimiser": "adam", "polish": 5, "objective": "steady tilt"}},
    "exactly": EXACTLY,
    "bob": {
        "block": {"width": 0.2, "height": 0.8, "mass": 60.0, "cavity_width": 0.15},
        "excitation": {"amplitude": 0.03, "frequency": 2.0},
        "bob": {"shape": "cylinder", "density": 11340.0, "aspect": 1.5},
    },
    "limits": {"limits": {"clearance": False, "worsening": 0.2, "mass": 2.0, "reserve": 1e-5}},
    "requirements": {
        "requirements": {"at_least": 0.2, "reduce": "tilt", "worse": 0.0, "wall_contacts": 0.05}
    },
    "ensemble": {"ensemble": {"size": 64, "growth": [1.0], "any_phase": False, "damping": 0.1}},
    "held out": {"excitation": {**RECORDS, "records": ["el-centro"], "validation_share": ["loma-prieta"]}},
    "scaled": {"excitation": {**RECORDS, "validation_share": 0.0, "pga": 0.3, "intensity": "scale"}},
    "pulse": {
        "excitation": {"pulse": MAVROEIDIS, "pulse_frequency": 1, "cycles": 2.0, "phase": 0.5, "pga": 1},
        "search": {"steps": 3, "designs": 5},
    },
    "sizes": {"excitation": {"pulse": "ricker", "pulse_frequency": 1.0, "pga": 1.0, "scales": [1, 2]}},
    "hazard": {"excitation": RECORDS, "hazard": {"levels": [0.1, 0.3], "rates": [0.01, 4e-4]}},
}


@pytest.mark.parametrize("given", JOBS.values(), ids=JOBS)
def test_a_written_job_file_defines_an_equal_job(given):
    job = jobs.job_of(given)
    assert jobs.job_of(tomllib.loads(job.toml)) == job
    assert jobs.job_of(json.loads(json.dumps(job.tables))) == job
    assert job.toml.startswith("# Repeat this run: tpd optimise")
    again = jobs.job_of(job.tables)
    for name in {"scene", *job.settings} - {"conditions", "validation_share"}:
        assert getattr(again, name) == getattr(job, name), name
    np.testing.assert_array_equal(conditions(again).factor_rows(), conditions(job).factor_rows())
    VALIDATOR.validate(job.tables)


def conditions(job: jobs.Job) -> Conditions:
    """Conditions of a job; without any it is searched in the neighbourhood of its motion."""
    return Conditions.around(job.scene) if job.conditions is None else job.conditions


def test_an_empty_job_file_describes_the_block_of_the_paper():
    job = jobs.job_of({})
    assert (job.scene, job.space, job.conditions) == (tpd.paper_scene(), DesignSpace(), None)
    assert len(conditions(job)) == 10
    assert (job.starts, jobs.job_of(JOBS["starts"]).starts) == (Starts.any(), Starts.rest())
    assert job.limits == limits.DEFAULT_LIMITS == jobs.job_of(BAND).limits
    assert isinstance(job.method, Descent)
    assert (job.method.searches, job.method.screening, job.method.steps) == (4, 256, 20)
    assert (job.method.corrections, job.method.polish) == (4, 60)
    assert job.objective == limits.Settling()
    assert (job.risk, job.ensemble, job.requirements) == (
        tpd.Risk.cvar(),
        Ensemble(size=2048, seed=0),
        Requirements(),
    )
    assert job.seed == 0


def test_each_table_of_a_job_becomes_an_object():
    exactly = jobs.job_of(EXACTLY)
    assert len(conditions(exactly)) == 1
    assert exactly.limits == (limits.Stroke(), limits.Reserve())
    bob = Bob(shape="cylinder", density=11340.0, aspect=1.5)
    assert limits.Clearance(bob) in jobs.job_of(JOBS["bob"]).limits
    without = jobs.job_of(JOBS["limits"]).limits
    assert not any(isinstance(limit, limits.Clearance) for limit in without)
    assert limits.Worsening(0.2) in without
    assert jobs.job_of({"search": {"model": "piecewise"}}).method.model == "piecewise"
    job = jobs.job_of(JOBS["robust"])
    band = Conditions.band(tpd.paper_scene(), 2.0, 3.5, 20)
    scatter = Conditions.scatter(16, 3, friction=0.2, length=0.02)
    expected = band * Conditions.amplitudes(0.8, 1.0, 1.2) * scatter
    np.testing.assert_array_equal(job.conditions.factor_rows(), expected.factor_rows())
    assert job.risk == tpd.Risk.cvar(0.2)


def test_keys_that_an_option_replaces_are_dropped():
    risk = {"search": {"risk": "cvar", "risk_share": 0.2}, **BAND}
    for given, over, table, key in (
        (risk, {"search": {"risk": "worst"}}, "search", "risk_share"),
        (EXACTLY, BAND, "conditions", "exactly"),
    ):
        merged, full = jobs.merge_tables(given, over)
        assert key not in merged[table]
        # The completion that a merge needs is the one that the job has.
        assert jobs.job_of(merged, full).full == jobs.job_of(merged).full
    # What is pointless in the file itself stays an error.
    with pytest.raises(ValueError, match=r"^`search.risk_share` requires `search.risk` cvar, which this job"):
        jobs.job_of(
            *jobs.merge_tables({"search": {"risk": "worst", "risk_share": 0.2}}, {"search": {"seed": 1}})
        )


def test_a_ratio_of_energies_as_restitution_gets_a_question():
    sizes, motion = {"width": 0.7, "height": 4.0, "mass": 2210.0}, {"amplitude": 0.1, "frequency": 1.0}
    e = Block(**sizes).velocity_ratio
    for value in ("housner", e, e - 0.02, e**2 - 0.011):
        jobs.job_of({"block": sizes | {"restitution": value}, "excitation": motion})
    for value in (e**2, e**2 - 0.0099):
        with pytest.warns(UserWarning, match="about the square of .*: is it the ratio of the energies"):
            jobs.job_of({"block": sizes | {"restitution": value}, "excitation": motion})


def test_a_job_states_accelerations_in_g():
    job = jobs.job_of(
        {"excitation": {**RECORDS, "validation_share": 0.0, "intensity": "pga", "scales": [0.3]}}
    )
    g = 9.80665
    assert (job.conditions.intensity, job.conditions.scales) == ("pga", (0.3,))
    of_python = tpd.Conditions.records(job.motions, [0.3], intensity="pga")
    for conditions in (job.conditions, of_python):
        assert motion_factors(job.scene, conditions) == pytest.approx([0.3 * g / m.pga for m in job.motions])
    one = jobs.job_of({"excitation": {"records": ["el-centro"], "intensity": "pga", "scales": [0.3]}})
    assert one.shaking.pga == pytest.approx(0.3 * g)


def test_records_on_a_building_keep_the_intensity_of_the_ground():
    site = {"building_period": 0.35, "building_damping": 0.05}
    ground, roof = (jobs.job_of({"excitation": RECORDS, "site": x}) for x in ({}, site))
    for one, other in zip(ground.motions, roof.motions, strict=True):
        assert other.at_ground == one
        assert float(other.pga) > 1.5 * float(one.pga)
    # The factors on the records are those of the ground.
    assert motion_factors(roof.scene, roof.conditions) == pytest.approx(
        motion_factors(ground.scene, ground.conditions)
    )
    with pytest.raises(ValueError, match=r"`site\.building_damping` requires a building"):
        jobs.job_of({"excitation": RECORDS, "site": {"building_damping": 0.1}})


OWN = {"width": 1.0, "height": 6.0, "mass": 9000.0}
CAVITY = {"block": OWN | {"cavity_width": 0.6}, "space": {"hinge_height": 5.0}}
FRAME = {"block": OWN, "frame": {"width": 1.2, "height": 7.0}}


def test_an_option_for_the_frame_replaces_the_cavity_of_a_file_and_the_other_way_round():
    shaking = {"excitation": {"amplitude": 0.1, "frequency": 0.6}}
    merged, full = jobs.merge_tables(CAVITY | shaking, {"frame": FRAME["frame"]})
    block, space = (job := jobs.job_of(merged, full)).block, job.space
    assert (block.cavity_width, block.frame_width, space.hinge_height) == (None, 1.2, 7.0)
    block = jobs.job_of(*jobs.merge_tables(FRAME | shaking, {"block": {"cavity_width": 0.5}})).block
    assert (block.cavity_width, block.frame_width) == (0.5, None)
    # Both in one place are a contradiction, which nobody can resolve.
    for other in ({"block": {"cavity_width": 0.5}}, {"space": {"hinge_height": 5.0}}):
        with pytest.raises(ValueError, match="must not be stated with"):
            jobs.job_of(*jobs.merge_tables(shaking | {"block": OWN}, {"frame": FRAME["frame"]} | other))


def test_the_keys_of_a_job_determine_the_kind_of_excitation():
    assert jobs.job_of({}).kind == "harmonic"
    pulse = jobs.job_of({"excitation": {"pulse": "ricker", "pulse_frequency": 2.0, "pga": 0.5}})
    assert pulse.kind == "pulse"
    assert pulse.scene.excitation == tpd.Pulse.ricker(acceleration=0.5 * 9.80665, frequency=2.0)
    c = pulse.conditions
    # By default the conditions are a band of periods and of sizes, and the stated pulse comes first.
    assert [1.0 / m.frequency for m in c.motions] == pytest.approx([0.5, 0.35, 0.425, 0.575, 0.65])
    assert {m.pga for m in c.motions} == {pulse.scene.excitation.pga}
    assert (c.intensity, c.scales, pulse.validation_share) == ("scale", (1.0, 0.9, 1.1), 0.0)
    one = {"pulse": "ricker", "pulse_frequency": 2.0, "pga": 0.5, "pulse_band": [0, 0]}
    c = jobs.job_of({"excitation": one}).conditions
    assert (c.motions, c.scales) == (pulse.motions, (1.0,))
    with pytest.raises(ValueError, match=r"\[excitation\] `pulse_band` must be between 0 and 0.5"):
        _ = jobs.job_of({"excitation": one | {"pulse_band": [0.6, 0.0]}}).conditions
    job = jobs.job_of({"excitation": RECORDS})
    assert job.kind == "records"
    assert [m.name for m in job.motions] == [m.name for m in (el_centro(), loma_prieta())]
    c = job.conditions
    assert (c.intensity, c.scales, job.validation_share) == ("pga_star", (2.0, 3.0), None)
    assert job.scene == tpd.Scene(tpd.paper_scene().block, job.motions[0])
    asked = GroundMotionProblem.of(job.block, job.conditions)
    for name in ("space", "risk", "limits", "method", "requirements", "ensemble"):
        assert getattr(job, name) == getattr(asked, name), name


def test_paths_are_relative_to_the_job_file_and_written_as_absolute(tmp_path, monkeypatch):
    text = "".join(f"{0.01 * i:.2f},{0.3 * np.sin(0.08 * i):.6f}\n" for i in range(100))
    (tmp_path / "there" / "quake").mkdir(parents=True)
    (tmp_path / "there" / "quake" / "one.csv").write_text("time (s),acc (g)\n" + text)
    motion = (
        "[excitation]\nrecords = ['quake', 'el-centro']\nscales = [2]\nvalidation_share = ['quake/one.csv']\n"
        "[records]\nevents = { 'quake' = 'A \"1\"' }\n"
    )
    (tmp_path / "there" / "job.toml").write_text(motion)
    monkeypatch.chdir(tmp_path)
    job = jobs.job_of(jobs.read_tables(Path("there/job.toml")))
    assert job.tables["excitation"]["records"] == [str(tmp_path / "there" / "quake"), "el-centro"]
    assert job.motions[0].event == 'A "1"'
    assert job.tables["records"] == {"events": {str(tmp_path / "there" / "quake"): 'A "1"'}}
    # The job of a report finds its records wherever it lies.
    (tmp_path / "scene.toml").write_text(job.toml)
    assert jobs.job_of(jobs.read_tables(tmp_path / "scene.toml")) == job
    assert list(job.validation_share) == ["one.csv"]


def test_an_option_that_chooses_records_drops_the_harmonic_keys_of_a_file():
    given = {
        "excitation": {"amplitude": 0.02, "frequency": 3.0},
        "conditions": {"band": [2.0, 3.0], "frequencies": 5},
        "limits": {"reserve": 0.1, "stroke": 0.4},
        "requirements": {"worse": 0.02, "at_least": 0.2},
        "search": {"searches": 3, "seed": 4},
        "scatter": {"frequency": 0.1, "length": 0.03},
    }
    merged, full = jobs.merge_tables(given, {"excitation": RECORDS})
    assert merged["excitation"] == RECORDS | {"kind": "records"}
    assert (merged["conditions"], merged["limits"]) == ({}, {"stroke": 0.4})
    assert (merged["requirements"], merged["search"]) == ({"worse": 0.02, "at_least": 0.2}, {"seed": 4})
    job = jobs.job_of(merged, full)
    assert job.full == jobs.job_of(merged).full
    assert job.ensemble == Ensemble(length=0.03)
    # What is of neither kind is dropped as well, and a harmonic drops what is of records.
    harmonic, _ = jobs.merge_tables({"excitation": RECORDS}, {"excitation": {"amplitude": 0.02}})
    assert harmonic["excitation"] == {"amplitude": 0.02, "kind": "harmonic"}


REFUSED = r"""
excitation.scales = [2] | `excitation.scales` requires a pulse or records, which this job
excitation = {RECORDS, amplitude = 0.1} | keys of records (`records`) and of a harmonic motion (`am
excitation = {RECORDS}; limits.reserve = 0.1 | `limits.reserve` requires a harmonic motion
excitation = {PULSE, cycles = 3} | `excitation.cycles` requires the
excitation = {pulse = "ricker"} | a pulse needs `excitation.pulse` (--pulse KIND) and `excitation.p
hazard.levels = [0.1, 0.2] | `hazard.levels` requires a pulse or records of several levels
excitation = {RECORDS}; hazard.levels = [0.1, 0.2] | [hazard] exactly one of `rates`, `return_pe
excitation = {RECORDS}; hazard = {levels = [7, 16, 33], rates = [0.014, 0.0021, 4e-4]} | [hazard] at this site
limits.clearance = false; bob.shape = "cylinder" | `bob.shape` requires a limit on `clearance` in [limits]
conditions.exactly = true; bob.density = 11340 | `bob.density` requires a limit on `clearance` in [limits]
conditions.exactly = true; limits.worsening = 0.1 | `limits.worsening` requires more than the stated motion
limits = {clearance = false, stroke = false}; requirements.wall_contacts = 0.1 | requires a limit on runs in
ensemble = {disturbed = 0, swing = 0.1} | `ensemble.swing` requires a share `ensemble.disturbed` above 0
block.friction = 0; ensemble.friction = 0.1 | `ensemble.friction` requires a `block.friction` above 0
space.damping_ratio = 0.0; ensemble.damping = 0.1 | `ensemble.damping` requires a `space.damping_ratio` above
conditions.amplitudes = [] | [conditions] `amplitudes` must be one or more numbers, all finite, but is ()
conditions = {band = [2, 3], frequencies = 1} | [conditions] `frequencies` must be a whole number, 2 or more
conditions.samples = 0; scatter.mass = 0.1 | [scatter] `samples` must be a whole number, 1 or more, but is 0
conditions.amplitudes = [1, 2]; search.risk_share = 2 | [search] `risk_share` must be between 1e-09 and 1
excitation = {PULSE, pga = 0} | [excitation] `pga` must be positive and finite, but is 0
excitation = {pulse = "ricker", pulse_frequency = 0, pga = 1} | [excitation] `pulse_frequency` must be
excitation = {RECORDS, pga = 0.3} | `excitation.pga` requires `excitation.intensity` scale, or no `excitation
"""
"""Jobs, and a part of the sentence that rejects each."""


@pytest.mark.parametrize("line", REFUSED.strip().splitlines())
def test_keys_without_effect_and_misspelt_keys_are_rejected_in_one_sentence(line):
    text, sentence = line.split(" | ")
    text = text.replace("RECORDS", 'records = ["el-centro", "loma-prieta"], scales = [2.0, 3.0]')
    text = text.replace("PULSE", 'pulse = "ricker", pulse_frequency = 1')
    assert sentence in str(refusal(tomllib.loads(text.replace("; ", "\n"))))


def test_a_history_needs_one_excitation_and_a_search_needs_scales():
    alone = {"records": ["el-centro"]}
    job = jobs.job_of({"excitation": alone | {"scales": [3.0]}})
    assert job.shaking.pga == pytest.approx(3.0 * 9.80665 * job.block.slenderness)
    unsized = jobs.job_of({"excitation": alone})
    assert unsized.shaking.name == el_centro().name
    with pytest.raises(ValueError, match=r"a design for records needs `excitation.scales` \(--scales\)"):
        _ = unsized.conditions
    # The records are read for the conditions: the message names the table once.
    with pytest.raises(ValueError, match=r"^\[excitation\] `pga` must be positive and finite, but is -1"):
        _ = jobs.job_of({"excitation": alone | {"pga": -1.0, "intensity": "scale"}}).conditions
    with pytest.raises(ValueError, match="the job has 2 scales, but exactly one is needed"):
        _ = jobs.job_of({"excitation": alone | {"scales": [1.0, 2.0]}}).shaking
    with pytest.raises(
        ValueError, match=r"the job has 2 records \(el-centro; loma-prieta\), but exactly one is needed"
    ):
        _ = jobs.job_of({"excitation": RECORDS}).shaking


def refusal(given):
    """The sentence that refuses the tables, or None; any other exception is a failure, but not a warning."""
    try:
        with warnings.catch_warnings(action="ignore"):
            jobs.job_of(given)
    except ValueError as error:
        return str(error)
    return None


JOB = """[block]
width = 0.5
height = 2.5
mass = 1000
restitution = 0.9
[excitation]
records = ["~/größe.csv", "el-centro", "b.csv"]
validation_share = ["~/others"]
"""


@pytest.mark.parametrize("encoding", ["utf-8", "utf-8-sig"])
@pytest.mark.parametrize("end", ["\n", "\r\n"])
def test_a_job_file_can_have_a_byte_order_mark_and_paths_with_a_tilde(tmp_path, monkeypatch, encoding, end):
    monkeypatch.setenv("HOME", str(tmp_path / "home"))
    (tmp_path / "job.toml").write_bytes(JOB.replace("\n", end).encode(encoding))
    monkeypatch.chdir(tmp_path)
    (tmp_path / "home").mkdir()
    motion = jobs.Job.read("~/../job.toml").full["excitation"]
    home = f"{tmp_path}/home"
    assert motion["records"] == (f"{home}/größe.csv", "el-centro", f"{tmp_path}/b.csv")
    assert motion["validation_share"] == (f"{home}/others",)
    (tmp_path / "job.toml").write_bytes(JOB.encode("utf-16"))
    with pytest.raises(ValueError, match=r"job\.toml is not a text file in UTF-8"):
        jobs.Job.read(tmp_path / "job.toml")


def test_a_table_without_names_is_rejected_with_its_columns_and_options(tmp_path):
    path, job = tmp_path / "a.csv", tmp_path / "job.toml"
    rows = "".join(f"{10 * i},{x:.4f},{2 * x:.4f}\n" for i, x in enumerate(shaking(100)))
    path.write_text(f"time (ms),Nord x 10,Ost x 10\n{rows}")
    job.write_text(f'[excitation]\nrecords = ["{path}"]\n')
    with pytest.raises(ValueError, match="; try these options: --columns ") as error:
        _ = jobs.Job.read(job).motions
    sentence, *preview = str(error.value).splitlines()
    # The words are those of a shell.
    said = shlex.split(sentence.partition("try these options: ")[2])
    assert said == ["--columns", "time (ms)=1", "NAME2 (UNIT)=2", "NAME3 (UNIT)=3"]
    assert "columns=" not in sentence
    assert preview[0] == "  line 1    time (ms),Nord x 10,Ost x 10"
    filled = [x.replace("NAME2", "N").replace("NAME3", "E").replace("UNIT", "cm/s2") for x in said[1:]]
    motion = {"records": [str(path)], "scales": [1.0]}
    north, east = jobs.job_of({"excitation": motion | {"columns": filled, "factor": 10.0}}).motions
    assert (north.dt, north.name, east.name) == (0.01, "N", "E")
    assert 2.0 * north.pga == pytest.approx(east.pga, rel=1e-3)
    assert north.pga == pytest.approx(0.1 * np.max(np.abs(shaking(100).round(4))), rel=1e-12)
    for wrong in (["N"], ["N=x"], ["N=1", "N=2"], ["=1"]):
        with pytest.raises(
            ValueError, match=r"`excitation.columns` \(--columns\) must be rows, or names with"
        ):
            _ = jobs.job_of({"excitation": motion | {"columns": wrong}}).motions


def test_a_frame_as_an_option_replaces_the_cavity_of_a_file_and_vice_versa():
    sizes = {"width": 1.0, "height": 6.0, "mass": 9000.0}
    cavity, frame = {"cavity_width": 0.7}, {"width": 1.2, "height": 7.0}
    excitation = {"amplitude": 0.1, "frequency": 0.5}
    inside = {"block": sizes | cavity, "excitation": excitation}
    above = {"block": sizes, "frame": frame, "excitation": excitation}
    for given, over, clear, hinge in (
        (inside, {"frame": frame}, 1.2, 7.0),
        (above, {"block": cavity}, 0.7, None),
        (inside, {"block": {"cavity_width": 0.6}}, 0.6, None),
        (above, {"frame": {"width": 1.4}}, 1.4, 7.0),
        (above, {"block": {"mass": 8000.0}}, 1.2, 7.0),
    ):
        job = jobs.job_of(*jobs.merge_tables(given, over))
        assert job.block.clear_width == clear
        assert job.space.hinge_height == hinge
        assert (job.block.frame_width is None) == (hinge is None)
    with pytest.raises(ValueError, match="the bob swings in a cavity or in a frame"):
        jobs.job_of(*jobs.merge_tables({"excitation": excitation}, {"block": sizes | cavity, "frame": frame}))


def test_a_pulse_has_a_band_of_periods_and_keeps_its_scales():
    base = {"pulse": "ricker", "pulse_frequency": 2.0, "pga": 0.5}
    assert jobs.job_of({"excitation": base}).in_words.endswith("; 5 periods from 0.35 to 0.65 s")
    assert "periods" not in jobs.job_of({"excitation": base | {"pulse_band": [0.0, 0.1]}}).in_words
    both = jobs.job_of({"excitation": base | {"pulse_band": [0.2, 0.0], "scales": [2.0, 1.0]}}).conditions
    assert (len(both.motions), both.scales) == (5, (2.0, 1.0))
    assert both.motions[0].frequency == 2.0
