"""Options and job file are the same thing: every option sets a key of the schema, and the jobs are equal."""

import tomllib

import pytest

from tpd.cli import common, main, optimise, parser
from tpd.cli.options import plain
from tpd.design import job as jobs

SEQUENTIAL = ("--method", "sequential")
WAVE = ("--cycles", "2", "--phase", "0.5")
RECORDS = ("--records", "el-centro", "b.txt")
NAMED = ("--event", "1940", "B", "--baseline", "mean")
READ = ("--dt", "0.01", "--unit", "g", "--channel", "1")
SAME = [
    ("", ()),
    (
        "[block]\nwidth = 2\nheight = 10.0\nmass = 40e3\n[motion]\namplitude = 0.3\nfrequency = 0.5\n",
        ("--width", "2", "--height", "10", "--mass", "40e3", "--amplitude", "0.3", "--frequency", "0.5"),
    ),
    ("[block]\nfriction = 0.1\nrestitution = 1\n", ("--friction", "0.1", "--restitution", "1")),
    ("[block]\nrestitution = 'housner'\n", ("--restitution", "housner")),
    ("[motion]\namplitude = 0.02\nfrequency = 3\n", ("--amplitude", "0.02", "--frequency", "3")),
    (
        "[space]\nmass_ratio = [0.1, 0.4]\nlength_ratio = [0.2, 1]\ndamping_ratio = [0.05, 0.3]\n",
        ("--mass-ratio", "0.1", "0.4", "--length-ratio", "0.2", "1", "--damping", "0.05", "0.3"),
    ),
    ("[space]\ndamping_ratio = 0.2\n", ("--damping", "0.2")),
    ("[limits]\nstroke = 0.4\nroom = false\n", ("--stroke", "0.4", "--no-walls")),
    ("[bob]\nshape = 'cylinder'\n[block]\ncavity_width = 0.08\n", ("--bob", "cylinder", "--cavity", "0.08")),
    ("[conditions]\nexactly = true\n", ("--exactly",)),
    ("[worth]\nat_least = 0.2\n", ("--at-least", "0.2")),
    ("[worth]\nstrikes = 0.05\n", ("--allowed", "0.05")),
    (
        "[search]\nsearches = 3\nseed = 7\n[conditions]\namplitudes = [1, 1.1]\n",
        ("--searches", "3", "--seed", "7", "--amplitudes", "1", "1.1"),
    ),
    (
        "[search]\nmethod = 'descent'\noptimiser = 'rmsprop'\n[conditions]\nband = [2, 3]\n",
        ("--method", "descent", "--optimiser", "rmsprop", "--band", "2", "3"),
    ),
    (
        "[search]\nmethod = 'sequential'\nsteps = 4\npareto = true\n",
        (*SEQUENTIAL, "--steps", "4", "--pareto"),
    ),
    (
        "[motion]\npulse = 'mavroeidis-papageorgiou'\npulse_frequency = 1\npga = 0.4\ncycles = 2\n"
        "phase = 0.5\n",
        ("--pulse", "mavroeidis-papageorgiou", "--pulse-frequency", "1", "--pga", "0.4", *WAVE),
    ),
    (
        "[motion]\nrecords = ['el-centro', 'b.txt']\nscales = [2, 3]\nintensity = 'pga'\n"
        "held_out = 0.3\nevent = ['1940', 'B']\nbaseline = 'mean'\n[search]\nstarts = 8\n",
        (*RECORDS, "--scales", "2", "3", "--intensity", "pga", "--held-out", "0.3", *NAMED, "--starts", "8"),
    ),
    (
        "[motion]\nrecords = ['a.txt']\nscales = [1]\nheld_out = ['el-centro']\ndt = 0.01\nunit = 'g'\n"
        "channel = 1\n",
        ("--records", "a.txt", "--scales", "1", "--held-out", "el-centro", *READ),
    ),
    (
        "[conditions]\nband = [2.3, 2.7]\namplitudes = [0.8, 1, 1.2]\n[risk]\nmeasure = 'cvar'\n",
        ("--band", "2.3", "2.7", "--amplitudes", "0.8", "1", "1.2", "--measure", "cvar"),
    ),
    ("[scatter]\nfriction = 0.2\nlength = 0.02\n", ("--scatter", "friction=0.2", "length=0.02")),
    ("[conditions]\namplitudes = [1.2]\n", ("--amplitudes", "1.2")),
    ("[starts]\nkind = 'rest'\n[conditions]\nband = [2, 3]\n", ("--from-rest", "--band", "2", "3")),
    (
        "[risk]\nmeasure = 'expected'\n[conditions]\namplitudes = [1, 1.1]\n",
        ("--measure", "expected", "--amplitudes", "1", "1.1"),
    ),
]
WHOLE = {
    "block": {"width": 0.15, "height": 0.5, "mass": 20.0},
    "motion": {"amplitude": 0.02, "frequency": 2.0},
}


def job_of(*options: str) -> jobs.Job:
    """The job of a command."""
    return common.case(parser().parse_args(["optimise", *options])).job


@pytest.mark.parametrize(("file", "options"), SAME)
def test_a_file_and_the_options_are_the_same_job(tmp_path, monkeypatch, file, options):
    monkeypatch.chdir(tmp_path)
    path = tmp_path / "job.toml"
    # A file without a table is refused: it says nothing.
    path.write_text(file or "[block]\n")
    job = jobs.job_of(tomllib.loads(file))
    assert job_of(*options) == job
    assert job_of("--scene", str(path)) == job
    assert (job == jobs.job_of({})) is (file == "")


def test_all_options_together_override_a_file_of_other_values(tmp_path):
    path = tmp_path / "job.toml"
    amplitudes = {"conditions": {"amplitudes": [1, 1.1]}}
    path.write_text(jobs.job_of({**WHOLE, "risk": {"measure": "cvar"}, **amplitudes}).toml)
    job = job_of("--scene", str(path), "--width", "0.12", "--measure", "worst", "--seed", "2")
    assert (job.scene.block.width, job.risk.name, job.seed) == (0.12, "worst", 2)


def test_a_written_job_is_a_file_for_the_command(tmp_path):
    path = tmp_path / "job.toml"
    options = ("--band", "2", "3", "--scatter", "mass=0.1", "--damping", "0.1", "0.2", "--from-rest")
    path.write_text(job_of(*options).toml)
    assert job_of("--scene", str(path)) == job_of(*options)


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
    block = common.case(parser().parse_args(["response", "--scene", str(file), *options])).job.block
    assert (block.friction, block.restitution) == expected


def test_options_do_not_leak_from_one_call_to_the_next():
    assert job_of("--frequency", "3").scene.motion.frequency == 3.0
    assert job_of() == jobs.job_of({})


def test_the_help_has_the_texts_and_defaults_of_the_schema(capsys):
    with pytest.raises(SystemExit):
        main(["optimise", "--help"])
    text = " ".join(capsys.readouterr().out.split())
    assert "whole width of the base, m (default 0.1)" in text
    assert "lower and upper bound of mu = m/M (default 0.01 0.2)" in text
    assert "--no-walls do not ask for room between the walls" in text
    assert "--exactly search for the motion itself alone with a point bob, as in the paper" in text
    assert "least share by which the mean tilt over all runs must fall (default 0.1)" in text
    assert "seed of every random choice of the search (default 0)" in text


def test_the_help_lists_the_commands_and_explains_the_exit_statuses(capsys):
    for arguments, parts in (
        (
            ("--help",),
            ("new write a commented", "optimise find the", "check say whether", "response amp", "map amp"),
        ),
        (("optimise", "--help"), ("0 a pendulum is offered", "3 no pendulum to rely on", "130 interrupted")),
        (
            ("check", "--help"),
            ("asks of its designs: the same conditions", "0 it helps and it fits", "3 one of these"),
        ),
    ):
        with pytest.raises(SystemExit):
            main([*arguments])
        text = " ".join(capsys.readouterr().out.split())
        for part in parts:
            assert part in text


def test_every_declared_option_is_compared_with_a_file():
    motions = (common.HARMONIC, common.PULSE, common.RECORDS, (optimise.HELD_OUT,))
    groups = (common.BLOCK, *motions, optimise.DESIGN, optimise.CONDITIONS, optimise.SEARCH)
    declared = [option.flag for group in groups for option in group]
    assert len(declared) == len(set(declared))
    assert {*declared, "--scatter"} == {word for _, options in SAME for word in options if word[:2] == "--"}


@pytest.mark.parametrize(
    ("text", "value"), [("3", 3), ("3.0", 3.0), ("1e3", 1000.0), ("housner", "housner"), ("", ""), ("-1", -1)]
)
def test_texts_become_numbers_where_they_are(text, value):
    assert plain(text) == value
    assert type(plain(text)) is type(value)


@pytest.mark.parametrize(
    ("words", "sentence"),
    [
        (("optimise", "--recrods", "a"), "unrecognized arguments: --recrods a; did you mean `--records`?"),
        (("optmise",), "did you mean `optimise`?"),
        (("new", "towr"), "did you mean `tower`?"),
        (("optimise", "--optimiser", "adamm"), "but is 'adamm'; did you mean `adam`?"),
        (("optimise", "--scatter", "frcition=0.1"), "unknown key `frcition` in [scatter]; did you mean `fri"),
    ],
)
def test_a_misspelt_word_is_recognised(words, sentence, capsys):
    try:
        status = main([*words])
    except SystemExit as stop:
        status = stop.code
    assert status == 2
    assert sentence in capsys.readouterr().err
