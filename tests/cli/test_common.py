"""Steps that the commands share: the pendulum of the options, the description of a job, stored programs, and
the rejection of invalid input: one sentence on stderr, exit status 2, and no files."""

import io
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
from tpd.core import files
from tpd.design.job import job_of
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


def test_only_a_job_of_records_states_its_levels_in_words():
    records = {"records": ["el-centro", "loma-prieta"], "scales": [2, 3]}
    two = job_of({"excitation": records})
    assert two.in_words == "2 records, each at 2, 3 (PGA over g tan(alpha); at 1 the block lifts)"
    assert [line.partition(",")[0] for line in two.messages] == ["record: el-centro", "record: loma-prieta"]
    one = job_of({"excitation": records | {"records": ["el-centro"]}})
    assert (
        one.in_words
        == "El Centro/NS, 3.127 m/s^2 at most, 31.18 s, each at 2, 3 (PGA over g tan(alpha); at 1 the "
        "block lifts)"
    )
    assert (job_of({}).in_words, job_of({}).messages) == ("", ())


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
optimise --width wide | `block.width` must be a number, but is 'wide'
optimise --width 0.3 REST_OF_IT | [block] `width` must be at most 0.5 of `height` (the linear model neglects
optimise --amplitude -0.1 | [excitation] `amplitude` must be zero or positive, and finite, but is -0.1
optimise --restitution 1.5 | [block] `restitution` must be between 0 and 1, but is 1.5
optimise --mass-ratio 0.1 0.2 0.3 | must be a number or a pair of numbers, but is [0.1, 0.2, 0.3]
optimise --mass-ratio 0.1 0.2 --pendulum-mass 2 | [space] `mass` and `mass_ratio` state the same quantity: gi
optimise --pendulum-mass 20 | [space] `mass` must be between 0 and 16.224 kg in this block, but is 20
optimise --pendulum-length 0.1 0.5 | [space] `length` must be between 0.0002 and 0.4 m in this block, but is
optimise --pendulum-mass 1 --pareto | `search.pareto` requires two bounds for the mass, `space.mass` or
optimise --pendulum-mass 0 | [space] `mass` must be positive and finite, but is 0
optimise --damping -1 | [space] `damping_ratio` must be between 0 and 2, but is -1
optimise --bob cube | [bob] `shape` must be one of ball, cylinder, but is 'cube'
optimise --cavity 0.1 | [block] `cavity_width` must be less than the width of the block, 0.1 m, because
optimise --exactly --band 2 3 | `conditions.exactly` requires a single motion (no band, no amplitudes and no s
optimise --designs 8 | `search.designs` requires a pulse or records, which this job does not have
optimise --risk median | `search.risk` must be one of cvar, expected, worst, but is 'median'
optimise --amplitudes inf | [conditions] `amplitudes` must be positive and finite, but is inf
optimise --scatter friction | `--scatter` must be NAME=WIDTH, such as friction=0.2, but is 'friction'
optimise --scatter friction=0.6 | [scatter] `friction` must be between 0 and 0.5, but is 0.6
optimise --scatter colour=0.1 | there is no key `colour` in [scatter]; allowed are amplitude, frequency
optimise --width 0.2 | amplitude` and `frequency` in [excitation] are missing. A block with `width` needs
optimise SIZE --amplitude 0.02 | `frequency` in [excitation] is missing. A block with `width`, `height` an
optimise --scene absent.toml | cannot read absent.toml: No such file or directory
optimise --scene . | cannot read .: Is a directory
optimise --scene /dev/null | /dev/null is empty: create a job file with `tpd new`
optimise --stroke 1.6 | [limits] `stroke` must be at most 1.5708, a right angle in rad, but is 1.6
optimise --friction 0.6 | [block] `friction` must be at most 0.25, width/height (it is a moment over
optimise --amplitude 0 | [excitation] `amplitude` must be above 0 in a search, but is 0: the base does not
optimise --mass-ratio 0.1 1.5 | [space] `mass_ratio` must be an interval low < high within 0 to 1
optimise --exactly --risk worst | `search.risk` requires several conditions, [conditions] or [scatter], whi
optimise --friction 0 --scatter friction=0.1 | [scatter] `friction` cannot vary by a share of itsel
optimise --scatter restitution=0.1 | [scatter] `restitution` can vary only if it is a number below
job block.widht = 1.0 | there is no key `widht` in [block]; did you mean `width`?
job blok.width = 1.0 | there is no table [blok]; did you mean `blo
job block.width = 2020-01-01 | `block.width` must be a number, but is 2020-01-01
job block.restitution = true | `block.restitution` must be a number or a text, but is True
job project.name = 3 | `project.name` must be a text in one line of at most 100 characters, but is 3
job site.gravity = 0 | [site] `gravity` must be positive and finite, but is 0
job space.mass_ratio = [0.1, true] | `space.mass_ratio` must be a number or a pair of numbers, but is [0.1, T
job search.budget = 8 | there is no key `budget` in [search]; allowed are optimiser, model
job ensemble.any_phase = 1 | `ensemble.any_phase` must be true or false, but is 1
job conditions.band = [2, 3]; conditions.frequencies = 1 | [conditions] `frequencies` must be a whole number,
job conditions.band = [2, 3]; conditions.frequencies = 2000000 | a job must have at most 100000 conditions, bu
job conditions.amplitudes = [] | [conditions] `amplitudes` must contain at least one number, but is em
job search.risk = 'cvar'; search.risk_share = 0 | [search] `risk_share` must be between 1e-09 and 1, but is 0
job bob.density = 10 | [bob] `density` must be between 100 and 25000 kg/m^3, but is 10
job ensemble.growth = [-1.0] | [ensemble] `growth` must be zero or positive, and finite, but is -1
job block.width = 0.1; block.radius_of_gyration = 0.3; REST | [block] `radius_of_gyration` must be at most 0.2
job limits.tilt = 1.5 | [limits] `tilt` must be at most 1, a block that stands on its corner
job ensemble.restitution = 0.1 | [ensemble] `restitution` can vary only if it is a number
response --pendulum-mass 1 | has no length: give --pendulum-length or --length-ratio as well
response BOB --pendulum-mass 1 | not allowed with argument
response BOB --pendulum-damping -1 | `damping_ratio` must be zero or positive
response --pendulum-mass heavy | invalid float value: 'heavy'
response --pendulum-mass 20 --length-ratio 0.5 | `--pendulum-mass` must be at most 16.224, the mass of the blo
response --mass-ratio 0.1 --pendulum-length 0.5 | `--pendulum-length` must be at most 0.4, the height of the b
response --from 0 | `--from` must be positive and finite, but is 0
response --from 3 --to 2 | `--from` must be below `--to`, but they are 3 and 2
response --points 3 | `--points` must be between 8 and 100000, but is 3
response --runs-from-rest 1 | `--runs-from-rest` must be a whole number, 2 or more, but is 1
map X | the following arguments are required: --y
map X --y lam a 1 | `--y` must be a name and two numbers, but is lam a 1
map X --y lam 1 0.1 | `--y` must have the lower number first, but goes from 1 to 0.1
map BOB X --y omega 1 2 | `y` must be one of width, height
map BOB X --y pendulum-mass 1 2 | must not both move mu
map MAP --points 3000 | `--points` must be a whole number, 2 to 2000, but is 3000
check absent | cannot read absent: No such file or directory
check | a pendulum is missing: give DESIGN, or --pendulum-mass and --pendulum-length
check absent BOB | absent contains a scene and a pendulum: give either DESIGN or options for these
response --out LONG | cannot write to xxx
check BOB --runs 0 | `--runs` must be a whole number, 1 or more, but is 0
check BOB --engine drake | argument --engine: invalid choice: 'drake'
check BOB --runs 5 | --runs has an effect only together with --engine
check BOB --sliding 0.5 | unrecognized arguments: --sliding; it is now called `--base-friction`
map --x mu 0.1 50 --y lam 0.1 1.5 | `--x` must be at most 1, a bob as heavy as the block
map X --y lam 0.1 3 | `--y` must be at most 2, a rod as long as the block
shake SIZE --record el-centro --dt 0.5 | `excitation.dt` requires a file of a record
fragility --records el-centro loma-prieta --event a=b | `records.events` requires a fi
spectrum --record el-centro --sizes-to 5 | --sizes-to has an effect on the spectrum of a pulse
spectrum --pulse ricker --sizes-to nan | `--sizes-to` must be positive and finite
spectrum --pulse ricker --pga 0.3 | --pga has no effect here: a spectrum has pulses of all freq
job block.size.width = 1.0 | there is no key `size` in [block]
job x = = 3 | is not valid TOML: Invalid value (at line 1, column 5)
job [block]; width = 0,5 | (at line 2, column 10); write 0.5 with a decimal point, not 0,5
job [space]; mass_ratio = [0,01, 0.2] | ; write 0.01 with a decimal point, not 0,01
job [block]; width = "0,5" | `block.width` must be a number, but is '0,5'; write 0.5 with a decimal point
optimise --width 0,5 | `block.width` must be a number, but is '0,5'; write 0.5 with a decimal point
optimise --mass-ratio 0,01 0,2 | ['0,01', '0,2']; write 0.01 with a decimal point, not 0,01
shake --free 1,5 | invalid float value: '1,5'; write 1.5 with a decimal point, not 1,5
shake --free x | invalid float value: 'x' (see
job [block]; [block] | is not valid TOML: Cannot declare
job [[block]]; width = 1 | `block` must be a table, but is [{'width': 1}]
shake | the motion must be a pulse or a record: give --record FIL
shake SIZE --record nothing.csv | nothing.csv
shake SIZE PULSE --pga 0 | [excitation] `pga` must be positive
fragility | the motion must be a pulse or a record: give --record FIL
new | required: KIND
new tower --out /proc/nowhere/tower.toml | cannot use /proc/nowhere/tower.toml
new towr | did you mean `tower`?
optmise | did you mean `optimise`?
optimise --recrods a | unrecognized arguments: --recrods; did you mean `--records`?
optimise --optimiser adamm | but is 'adamm'; did you mean `adam`?
optimise --scatter frcition=0.1 | there is no key `frcition` in [scatter]; did you mean `fri
export --as csv --pulse ricker --amplitude 1 | has keys of a pulse (`pulse`) and of a harm
export --as csv BOB --scale 5 | `excitation.scales` requires a pulse or records
export --as csv BOB --out . | --out must name a file, but . is a directory
optimise --width 100 --height 400 --mass 16.2 --amplitude 15 --frequency 2.5 | [block] `mass` must give a dens
optimise SHAKEN --width 0.1 --height 0.4 --mass 0.016 | are the lengths in m and the mass in kg?
optimise --amplitude 50 --frequency 1 | [excitation] `amplitude` and `frequency` give
optimise --amplitudes 100 120 | [excitation] `amplitude` and `frequency` give
optimise --band 2250 2750 | are they in m and Hz?
optimise OWN | `cavity_width` must be given, but is missing. It is the distance in m between the walls
response BOB --pendulum-damping 5 | `--pendulum-damping` must be at most 2, twice crit
response BOB --amplitude 50 --frequency 1 | at most 10 g, but is 201 g: are they in m and Hz?
map BOB X --y amplitude 5 50 | whose acceleration must be at most 10 g
spectrum --width 450 --height 1800 --mass 900 --pulse one-sine | kg/m^3
check BOB OWN | `cavity_width` must be given, but is missing. It is the distance in m between the
job site.gravity = 1.0 | [site] `gravity` must be between 1.5 and 30 m/s^2 (on Earth it is 9.80665)
job conditions.amplitudes = [100.0] | 1.5 m at 2.5 Hz, whose acceleration must be at most 10 g
job limits.clearance = true; block.width = 0.1; REST | `cavity_width` must be given, but is missing
response BOB --from -1e0 | `--from` must be positive and finite, but is -1
optimise --seed -1e0 | `search.seed` must be a whole number up to 2147483647, but is -1.0
optimise --stroke -.5E-1 | [limits] `stroke` must be positive and finite, but is -0.05
optimise --records el-centro --records loma-prieta | argument --records: it is given 2 times
response BOB --points 9 --points=10 | argument --points: it is given 2 times; give it once, with all its va
shake SIZE --pulse mavroeidis-papageorgiou --pulse-frequency 1 --pga 1 --phase 90 | 6.28319 rad, but is 90
shake SIZE PULSE | [excitation] `pga`, the peak acceleration of the pulse in g, is missing
assess SIZE PULSE --scales 2 | [excitation] `pga`, the peak acceleration of the pulse in g, is missing
record '' | the name of a record must not be empty, but is ''
fragility SIZE --records el-centro '' | the name of a record must not be empty, but is ''
optimise --scene '' | argument --scene: the name of a file is empty or has control characters: ''
map BOB X --y lam 0.1 1 --out '' | argument --out: the name of a file is empty or has control characters: ''
export --as mjcf --out '' | argument --out: the name of a file is empty or has control characters: ''
assess SIZE --scales 1 --records '' | the name of a record must not be empty, but is ''
job excitation.records = ["C:\Users\a.AT2"] | write a path with backslashes in single quotes
job excitation.records = ["C:\temp\new.AT2"] | write a path with backslashes in single quotes
fragility SIZE --records el-centro --intensity sa | a spectral acceleration, needs `period` (--period S)
fragility SIZE --records el-centro --intensity pga --period 1 | (--period) has an effect only with the
assess SIZE --records el-centro --intensity pgv | a design for records needs `excitation.scales` (--scales)
assess SIZE --records el-centro --scales 1 --intensity PGA | but is 'PGA'; did you mean `pga`?
optimise --at-least 20% | `requirements.at_least` must be a number, but is '20%'; write 0.2 for 20%
optimise --stroke 5% | write 0.05 for 5%
job [requirements]; at_least = 20% | write 0.2 for 20%
job worth.at_least = 0.2 | there is no table [worth]; it is now called `requirements`
job requirements.strikes = 0.2 | there is no key `strikes` in [requirements]; it is now called `wall_contacts`
job excitation.held_out = 0.5 | there is no key `held_out` in [excitation]; it is now called `validation_s
job limits.room = true | there is no key `room` in [limits]; it is now called `clearance`
job space.stroke = 0.4 | there is no key `stroke` in [space]; it is now the key `stroke` of [limits]
job conditions.measure = 'cvar' | it is now the key `risk` of [search]
job conditions.from_rest = true | it is now the key `kind` of [starts]
optimise --held-out 0.5 | unrecognized arguments: --held-out; it is now called `--validation-share`
optimise --demand cvar | unrecognized arguments: --demand; it is now called `--risk`
optimise --measure cvar | unrecognized arguments: --measure; it is now called `--risk`
map BOB X --y lam 0.1 1 --from-rest | arguments: --from-rest; it is now called `--simulate`
response --simulate 40 | unrecognized arguments: --simulate; it is now called `--runs-from-rest`
job excitation.scale = 10 | there is no key `scale` in [excitation]; it is now called `factor`
optimise --allowed 0.1 | unrecognized arguments: --allowed; it is now called `--wall-contacts`
job risk.measure = 'cvar' | there is no table [risk]; it is now the key `risk` of [search]
job requirements.measure = 'tilt' | there is no key `measure` in [requirements]; it is now called `reduce`
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


def test_a_file_that_is_not_text_is_rejected(capsys, tmp_path):
    (tmp_path / "job.toml").write_bytes(b"\xff\xfe[block]")
    assert "is not a text file in UTF-8" in rejection(capsys, "optimise", "--scene", "job.toml")


def test_a_file_that_is_not_a_design_is_rejected(capsys, tmp_path):
    """Check some files; the tests of the reader have more."""
    for content, message in (
        ("not json", "is not a design in JSON"),
        ("\xff", "is not a design in JSON"),
        ('{"version": 7, "job": {}, "pendulum": null}', "must be of version 14, but is of 7"),
    ):
        (tmp_path / "design.json").write_text(content, encoding="latin-1")
        for command in (("check", "."), ("response", "design.json"), ("export", ".", "--as", "mjcf")):
            assert message in rejection(capsys, *command)


def test_a_record_of_zeros_is_rejected(capsys, tmp_path):
    (tmp_path / "a.txt").write_text("t a\n" + "".join(f"{0.01 * i:.2f} 0.0\n" for i in range(100)))
    command = f"shake {WORDS['SIZE']} --record a.txt --unit g --out out"
    assert "the acceleration of the motion must not be zero" in rejection(capsys, *command.split())
    assert not (tmp_path / "out").exists()


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


@pytest.mark.parametrize("command", ["shake", "spectrum", "fragility", "export", "check"])
def test_every_command_prints_the_notes_on_its_records(run, tmp_path, command):
    (tmp_path / "XXX001.EW").write_text(knet(1e5 * shaking(100) + 1e4, 0.01))
    (tmp_path / "validation.EW").write_text(knet(1e5 * shaking(100, 1) + 1e4, 0.01).replace("1999/", "1998/"))
    block = template("column").partition("[excitation]")[0]
    motion = 'records = ["XXX001.EW"]\nscales = [1]\nvalidation_share = ["validation.EW"]\n'
    (tmp_path / "job.toml").write_text(f"{block}[excitation]\n{motion}")
    words = f"{command} --scene {tmp_path / 'job.toml'} {PENDULUM_OPTIONS} "
    words += {
        "shake": "--free 0.1",
        "spectrum": "--points 2",
        "fragility": "--scales 1 2",
        "export": f"--as csv --out {tmp_path / 'a.csv'}",
        "check": "",
    }[command]
    done = call(words) if command in ("export", "check") else run(words)
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


def test_a_command_that_cannot_write_removes_its_new_folder(tmp_path, monkeypatch):
    class Full(io.FileIO):
        def write(self, _):
            raise OSError(28, "No space left on device")

    monkeypatch.setattr(
        "tpd.cli.optimise.run", lambda options, _: files.place(options.out / "design.json", "")
    )
    monkeypatch.setattr(files, "open", Full, raising=False)
    out = tmp_path / "out"
    done = call("optimise", out=out)
    assert (done.status, done.out) == (2, "")
    assert done.err == f"tpd: cannot use {out}/design.json: No space left on device\n"
    assert not out.exists()
    out.mkdir()
    assert call("optimise", out=out).status == 2
    assert out.exists()


HEAVY = ("jax", "equinox", "optax", "diffrax", "numba", "scipy", "matplotlib", "dask")
MISTAKES = (
    ("optimise", "--scene", "missing.toml"),
    ("optimise", "--scene", "misspelt.toml"),
    ("optimise", "--out", "full"),
    ("optimise", "--records", "missing", "--scales", "1"),
    ("optimise", "--width", "-1"),
    ("check", "missing"),
    ("response", "--scene", "misspelt.toml"),
    ("map", "--scene", "missing.toml", "--x", "mu", "0.01", "0.1", "--y", "lam", "0.1", "1"),
    ("shake", "--record", "missing.at2"),
    ("shake",),
    ("fragility",),
    ("check", "--pulse", "ricker", "--pulse-frequency", "1", "--engine", "mujoco"),
    ("spectrum", "--pulse", "ricker", "--pga", "0.3"),
    ("fragility", "--records", "missing"),
    ("export", "missing", "--as", "csv"),
)


@pytest.mark.parametrize("command", MISTAKES, ids=" ".join)
def test_a_mistake_is_rejected_before_jax_is_imported(tmp_path, command):
    (tmp_path / "misspelt.toml").write_text("[block]\nwidht = 1.0\n")
    (tmp_path / "full").mkdir()
    (tmp_path / "full" / "report.html").write_text("a report")
    program = (
        "import sys\nfrom tpd.cli import main\n"
        "try:\n    status = main()\nexcept SystemExit as stop:\n    status = stop.code\n"
        f"print(status, sorted({HEAVY} & sys.modules.keys()))".replace(str(HEAVY), str(set(HEAVY)))
    )
    call = [sys.executable, "-c", program, *command]
    done = subprocess.run(call, cwd=tmp_path, capture_output=True, text=True, check=False)
    assert done.stdout == "2 []\n", done.stdout + done.stderr
    # There is one sentence, and no message about the work of the command.
    assert len(done.stderr.splitlines()) == 1, done.stderr
    assert "searching" not in done.stderr


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
