"""`tpd new`: write a commented job file to begin with."""

from __future__ import annotations

import argparse
import contextlib
import shlex
from importlib import resources
from pathlib import Path

from tpd.cli.interrupts import SOUND
from tpd.core import files


def run(options: argparse.Namespace) -> int:
    """Write the template and print how to go on; return the exit status."""
    out = Path(f"{options.kind}.toml") if options.out is None else options.out
    # The file tells how to run it: by the name that it has, not by that of the template.
    again = f"tpd optimise --scene {shlex.quote(str(out))} --out {shlex.quote(out.stem)}"
    old = f"tpd optimise --scene {options.kind}.toml --out {options.kind}"
    try:
        files.make_folder(out.parent)
        # Mode x fails where the file exists: no other program can write it between a check and the writing.
        with out.open("x", encoding="utf-8", errors="replace") as file:
            file.write(files.readable(template(options.kind).replace(old, again)))
    except FileExistsError:
        raise ValueError(f"{out} exists and is left as it is: name another file with --out") from None
    except OSError as error:
        with contextlib.suppress(OSError):
            out.unlink()
        raise ValueError(f"cannot write {out}: {error.strerror or error}") from None
    print(f"written: {out}\nnext: change its numbers, then {again}")
    return SOUND


def template(kind: str) -> str:
    """Return the job file of one of `tpd.cli.grammar.KINDS`."""
    return resources.files("tpd.cli").joinpath("templates", f"{kind}.toml").read_text(encoding="utf-8")
