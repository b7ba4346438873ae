"""Every cell of every notebook runs at small sizes, and outputs of a whole run are committed."""

import os
import subprocess
import sys
from pathlib import Path

import nbformat
import pytest

from tests.notebooks import DONE, NOTEBOOKS

each_notebook = pytest.mark.parametrize("path", NOTEBOOKS, ids=[path.stem for path in NOTEBOOKS])
LARGEST = 600_000
"""Bytes of a notebook file, pictures included."""


def test_there_are_twelve_notebooks():
    assert len(NOTEBOOKS) == 12


@each_notebook
def test_outputs_are_committed(path):
    notebook = nbformat.read(path, as_version=4)
    nbformat.validate(notebook)
    code = [cell for cell in notebook.cells if cell.cell_type == "code"]
    assert 4 <= len(code) <= 13
    assert any("assert" in cell.source for cell in code)
    assert all(cell.outputs for cell in code)
    assert all(output.output_type != "error" for cell in code for output in cell.outputs)
    assert [cell.execution_count for cell in code] == list(range(1, len(code) + 1))
    assert path.stat().st_size < LARGEST


@pytest.fixture(scope="module")
def runner(tmp_path_factory):
    """One process of its own for all notebooks: no types are checked there, as in a kernel."""
    process = subprocess.Popen(
        [sys.executable, "-m", "tests.notebooks", "-"],
        cwd=tmp_path_factory.mktemp("notebooks"),
        stdin=subprocess.PIPE,
        stdout=subprocess.PIPE,
        text=True,
        env={**os.environ, "PYTHONPATH": str(Path(__file__).parents[1])},
    )
    yield process
    process.communicate()


@each_notebook
def test_a_notebook_runs_without_error(path, runner):
    runner.stdin.write(f"{path.stem}\n")
    runner.stdin.flush()
    said = runner.stdout.readline()
    assert said.startswith(path.stem), said
    assert said.endswith(f"{DONE}\n"), said
