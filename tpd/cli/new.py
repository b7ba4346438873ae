"""`tpd new`: write a job file with comments to start from."""

from __future__ import annotations

import argparse
import os
import re
import shlex
import tomllib
from importlib import resources
from pathlib import Path

import jinja2

from tpd.cli.terminal import SOUND
from tpd.core import files


def run(options: argparse.Namespace) -> int:
    """Write the template, print the next step and return the exit status."""
    out = Path(f"{options.kind}.toml") if options.out is None else options.out
    if os.path.lexists(out):
        raise ValueError(f"{out} exists and was not changed: choose another file with --out")
    files.place(out, template(options.kind, out), overwrite=False)
    print(f"written: {out}\nnext: change the numbers in this file, then run\n  {_command(out)}")
    return SOUND


def template(kind: str, out: Path | None = None) -> str:
    """Return the text of a job file.

    Args:
        kind: one of `tpd.cli.grammar.TEMPLATES`.
        out: path of the file, for the command in its first comment.
    """
    folder = resources.files("tpd.cli").joinpath("templates")
    text, blocks = (folder.joinpath(x).read_text(encoding="utf-8") for x in ("job.toml.j2", "blocks.toml"))
    values = tomllib.loads(blocks)[kind] | {"command": _command(out or Path(f"{kind}.toml"))}
    lines = jinja2.Template(text, keep_trailing_newline=True).render(values)
    # The comments of all keys begin in the same column.
    return re.sub(r"^((?:# )?\w+ = .*?) +# ", lambda key: f"{key[1]:28}  # ", lines, flags=re.MULTILINE)


def _command(file: Path) -> str:
    """Return the command that finds a pendulum for a job file."""
    return f"tpd optimise {shlex.quote(str(file))} --out {shlex.quote(file.stem)}"
