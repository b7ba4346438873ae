# PYTHON_ARGCOMPLETE_OK
"""Command line: `tpd new`, `record`, `assess`, `optimise`, `check`, `explore`, `response`, `map`, `shake`,
`spectrum`, `fragility` and `export`.

The grammar of all commands is in `grammar`. A command is a module with a function `run`, which is imported
when the command is chosen: the help does not wait for JAX.
"""

from __future__ import annotations

import argparse
import contextlib
import os
import signal
import sys
import warnings
from importlib import import_module
from pathlib import Path

import tpd

ABOUT = "Tuned pendulum design: find the pendulum that keeps a rocking block from rocking."
"""The package in a sentence. Docstrings are not there under `python -OO`."""


def parser() -> argparse.ArgumentParser:
    """Return the grammar of the command line."""
    from tpd.cli import grammar

    return grammar.parser(ABOUT, tpd.__version__)


def main(arguments: list[str] | None = None) -> int:
    """Run the command line and return the exit status.

    Without `arguments` those of the process are taken: then the process is this command's, and Ctrl-C ends it
    at once, also while something is imported or compiled.
    """
    grammar = parser()
    if arguments is not None:
        return _run(grammar.parse_args(arguments))
    # A shell asks for the words that may come next, by way of an optional package.
    if "_ARGCOMPLETE" in os.environ:
        import_module("argcomplete").autocomplete(grammar)
    # The exception that Python raises instead waits until compiled code returns. The default action does not
    # wait, and a shell has status 130 for it. Files are complete before they get their names.
    signal.signal(signal.SIGINT, signal.SIG_DFL)
    # Processes of a cluster that end with this one are no mistake that Python should warn of.
    os.environ.setdefault("PYTHONWARNINGS", "ignore:resource_tracker:UserWarning")
    from tpd.cli import interrupts

    with interrupts.lasting_output():
        read = grammar.parse_args()
        warnings.showwarning = interrupts.warned
        return _run(read, read.does.format(**vars(read)))


def _run(read: argparse.Namespace, does: str = "") -> int:
    """Run the command that was read, and print what it does unless an input is bad; an error is one
    sentence."""
    out: Path | None = getattr(read, "out", None)
    made = None if out is None or os.path.exists(out) else out
    try:
        # A command that ends at once does not wait for JAX.
        if not read.does:
            return import_module(f"tpd.cli.{read.command}").run(read)
        from tpd.cli import common, interrupts

        # All inputs are checked before JAX is imported, which takes seconds.
        found = common.checked(read)
        with interrupts.announced(does):
            common.set_up(found.job)
            return import_module(f"tpd.cli.{read.command}").run(read, found)
    except Exception as error:
        if made is not None:
            # What could not be written leaves no empty folder.
            with contextlib.suppress(OSError, ValueError):
                made.rmdir()
        return _refused(error)


def _refused(error: Exception) -> int:
    """Say in one sentence why a command has ended, and return its exit status; a defect is raised."""
    from tpd.cli.interrupts import BAD_INPUT

    if isinstance(error, MemoryError):
        print("tpd: the job does not fit into memory: ask for less at once", file=sys.stderr)
    elif isinstance(error, OSError) and error.strerror and error.filename:
        print(f"tpd: cannot use {error.filename}: {error.strerror}", file=sys.stderr)
    elif isinstance(error, (ValueError, OSError)):
        print(f"tpd: {error}", file=sys.stderr)
    else:
        raise error
    return BAD_INPUT
