"""The command line: `tpd optimise`, `tpd check`, `tpd response`, `tpd map`. A command is a module with
`add`, its grammar, and `run`; everything slow is imported when it is needed."""

from __future__ import annotations

import argparse
import sys

import tpd
from tpd.cli import check as checking
from tpd.cli import common, optimise, response
from tpd.cli import map as mapping


def parser() -> argparse.ArgumentParser:
    """The command line's grammar."""
    top = argparse.ArgumentParser(prog="tpd", description=str(tpd.__doc__).splitlines()[0])
    top.add_argument("--version", action="version", version=f"tpd {tpd.__version__}")
    commands = top.add_subparsers(dest="command", required=True, metavar="COMMAND")
    for command in (optimise, checking, response, mapping):
        command.add(commands)
    return top


def main(arguments: list[str] | None = None) -> int:
    """Run the command line; returns the exit status."""
    options = parser().parse_args(arguments)
    try:
        return options.run(options)
    except (ValueError, OSError) as error:
        print(f"tpd: {error}", file=sys.stderr)
        return common.BAD_INPUT
    except KeyboardInterrupt:
        print("tpd: interrupted; what is not in the output directory is lost", file=sys.stderr)
        return common.INTERRUPTED
