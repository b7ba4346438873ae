"""Grammar of the command line: all commands and their options.

Nothing here imports JAX, because the help must appear at once.
"""

from __future__ import annotations

import argparse
import tomllib
from collections import defaultdict
from collections.abc import Iterable
from importlib import resources
from typing import Any

from tpd.cli.options import Option, Parser, SetWidths, keys
from tpd.core.files import path_of

TEMPLATES = ("tower", "chimney", "column", "statue", "paper")
"""Names of the job files that `tpd new` can write, one template each."""
EXPORTED = {"mjcf": "model.xml", "opensees": "model.tcl", "csv": "histories.csv"}
"""Formats that `tpd export` writes, with the default name of the file."""

_AXIS = "name of the quantity, lowest and highest value, in m, kg or Hz; ratios are dimensionless"
_DONE = "Exit status: 0 success; 2 invalid input, the message says what is allowed; 130 interrupted."
"""Explanation of the exit status of most commands."""


def _options(table: str, names: str) -> tuple[Option, ...]:
    """Return the options of some keys of a table, which `tpd/design/tables.py` declares."""
    return tuple(Option(table, name) for name in names.split())


BLOCK = _options(
    "block",
    "width height centroid_height mass friction restitution radius_of_gyration base_friction cavity_width "
    "effective_width",
) + _options("frame", "width height")
HARMONIC = _options("excitation", "amplitude frequency")
PULSE = _options("excitation", "pulse pulse_frequency cycles phase pga")
PULSES = (*PULSE, *_options("excitation", "pulse_band"))
READING = _options("excitation", "channel dt unit baseline columns skip factor")
# Commands that simulate one motion have `--record` and `--scale`. The others have `--records` and `--scales`.
_RECORD = Option("excitation", "records", "--record FILE", help="file, or name such as el-centro", one=True)
_SCALE = Option(
    "excitation",
    "scales",
    "--scale X",
    help="factor on the acceleration of the motion",
    one=True,
    also={"intensity": "scale"},
)
RECORD = (_RECORD, *READING, _SCALE)
RECORDS = (*_options("excitation", "records scales intensity"), Option("records", "events"), *READING)
_NO_WALLS = "no walls around the bob: no limit on clearance"
NO_WALLS = Option("limits", "clearance", "--no-walls", value=False, help=_NO_WALLS)
DESIGN = (
    *_options("space", "mass_ratio length_ratio mass length damping_ratio hinge_height"),
    *_options("limits", "stroke"),
    *_options("bob", "shape"),
    NO_WALLS,
)
_REST = "design for a block that starts at rest (default: for the largest stable motion of the block)"
CONDITIONS = (
    *_options("conditions", "exactly band amplitudes"),
    *_options("search", "objective risk"),
    Option("starts", "kind", "--from-rest", value="rest", help=_REST),
)
SEARCH = (
    *_options("search", "method optimiser searches designs steps"),
    *_options("requirements", "at_least reduce wall_contacts"),
    *_options("search", "seed"),
)


def parser(about: str, version: str) -> Parser:
    """Return the grammar of the command line.

    Args:
        about: the package in a sentence.
        version: version of the package.
    """
    top = Parser(prog="tpd", description=about)
    top.add_argument("--version", action="version", version=f"tpd {version}")
    commands = top.add_subparsers(dest="command", required=True, metavar="COMMAND")
    # The texts are in a separate file, in which they can be read and revised as text.
    texts = tomllib.loads(resources.files("tpd.cli").joinpath("commands.toml").read_text(encoding="utf-8"))
    for name, add_options in COMMANDS.items():
        text = texts[name]
        end = text.get("exit_status", _DONE)
        short = {key: text[key] for key in ("summary", "common", "example", "description")}
        command = commands.add_parser(name, help=text["summary"], epilog=end, **short)
        # The options set keys of the job file in these tables.
        command.set_defaults(activity=text.get("activity", ""), tables=defaultdict(dict))
        add_options(command)
    return top


def _add_number(to: Any, flag: str, metavar: str, text: str, kind: type = float, **more: Any) -> None:
    """Add an option with one number, which is no key of the job file."""
    to.add_argument(flag, type=kind, metavar=metavar, help=text, **more)


def _add_switch(to: Any, flag: str, text: str) -> None:
    """Add an option without a value, which is no key of the job file."""
    to.add_argument(flag, action="store_true", help=text)


def _add_group(command: Parser, title: str, options: Iterable[Option], text: str | None = None) -> Any:
    """Add options as a group with a title and an explanation."""
    group = command.add_argument_group(title, text)
    for option in options:
        option.add(group)
    return group


def _add_scene(command: Parser, *motions: Option) -> None:
    """Add the options that describe a block and its excitation."""
    text = "job file in TOML; the options below replace its values"
    command.add_argument("--scene", type=path_of, metavar="FILE", help=text)
    block = (
        "Default: the block of Collini et al. (2016). For another block give --width, --height, --mass and "
        "the excitation."
    )
    _add_group(command, "block", BLOCK, block)
    command.add_argument_group("excitation", "One of these kinds. It replaces the motion of the job file.")
    kinds = {"harmonic": HARMONIC, "pulse": PULSES, "files of records": READING}
    records = [option for option in motions if not any(option in kind for kind in kinds.values())]
    # Each command has some of the kinds of motion. The options for reading files come last.
    for title, kind in {"harmonic": HARMONIC, "pulse": PULSES, "records": records, **kinds}.items():
        if options := [option for option in motions if option in kind]:
            _add_group(command, title, options)


def _add_job(command: Parser, *motions: Option) -> None:
    """Add the options that name a job file, or describe a block and its excitation."""
    text = "job file in TOML, the same as --scene FILE; `tpd new` writes one"
    command.add_argument("job", type=path_of, nargs="?", metavar="JOB", help=text)
    _add_scene(command, *motions)


def _add_case(command: Parser, *motions: Option) -> None:
    """Add the options that name a design, or describe a block, its excitation and a pendulum."""
    text = (
        "folder with a report of `tpd optimise`, or its design.json, with block, excitation and pendulum; "
        "a job file is given with --scene"
    )
    command.add_argument("design", type=path_of, nargs="?", metavar="DESIGN", help=text)
    _add_scene(command, *motions)
    rod = "An equivalent point mass on a rod. Give one value for the mass and one for the length."
    group = command.add_argument_group("pendulum", rod)
    # argparse itself rejects a mass together with a mass ratio.
    mass, length = group.add_mutually_exclusive_group(), group.add_mutually_exclusive_group()
    _add_number(mass, "--pendulum-mass", "KG", "mass of the bob, kg")
    _add_number(mass, "--mass-ratio", "MU", "mass ratio: bob divided by block")
    _add_number(length, "--pendulum-length", "M", "length of the pendulum, m")
    _add_number(length, "--length-ratio", "LAM", "length ratio: pendulum divided by half the block height")
    _add_number(group, "--pendulum-damping", "ZETA", "damping ratio of the hinge (default 0.1)")
    Option("space", "hinge_height").add(group)


def _add_out(command: Parser, default: str | None, text: str = "folder for the results") -> None:
    """Add the options of the folder that the command writes to."""
    shown = text if default is None else f"{text} (default {default})"
    command.add_argument("--out", type=path_of, default=default, metavar="DIR", help=shown)
    _add_switch(command, "--overwrite", "replace earlier results in DIR")


# Each of the following functions adds the options of one command. Options that set keys of the job file are
# declared above; the others belong to the command alone.


def _new(command: Parser) -> None:
    command.add_argument("kind", choices=TEMPLATES, metavar="KIND", help=f"one of {', '.join(TEMPLATES)}")
    text = "job file to write; it must not exist yet (default KIND.toml)"
    command.add_argument("--out", type=path_of, metavar="FILE", help=text)


def _record(command: Parser) -> None:
    text = "files or folders with records, or names of built-in records: el-centro, loma-prieta, fema-p695"
    command.add_argument("records", nargs="+", metavar="FILE", help=text)
    _add_group(command, "files of records", READING)
    _add_out(command, None, "folder for a table and pictures (default: write no files)")


def _assess(command: Parser) -> None:
    _add_job(command, *HARMONIC, *PULSES, _RECORD, *RECORDS)
    _add_group(command, "conditions", CONDITIONS)


def _optimise(command: Parser) -> None:
    _add_job(command, *HARMONIC, *PULSES, *RECORDS, *_options("excitation", "validation_share"))
    _add_group(command, "design space and limits", DESIGN)
    conditions = _add_group(command, "conditions", CONDITIONS)
    # One option sets many keys of the table [scatter], so it is no `Option`.
    text = f"uncertain quantities with their relative half widths. Names: {', '.join(keys()['scatter'])}"
    how: dict[str, Any] = {"nargs": "+", "action": SetWidths, "default": argparse.SUPPRESS}
    conditions.add_argument("--scatter", metavar="NAME=WIDTH", help=text, **how)
    _add_group(command, "search and requirements", SEARCH)
    output = command.add_mutually_exclusive_group()
    _add_switch(output, "--quiet", "print only the verdict and the folder of the report")
    _add_switch(output, "--json", "print only the content of design.json")
    _add_switch(output, "--verbose", "print all rows of the answer, however many lines they have")
    _add_out(command, "tpd-design", "folder for the report")


def _check(command: Parser) -> None:
    _add_case(command, *HARMONIC, *PULSES, _RECORD, _SCALE, *RECORDS)
    # The other limits come from the job: a check uses those with which the pendulum was designed.
    NO_WALLS.add(command)
    _add_number(command, "--seed", "N", "seed of the runs (default: seed of the job; with --engine 0)", int)
    engine = command.add_argument_group("rigid-body engine (needs the extra engines)")
    text = (
        "simulate runs with and without the pendulum in a rigid-body engine with contact and sliding, "
        "instead of the models of this package. With DESIGN the result is added to its report"
    )
    engine.add_argument("--engine", choices=("mujoco",), help=text)
    _add_number(engine, "--runs", "N", "number of runs in the engine (default 64)", int)
    _add_out(command, None, "folder for the results (default: write no files)")


def _explore(command: Parser) -> None:
    text = "report directory, its design.json, or a job file in TOML"
    command.add_argument("source", type=path_of, metavar="DESIGN", help=text)
    text = "default explore.html in the report directory; for a job file, in the working directory"
    command.add_argument("--out", type=path_of, metavar="FILE", help=text)
    _add_switch(command, "--open", "open the page in the browser")
    _add_switch(command, "--overwrite", "replace FILE if it exists")


def _response(command: Parser) -> None:
    _add_case(command, *HARMONIC)
    text = "frequency, Hz (default {} times that of the excitation)"
    _add_number(command, "--from", "HZ", f"lowest {text.format(0.4)}", dest="low")
    _add_number(command, "--to", "HZ", f"highest {text.format(2)}", dest="high")
    _add_number(command, "--points", "N", "number of points on each branch (default 400)", int, default=400)
    text = "vary the frequency ratio xi at constant base acceleration f; --from and --to are values of xi"
    _add_switch(command, "--dimensionless", f"{text}, dimensionless")
    text = "number of frequencies at which motions from rest are simulated, 0 for none (default 40)"
    _add_number(command, "--runs-from-rest", "N", text, int, default=40)
    _add_out(command, "tpd-response")


def _map(command: Parser) -> None:
    _add_case(command, *HARMONIC)
    for axis in ("x", "y"):
        named: dict[str, Any] = {"metavar": ("NAME", "LO", "HI"), "help": f"{axis} axis: {_AXIS}"}
        command.add_argument(f"--{axis}", nargs=3, required=True, **named)
    _add_number(command, "--points", "N", "number of points along each axis (default 200)", int, default=200)
    _add_switch(command, "--simulate", "simulate each design from rest; this takes about 40 times longer")
    _add_out(command, "tpd-map")


def _shake(command: Parser) -> None:
    _add_case(command, *PULSE, *RECORD)
    text = "free motion after the base has stopped, s (default 20)"
    _add_number(command, "--free", "S", text, default=20.0)
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
    _add_out(command, "tpd-spectrum")


def _fragility(command: Parser) -> None:
    _add_case(command, *RECORDS, *PULSE)
    _add_number(command, "--period", "S", "period of the spectral acceleration for --intensity sa, s")
    _add_out(command, "tpd-fragility")


def _export(command: Parser) -> None:
    _add_case(command, *HARMONIC, *PULSE, *RECORD)
    text = "mjcf: model for MuJoCo; opensees: model for OpenSees; csv: time histories as a table"
    command.add_argument("--as", dest="kind", required=True, choices=tuple(EXPORTED), help=text)
    text = f"file to write (default {', '.join(EXPORTED.values())})"
    command.add_argument("--out", type=path_of, metavar="FILE", help=text)
    _add_switch(command, "--overwrite", "replace FILE if it exists")


COMMANDS = {
    function.__name__.lstrip("_"): function
    for function in (
        *(_new, _record, _assess, _optimise, _check, _explore),
        *(_response, _map, _shake, _spectrum, _fragility, _export),
    )
}
"""Functions that add the options of each command. The help texts of the commands are in `commands.toml`."""
