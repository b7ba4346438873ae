"""`tpd new`: write a job file with comments to start from."""

from __future__ import annotations

import argparse
import os
import shlex
from importlib import resources
from pathlib import Path

from tpd.cli.terminal import SOUND
from tpd.core import files


def run(options: argparse.Namespace) -> int:
    """Write the template, print the next step and return the exit status."""
    out = Path(f"{options.kind}.toml") if options.out is None else options.out
    # A comment in the template shows the command that runs it, with the name of the template. The file gets
    # the command with its own name.
    again = f"tpd optimise --scene {shlex.quote(str(out))} --out {shlex.quote(out.stem)}"
    old = f"tpd optimise --scene {options.kind}.toml --out {options.kind}"
    if os.path.lexists(out):
        raise ValueError(f"{out} exists and was not changed: choose another file with --out")
    files.place(out, template(options.kind).replace(old, again))
    print(f"written: {out}\nnext: change the numbers in this file, then run\n  {again}")
    return SOUND


def template(kind: str) -> str:
    """Return the job file of one of `tpd.cli.grammar.TEMPLATES`."""
    return resources.files("tpd.cli").joinpath("templates", f"{kind}.toml").read_text(encoding="utf-8")
