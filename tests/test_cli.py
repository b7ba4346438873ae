"""The command line: what it refuses, what it writes, and that it starts fast."""

import json
import subprocess
import sys
import tomllib

import pytest

import tpd
from tpd import Pendulum, paper_scene
from tpd.cli import common, main, optimise, parser
from tpd.design import job

SMALL = "[space]\nmass_ratio = [0.1, 0.4]\n[search]\nstarts = 2\nsteps = 4\nscreening = 12\n"
PICTURES = {"search.png", "motion.png", "response.png", "drawing.png", "animation.gif"}
FILES = {"report.txt", "report.html", "design.json", "scene.toml", *PICTURES}


def refused(capsys, *arguments: str, command: str = "optimise") -> str:
    try:
        status = main([command, *arguments])
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
        (("--restitution", "0"), "`restitution` must be positive and finite, but is 0"),
        (("--restitution", "1.5"), "`restitution` must be between 0 and 1, but is 1.5"),
        (("--restitution", "bouncy"), "`restitution` must be a number or 'housner', but is 'bouncy'"),
        (("--width", "0.3"), "`width` must be at most 0.5 of `height` (the linear equations drop"),
        (("--mass-ratio", "0.2", "0.1"), "`mass_ratio` must be an interval low < high"),
        (("--length-ratio", "0.5", "0.5"), "`length_ratio` must be an interval"),
        (("--damping", "0.1", "0.2", "0.3"), "`--damping` must be one number or two bounds"),
        (("--stroke", "0"), "`stroke` must be positive"),
        (("--starts", "0"), "`starts` must be a whole number, 1 or more"),
        (("--seed", "-1"), "`seed` must be zero or positive"),
        (("--band", "3", "2"), "`band` must be an interval low < high"),
        (("--band", "2", "3", "--from-starts", "-1"), "`reached` must be a whole number, 0 or more"),
        (("--band", "2", "3", "--worst-start"), "the worst start (`by_share` false) is among those"),
        (("--band", "2", "3", "--method", "newton"), "`method` must be one of sequential, adam, lbfgs"),
        (("--method", "adam"), "`search.method` goes with conditions"),
        (("--scatter", "friction"), "`--scatter` must be NAME=WIDTH"),
        (("--scatter", "colour=0.1"), "unknown key `colour` in [scatter]"),
        (("--pareto",), "`--pareto` and `--resume` go with conditions"),
        (("--band", "2", "3", "--resume"), "there is nothing to resume"),
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


MAP = ("--x", "mu", "0.01", "0.2", "--y", "lam", "0.1", "1.5")
HUNG = ("--mass-ratio", "0.1", "--length-ratio", "0.5")


@pytest.mark.parametrize(
    ("arguments", "message"),
    [
        (("response", "--width", "-1"), "`width` must be positive and finite, but is -1"),
        (("response", "--pendulum-mass", "1"), "give --pendulum-length or --length-ratio as well"),
        (("response", "--pendulum-length", "1"), "give --pendulum-mass or --mass-ratio as well"),
        (("response", "--pendulum-damping", "0.2"), "give --pendulum-mass or --mass-ratio as well"),
        (("response", *HUNG, "--pendulum-mass", "1"), "not allowed with argument"),
        (("response", *HUNG, "--pendulum-damping", "-1"), "`damping_ratio` must be zero or positive"),
        (("response", "--from", "0"), "`--from` must be positive and finite, but is 0"),
        (("response", "--from", "3", "--to", "2"), "`--from` must be below `--to`, but they are 3 and 2"),
        (("response", "--points", "3"), "`--points` must be between 8 and 100000, but is 3"),
        (("response", "--from-rest", "1"), "`--from-rest` must be a whole number, 2 or more, but is 1"),
        (("map", "--x", "mu", "0.01", "0.2"), "the following arguments are required: --y"),
        (("map", *MAP[:4], "--y", "lam", "a", "1"), "`--y` must be a name and two numbers, but is lam a 1"),
        (("map", *MAP[:4], "--y", "lam", "1", "0.1"), "`--y` must go up, but goes from 1 to 0.1"),
        (("map", *HUNG, *MAP[:4], "--y", "omega", "1", "2"), "`y` must be one of width, height"),
        (("map", *HUNG, *MAP[:4], "--y", "pendulum-mass", "1", "2"), "must not both move mu"),
        (("map", *MAP[:4], "--y", "f", "0.1", "0.2"), "give --pendulum-length or --length-ratio as well"),
        (("map", *MAP[:4], "--y", "nu", "0.1", "0.6"), "give --pendulum-length"),
        (("map", *MAP, "--points", "3000"), "`--points` must be between 2 and 2000, but is 3000"),
        (("map", *MAP, "--points", "1"), "`--points` must be a whole number, 2 or more, but is 1"),
        (("map", *MAP, "--scene", "absent.toml"), "cannot read absent.toml: No such file or directory"),
    ],
)
def test_bad_options_of_the_other_commands_are_one_sentence(
    capsys, tmp_path, monkeypatch, arguments, message
):
    monkeypatch.chdir(tmp_path)
    command, *rest = arguments
    assert message in refused(capsys, *rest, command=command)
    assert list(tmp_path.iterdir()) == []


def test_a_pendulum_is_given_in_si_units_or_in_ratios():
    scene = paper_scene()
    options = parser().parse_args(["response", "--pendulum-mass", "0.8112", "--length-ratio", "0.5"])
    assert common.pendulum(options, scene) == Pendulum(mass=0.8112, length=0.1, damping_ratio=0.1)
    options = parser().parse_args(["response", "--mass-ratio", "0.05", "--pendulum-length", "0.1"])
    assert common.pendulum(options, scene).mass == pytest.approx(0.8112)
    assert common.pendulum(parser().parse_args(["response"]), scene) is None
    # What a map varies need not be given.
    options = parser().parse_args(["map", *MAP])
    assert common.pendulum(options, scene, ("mu", "lam")).damping_ratio == 0.1


@pytest.mark.parametrize(
    ("content", "message"),
    [
        ("[block]\nwidht = 1.0\n", "unknown key `widht` in [block]; allowed are friction, height"),
        ("[blok]\nwidth = 1.0\n", "unknown table [blok]"),
        ("[block]\nwidth = 'wide'\n", "`block.width` must be a number, but is 'wide'"),
        ("[block]\nwidth = true\n", "`block.width` must be a number, but is True"),
        ("[block]\nwidth = [0.1, 0.2]\n", "`block.width` must be a number"),
        ("[block]\nrestitution = 'bouncy'\n", "`restitution` must be a number or 'housner', but is 'bouncy'"),
        ("[block]\nrestitution = true\n", "`block.restitution` must be a number, but is True"),
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


@pytest.mark.parametrize(
    ("content", "options", "expected"),
    [
        ("", (), (0.05, None)),
        ("", ("--restitution", "housner"), (0.0, "housner")),
        ("restitution = 'housner'\n", ("--friction", "0.02"), (0.02, "housner")),
        ("restitution = 'housner'\n", ("--restitution", "0.9"), (0.0, 0.9)),
        ("friction = 0.1\n", ("--restitution", "1"), (0.1, 1.0)),
    ],
)
def test_losses_come_from_the_file_and_the_options(tmp_path, content, options, expected):
    file = tmp_path / "scene.toml"
    file.write_text(f"[block]\n{content}")
    block = common.scene(parser().parse_args(["response", "--scene", str(file), *options])).block
    assert (block.friction, block.restitution) == expected


@pytest.mark.parametrize(
    ("options", "starts", "by_share", "method"),
    [
        ((), 0, True, "sequential"),
        (("--from-starts", "12"), 12, True, "sequential"),
        (("--from-starts", "12", "--worst-start", "--method", "lbfgs"), 12, False, "lbfgs"),
    ],
)
def test_what_a_search_over_conditions_is_about_comes_from_the_options(options, starts, by_share, method):
    given = parser().parse_args(["optimise", "--band", "2", "3", "--scatter", "friction=0.1", *options])
    work = job.build(optimise._given(given))
    assert work.asked.reached(3) == (tpd.Starts(size=starts, seed=3) if starts else None)
    assert work.asked.wanted.by_share is by_share
    assert work.asked.scatter == {"friction": 0.1}
    assert work.search.method == method
    assert job.build(tomllib.loads(job.dump(work))) == work


def test_a_file_may_leave_to_the_options_what_makes_it_whole(tmp_path):
    file = tmp_path / "scene.toml"
    file.write_text('[search]\nmethod = "adam"\n[conditions]\nby_share = false\n')
    options = ("--band", "2", "3", "--from-starts", "4")
    work = job.build(optimise._given(parser().parse_args(["optimise", "--scene", str(file), *options])))
    assert (work.search.method, work.asked.wanted.reached, work.asked.wanted.by_share) == ("adam", 4, False)


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


@pytest.mark.slow
def test_the_written_scene_repeats_the_run(written):
    folder, _ = written
    command = [sys.executable, "-m", "tpd.cli", "optimise", "--scene", "first/scene.toml", "--out", "second"]
    subprocess.run(command, cwd=folder, check=True, capture_output=True)
    for name in ("design.json", "scene.toml", "report.txt"):
        assert (folder / "first" / name).read_bytes() == (folder / "second" / name).read_bytes()


def test_a_check_takes_the_design_of_a_report_up_the_ladder(written):
    folder, _ = written
    command = [sys.executable, "-m", "tpd.cli", "check", "first", "--quick"]
    done = subprocess.run(command, cwd=folder, capture_output=True, text=True)
    assert done.returncode == 0, done.stderr
    table, verdict = done.stdout.split("\n\n")
    assert [line.split()[0] for line in table.splitlines()] == ["rung", "uplift", "one", "exact", "nonlinear"]
    assert "nothing against this design" in verdict


@pytest.mark.parametrize(
    ("content", "message"),
    [
        (None, "cannot read"),
        ("not json", "is not a design in JSON"),
        ("[1]", "has no `job` and `pendulum`"),
        ('{"job": [], "pendulum": null}', "is not what a report holds"),
        ('{"job": {}, "pendulum": {"mass": 1.0}}', "is not what a report holds"),
    ],
)
def test_what_is_no_design_is_not_checked(capsys, tmp_path, content, message):
    file = tmp_path / "design.json"
    if content is not None:
        file.write_text(content)
    assert message in refused(capsys, str(file), command="check")


@pytest.mark.parametrize("flag", ["--version", "--help", "map --help", "response --help"])
def test_help_and_version_do_not_wait_for_jax(flag):
    code = f"""
import sys
from tpd.cli import main
try:
    main({flag.split()})
except SystemExit:
    pass
assert "jax" not in sys.modules
"""
    done = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True)
    assert done.returncode == 0, done.stderr
    assert done.stderr == ""
    if flag == "--version":
        assert done.stdout == f"tpd {tpd.__version__}\n"


def test_what_the_command_line_compiles_can_be_kept():
    """A program that calls back to Python is compiled anew in every run."""
    code = """
from tpd.cli import common
common.use_64_bits()
import equinox as eqx, jax
from tpd import Segmented, Smoothed, Terms, paper_scene, steady_state
from tpd.core.parameters import as_arrays
p = as_arrays(paper_scene().parameters())
def amplitude(mu, model):
    return steady_state(eqx.tree_at(lambda q: q.mu, p, mu), model=model).amplitude
for model in (Smoothed(), Segmented(terms=Terms.nonlinear)):
    text = jax.jit(lambda mu: amplitude(mu, model)).lower(0.1).as_text()
    assert "while" in text
    assert "callback" not in text, model
"""
    done = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True)
    assert done.returncode == 0, done.stderr
