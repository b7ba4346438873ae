"""Commands run in this process, and a design, for the tests of several commands."""

import contextlib
import csv
import io
import json
from collections.abc import Callable
from pathlib import Path
from typing import NamedTuple

import pytest

import tpd
from tests.report.conftest import harmonic, json_text
from tpd.cli import main

COLUMN = "--width 1 --height 6 --mass 9000 --friction 0 --restitution 0.9595"
PENDULUM = tpd.Pendulum(mass=1.6224, length=0.12, damping_ratio=0.1)
PENDULUM_OPTIONS = "--pendulum-mass 450 --pendulum-length 0.9"


class Done(NamedTuple):
    """Result of a command."""

    status: int
    out: str
    err: str
    files: dict[str, Path]
    """Files in the output folder by their names, except the hidden list of files."""

    def rows(self, name: str) -> list[dict[str, str]]:
        """Return the rows of a table."""
        return list(csv.DictReader(self.files[name].read_text().splitlines()))

    def json(self, name: str) -> dict:
        """Return the content of a JSON file."""
        return json.loads(self.files[name].read_text())


def call(*words: str, out: Path | None = None) -> Done:
    """Run a command in this process.

    Args:
        words: words of the command line, in one text or several.
        out: output folder, if the command has one.
    """
    stdout, stderr = io.StringIO(), io.StringIO()
    with contextlib.redirect_stdout(stdout), contextlib.redirect_stderr(stderr):
        status = main([*" ".join(words).split(), *([] if out is None else ["--out", str(out)])])
    files = {p.name: p for p in out.glob("[!.]*")} if out is not None and out.is_dir() else {}
    return Done(status, stdout.getvalue(), stderr.getvalue(), files)


@pytest.fixture
def run(tmp_path) -> Callable[..., Done]:
    """Return a function that runs a command with an output folder of the test."""
    return lambda *words: call(*words, out=tmp_path / "out")


def design_json(job: dict, pendulum: dict | None = None) -> str:
    """Return the text of design.json for a job and a pendulum."""
    return json.dumps(json.loads(json_text(harmonic(), job)) | {"pendulum": pendulum})
