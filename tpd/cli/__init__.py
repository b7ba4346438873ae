"""Command line: `tpd new`, `optimise`, `check`, `response`, `map`, `shake`, `spectrum`, `fragility` and
`export`.

A command is a module with `add`, its grammar, and `run`. Modules that need JAX are imported by `run`, so that
the help does not wait for them.
"""

from __future__ import annotations

import argparse
import sys
import warnings

import tpd
from tpd.cli import (
    check,
    common,
    export,
    fragility,
    interrupts,
    new,
    optimise,
    options,
    response,
    shake,
    spectrum,
)
from tpd.cli import map as mapping


def parser() -> argparse.ArgumentParser:
    """Return the grammar of the command line."""
    top = options.Parser(prog="tpd", description=str(tpd.__doc__).splitlines()[0])
    top.add_argument("--version", action="version", version=f"tpd {tpd.__version__}")
    commands = top.add_subparsers(dest="command", required=True, metavar="COMMAND")
    for command in (new, optimise, check, response, mapping, shake, spectrum, fragility, export):
        command.add(commands)
    return top


def main(arguments: list[str] | None = None) -> int:
    """Run the command line and return the exit status.

    Without `arguments` those of the process are taken: then the command runs in a process of its own, so that
    Ctrl-C ends it also while something compiles.
    """
    if arguments is not None:
        return _run(parser().parse_args(arguments))
    read = parser().parse_args()
    warnings.showwarning = interrupts.warned
    does = getattr(read, "does", "").format(**vars(read))
    with interrupts.watched(getattr(read, "out", None), does):
        status = _run(read)
        return interrupts.exit_now(status) if status == common.INTERRUPTED else status


def _run(read: argparse.Namespace) -> int:
    """Run the command that was read; an error is one sentence."""
    out = getattr(read, "out", None)
    existed = interrupts.exists(out)
    try:
        status = read.run(read)
    except (Exception, KeyboardInterrupt) as error:
        status = _refused(error)
    if status == common.INTERRUPTED and (hint := interrupts.leave(out, existed)):
        print(hint, file=sys.stderr if getattr(read, "json", False) else sys.stdout)
    return status


def _refused(error: BaseException) -> int:
    """Say in one sentence why a command has ended, and return its exit status; a defect is raised."""
    # An import or a compiler that is interrupted raises an error of its own.
    if isinstance(error, KeyboardInterrupt) or interrupts.received():
        print("tpd: interrupted", file=sys.stderr)
        return common.INTERRUPTED
    if isinstance(error, MemoryError):
        print("tpd: the job does not fit into memory: ask for less at once", file=sys.stderr)
    elif isinstance(error, OSError) and error.strerror:
        print(f"tpd: cannot use {str(error.filename)[:80]}: {error.strerror}", file=sys.stderr)
    elif isinstance(error, (ValueError, OSError)):
        print(f"tpd: {error}", file=sys.stderr)
    else:
        raise error
    return common.BAD_INPUT
