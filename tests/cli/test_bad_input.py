"""Bad input: one sentence on stderr, exit status 2, and nothing is written."""

import pytest

from tpd.cli import main

BAND = ("--band", "2", "3")
MAP = ("--x", "mu", "0.01", "0.2", "--y", "lam", "0.1", "1.5")
OWN = ("--width", "0.1", "--height", "0.4", "--mass", "16", "--amplitude", "0.015", "--frequency", "2.5")
REST = "height = 0.4\nmass = 16\n[motion]\namplitude = 0.015\nfrequency = 2.5\n"
HUNG = ("--mass-ratio", "0.1", "--length-ratio", "0.5")

MILLIMETRES = ("--width", "100", "--height", "400", "--mass", "16.2")
NO_CAVITY = (
    "`cavity_width`, the width in m between the walls that the bob swings within, must be given, but is"
)
UNITS = [
    (
        (*MILLIMETRES, "--amplitude", "15", "--frequency", "2.5"),
        "[block] `mass` must make between 10 and 500000 kg/m^3 of a block as deep as it is wide, but 16.2 kg",
    ),
    ((*OWN, "--mass", "0.016"), "are the lengths in m and the mass in kg?"),
    (
        ("--amplitude", "50", "--frequency", "1"),
        "[motion] `amplitude` and `frequency` must make at most 10 g, but 50 m at 1 Hz make 201 g: are they",
    ),
    (
        ("--amplitudes", "100", "120"),
        "[motion] `amplitude` and `frequency` must make at most 10 g, but 1.8 m",
    ),
    (("--band", "2250", "2750"), "are they in m and Hz?"),
    (OWN, f"{NO_CAVITY} not, and no pendulum hangs inside a solid block: state it (--cavity, or"),
]
"""Options of `tpd optimise` in another unit, or of a block without a cavity; they were searched."""

OPTIONS = [
    ((*OWN, "--width", "-1"), "[block] `width` must be positive and finite, but is -1"),
    (("--width", "wide"), "`block.width` must be a number, but is 'wide'"),
    (("--width", "true"), "`block.width` must be a number, but is 'true'"),
    ((*OWN, "--width", "0.3"), "[block] `width` must be at most 0.5 of `height` (the linear equations drop"),
    (("--width",), "argument --width: expected one argument"),
    ((*OWN, "--height", "0"), "[block] `height` must be positive and finite, but is 0"),
    ((*OWN, "--mass", "nan"), "[block] `mass` must be positive and finite, but is nan"),
    ((*OWN, "--mass", "inf"), "[block] `mass` must be positive and finite, but is inf"),
    (("--frequency", "0"), "[motion] `frequency` must be positive and finite, but is 0"),
    (("--amplitude", "-0.1"), "[motion] `amplitude` must be zero or positive, and finite, but is -0.1"),
    (("--friction", "-0.1"), "[block] `friction` must be zero or positive, and finite"),
    (("--restitution", "0"), "[block] `restitution` must be positive and finite, but is 0"),
    (("--restitution", "1.5"), "[block] `restitution` must be between 0 and 1, but is 1.5"),
    (("--restitution", "bouncy"), "[block] `restitution` must be a number or 'housner', but is 'bouncy'"),
    (("--mass-ratio", "0.2", "0.1"), "[space] `mass_ratio` must be an interval low < high"),
    (("--mass-ratio", "0.2"), "argument --mass-ratio: expected 2 arguments"),
    (("--length-ratio", "0.5", "0.5"), "[space] `length_ratio` must be an interval"),
    (("--damping", "0.1", "0.2", "0.3"), "must be a number or a pair of numbers, but is [0.1, 0.2, 0.3]"),
    (("--damping", "-1"), "[space] `damping_ratio` must be between 0 and 2, but is -1"),
    (("--stroke", "0"), "[limits] `stroke` must be positive and finite, but is 0"),
    (("--walls",), "unrecognized arguments: --walls"),
    (("--bob", "cube"), "[bob] `shape` must be one of ball, cylinder, but is 'cube'"),
    (("--cavity", "0.2"), "[block] `cavity_width` must be at most the outside width, 0.1 m, but is 0.2 m"),
    (("--cavity", "0"), "[block] `cavity_width` must be positive and finite, but is 0"),
    (("--at-least", "10"), "[worth] `at_least` must be between 0 and 1, but is 10"),
    (
        ("--exactly", *BAND),
        "`conditions.exactly` goes with one motion: no band, no amplitudes and no scatter",
    ),
    (("--searches", "0"), "[search] `searches` must be a whole number, 1 or more, but is 0"),
    (("--searches", "2.5"), "`search.searches` must be a whole number up to 2147483647, but is 2.5"),
    (("--starts", "8"), "`search.starts` goes with a pulse or records, which this job does not have"),
    (("--search", "8"), "unrecognized arguments: --search 8"),
    (("--seed", "-1"), "[search] `seed` must be a whole number, 0 or more, but is -1"),
    (("--seed", "1e3"), "`search.seed` must be a whole number up to 2147483647, but is 1000.0"),
    (("--method", "newton"), "`search.method` must be one of descent, sequential, but is 'newton'"),
    (("--method", "adam"), "`search.method` must be one of descent, sequential, but is 'adam'"),
    (("--optimiser", "sgd"), "[search] `optimiser` must be one of adam, rmsprop, but is 'sgd'"),
    (
        ("--method", "sequential", "--optimiser", "rmsprop"),
        "`search.optimiser` goes with `search.method` descent",
    ),
    (("--measure", "median"), "`risk.measure` must be one of cvar, expected, worst, but is 'median'"),
    (("--band", "3", "2"), "[conditions] `band` must be an interval low < high"),
    (("--band", "2", "x"), "`conditions.band` must be a pair of numbers, but is [2, 'x']"),
    (("--amplitudes", "1", "0"), "[conditions] `amplitudes` must be positive and finite, but is 0"),
    (("--amplitudes", "inf"), "[conditions] `amplitudes` must be positive and finite, but is inf"),
    (("--scatter", "friction"), "`--scatter` must be NAME=WIDTH, such as friction=0.2, but is 'friction'"),
    (("--scatter", "=0.1"), "`--scatter` must be NAME=WIDTH"),
    (("--scatter", "friction=wide"), "`scatter.friction` must be a number, but is 'wide'"),
    (("--scatter", "friction=0.6"), "[scatter] `friction` must be between 0 and 0.5, but is 0.6"),
    (("--scatter", "colour=0.1"), "unknown key `colour` in [scatter]; allowed are amplitude, frequency"),
    (
        ("--width", "0.2"),
        "a block of your own must be whole, with a motion of its own, but `height` and `mass` in [block] and "
        "`amplitude` and `frequency` in [motion] are missing beside `width`; without any of these",
    ),
    (
        (*OWN[:6], "--amplitude", "0.02"),
        "but `frequency` in [motion] is missing beside `width`, `height` and",
    ),
    ((*OWN[2:], "--friction", "0.1"), "but `width` in [block] is missing beside `height` and `mass`"),
    (("--resume",), "there is nothing to resume: tpd-design/unfinished.npz does not exist"),
    ((*BAND, "--resume"), "there is nothing to resume"),
    (("--scene", "absent.toml"), "cannot read absent.toml: No such file or directory"),
    (("--scene", "."), "cannot read .: Is a directory"),
    (("--scene", "/dev/null"), "/dev/null is empty: `tpd new` writes a job file to begin with"),
    (("--stroke", "1.6"), "[limits] `stroke` must be at most 1.5708, a right angle in rad, but is 1.6"),
    (("--stroke", "90"), "[limits] `stroke` must be at most 1.5708, a right angle in rad, but is 90"),
    (("--friction", "0.6"), "[block] `friction` must be at most 0.25, width/height (a moment over M g b"),
    (("--amplitude", "0"), "[motion] `amplitude` must be above 0 in a search, but is 0: nothing shakes the"),
    (("--mass-ratio", "0.1", "1.5"), "[space] `mass_ratio` must be an interval low < high within 0 to 1"),
    (("--length-ratio", "0.1", "2.5"), "[space] `length_ratio` must be an interval low < high within 0.001"),
    (
        ("--exactly", "--measure", "cvar"),
        "`risk.measure` goes with several conditions, [conditions] or [scatter], which",
    ),
    (
        ("--friction", "0", "--scatter", "friction=0.1"),
        "[scatter] `friction` cannot scatter by a share of it",
    ),
    (
        ("--damping", "0", "--scatter", "damping=0.1"),
        "[scatter] `damping` cannot scatter by a share of itself",
    ),
    (("--scatter", "restitution=0.1"), "[scatter] `restitution` can scatter where it is a number, but there"),
    (
        ("--restitution", "housner", "--scatter", "restitution=0.1"),
        "[scatter] `restitution` can scatter where it is a number, but it is 'housner'",
    ),
]

FILES = [
    ("[block]\nwidht = 1.0\n", "unknown key `widht` in [block]; did you mean `width`?"),
    ("[blok]\nwidth = 1.0\n", "unknown table [blok]; did you mean `block`?"),
    ("[block]\nwidth = 'wide'\n", "`block.width` must be a number, but is 'wide'"),
    ("[block]\nwidth = '0.1'\n", "`block.width` must be a number, but is '0.1'"),
    ("[block]\nwidth = true\n", "`block.width` must be a number, but is True"),
    ("[block]\nwidth = [0.1, 0.2]\n", "`block.width` must be a number, but is [0.1, 0.2]"),
    ("[block]\nwidth = 2020-01-01\n", "`block.width` must be a number, but is datetime.date"),
    (f"[block]\nwidth = inf\n{REST}", "[block] `width` must be positive and finite, but is inf"),
    (
        "[block]\nrestitution = 'bouncy'\n",
        "[block] `restitution` must be a number or 'housner', but is 'bouncy'",
    ),
    ("[block]\nrestitution = true\n", "`block.restitution` must be a number or a text, but is True"),
    ("[block]\nradius_of_gyration = 0.1\n", "`width`, `height` and `mass` in [block]"),
    (
        f"[block]\nwidth = 0.1\n{REST.split('[')[0]}",
        "but `amplitude` and `frequency` in [motion] are missing",
    ),
    (
        "[project]\nname = 3\n",
        "`project.name` must be a text in one line of at most 100 characters, but is 3",
    ),
    ("[project]\nname = 'a\\tb'\n".replace("\\t", "\t"), "`project.name` must be a text in one line"),
    ("[block.size]\nwidth = 1.0\n", "unknown key `size` in [block]"),
    ("[site]\ngravity = 0\n", "[site] `gravity` must be positive and finite, but is 0"),
    ("[space]\nstroke = 0.5\n", "unknown key `stroke` in [space]; allowed are mass_ratio, length_ratio"),
    ("[space]\nmass_ratio = 0.1\n", "`space.mass_ratio` must be a pair of numbers, but is 0.1"),
    (
        "[space]\nmass_ratio = [0.1, true]\n",
        "`space.mass_ratio` must be a pair of numbers, but is [0.1, True]",
    ),
    ("[space]\nlength_ratio = [0.1, 3]\n", "[space] `length_ratio` must be an interval low < high within"),
    ("[search]\nseed = 1.5\n", "`search.seed` must be a whole number up to 2147483647, but is 1.5"),
    ("[search]\nseed = 9999999999\n", "must be a whole number up to 2147483647, but is 9999999999"),
    ("[search]\nbudget = 8\n", "unknown key `budget` in [search]; allowed are method, model, searches"),
    ("[search]\nmethod = 3\n", "`search.method` must be one of descent, sequential, but is 3"),
    ("[ensemble]\nany_phase = 1\n", "`ensemble.any_phase` must be true or false, but is 1"),
    (
        "[search]\nmethod = 'sequential'\ntolerance = 0.1\n",
        "`search.tolerance` goes with `search.method` descent",
    ),
    ("[conditions]\nmeasure = 'worst'\n", "unknown key `measure` in [conditions]; allowed are exactly, band"),
    ("[conditions]\nband = [2.0]\n", "`conditions.band` must be a pair of numbers, but is [2.0]"),
    (
        "[conditions]\nband = [2, 3]\nfrequencies = 1\n",
        "[conditions] `frequencies` must be a whole number, 2 or more, but is 1",
    ),
    (
        "[conditions]\nband = [2, 3]\nfrequencies = 2000000\n",
        "a job must have at most 100000 conditions, but has",
    ),
    ("[conditions]\nfrequencies = 9\n", "`conditions.frequencies` goes with a band, `conditions.band`"),
    ("[conditions]\nsamples = 9\n", "`conditions.samples` goes with a width in [scatter], which this job"),
    ("[conditions]\namplitudes = 1.0\n", "`conditions.amplitudes` must be a list, each a number, but is 1.0"),
    (
        "[conditions]\namplitudes = []\n",
        "[conditions] `amplitudes` must hold at least one number, but is empty",
    ),
    ("[scatter]\nfriction = -0.1\n", "[scatter] `friction` must be between 0 and 0.5, but is -0.1"),
    ("[starts]\nkind = 'some'\n", "`starts.kind` must be one of any, rest, but is 'some'"),
    ("[starts]\nsize = 4\n", "unknown key `size` in [starts]; allowed are kind"),
    ("[search]\nmodel = 'segmented'\n", "`search.model` must be one of piecewise, smoothed, but is 'segm"),
    ("[search]\nmethod = 'sequential'\nmodel = 'smoothed'\n", "`search.model` goes with `search.method` des"),
    ("[risk]\nshare = 0.2\n", "`risk.share` goes with `risk.measure` cvar, which this job does not have"),
    ("[risk]\nmeasure = 'cvar'\nshare = 0\n", "[risk] `share` must be between 1e-09 and 1, but is 0"),
    ("[limits]\nmultiplier = 1.5\n", "[limits] `multiplier` must be between 1e-06 and 1, but is 1.5"),
    ("[limits]\nmass = nan\n", "[limits] `mass` must be positive and finite, but is nan"),
    ("[limits]\nmass = inf\n", "[limits] `mass` must be positive and finite, but is inf"),
    ("[limits]\nroom = 'yes'\n", "`limits.room` must be true or false, but is 'yes'"),
    (
        "[limits]\nwalls = true\n",
        "unknown key `walls` in [limits]; allowed are stroke, relative_stroke, tilt",
    ),
    ("[bob]\nshape = 'cube'\n", "[bob] `shape` must be one of ball, cylinder, but is 'cube'"),
    ("[bob]\ndensity = 10\n", "[bob] `density` must be between 100 and 25000 kg/m^3, but is 10"),
    ("[bob]\naspect = 3.0\n", "`bob.aspect` goes with `bob.shape` cylinder, which this job does not have"),
    ("[worth]\nat_least = 10\n", "[worth] `at_least` must be between 0 and 1, but is 10"),
    ("[worth]\nruns = 0\n", "[worth] `runs` must be a whole number, 1 or more, but is 0"),
    (
        f"[block]\nwidth = 0.1\ncavity_width = 0.12\n{REST}",
        "[block] `cavity_width` must be at most the outside width, 0.1 m, but is 0.12 m",
    ),
    (
        "[conditions]\nexactly = true\nband = [2, 3]\n",
        "`conditions.exactly` goes with one motion: no band, no amplitudes and no scatter",
    ),
    ("[ensemble]\nsize = 0\n", "[ensemble] `size` must be a whole number, 1 or more, but is 0"),
    (
        "[ensemble]\nramps = [-1.0]\n",
        "[ensemble] `ramps` must be zero or positive, and finite, but is -1",
    ),
    ("[ensemble]\nrunes = 1\n", "unknown key `runes` in [ensemble]"),
    ("block = 3\n", "`block` must be a table, but is 3"),
    ("[[block]]\nwidth = 1\n", "`block` must be a table, but is [{'width': 1}]"),
    ("", "is empty: `tpd new` writes a job file to begin with"),
    ("# nothing yet\n", "is empty: `tpd new` writes a job file to begin with"),
    (
        f"[block]\nwidth = 0.1\nradius_of_gyration = 0.3\n{REST}",
        "[block] `radius_of_gyration` must be at most 0.206155, half the",
    ),
    ("[limits]\nrelative_stroke = 2.0\n", "[limits] `relative_stroke` must be at most 1.5708, a right angle"),
    ("[limits]\ntilt = 1.5\n", "[limits] `tilt` must be at most 1, a block that stands on its corner"),
    ("[ensemble]\nrestitution = 0.1\n", "[ensemble] `restitution` can scatter where it is a number"),
    ("[ensemble]\nswing = 2.0\n", "[ensemble] `swing` must be at most 1.5708, a right angle in rad"),
    (f"[block]\nmass = {'9' * 400}\n", "`block.mass` must be a number, but is 9999"),
    (f"[block]\n{'x' * 5000} = 1\n", "...` in [block]; allowed are width"),
    ("x = = 3\n", "is not valid TOML: Invalid value (at line 1, column 5)"),
    ("[block]\n[block]\n", "is not valid TOML: Cannot declare"),
    (f"x = {'[' * 100_000}", "nests too deeply"),
]

OTHERS = [
    (("response", *OWN, "--width", "-1"), "[block] `width` must be positive and finite, but is -1"),
    (("response", "--pendulum-mass", "1"), "give --pendulum-length or --length-ratio as well"),
    (("response", "--pendulum-length", "1"), "give --pendulum-mass or --mass-ratio as well"),
    (("response", "--pendulum-damping", "0.2"), "give --pendulum-mass or --mass-ratio as well"),
    (("response", *HUNG, "--pendulum-mass", "1"), "not allowed with argument"),
    (("response", *HUNG, "--pendulum-damping", "-1"), "`damping_ratio` must be zero or positive"),
    (("response", "--pendulum-mass", "heavy"), "invalid float value: 'heavy'"),
    (
        ("response", "--pendulum-mass", "20", "--length-ratio", "0.5"),
        "`--pendulum-mass` must be at most 16.224, the mass of the block in kg, but is 20",
    ),
    (
        ("response", "--mass-ratio", "1.5", "--length-ratio", "0.5"),
        "`--mass-ratio` must be at most 1, a bob as heavy as the block, but is 1.5",
    ),
    (
        ("response", "--mass-ratio", "0.1", "--pendulum-length", "0.5"),
        "`--pendulum-length` must be at most 0.4, the height of the block in m, but is 0.5",
    ),
    (
        ("response", "--mass-ratio", "0.1", "--length-ratio", "2.5"),
        "`--length-ratio` must be at most 2, a rod as long as the block, but is 2.5",
    ),
    (
        ("map", *HUNG, *MAP[:4], "--y", "pendulum-length", "0.1", "0.5"),
        "`pendulum_length` must be at most 0.4, the height of the block, but is 0.5",
    ),
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
    (("check", "absent"), "cannot read absent: No such file or directory"),
    (("check",), "give DESIGN, or a pendulum by --pendulum-mass and --pendulum-length"),
    (("check", "--pendulum-mass", "1"), "give --pendulum-length or --length-ratio as well"),
    (("check", *HUNG, "--width", "0.2"), "a block of your own must be whole"),
    (
        ("check", "absent", *HUNG),
        "absent has a scene and a pendulum: give it alone, or the options without it",
    ),
    (("check", "absent", "--frequency", "3"), "absent has a scene and a pendulum: give it alone"),
    (("response", "absent", "--scene", "a.toml"), "absent has a scene and a pendulum: give it alone"),
    (("response", "absent"), "cannot read absent: No such file or directory"),
    (("response", "--out", "x" * 300), "cannot use xxx"),
    (("check", *HUNG, "--runs", "0"), "`--runs` must be a whole number, 1 or more, but is 0"),
    (("check", *HUNG, "--engine", "mujoco", "--runs", "-5"), "`--runs` must be a whole number, 1 or more"),
    (("check", *HUNG, "--sliding", "0.5"), "--sliding is of --engine, which is not given"),
    (("map", "--x", "mu", "0.1", "50", *MAP[4:]), "`--x` must be at most 1, a bob as heavy as the block"),
    (("map", *MAP[:4], "--y", "lam", "0.1", "3"), "`--y` must be at most 2, a rod as long as the block"),
    (("shake", *OWN[:6], "--record", "el-centro", "--scale", "0"), "must have an acceleration, but is zero"),
    (("shake", *OWN[:6], "--record", "el-centro", "--dt", "0.5"), "`motion.dt` goes with a file of a record"),
    (("export", "--as", "csv", "--record", "el-centro", "--unit", "g"), "`motion.unit` goes with a file"),
    (("fragility", "--records", "el-centro", "loma-prieta", "--event", "a"), "`motion.event` goes with a fi"),
    (("spectrum", "--record", "el-centro", "--sizes-to", "5"), "--sizes-to is of the sizes of a pulse"),
    (("spectrum", "--pulse", "ricker", "--sizes-to", "nan"), "`--sizes-to` must be positive and finite"),
    (("spectrum", "--pulse", "ricker", "--to", "0"), "`--to` must be positive and finite, but is 0"),
    (("spectrum", "--pulse", "ricker", "--pga", "0.3"), "--pga has no effect here: pulses of every freq"),
    (("design",), "invalid choice: 'design'"),
    ((), "the following arguments are required: COMMAND"),
]

DESIGNS = [
    ("not json", "is not a design in JSON"),
    ("\xff", "is not a design in JSON"),
    ("[1]", "it has no `pendulum`"),
    ('{"job": {}, "pendulum": null}', "must be of version 8, but is of 1: run the job again"),
    ('{"version": 7, "job": {}, "pendulum": null}', "must be of version 8, but is of 7"),
    ('{"version": 8, "job": [], "pendulum": null}', "`job` must be a table, but is []"),
    (
        '{"version": 8, "job": {}, "pendulum": {"mass": 1.0}}',
        "`pendulum` must have mass, length, damping_ratio, but has mass",
    ),
    (
        '{"version": 8, "job": {}, "pendulum": {"mass": "1", "length": 1.0, "damping_ratio": 0.1}}',
        "[pendulum] `mass` must be a number, but is '1'",
    ),
    (
        '{"version": 8, "job": {}, "pendulum": {"mass": 1.0, "length": -1.0, "damping_ratio": 0.1}}',
        "`length` must be positive and finite, but is -1",
    ),
    ('{"version": 8, "job": {}, "pendulum": null}', "it has no `status`"),
]


@pytest.fixture(autouse=True)
def no_search(monkeypatch):
    """Bad input that is not refused fails at once, not after a whole search."""

    def run(*_: object) -> None:
        raise AssertionError("the input is not refused: a search has begun")

    monkeypatch.setattr("tpd.design.search.Multistart.run", run)


def refused(capsys, *command: str) -> str:
    """The sentence that refuses a command."""
    try:
        status = main([*command])
    except SystemExit as stop:
        status = stop.code
    out, err = capsys.readouterr()
    assert status == 2
    assert out == ""
    assert err.startswith("tpd")
    assert err.endswith("\n")
    assert len(err.splitlines()) == 1, err
    assert len(err) <= 400
    assert "Traceback" not in err
    return err


@pytest.mark.parametrize(("options", "message"), OPTIONS)
def test_bad_options_are_refused(capsys, tmp_path, monkeypatch, options, message):
    monkeypatch.chdir(tmp_path)
    assert message in refused(capsys, "optimise", *options)
    assert list(tmp_path.iterdir()) == []


@pytest.mark.mends("implausible units, and a block without a cavity, were searched")
@pytest.mark.parametrize(("options", "message"), UNITS)
def test_options_in_another_unit_are_asked_back(capsys, tmp_path, monkeypatch, options, message):
    monkeypatch.chdir(tmp_path)
    assert message in refused(capsys, "optimise", *options)
    assert list(tmp_path.iterdir()) == []


@pytest.mark.mends("implausible units were taken by every command")
@pytest.mark.parametrize(
    ("command", "message"),
    [
        (
            ("response", *HUNG, "--pendulum-damping", "5"),
            "`--pendulum-damping` must be at most 2, twice crit",
        ),
        (("response", *HUNG, "--amplitude", "50", "--frequency", "1"), "make 201 g: are they in m and Hz?"),
        (("map", *HUNG, *MAP[:4], "--y", "amplitude", "5", "50"), "must make at most 10 g"),
        (
            ("spectrum", "--width", "450", "--height", "1800", "--mass", "900", "--pulse", "one-sine"),
            "kg/m^3",
        ),
        (("check", *HUNG, *OWN), NO_CAVITY),
    ],
)
def test_the_other_commands_ask_back_as_well(capsys, tmp_path, monkeypatch, command, message):
    monkeypatch.chdir(tmp_path)
    assert message in refused(capsys, *command)
    assert list(tmp_path.iterdir()) == []


@pytest.mark.mends("a damping of the space in per cent, and a gravity in g, were searched")
@pytest.mark.parametrize(
    ("content", "message"),
    [
        (
            "[site]\ngravity = 1.0\n",
            "[site] `gravity` must be between 1.5 and 30 m/s^2 (the Earth's is 9.80665)",
        ),
        ("[conditions]\namplitudes = [100.0]\n", "must make at most 10 g, but 1.5 m at 2.5 Hz make"),
        (f"[block]\nwidth = 0.1\n{REST}[limits]\nroom = true\n", NO_CAVITY),
    ],
)
def test_files_in_another_unit_are_asked_back(capsys, tmp_path, content, message):
    scene = tmp_path / "scene.toml"
    scene.write_text(content)
    assert message in refused(capsys, "optimise", "--scene", str(scene), "--out", str(tmp_path / "out"))


@pytest.mark.parametrize(("content", "message"), FILES)
def test_bad_files_are_refused(capsys, tmp_path, content, message):
    scene = tmp_path / "scene.toml"
    scene.write_text(content)
    assert message in refused(capsys, "optimise", "--scene", str(scene), "--out", str(tmp_path / "out"))
    assert list(tmp_path.iterdir()) == [scene]


@pytest.mark.parametrize(("content", "message"), [case for case in FILES if case[0][1:6] == "block"])
def test_a_bad_block_is_refused_by_the_other_commands_too(capsys, tmp_path, content, message):
    scene = tmp_path / "scene.toml"
    scene.write_text(content)
    for command in (("response",), ("map", *MAP)):
        assert message in refused(capsys, *command, "--scene", str(scene), "--out", str(tmp_path / "out"))
    assert list(tmp_path.iterdir()) == [scene]


def test_a_file_that_is_no_text_is_refused(capsys, tmp_path):
    scene = tmp_path / "scene.toml"
    scene.write_bytes(b"\xff\xfe[block]")
    for command in (("optimise",), ("response",), ("map", *MAP)):
        assert "is not a text file in UTF-8" in refused(capsys, *command, "--scene", str(scene))


@pytest.mark.parametrize(("command", "message"), OTHERS)
def test_bad_options_of_the_other_commands_are_refused(capsys, tmp_path, monkeypatch, command, message):
    monkeypatch.chdir(tmp_path)
    assert message in refused(capsys, *command)
    assert list(tmp_path.iterdir()) == []


@pytest.mark.parametrize(("content", "message"), DESIGNS)
def test_a_file_that_is_no_design_is_not_checked(capsys, tmp_path, content, message):
    file = tmp_path / "design.json"
    file.write_text(content, encoding="latin-1")
    for command in ("check", "response"):
        assert message in refused(capsys, command, str(tmp_path))
    assert message in refused(capsys, "export", str(tmp_path), "--as", "mjcf", "--file", str(tmp_path / "m"))
    assert message in refused(capsys, "check", str(file))


def test_a_record_of_zeros_shakes_nothing(capsys, tmp_path):
    (tmp_path / "a.txt").write_text("".join(f"{0.01 * i:.2f} 0.0\n" for i in range(100)))
    words = ("--record", str(tmp_path / "a.txt"), "--unit", "g", "--out", str(tmp_path / "out"))
    assert "must have an acceleration, but is zero" in refused(capsys, "shake", *OWN[:6], *words)
    assert not (tmp_path / "out").exists()


def test_existing_reports_and_unwritable_places_are_left_alone(capsys, tmp_path):
    taken = tmp_path / "taken"
    taken.mkdir()
    (taken / "mine.txt").write_text("keep me")
    (taken / "unfinished.npz").write_text("keep me")
    for command in (
        ("optimise",),
        ("response",),
        ("map", *MAP, "--mass-ratio", "0.1", "--length-ratio", "0.5"),
    ):
        assert "already holds files" in refused(capsys, *command, "--out", str(taken))
        assert "is a file" in refused(capsys, *command, "--out", str(taken / "mine.txt"))
        assert "cannot write to" in refused(capsys, *command, "--out", "/proc/nowhere/out")
    assert {path.name: path.read_text() for path in taken.iterdir()} == {
        "mine.txt": "keep me",
        "unfinished.npz": "keep me",
    }


def test_bad_input_leaves_what_an_interrupted_run_left(capsys, tmp_path):
    (tmp_path / "unfinished.npz").write_text("keep me")
    refused(capsys, "optimise", "--width", "-1", "--overwrite", "--out", str(tmp_path))
    assert (tmp_path / "unfinished.npz").read_text() == "keep me"
