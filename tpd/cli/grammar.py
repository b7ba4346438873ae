"""Grammar of the command line: every command with its options, and how each is explained.

Nothing here imports JAX, so that the help does not wait for it.
"""

from __future__ import annotations

import argparse
from collections.abc import Callable, Iterable
from typing import Any, NamedTuple

from tpd.cli.options import Option, Parser, SetWidths, keys
from tpd.core.files import path_of

KINDS = ("tower", "chimney", "column", "statue", "paper")
"""Scenes that there is a template of, see `tpd new`."""
EXPORTED = {"mjcf": "model.xml", "opensees": "model.tcl", "csv": "histories.csv"}
"""Kinds of files that `tpd export` writes, and their names."""

_SLIDING = "coefficient of friction on the floor, dimensionless (default 0.6)"
_AXIS = "a name, its lower and its upper end, in m, kg and Hz; ratios are dimensionless"


def _options(table: str, **metavars: str | tuple[str, ...]) -> tuple[Option, ...]:
    """Options with the names of the keys that they set, by these names."""
    return tuple(Option(f"--{key.replace('_', '-')}", table, key, x) for key, x in metavars.items())


BLOCK = (
    *_options("block", width="M", height="M", mass="KG", friction="K", restitution="E"),
    *_options("block", radius_of_gyration="M", base_friction="MU"),
    Option("--cavity", "block", "cavity_width", "M"),
)
HARMONIC = _options("motion", amplitude="M", frequency="HZ")
PULSE = _options("motion", pulse="KIND", pulse_frequency="HZ", cycles="N", phase="RAD", pga="G")
READING = _options("motion", channel="N", dt="S", unit="UNIT", baseline="WORD", columns="NAME=N", skip="N")
_FACTOR: dict[str, Any] = {"one": True, "also": {"intensity": "scale"}, "help": "factor on a pulse or record"}
RECORD = (
    Option("--record", "motion", "records", "FILE", one=True, help="record of an accelerograph"),
    *READING,
    Option("--scale", "motion", "scales", "X", **_FACTOR),
)
RECORDS = (
    *_options("motion", records="FILE", scales="X", intensity="WORD", event="NAME"),
    *READING,
    *_options("motion", scale="X"),
)
VALIDATION_SHARE = Option("--validation-share", "motion", "validation_share", "X")
NO_WALLS = Option(
    "--no-walls", "limits", "clearance", value=False, help="do not ask for room between the walls"
)
DESIGN = (
    *_options("space", mass_ratio=("LO", "HI"), length_ratio=("LO", "HI")),
    Option("--pendulum-mass", "space", "mass", ("LO", "HI")),
    Option("--pendulum-length", "space", "length", ("LO", "HI")),
    Option("--damping", "space", "damping_ratio", "ZETA"),
    Option("--stroke", "limits", "stroke", "RAD"),
    Option("--bob", "bob", "shape", "WORD"),
    NO_WALLS,
)
_REST = "count rest wherever it holds, though rocking attracts from other starts"
CONDITIONS = (
    Option("--exactly", "conditions", "exactly"),
    Option("--band", "conditions", "band", ("LO", "HI")),
    Option("--amplitudes", "conditions", "amplitudes", "X"),
    Option("--measure", "risk", "measure", "WORD"),
    Option("--from-rest", "starts", "kind", value="rest", help=_REST),
)
SEARCH = (
    *_options("search", optimiser="WORD", searches="N", starts="N", steps="N"),
    Option("--at-least", "requirements", "at_least", "X"),
    Option("--reduce", "requirements", "measure", "WORD"),
    Option("--allowed", "requirements", "wall_contacts", "X"),
    Option("--seed", "search", "seed", "N"),
    Option("--pareto", "search", "pareto", help="also find three lighter ones, each verified"),
)


class Command(NamedTuple):
    """One command: the module of its name in this folder has a function `run`."""

    add: Callable[[Parser], None]
    """Adds its options."""
    help: str
    does: str
    """Words for its work, said before anything is imported; empty where it ends at once."""
    description: str
    example: str
    more: str = "Exit status: 0 done; 2 bad input, and one sentence says what is allowed; 130 interrupted."
    """Text after the options."""


def parser(about: str, version: str) -> Parser:
    """Return the grammar of the command line.

    Args:
        about: the package in a sentence.
        version: of the package.
    """
    top = Parser(prog="tpd", description=about)
    top.add_argument("--version", action="version", version=f"tpd {version}")
    commands = top.add_subparsers(dest="command", required=True, metavar="COMMAND")
    for name, c in COMMANDS.items():
        epilog = f"{c.more}\nExample: {c.example}"
        command = commands.add_parser(name, help=c.help, description=c.description, epilog=epilog)
        command.set_defaults(does=c.does)
        c.add(command)
    return top


def _number(to: Any, flag: str, metavar: str, text: str, kind: type = float, **more: Any) -> None:
    to.add_argument(flag, type=kind, metavar=metavar, help=text, **more)


def _switch(to: Any, flag: str, text: str) -> None:
    to.add_argument(flag, action="store_true", help=text)


def _group(
    command: Parser, title: str, options: Iterable[Option], text: str | None = None
) -> argparse._ArgumentGroup:
    """Add options as a group."""
    group = command.add_argument_group(title, text)
    for option in options:
        option.add(group)
    return group


def _scene(command: Parser, *motions: Option) -> None:
    """Add the options that describe a block and its motion."""
    command.add_argument("--scene", type=path_of, metavar="FILE", help="job file in TOML; options change it")
    own = (
        "without any: the paper's; a block of your own needs width, height and mass, and a motion of its own"
    )
    _group(command, "block", BLOCK, own)
    _group(command, "motion", motions, "a harmonic, a pulse or records, in place of that of FILE or DESIGN")


def _case(command: Parser, *motions: Option) -> None:
    """Add the options that name a design, or describe a block, its motion and a pendulum."""
    text = "report directory, or its design.json: its job and its pendulum, in place of --scene"
    command.add_argument("design", type=path_of, nargs="?", metavar="DESIGN", help=text)
    _scene(command, *motions)
    group = command.add_argument_group("pendulum")
    mass, length = group.add_mutually_exclusive_group(), group.add_mutually_exclusive_group()
    _number(mass, "--pendulum-mass", "KG", "mass of the bob, kg")
    _number(mass, "--mass-ratio", "MU", "ratio of the masses of bob and block")
    _number(length, "--pendulum-length", "M", "length of the pendulum, m")
    _number(length, "--length-ratio", "LAM", "ratio of the length to the half height of the block")
    _number(group, "--pendulum-damping", "ZETA", "damping ratio of the hinge (default 0.1)")


def _out(command: Parser, default: str) -> None:
    """Add the options of the output directory."""
    command.add_argument("--out", type=path_of, default=default, metavar="DIR", help=f"default {default}")
    _switch(command, "--overwrite", "replace the results in an existing DIR")


def _cluster(command: Parser) -> None:
    """Add the options of the processes and machines that compute."""
    group = command.add_argument_group(
        "many processes or machines",
        "with one of these the work is done in chunks, which are stored in DIR.chunks as they finish: the "
        "same command goes on where it was interrupted. Needs `tpd[dask]`",
    )
    either = group.add_mutually_exclusive_group()
    _number(either, "--workers", "N", "number of processes on this machine", int)
    either.add_argument("--dask", metavar="ADDRESS", help="scheduler of a Dask cluster, tcp://host:port")


def _new(command: Parser) -> None:
    command.add_argument("kind", choices=KINDS, metavar="KIND", help=f"one of {', '.join(KINDS)}")
    command.add_argument("--out", type=path_of, metavar="FILE", help="default KIND.toml; it must not exist")


def _record(command: Parser) -> None:
    text = (
        "files and folders of records, or names of those that are built in: el-centro, loma-prieta, fema-p695"
    )
    command.add_argument("records", nargs="+", metavar="FILE", help=text)
    _group(command, "reading", READING)
    command.add_argument("--out", type=path_of, metavar="DIR", help="directory of pictures and of a table")
    _switch(command, "--overwrite", "replace the results in an existing DIR")


def _assess(command: Parser) -> None:
    command.add_argument("job", type=path_of, nargs="?", metavar="JOB", help="job file, as --scene FILE")
    _scene(command, *HARMONIC, *PULSE, *RECORDS)
    _group(command, "conditions", CONDITIONS)


def _optimise(command: Parser) -> None:
    command.add_argument("job", type=path_of, nargs="?", metavar="JOB", help="job file, as --scene FILE")
    _scene(command, *HARMONIC, *PULSE, *RECORDS, VALIDATION_SHARE)
    _group(command, "design space and limits", DESIGN)
    many = _group(command, "conditions", CONDITIONS)
    text = f"uncertain quantities by their relative half widths: {', '.join(keys()['scatter'])}"
    how: dict[str, Any] = {"nargs": "+", "action": SetWidths, "default": argparse.SUPPRESS}
    many.add_argument("--scatter", metavar="NAME=WIDTH", help=text, **how)
    _group(command, "search", SEARCH)
    said = command.add_mutually_exclusive_group()
    _switch(said, "--quiet", "print the verdict and the path of the report")
    _switch(said, "--json", "print design.json alone, for a pipe")
    _switch(said, "--verbose", "print the whole report")
    _out(command, "tpd-design")


def _check(command: Parser) -> None:
    _case(command, *HARMONIC, *PULSE, *RECORDS)
    NO_WALLS.add(command)
    _switch(command, "--full", "solve the smoothed models as well, which take long to compile")
    _number(command, "--seed", "N", "seed of the runs (default: the job's, of an engine 0)", int)
    engine = command.add_argument_group("an independent engine (extra: tpd[engines])")
    text = (
        "follow paired runs in a rigid-body engine with contact and sliding in place of the models, and put "
        "the result into the report"
    )
    engine.add_argument("--engine", choices=("mujoco",), help=text)
    _number(engine, "--runs", "N", "number of runs in the engine (default 64)", int)
    _number(engine, "--sliding", "MU", _SLIDING)


def _explore(command: Parser) -> None:
    command.add_argument(
        "source",
        type=path_of,
        metavar="DESIGN",
        help="report directory, its design.json, or a job file in TOML",
    )
    text = "default explore.html in the report directory, or here for a job file"
    command.add_argument("--out", type=path_of, metavar="FILE", help=text)
    _switch(command, "--open", "open the page in the browser")
    _switch(command, "--overwrite", "replace FILE if it exists")


def _response(command: Parser) -> None:
    _case(command, *HARMONIC)
    _number(command, "--from", "HZ", "lowest frequency, Hz (default 0.4 of the scene's)", dest="low")
    _number(command, "--to", "HZ", "highest frequency, Hz (default twice the scene's)", dest="high")
    _number(command, "--points", "N", "number of points of each branch (default 400)", int, default=400)
    _switch(command, "--dimensionless", "against xi at constant f; --from and --to are xi, dimensionless")
    text = "number of frequencies at which the motion from rest is followed (default 40), 0 for none"
    _number(command, "--from-rest", "N", text, int, default=40)
    _out(command, "tpd-response")


def _map(command: Parser) -> None:
    _case(command, *HARMONIC)
    for axis in ("x", "y"):
        named: dict[str, Any] = {"metavar": ("NAME", "LO", "HI"), "help": f"the {axis} axis: {_AXIS}"}
        command.add_argument(f"--{axis}", nargs=3, required=True, **named)
    _number(command, "--points", "N", "number of points along each axis (default 200)", int, default=200)
    _switch(command, "--from-rest", "follow every design from rest: forty times slower")
    _cluster(command)
    _out(command, "tpd-map")


def _shake(command: Parser) -> None:
    _case(command, *PULSE, *RECORD)
    _number(command, "--free", "S", "free motion after it, s (default 20)", default=20.0)
    _out(command, "tpd-shake")


def _spectrum(command: Parser) -> None:
    _case(command, *PULSE, *RECORD)
    _number(command, "--points", "N", "number of points along each axis (default 120)", int, default=120)
    _number(
        command,
        "--to",
        "X",
        "largest ratio omega_p/p (default 10); of a record 2 pi/p, s (default 12)",
    )
    _number(command, "--sizes-to", "X", "largest ratio a_p/(g tan alpha) of a pulse (default 10)")
    _cluster(command)
    _out(command, "tpd-spectrum")


def _fragility(command: Parser) -> None:
    _case(command, *RECORDS, *PULSE)
    _number(command, "--period", "S", "period of the spectral acceleration of --intensity sa, s")
    _cluster(command)
    _out(command, "tpd-fragility")


def _export(command: Parser) -> None:
    _case(command, *HARMONIC, *PULSE, *RECORD)
    kinds: dict[str, Any] = {"choices": tuple(EXPORTED), "help": "mjcf: MuJoCo; csv: the histories"}
    command.add_argument("--as", dest="kind", required=True, **kinds)
    _number(command, "--sliding", "MU", _SLIDING)
    text = f"to write to (default {', '.join(EXPORTED.values())})"
    command.add_argument("--file", type=path_of, metavar="FILE", help=text)
    _switch(command, "--overwrite", "replace FILE if it exists")


COMMANDS = {
    "new": Command(
        _new,
        "write a commented job file to begin with",
        "",
        "Write a job file in TOML with a realistic scene of the kind asked for: every key that matters, "
        "with its unit and the reason for it. Change the numbers, then run `tpd optimise FILE`.",
        "tpd new tower --out mine.toml",
        "Exit status: 0 written, 2 bad input or an existing file.",
    ),
    "record": Command(
        _record,
        "preview a ground motion: its peaks, duration and spectrum",
        "",
        "Read records and print what was read and what was left out, PGA in g and m/s^2, PGV, PGD, the time "
        "from 5 to 95 % of the energy and the spectral acceleration at 5 % damping; of several records a "
        "line each. A PGA that is implausible gets a warning: look for a wrong unit. With --out also "
        "pictures of the histories and the response spectrum.",
        "tpd record el-centro",
    ),
    "assess": Command(
        _assess,
        "say whether a block lifts, slides or overturns without any pendulum",
        "following the block",
        "Compare the excitation with the acceleration that lifts the block and the friction of its base, and "
        "follow the block without a pendulum in the runs by which `tpd optimise` validates its designs: "
        "the share in which it overturns, and what helps instead of a pendulum.",
        "tpd assess tower.toml",
    ),
    "optimise": Command(
        _optimise,
        "find the pendulum for a block",
        "searching for the pendulum of least rocking, for {out}",
        "Find the pendulum of least rocking under a harmonic (one condition or many), pulses or records. "
        "Without options: the block of Collini et al. (2016), from rest. A job file (--scene) can set all "
        "that the options set, and more: `tpd new tower` writes one to begin with, and every report has "
        "one, scene.toml, that repeats it.",
        "tpd optimise --scene tower.toml --out tower",
        "Exit status: 0 a pendulum is offered, or the bare block needs none; 2 bad input, and one sentence "
        "says what is allowed; 3 no pendulum to rely on, and the first line of the report says why; 130 "
        "interrupted.",
    ),
    "check": Command(
        _check,
        "say whether a design, or a pendulum of your own, can be hung",
        "solving the design",
        "Solve a design from the closed forms to the nonlinear equations, and ask of it what `tpd optimise` "
        "asks of its designs: the same conditions, starts, limits and runs.",
        "tpd check --scene tower.toml --mass-ratio 0.03 --length-ratio 0.2",
        "Exit status: 0 it helps and it fits; 2 bad input; 3 one of these fails, and the last line says "
        "which; 130 interrupted.",
    ),
    "explore": Command(
        _explore,
        "write an interactive page of a design: sliders, and a block that rocks",
        "",
        "Write one HTML page that needs no network. Sliders and number fields change mass, length and "
        "damping of the pendulum, and frequency and amplitude of the base motion. The page shows the steady "
        "tilt over frequency and over mass and length, the limits, the pendulum to scale, and the motion of "
        "the block with and without the pendulum. Every value names its source. For a job file, `tpd "
        "explore` does not search for a pendulum.",
        "tpd explore tower.toml",
        "Exit status: 0 written, 2 bad input or an existing file.",
    ),
    "response": Command(
        _response,
        "amplitude and stroke against frequency",
        "following the motions over frequency, for {out}",
        "Branches of symmetric period-one orbits against frequency, stable and unstable, and where they are "
        "lost: of the bare block and, if one is given, with a pendulum. The amplitude of the base stays as "
        "it is, or with --dimensionless its acceleration f. Beside them, what a start from rest settles "
        "into, every 0.4 % within 5 % of the scene's frequency. Without options: the block of Collini et "
        "al. (2016).",
        "tpd response --scene tower.toml --mass-ratio 0.03 --length-ratio 0.2",
    ),
    "map": Command(
        _map,
        "amplitude, stroke, status and uplift over any two parameters",
        "solving the designs of a map, for {out}",
        "Solve every design on a grid of two names: dimensionless parameters (nu, mu, lam, zeta, k, f, xi, "
        "e, rho) or, in SI units, width, height, mass, friction, restitution, amplitude, frequency, "
        "pendulum-mass, pendulum-length and pendulum-damping. Shown is the largest attracting symmetric "
        "period-one orbit, or rest; with --from-rest what is settled into from rest.",
        "tpd map --scene tower.toml --x mu 0.01 0.1 --y lam 0.1 0.9",
    ),
    "shake": Command(
        _shake,
        "a block under one pulse or record",
        "shaking the block, for {out}",
        "Follow a block from rest through one pulse or record, bare and, if one is given, with a pendulum: "
        "largest angles, whether and when it overturns, impacts, and the friction that the base needs. The "
        "nonlinear equations count, and the linear ones, exact between the samples, stand beside them; "
        "histories, impacts and friction are of the linear equations.",
        "tpd shake --scene tower.toml --record el-centro --pga 0.3",
        "Exit status: 0 done, 2 bad input, 3 the block overturns in the last of the cases, or its motion "
        "has no answer, 130 interrupted.",
    ),
    "spectrum": Command(
        _spectrum,
        "overturning and rocking spectra",
        "following blocks, for {out}",
        "With --pulse: what a pulse of every frequency and size does to the block, over omega_p/p and "
        "a_p/(g tan alpha). With --record: the largest tilt of blocks of the same slenderness and every "
        "size, over 2 pi/p. Bare and, if one is given, with a pendulum.",
        "tpd spectrum --scene tower.toml --pulse ricker",
    ),
    "fragility": Command(
        _fragility,
        "fragility curves over records",
        "following the block, for {out}",
        "Scale every record to every stripe of an intensity (--scales; default 20 from 0.5 to 8) and follow "
        "the block through all of them, bare and, if one is given, with a pendulum on the same motions.",
        "tpd fragility --scene tower.toml --records el-centro loma-prieta --scales 1 2 4",
    ),
    "export": Command(
        _export,
        "write a design as a model of MuJoCo or OpenSees, or its motion as a table",
        "",
        "Write the block and the pendulum of a report, or of the options, as a model for another program, "
        "or their motion from rest as CSV, bare and with the pendulum, under the harmonic of the report or "
        "the options, or the pulse or record that is given. A model in MJCF has no motion.",
        "tpd export --scene tower.toml --mass-ratio 0.03 --length-ratio 0.2 --as mjcf",
    ),
}
"""All commands, in the order of the help."""
