"""Command line: `tpd new`, `tpd optimise`, `tpd check`, `tpd response`, `tpd map`.

A command is a module with `add`, its grammar, and `run`. Modules that need JAX are imported by `run`, so that
the help does not wait for them.
"""

from __future__ import annotations

import argparse
import sys

import tpd
from tpd.cli import check, common, new, optimise, options, response
from tpd.cli import map as mapping


def parser() -> argparse.ArgumentParser:
    """Return the grammar of the command line."""
    top = options.Parser(prog="tpd", description=str(tpd.__doc__).splitlines()[0])
    top.add_argument("--version", action="version", version=f"tpd {tpd.__version__}")
    commands = top.add_subparsers(dest="command", required=True, metavar="COMMAND")
    for command in (new, optimise, check, response, mapping):
        command.add(commands)
    return top


def main(arguments: list[str] | None = None) -> int:
    """Run the command line and return the exit status."""
    read = parser().parse_args(arguments)
    try:
        return read.run(read)
    except (ValueError, OSError) as error:
        print(f"tpd: {error}", file=sys.stderr)
        return common.BAD_INPUT
    except MemoryError:
        print("tpd: the job does not fit into memory: ask for less at once", file=sys.stderr)
        return common.BAD_INPUT
    except KeyboardInterrupt:
        print("tpd: interrupted; what is not in the output directory is lost", file=sys.stderr)
        return common.INTERRUPTED
