"""A small design and its report, made once for the tests of several commands."""

import contextlib
import csv
import io
import json
from collections.abc import Callable
from pathlib import Path
from typing import NamedTuple

import pytest

import tpd
from tests.report.conftest import harmonic
from tpd.cli import main
from tpd.design.as_built import Details
from tpd.report.json import as_json

COLUMN = "--width 1 --height 6 --mass 9000 --friction 0 --restitution 0.9595"
PENDULUM = tpd.Pendulum(mass=1.6224, length=0.12, damping_ratio=0.1)
WITH = "--pendulum-mass 450 --pendulum-length 0.9"


class Done(NamedTuple):
    """A command that has ended."""

    status: int
    out: str
    err: str
    files: dict[str, Path]
    """Files of its directory by their names."""

    def rows(self, name: str) -> list[dict[str, str]]:
        """Rows of a table."""
        return list(csv.DictReader(self.files[name].read_text().splitlines()))

    def json(self, name: str) -> dict:
        """Content of a file in JSON."""
        return json.loads(self.files[name].read_text())


def call(*words: str, out: Path | None = None) -> Done:
    """Run a command in this process, its words in one text or several, with its directory if it has one."""
    said, err = io.StringIO(), io.StringIO()
    with contextlib.redirect_stdout(said), contextlib.redirect_stderr(err):
        status = main([*" ".join(words).split(), *([] if out is None else ["--out", str(out)])])
    found = {p.name: p for p in out.iterdir()} if out is not None and out.is_dir() else {}
    return Done(status, said.getvalue(), err.getvalue(), found)


@pytest.fixture
def run(tmp_path) -> Callable[..., Done]:
    """Runs a command that writes into a directory of the test."""
    return lambda *words: call(*words, out=tmp_path / "out")


def design_json(job: dict, pendulum: dict | None = None) -> str:
    """design.json of a job and a pendulum."""
    return json.dumps(json.loads(as_json(harmonic(), Details(), job)) | {"pendulum": pendulum})
