"""Steps that the commands share: the pendulum of the options, the description of a job, stored programs, and
the rejection of invalid input: one sentence on stderr, exit status 2, and no files."""

import os
import re
import shlex
import subprocess
import sys

import pytest

from tests.cli.conftest import PENDULUM_OPTIONS, call
from tests.formats.synthetic import knet, shaking
from tpd import Pendulum, Record, paper_scene
from tpd.cli import common, main, parser
from tpd.cli.new import template
from tpd.records.read import facts

MAP = "--x mu 0.01 0.2 --y lam 0.1 1.5"


def pendulum(command: str) -> Pendulum | None:
    """Return the pendulum of a command for the paper's block."""
    return common.read_pendulum(parser().parse_args(command.split()), paper_scene().block)


def test_options_define_a_pendulum_in_si_units_or_in_ratios():
    mixed = pendulum("response --pendulum-mass 0.8112 --length-ratio 0.5")
    assert mixed == Pendulum(mass=0.8112, length=0.1, damping_ratio=0.1)
    assert pendulum("response --mass-ratio 0.05 --pendulum-length 0.1").mass == pytest.approx(0.8112)
    assert pendulum("response") is None
    # Quantities that a map varies can be left out.
    assert pendulum(f"map {MAP}").damping_ratio == 0.1
    with pytest.raises(ValueError, match="the pendulum has no length: give --pendulum-length or --length-ra"):
        pendulum("response --pendulum-mass 1")
    with pytest.raises(ValueError, match="the pendulum has no mass: give --pendulum-mass or --mass-ratio as"):
        pendulum("response --pendulum-damping 0.2")


def test_compiled_programs_have_no_callback_that_prevents_caching():
    """Check that no program calls back to Python: JAX would compile such a program in every run."""
    code = """
from tpd.core import jax_setup
jax_setup.use_64_bits()
import equinox as eqx, jax
text = jax.jit(lambda x: eqx.error_if(x, x < 0.0, "negative")).lower(0.1).as_text()
assert "callback" not in text
"""
    env = {name: value for name, value in os.environ.items() if name != "EQX_ON_ERROR"}
    done = subprocess.run([sys.executable, "-c", code], env=env, capture_output=True, text=True)
    assert done.returncode == 0, done.stderr


WORDS = {
    "OWN": "SIZE SHAKEN",
    "SHAKEN": "--amplitude 0.015 --frequency 2.5",
    "REST_OF_IT": "--height 0.4 --mass 16 SHAKEN",
    "SIZE": "--width 0.1 --height 0.4 --mass 16",
    "BOB": "--mass-ratio 0.1 --length-ratio 0.5",
    "MAP": "X --y lam 0.1 1.5",
    "X": "--x mu 0.01 0.2",
    "PULSE": "--pulse one-sine --pulse-frequency 1.2375",
    "LONG": "x" * 300,
    "REST": "block.height = 0.4; block.mass = 16; excitation.amplitude = 0.015; excitation.frequency = 2.5",
}
"""Abbreviations in capitals of the table, with the words that they stand for."""
CAPITALS = rf"\b({'|'.join(WORDS)})\b"
TABLE = r"""
optimise --width -1 REST_OF_IT | [block] `width` must be positive and finite, but is -1
optimise --width 0.3 REST_OF_IT | [block] `width` must be at most 0.5 of `height`, or of twice `cen
optimise --mass-ratio 0.1 0.2 0.3 | must be a number or a pair of numbers, but is [0.1, 0.2, 0.3]
optimise --mass-ratio 0.1 0.2 --pendulum-mass 2 | [space] `mass` and `mass_ratio` state the same quantity: gi
optimise --pendulum-length 0.1 0.5 | [space] `length` must be between 0.0002 and 0.4 m in this block, but is
optimise --cavity 0.1 | [block] `cavity_width` must be less than the width of the block, 0.1 m, because
optimise --exactly --band 2 3 | `conditions.exactly` requires a single motion (no band, no amplitudes and no s
optimise --scatter friction | `--scatter` must be NAME=WIDTH, such as friction=0.2, but is 'friction'
optimise --width 0.2 | amplitude` and `frequency` in [excitation] are missing. A block with `width` needs
optimise --scene absent.toml | cannot read absent.toml: No such file or directory
optimise --scene . | cannot read .: Is a directory
optimise --scene /dev/null | /dev/null is empty: create a job file with `tpd new`
optimise --stroke 1.6 | [limits] `stroke` must be at most 1.5708, a right angle in rad, but is 1.6
optimise --exactly --risk worst | `search.risk` requires several conditions, [conditions] or [scatter], whi
optimise --friction 0 --scatter friction=0.1 | [scatter] `friction` cannot vary by a share of itsel
job block.widht = 1.0 | there is no key `widht` in [block]; did you mean `width`?
job blok.width = 1.0 | there is no table [blok]; did you mean `blo
job project.name = 3 | `project.name` must be a text in one line of at most 100 characters, but is 3
job search.budget = 8 | there is no key `budget` in [search]; allowed are optimiser, model
job conditions.band = [2, 3]; conditions.frequencies = 2000000 | a job must have at most 100000 conditions, bu
job block.width = 0.1; block.radius_of_gyration = 0.3; REST | [block] `radius_of_gyration` must be at most 0.2
response --pendulum-mass 1 | has no length: give --pendulum-length or --length-ratio as well
response BOB --pendulum-mass 1 | not allowed with argument
response --pendulum-mass 20 --length-ratio 0.5 | `--pendulum-mass` must be at most 16.224, the mass of the blo
response --from 3 --to 2 | `--from` must be below `--to`, but they are 3 and 2
response --points 3 | `--points` must be between 8 and 100000, but is 3
map X | the following arguments are required: --y
map X --y lam a 1 | `--y` must be a name and two numbers, but is lam a 1
map BOB X --y omega 1 2 | `y` must be one of width, height
check absent | cannot read absent: No such file or directory
check | a pendulum is missing: give DESIGN, or --pendulum-mass and --pendulum-length
check absent BOB | absent contains a scene and a pendulum: give either DESIGN or options for these
response --out LONG | cannot write to xxx
check BOB --runs 5 | --runs has an effect only together with --engine
check BOB --sliding 0.5 | unrecognized arguments: --sliding; it is now called `--base-friction`
map --x mu 0.1 50 --y lam 0.1 1.5 | `--x` must be at most 1, a bob as heavy as the block
fragility --records el-centro loma-prieta --event a=b | `records.events` requires a fi
spectrum --record el-centro --sizes-to 5 | --sizes-to has an effect on the spectrum of a pulse
spectrum --pulse ricker --pga 0.3 | --pga has no effect here: a spectrum has pulses of all freq
job x = = 3 | is not valid TOML: Invalid value (at line 1, column 5)
job [block]; width = 0,5 | (at line 2, column 10); write 0.5 with a decimal point, not 0,5
job [block]; width = "0,5" | `block.width` must be a number, but is '0,5'; write 0.5 with a decimal point
optimise --width 0,5 | `block.width` must be a number, but is '0,5'; write 0.5 with a decimal point
shake --free 1,5 | invalid float value: '1,5'; write 1.5 with a decimal point, not 1,5
job [block]; [block] | is not valid TOML: Cannot declare
job [[block]]; width = 1 | `block` must be a table, but is [{'width': 1}]
shake | the motion must be a pulse or a record: give --record FIL
shake SIZE --record nothing.csv | nothing.csv
new | required: KIND
new tower --out /proc/nowhere/tower.toml | cannot use /proc/nowhere/tower.toml
optmise | did you mean `optimise`?
optimise --recrods a | unrecognized arguments: --recrods; did you mean `--records`?
export --as csv --pulse ricker --amplitude 1 | has keys of a pulse (`pulse`) and of a harm
export --as csv BOB --out . | --out must name a file, but . is a directory
optimise --width 100 --height 400 --mass 16.2 --amplitude 15 --frequency 2.5 | [block] `mass` must give a dens
optimise SHAKEN --width 0.1 --height 0.4 --mass 0.016 | are the lengths in m and the mass in kg?
optimise --amplitude 50 --frequency 1 | [excitation] `amplitude` and `frequency` give
optimise OWN | `cavity_width` must be given, but is missing. It is the distance in m between the walls
map BOB X --y amplitude 5 50 | whose acceleration must be at most 10 g
spectrum --width 450 --height 1800 --mass 900 --pulse one-sine | kg/m^3
response BOB --from -1e0 | `--from` must be positive and finite, but is -1
optimise --records el-centro --records loma-prieta | argument --records: it is given 2 times
shake SIZE --pulse mavroeidis-papageorgiou --pulse-frequency 1 --pga 1 --phase 90 | 6.28319 rad, but is 90
shake SIZE PULSE | [excitation] `pga`, the peak acceleration of the pulse in g, is missing
record '' | the name of a record must not be empty, but is ''
map BOB X --y lam 0.1 1 --out '' | argument --out: the name of a file is empty or has control characters: ''
job excitation.records = ["C:\Users\a.AT2"] | write a path with backslashes in single quotes
assess SIZE --records el-centro --intensity pga --scales 30 | must be at most 10 g, but is 30 g: is it in g?
fragility SIZE --records el-centro --intensity sa | a spectral acceleration, needs `period` (--period S)
assess SIZE --records el-centro --intensity pgv | a design for records needs `excitation.scales` (--scales)
assess SIZE --records el-centro --scales 1 --intensity PGA | but is 'PGA'; did you mean `pga`?
optimise --at-least 20% | `requirements.at_least` must be a number, but is '20%'; write 0.2 for 20%
job [requirements]; at_least = 20% | write 0.2 for 20%
job worth.at_least = 0.2 | there is no table [worth]; it is now called `requirements`
job space.stroke = 0.4 | there is no key `stroke` in [space]; it is now the key `stroke` of [limits]
map BOB X --y lam 0.1 1 --from-rest | arguments: --from-rest; it is now called `--simulate`
export --as mjcf --file a.xml | unrecognized arguments: --file; it is now called `--out`
optimise --width 0.4 --height 0.1 --mass 16 SHAKEN | but is 4 of it: are width and height exchanged?
optimise --width 0.6 --height 12 --mass 7000 --radius-of-gyration 0.35 SHAKEN | that of the cross-section?
assess SIZE --cavity 0.0995 --records el-centro --scales 1 | must leave walls of at most 50000 kg/m^3
"""
"""Commands with a part of the message; `job` stands for `tpd optimise` with a file of these lines."""
ROWS = [
    *(line.split(" | ") for line in TABLE.strip().splitlines()),
    (f"job block.mass = {'9' * 400}", "`block.mass` must be a number, but is 9999"),
    (f"job block.{'x' * 5000} = 1", "...` in [block]; allowed are width"),
    (f"job x = {'[' * 100_000}", "nests too deeply"),
    ("job project.name = 'a\tb'", "`project.name` must be a text in one line"),
    ("", "the following arguments are required: COMMAND"),
]


@pytest.fixture(autouse=True)
def no_search(monkeypatch, tmp_path):
    """Let input that is not rejected fail at once, and not after a search; work in an empty folder."""

    def run(*_: object) -> None:
        raise AssertionError("the input was not rejected: a search has begun")

    monkeypatch.setattr("tpd.design.optimise.first_guess", run)
    monkeypatch.chdir(tmp_path)


def rejection(capsys, *command: str) -> str:
    """Return the message that rejects a command."""
    try:
        status = main([*command])
    except SystemExit as stop:
        status = stop.code
    out, err = capsys.readouterr()
    assert (status, out, len(err.splitlines())) == (2, "", 1), err
    assert err.startswith("tpd")
    assert err.endswith("\n")
    assert len(err) <= 400
    return err


@pytest.mark.parametrize(("words", "message"), ROWS, ids=[f"{i} {w[:50]}" for i, (w, _) in enumerate(ROWS)])
def test_the_message_for_invalid_input_is_one_sentence_with_a_remedy(capsys, tmp_path, words, message):
    while re.search(CAPITALS, words):
        words = re.sub(CAPITALS, lambda match: WORDS[match[0]], words)
    kind, _, content = words.partition(" ")
    if kind != "job":
        assert message in rejection(capsys, *shlex.split(words))
        assert list(tmp_path.iterdir()) == []
        return
    (tmp_path / "job.toml").write_text(content.replace("; ", "\n"))
    # Every command rejects an invalid block.
    for command in ("optimise", *(["response"] if content.startswith("block") else [])):
        assert message in rejection(capsys, command, "--scene", "job.toml", "--out", "out")
    assert [path.name for path in tmp_path.iterdir()] == ["job.toml"]


def test_commands_do_not_overwrite_a_report_without_overwrite(capsys, tmp_path):
    (tmp_path / "used").mkdir()
    paths = [tmp_path / "used" / name for name in ("mine.txt", "table.csv")]
    for path in paths:
        path.write_text("keep me")
    for command in (("optimise",), ("response",), ("map", *WORDS["MAP"].replace("X", WORDS["X"]).split())):
        assert "already contains files" in rejection(capsys, *command, "--out", "used")
        assert "is a file" in rejection(capsys, *command, "--out", "used/mine.txt")
        assert "cannot write to" in rejection(capsys, *command, "--out", "/proc/nowhere/out")
    # Invalid input removes no files.
    rejection(capsys, "optimise", "--width", "-1", "--overwrite", "--out", "used")
    assert [path.read_text() for path in paths] == ["keep me"] * 2
    assert len([*paths[0].parent.iterdir()]) == 2


@pytest.mark.parametrize("command", ["fragility", "check"])
def test_every_command_prints_the_notes_on_its_records(run, tmp_path, command):
    (tmp_path / "XXX001.EW").write_text(knet(1e5 * shaking(100) + 1e4, 0.01))
    (tmp_path / "validation.EW").write_text(knet(1e5 * shaking(100, 1) + 1e4, 0.01).replace("1999/", "1998/"))
    block = template("column").partition("[excitation]")[0]
    motion = 'records = ["XXX001.EW"]\nscales = [1]\nvalidation_share = ["validation.EW"]\n'
    (tmp_path / "job.toml").write_text(f"{block}[excitation]\n{motion}")
    words = f"{command} --scene {tmp_path / 'job.toml'} {PENDULUM_OPTIONS} "
    words += "--scales 1 2" if command == "fragility" else ""
    done = call(words) if command == "check" else run(words)
    first = next(line for line in done.out.splitlines() if "record: " in line)
    motion = Record.read(tmp_path / "XXX001.EW")
    pga = float(motion.pga) / 9.80665
    assert first.startswith(
        f"record: XXX001.EW, 100 samples of 0.01 s, 0.99 s long, PGA {pga:.4g} g; uncorrected: "
    )
    assert all(note in first for note in motion.notes)
    assert "; baseline removed: the mean, " in first
    if command == "check":
        assert "validation, validation.EW: record: validation.EW, 100 samples" in done.out
    if done.files:
        assert done.json(f"{command}.json")["records"] == {"files": [facts(motion)], "notes": []}


HEAVY = ("jax", "equinox", "optax", "diffrax", "numba", "scipy", "matplotlib")
MISTAKES = (
    "optimise --scene misspelt.toml",
    "optimise --out full",
    "optimise --records missing --scales 1",
    "check missing",
    "response --scene misspelt.toml",
    "map --scene missing.toml --x mu 0.01 0.1 --y lam 0.1 1",
    "shake --record missing.at2",
    "check --pulse ricker --pulse-frequency 1 --engine mujoco",
    "spectrum --pulse ricker --pga 0.3",
    "fragility --records missing",
    "export missing --as csv",
)


def test_a_mistake_is_rejected_before_jax_is_imported(tmp_path):
    (tmp_path / "misspelt.toml").write_text("[block]\nwidht = 1.0\n")
    (tmp_path / "full").mkdir()
    (tmp_path / "full" / "report.html").write_text("a report")
    program = f"""
import sys
from tpd.cli import main
for words in {MISTAKES}:
    try:
        status = main(words.split())
    except SystemExit as stop:
        status = stop.code
    print(status, [name for name in {HEAVY} if name in sys.modules])
"""
    call = [sys.executable, "-c", program]
    done = subprocess.run(call, cwd=tmp_path, capture_output=True, text=True, check=False)
    assert done.stdout.splitlines() == ["2 []"] * len(MISTAKES), done.stdout + done.stderr
    # There is one sentence for each, and no message about the work of a command.
    assert len(done.stderr.splitlines()) == len(MISTAKES), done.stderr


def test_a_job_file_is_an_argument_or_the_option_scene(tmp_path):
    job, other = tmp_path / "job.toml", tmp_path / "other.toml"
    job.write_text(
        "[block]\nwidth = 2.0\nheight = 10.0\nmass = 4e4\n[excitation]\namplitude = 0.3\nfrequency = 0.5\n"
    )
    for words in ([str(job)], ["--scene", str(job)], [str(job), "--scene", f"{tmp_path}/./job.toml"]):
        assert common.read_case(parser().parse_args(["optimise", *words])).job.block.height == 10.0
    with pytest.raises(
        ValueError, match=rf"^JOB and --scene must name the same job file, but are {job} and {other}$"
    ):
        common.read_case(parser().parse_args(["optimise", str(job), "--scene", str(other)]))


@pytest.mark.parametrize("command", ["check", "shake", "export --as csv"])
def test_a_job_file_instead_of_a_design_gets_a_hint(capsys, tmp_path, command):
    (tmp_path / "job.toml").write_text(template("tower"))
    message = "job.toml is a job file, but DESIGN is the folder of a report: write --scene job.toml"
    assert message in rejection(capsys, *command.split(), "job.toml")
