"""`tpd optimise` and `tpd check` as a whole, on small jobs: what is written, printed and returned."""

import json
import signal
import subprocess
import sys
import time
import tomllib

import numpy as np
import pytest

import tpd
from tpd.cli import main
from tpd.cli.new import template
from tpd.design import job as jobs

SMALL = """
[block]
restitution = 0.9
[space]
mass_ratio = [0.1, 0.4]
[search]
searches = 2
steps = 4
screening = 12
[ensemble]
size = 32
periods = 40
"""
BAND = """
[space]
damping_ratio = [0.05, 0.4]
[conditions]
band = [2.3, 2.7]
frequencies = 3
[search]
searches = 4
steps = 6
screening = 32
[ensemble]
size = 32
periods = 40
"""
DATA = {"report.txt", "report.html", "design.json", "scene.toml"}


def command(folder, *arguments: str) -> subprocess.CompletedProcess:
    """A finished run of the command line in `folder`."""
    return subprocess.run(
        [sys.executable, "-m", "tpd.cli", *arguments], cwd=folder, capture_output=True, text=True
    )


@pytest.fixture(scope="module", params=[SMALL, BAND], ids=["one", "band"])
def written(request, tmp_path_factory):
    """A small run of the whole command, and what it printed."""
    folder = tmp_path_factory.mktemp("cli")
    (folder / "small.toml").write_text(request.param)
    return folder, command(folder, "optimise", "--scene", "small.toml", "--seed", "3", "--out", "first")


def test_a_run_writes_its_report(written):
    folder, done = written
    assert done.returncode in (0, 3), done.stderr
    names = {path.name for path in (folder / "first").iterdir()}
    assert names >= DATA
    assert "unfinished.npz" not in names
    report = (folder / "first" / "report.txt").read_text(encoding="utf-8")
    assert len(done.stdout.splitlines()) <= 30
    scene, shown = done.stdout.split("\n\n", maxsplit=1)
    own = "[block]" in (folder / "small.toml").read_text()
    losses = "other losses than the paper's" if own else "the paper's motion and losses"
    assert scene.splitlines()[0] == f"Scene: the paper's block (Collini et al. 2016) with {losses}."
    assert shown.split("\n  conditions ")[0] == report.split("\n\nblock  ")[0], "the verdict"
    assert shown.splitlines()[-2:] == [
        "  report     first/report.html",
        "  again      tpd optimise --scene first/scene.toml --out first-again",
    ]
    assert "\r" not in done.stderr, "no progress bar in a pipe"
    first, *others = done.stderr.splitlines()
    assert first == f"tpd {tpd.__version__}: searching for the pendulum of least rocking, for first"
    assert all(line.startswith("tpd: ") and line.endswith(" s") for line in others)


def test_the_exit_status_says_whether_a_design_is_offered(written):
    folder, done = written
    content = json.loads((folder / "first" / "design.json").read_text())
    assert content["version"] == 8
    assert (done.returncode == 0) is (content["pendulum"] is not None)


def test_the_report_holds_the_job_with_the_options_over_the_file(written):
    folder, _ = written
    content = json.loads((folder / "first" / "design.json").read_text())
    job = jobs.job_of(content["job"])
    assert job.seed == 3
    assert jobs.job_of(tomllib.loads((folder / "first" / "scene.toml").read_text())) == job


def test_the_report_is_read_back_bit_for_bit(written):
    folder, _ = written
    found = tpd.Design.read(folder / "first")
    job = jobs.job_of(tomllib.loads((folder / "first" / "scene.toml").read_text()))
    assert found.job == job
    assert job.seed == 3
    content = json.loads((folder / "first" / "design.json").read_text())
    assert (found.pendulum and vars(found.pendulum)) == content["pendulum"]
    assert found.status.name == content["status"]


def test_a_report_is_not_overwritten(written):
    folder, _ = written
    done = command(folder, "optimise", "--scene", "small.toml", "--out", "first")
    assert done.returncode == 2
    assert "already holds files" in done.stderr


@pytest.mark.slow
def test_the_written_job_repeats_the_run(written):
    folder, _ = written
    command(folder, "optimise", "--scene", "first/scene.toml", "--out", "second").check_returncode()
    for name in ("design.json", "scene.toml"):
        assert (folder / "first" / name).read_bytes() == (folder / "second" / name).read_bytes()


def test_a_check_solves_the_design_of_a_report_by_all_models(written):
    folder, _ = written
    done = command(folder, "check", "first", "--quick")
    assert done.returncode in (0, 3), done.stderr
    scene, table, *verdict = done.stdout.split("\n\n")
    assert scene.startswith("Scene: the paper's block")
    assert [line.split()[0] for line in table.splitlines()] == [
        "model",
        "uplift",
        "one",
        "exact",
        "nonlinear",
    ]
    assert verdict


@pytest.mark.slow
def test_after_ctrl_c_a_run_keeps_what_it_has_and_goes_on_with_resume(tmp_path):
    (tmp_path / "job.toml").write_text(BAND.replace("searches = 4", "searches = 64"))
    arguments = [sys.executable, "-m", "tpd.cli", "optimise", "--scene", "job.toml", "--out", "out"]
    run = subprocess.Popen(arguments, cwd=tmp_path, stdout=subprocess.PIPE, stderr=subprocess.PIPE, text=True)
    unfinished = tmp_path / "out" / "unfinished.npz"
    while run.poll() is None and not unfinished.exists():
        time.sleep(0.05)
    run.send_signal(signal.SIGINT)
    out, err = run.communicate(timeout=300)
    assert run.returncode == 130, err
    assert "go on with the same command and --resume" in out
    assert unfinished.exists()
    again = command(tmp_path, *arguments[3:], "--resume")
    assert again.returncode in (0, 3), again.stderr
    assert not unfinished.exists()
    # A run that was not interrupted has the same answer.
    whole = command(tmp_path, "optimise", "--scene", "job.toml", "--out", "whole")
    assert whole.returncode == again.returncode
    designs = [json.loads((tmp_path / name / "design.json").read_text()) for name in ("out", "whole")]
    assert designs[0]["pendulum"] == designs[1]["pendulum"]


def test_a_file_of_another_problem_is_not_resumed(capsys, tmp_path):
    job = tmp_path / "job.toml"
    job.write_text(BAND)
    out = tmp_path / "out"
    out.mkdir()
    np.savez(out / "unfinished.npz", problem=np.array("another"))
    content = (out / "unfinished.npz").read_bytes()
    assert main(["optimise", "--scene", str(job), "--out", str(out), "--resume"]) == 2
    assert "holds searches of another problem" in capsys.readouterr().err
    assert {path.name for path in out.iterdir()} == {"unfinished.npz"}
    assert (out / "unfinished.npz").read_bytes() == content


@pytest.fixture(scope="module")
def on_records(tmp_path_factory):
    """A small design on records by a job file, with what was printed."""
    folder = tmp_path_factory.mktemp("records")
    block = template("column").partition("[motion]")[0]
    motion = '[motion]\nrecords = ["mine", "loma-prieta"]\nscales = [2, 3]\n[search]\nstarts = 4\nsteps = 1\n'
    (folder / "job.toml").write_text(block + motion)
    (folder / "mine").mkdir()
    lines = (f"{0.01 * i:.2f},{0.3 * np.sin(0.05 * i):.6f}\n" for i in range(400))
    (folder / "mine" / "quake.csv").write_text("time (s),acc (g)\n" + "".join(lines))
    return folder, command(folder, "optimise", "--scene", "job.toml", "--out", "first", "--quiet")


def test_quiet_is_the_verdict_and_the_path(on_records):
    folder, done = on_records
    assert done.returncode == 3, done.stderr
    verdict, path = done.stdout.splitlines()
    assert verdict.startswith("NO PENDULUM WORTH HANGING: ")
    assert path == "first"
    assert (folder / "first" / "report.html").is_file()


def test_a_design_on_records_is_repeated_by_its_scene_alone(on_records):
    folder, _ = on_records
    (folder / "elsewhere").mkdir()
    done = command(
        folder / "elsewhere", "optimise", "--scene", "../first/scene.toml", "--json", "--out", "again"
    )
    assert done.returncode == 3, done.stderr
    again = json.loads(done.stdout)
    first = json.loads((folder / "first" / "design.json").read_text())
    assert again | {"command": ""} == first | {"command": ""}
    scenes = [path / "scene.toml" for path in (folder / "first", folder / "elsewhere" / "again")]
    assert scenes[0].read_text() == scenes[1].read_text()
    stored = tpd.Design.read(folder / "first")
    assert stored.job.tables["motion"]["records"] == [str(folder / "mine"), "loma-prieta"]
    assert stored.job.block == jobs.job_of(jobs.read(folder / "job.toml")).block


def test_a_pendulum_is_judged_on_the_records_of_a_job(on_records):
    folder, _ = on_records
    ratios = ("--mass-ratio", "0.05", "--length-ratio", "0.4", "--pendulum-damping", "0.2")
    done = command(folder, "check", "--scene", "job.toml", *ratios)
    assert done.returncode == 3
    last = done.stdout.splitlines()[-1]
    assert last.startswith("NO PENDULUM WORTH HANGING: ")
    assert "5 earthquakes on either side are the least for a judgement" in last
    assert "  motion  2 records, each at pga_star 2, 3" in done.stdout


def test_a_design_is_shaken_by_another_record(on_records):
    folder, _ = on_records
    done = command(folder, "shake", "first")
    assert done.returncode == 2
    assert "the job has 2 records, but one is needed: --record FILE" in done.stderr
    done = command(folder, "shake", "first", "--record", "el-centro", "--scale", "0.5", "--free", "1")
    assert done.returncode == 0
    assert json.loads((folder / "tpd-shake" / "shake.json").read_text())["scene"]["block"]["height"] == 6.0
    done = command(folder, "response", "first")
    assert done.returncode == 2
    assert "`tpd response` is about harmonic motion, and the job has records" in done.stderr
