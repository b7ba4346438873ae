"""`tpd optimise`: files, printed answer and exit status, for a small search and for prepared designs."""

import json
import re
import tomllib
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

import tpd
from tests.cli.conftest import call
from tests.formats.synthetic import peer, shaking
from tests.report.conftest import details, harmonic, rejected
from tpd.cli import optimise
from tpd.cli.grammar import TEMPLATES
from tpd.cli.new import template
from tpd.design import job as jobs
from tpd.design.reasons import DesignStatus
from tpd.records.read import facts

BAND = """
[block]
restitution = 0.9
[space]
mass_ratio = [0.1, 0.4]
[conditions]
band = [2.3, 2.7]
frequencies = 2
"""
DATA = {"report.txt", "report.html", "design.json", "report.json", "scene.toml"}


@pytest.fixture
def run_with(monkeypatch, tmp_path):
    """Return a function that runs `optimise` with a prepared design instead of a search.

    The function returns the result of the command and the inputs of the search.
    """
    monkeypatch.chdir(tmp_path)

    def run(design, *words: str):
        inputs = {}

        def search(problem, progress):
            inputs.update(problem.inputs)
            return replace(design, problem=replace(design.problem, job=problem.job))

        monkeypatch.setattr(optimise, "solve_problem", search)
        monkeypatch.setattr("tpd.plots.results.draw", lambda *_: b"<svg/>")
        shown = replace(details(), histories=())
        monkeypatch.setattr(optimise, "details", lambda *_, **__: shown)
        return call("optimise", *words, out=Path("out")), inputs

    return run


def test_a_run_writes_its_report_with_the_job_and_prints_its_first_screen(run_with, tmp_path):
    (tmp_path / "small.toml").write_text(BAND)
    done, inputs = run_with(harmonic(), "--scene small.toml --seed 3")
    assert (done.status, inputs["seed"]) == (3, 3)
    assert done.files.keys() >= DATA
    losses = "with other losses than the paper's"
    assert f"Scene: the paper's block (Collini et al. 2016) {losses}." in done.err.splitlines()
    assert done.out == done.files["report.txt"].read_text(encoding="utf-8")
    assert done.out.splitlines()[-2:] == [
        "  report         out/report.html",
        "  repeat         tpd optimise out/scene.toml --out out-again",
    ]
    content, stored = done.json("design.json"), tpd.read_design("out")
    job = jobs.job_of(tomllib.loads(done.files["scene.toml"].read_text()))
    assert stored.job == job == jobs.job_of(content["job"])
    assert job.seed == 3
    assert vars(stored.pendulum) == content["pendulum"]
    assert stored.status.name == content["status"]


def test_option_seed_sets_the_seeds_of_search_and_ensemble(run_with, tmp_path):
    (tmp_path / "small.toml").write_text(BAND + "[ensemble]\nsize = 40\n")
    # [ensemble] may have a seed of its own. --seed replaces both seeds.
    (tmp_path / "other.toml").write_text(BAND + "[search]\nseed = 2\n[ensemble]\nseed = 5\n")
    for words, seeds in (
        ("small.toml", (0, 0)),
        ("small.toml --seed 3", (3, 3)),
        ("other.toml", (2, 5)),
        ("out/scene.toml --seed 8", (8, 8)),
    ):
        inputs = run_with(harmonic(), f"--overwrite --scene {words}")[1]
        assert (inputs["seed"], inputs["ensemble"].seed) == seeds


def test_exit_status_is_3_if_no_design_is_recommended(run_with):
    assert run_with(rejected())[0].status == 3
    assert run_with(replace(rejected(), status=DesignStatus.no_uplift), "--overwrite")[0].status == 0


def test_quiet_prints_the_verdict_and_verbose_all_rows(run_with):
    done, _ = run_with(rejected(), "--quiet")
    verdict, path = done.out.splitlines()
    assert verdict.startswith("NOT RECOMMENDED: ")
    assert path == "out"
    done, _ = run_with(rejected(), "--json --overwrite")
    assert json.loads(done.out) == done.json("design.json")
    done, _ = run_with(rejected(), "--verbose --overwrite")
    assert done.out.startswith(done.files["report.txt"].read_text())
    assert re.search(r"\n  nearby .*", done.out)
    done, _ = run_with(rejected())
    assert done.status == 2
    assert "already contains files" in done.err


@pytest.fixture(scope="module")
def on_records(tmp_path_factory):
    """Return the folder of a job file with records, and the result of `tpd optimise`."""
    folder = tmp_path_factory.mktemp("records")
    block = template("column").partition("[excitation]")[0]
    motion = (
        '[excitation]\nrecords = ["mine", "loma-prieta"]\nscales = [2, 3]\n[search]\ndesigns = 4\nsteps = 1\n'
    )
    (folder / "job.toml").write_text(block + motion)
    (folder / "mine").mkdir()
    lines = (f"{0.01 * i:.2f},{0.3 * np.sin(0.05 * i):.6f}\n" for i in range(400))
    (folder / "mine" / "quake.csv").write_text("time (s),acc (g)\n" + "".join(lines))
    return folder, call("optimise --quiet --scene", str(folder / "job.toml"), out=folder / "first")


def test_the_scene_file_of_a_report_repeats_its_search_exactly(on_records, tmp_path, monkeypatch):
    folder, first = on_records
    assert first.status == 3
    assert first.err == "", "a quiet command has no progress"
    assert first.out.startswith("TOO FEW EARTHQUAKES")
    monkeypatch.chdir(tmp_path)
    again = call("optimise --json --scene", str(folder / "first" / "scene.toml"), out=tmp_path / "again")
    assert again.status == 3
    assert json.loads(again.out) == first.json("design.json")
    assert again.files["scene.toml"].read_text() == first.files["scene.toml"].read_text()
    stored = tpd.read_design(folder / "first")
    assert stored.job.tables["excitation"]["records"] == [str(folder / "mine"), "loma-prieta"]
    assert stored.job.block == jobs.job_of(jobs.read_tables(folder / "job.toml")).block


def test_check_validates_a_pendulum_with_the_records_of_a_job(on_records):
    words = "--mass-ratio 0.05 --length-ratio 0.4 --pendulum-damping 0.2"
    done = call("check --scene", str(on_records[0] / "job.toml"), words)
    assert done.status == 3
    text = " ".join(done.out.split())
    # All earthquakes count for a stated pendulum.
    assert "all records (32 runs): mean tilt" in text
    assert "2 to 2.05: " in text
    assert re.search("\n(NOT RECOMMENDED: |TOO FEW EARTHQUAKES)", done.out)
    assert "  excitation  2 records, each at 2, 3 (PGA over g tan(alpha); at 1 " in done.out


def test_shake_simulates_a_stored_design_under_another_record(on_records, tmp_path):
    first = str(on_records[0] / "first")
    done = call("shake", first, out=tmp_path / "out")
    assert "the job has 2 records (quake.csv; loma-prieta), but exactly one is needed: choose it" in done.err
    done = call("shake", first, "--record el-centro --scale 0.5 --free 1", out=tmp_path / "out")
    assert done.status == 0
    assert done.json("shake.json")["scene"]["block"]["height"] == 6.0
    done = call("response", first, out=tmp_path / "out")
    assert "`tpd response` needs a harmonic motion, but the job has records" in done.err


def test_report_and_json_describe_every_record(on_records):
    first = on_records[1]
    quake, quakes = (tpd.Record.read(on_records[0] / "mine" / "quake.csv"), tpd.records.loma_prieta())
    content = first.json("design.json")["records"]
    assert {r["source"] for r in content["files"]} == {"quake.csv", "loma-prieta"}
    expected = {"quake.csv": facts(quake), "loma-prieta": facts(quakes)}
    assert {r.pop("group") for r in content["files"]} == {"all records"}
    assert {r["source"]: r for r in content["files"]} == expected
    assert any("records state no orientation" in note for note in content["notes"])
    page = first.files["report.html"].read_text(encoding="utf-8")
    for part in ("quake.csv", "offset: the mean, ", "records state no orientation"):
        assert part in page.replace("\u00a0", " ")


def test_the_terminal_summarises_many_records_in_one_line(run_with, tmp_path):
    (tmp_path / "quakes").mkdir()
    for i in range(60):
        text = peer(0.3 * shaking(100, i), 0.01).replace("1/2/1999", f"1/2/{1940 + i}")
        (tmp_path / "quakes" / f"{i}.AT2").write_text(text)
    (tmp_path / "quakes" / "a.AT2").write_text(text.replace("ACCELERATION", "VELOCITY"))
    block = template("column").partition("[excitation]")[0]
    (tmp_path / "job.toml").write_text(block + '[excitation]\nrecords = ["quakes"]\nscales = [1]\n')
    done, _ = run_with(harmonic(), "--scene job.toml")
    assert done.status == 3
    lines = done.err.splitlines()
    assert len(done.out.splitlines()) <= 25
    assert lines[0].startswith("records: 60 of 60 earthquakes, 100 samples of 0.01 s, 0.99 s long, PGA ")
    assert lines[1] == "left out: a.AT2 (velocity)"


def test_validation_records_of_a_search_earthquake_are_left_out(tmp_path):
    texts = {"a.AT2": "1/2/1999", "b.AT2": "01/02/99", "c.AT2": "1/2/1990"}
    for i, (name, day) in enumerate(texts.items()):
        (tmp_path / name).write_text(peer(0.3 * shaking(100, i), 0.01).replace("1/2/1999", day))
    names = [str(tmp_path / name) for name in texts]
    job = jobs.job_of({"excitation": {"records": names[:1], "validation_share": names[1:], "scales": [1.0]}})
    assert job.file_notes == (
        "validation, b.AT2: left out, because the search uses the same earthquakes: b.AT2",
    )


FEW = "\n[ensemble]\nsize = 32\nperiods = 30\n"
"""Table of a job with few and short validation runs."""


STATUE = "--width 0.5 --height 1.5333 --mass 900 --cavity 0.3"
NOT_NEEDED = "NOT NEEDED: under all conditions the block without a pendulum stays at rest"


@pytest.mark.parametrize(
    ("words", "status", "first"),
    [
        (f"{STATUE} --records el-centro --pga 0.25 --validation-share 0", 0, NOT_NEEDED),
        ("--base-friction 0.1", 3, "NOT APPLICABLE: the block slides on its base before it lifts"),
    ],
    ids=["el centro at 0.25 g", "sliding"],
)
def test_a_block_that_does_not_rock_needs_no_search(words, status, first, tmp_path):
    done = call("optimise", words, out=tmp_path / "out")
    assert done.status == status
    assert done.out.startswith(first)
    assert done.json("design.json")["pendulum"] is None


@pytest.mark.slow
@pytest.mark.parametrize("kind", TEMPLATES)
def test_only_the_chimney_template_gets_a_pendulum(kind, tmp_path):
    """Only the chimney gets a pendulum, whose numbers the README states."""
    path = tmp_path / "job.toml"
    path.write_text(template(kind))
    done = call("optimise", str(path), out=tmp_path / "out")
    assert done.status == (0 if kind == "chimney" else 3)
    assert done.out.startswith("RECOMMENDED" if kind == "chimney" else "NOT RECOMMENDED")
    if kind == "chimney":
        content = done.json("design.json")
        assert 0.6 < content["overturning_reduction"]["mean"] < 0.85
        assert content["build"]["mass"] < 0.1 * 16280.0
