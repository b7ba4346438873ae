# PYTHON_ARGCOMPLETE_OK
"""Command line: `tpd new`, `record`, `assess`, `optimise`, `check`, `explore`, `response`, `map`, `shake`,
`spectrum`, `fragility` and `export`.

`grammar` declares all commands. Each command is a module with a function `run`. The module is imported when
the command is chosen, so that the help does not wait for JAX.
"""

from __future__ import annotations

import argparse
import os
import signal
import sys
import warnings
from importlib import import_module

import tpd

ABOUT = "Tuned pendulum design: find a pendulum that reduces the rocking of a block."
"""Description of the package in one sentence. Its docstring is absent under `python -OO`."""


def parser() -> argparse.ArgumentParser:
    """Return the grammar of the command line."""
    from tpd.cli import grammar

    return grammar.parser(ABOUT, tpd.__version__)


def main(arguments: list[str] | None = None) -> int:
    """Run the command line and return the exit status.

    Args:
        arguments: words after `tpd`. None takes the arguments of the process, which then belongs to the
            command: Ctrl-C ends it at once, also during an import or a compilation.
    """
    grammar = parser()
    if arguments is not None:
        return _run(grammar.parse_args(arguments))
    # A shell that completes words sets this variable; completion needs an optional package.
    if "_ARGCOMPLETE" in os.environ:
        import_module("argcomplete").autocomplete(grammar)
    # Python would raise KeyboardInterrupt only after compiled code returns. The default action of the signal
    # ends the process at once, and the shell reports status 130. No file can be left incomplete, because
    # files are renamed to their final names when they are complete.
    signal.signal(signal.SIGINT, signal.SIG_DFL)
    from tpd.cli import terminal

    with terminal.lasting_output():
        options = grammar.parse_args()
        warnings.showwarning = terminal.show_warning
        # Quiet commands print their answer only, and errors.
        is_quiet = getattr(options, "quiet", False)
        return _run(options, "" if is_quiet else options.activity.format(**vars(options)))


def _run(options: argparse.Namespace, activity: str = "") -> int:
    """Run a command and return its exit status. An error is printed as one sentence.

    Args:
        options: parsed options with the name of the command.
        activity: description of the work, printed if the input is valid; see `terminal.announced`.
    """
    try:
        # Commands without a description are quick and do not need JAX.
        if not options.activity:
            return import_module(f"tpd.cli.{options.command}").run(options)
        from tpd.cli import common, terminal

        # All inputs are checked before JAX is imported, which takes seconds.
        case = common.check_inputs(options)
        with terminal.announced(activity):
            common.set_up_jax(case.job)
            return import_module(f"tpd.cli.{options.command}").run(options, case)
    except Exception as error:
        return _report_error(error)


def _report_error(error: Exception) -> int:
    """Print an error as one sentence and return the exit status. An error of the program itself is raised."""
    from tpd.cli.terminal import BAD_INPUT

    if isinstance(error, MemoryError):
        print("tpd: the memory is not sufficient for this job: compute fewer points at once", file=sys.stderr)
    elif isinstance(error, OSError) and error.strerror and error.filename:
        print(f"tpd: cannot use {error.filename}: {error.strerror}", file=sys.stderr)
    elif isinstance(error, (ValueError, OSError)):
        print(f"tpd: {error}", file=sys.stderr)
    else:
        raise error
    return BAD_INPUT
