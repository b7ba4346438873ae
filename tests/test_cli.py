"""The command line: what it refuses, what it writes, and that it starts fast."""

import json
import subprocess
import sys

import pytest

import tpd
from tpd.cli import main

SMALL = "[space]\nmass_ratio = [0.01, 0.1]\nstroke = 1.5\n[search]\nstarts = 2\nsteps = 4\nscreening = 12\n"
FILES = {"report.txt", "design.json", "scene.toml", "search.png", "motion.png", "response.png"}


def refused(capsys, *arguments: str) -> str:
    try:
        status = main(["optimise", *arguments])
    except SystemExit as stop:
        status = stop.code
    out, err = capsys.readouterr()
    assert status == 2
    assert out == ""
    assert "Traceback" not in err
    return err


@pytest.mark.parametrize(
    ("arguments", "message"),
    [
        (("--width", "-1"), "`width` must be positive and finite, but is -1"),
        (("--height", "0"), "`height` must be positive"),
        (("--mass", "nan"), "`mass` must be positive and finite, but is nan"),
        (("--frequency", "0"), "`frequency` must be positive"),
        (("--friction", "-0.1"), "`friction` must be zero or positive"),
        (("--width", "0.3"), "`width` must be at most 0.5 of `height` (the linear equations drop"),
        (("--mass-ratio", "0.2", "0.1"), "`mass_ratio` must be an interval low < high"),
        (("--length-ratio", "0.5", "0.5"), "`length_ratio` must be an interval"),
        (("--damping", "0.1", "0.2", "0.3"), "`--damping` must be one number or two bounds"),
        (("--stroke", "0"), "`stroke` must be positive"),
        (("--starts", "0"), "`starts` must be a whole number of at least 1"),
        (("--seed", "-1"), "`seed` must be zero or positive"),
        (("--width", "wide"), "invalid float value: 'wide'"),
        (("--scene", "absent.toml"), "cannot read absent.toml: No such file or directory"),
    ],
)
def test_bad_options_are_one_sentence_and_nothing_is_written(
    capsys, tmp_path, monkeypatch, arguments, message
):
    monkeypatch.chdir(tmp_path)
    assert message in refused(capsys, *arguments)
    assert list(tmp_path.iterdir()) == []


@pytest.mark.parametrize(
    ("content", "message"),
    [
        ("[block]\nwidht = 1.0\n", "unknown key `widht` in [block]; allowed are friction, height"),
        ("[blok]\nwidth = 1.0\n", "unknown table [blok]"),
        ("[block]\nwidth = 'wide'\n", "`block.width` must be a number, but is 'wide'"),
        ("[block]\nwidth = true\n", "`block.width` must be a number, but is True"),
        ("[block]\nwidth = [0.1, 0.2]\n", "`block.width` must be a number"),
        ("[search]\nseed = 1.5\n", "`search.seed` must be a whole number"),
        ("block = 3\n", "`block` must be a table"),
        ("x = = 3\n", "is not valid TOML"),
    ],
)
def test_bad_scene_files_are_one_sentence(capsys, tmp_path, content, message):
    scene = tmp_path / "scene.toml"
    scene.write_text(content)
    assert message in refused(capsys, "--scene", str(scene), "--out", str(tmp_path / "out"))
    assert list(tmp_path.iterdir()) == [scene]


def test_existing_reports_and_unwritable_places_are_left_alone(capsys, tmp_path):
    taken = tmp_path / "taken"
    taken.mkdir()
    (taken / "mine.txt").write_text("keep me")
    assert "already holds files" in refused(capsys, "--out", str(taken))
    assert "is a file" in refused(capsys, "--out", str(taken / "mine.txt"))
    assert "cannot write to" in refused(capsys, "--out", "/proc/nowhere/out")
    assert (taken / "mine.txt").read_text() == "keep me"


@pytest.fixture(scope="module")
def written(tmp_path_factory):
    """A small run of the whole command, and what it printed."""
    folder = tmp_path_factory.mktemp("cli")
    (folder / "small.toml").write_text(SMALL)
    command = [sys.executable, "-m", "tpd.cli", "optimise", "--scene", "small.toml", "--seed", "3"]
    done = subprocess.run([*command, "--out", "first"], cwd=folder, capture_output=True, text=True)
    return folder, done


def test_a_run_writes_its_report(written):
    folder, done = written
    assert done.returncode == 0, done.stderr
    assert {path.name for path in (folder / "first").iterdir()} == FILES
    assert done.stdout.startswith((folder / "first" / "report.txt").read_text().splitlines()[0])
    assert done.stderr == "", "no progress bar in a pipe"
    content = json.loads((folder / "first" / "design.json").read_text())
    assert content["seed"] == 3, "options override the scene file"


def test_the_written_scene_repeats_the_run(written):
    folder, _ = written
    command = [sys.executable, "-m", "tpd.cli", "optimise", "--scene", "first/scene.toml", "--out", "second"]
    subprocess.run(command, cwd=folder, check=True, capture_output=True)
    for name in ("design.json", "scene.toml", "report.txt"):
        assert (folder / "first" / name).read_bytes() == (folder / "second" / name).read_bytes()


@pytest.mark.parametrize("flag", ["--version", "--help"])
def test_help_and_version_do_not_wait_for_jax(flag):
    code = f"""
import sys
from tpd.cli import main
try:
    main(["{flag}"])
except SystemExit:
    pass
assert "jax" not in sys.modules
"""
    done = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True)
    assert done.returncode == 0, done.stderr
    assert done.stderr == ""
    if flag == "--version":
        assert done.stdout == f"tpd {tpd.__version__}\n"
