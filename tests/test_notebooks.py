"""Every notebook runs from top to bottom, its assertions included, and has the outputs of such a run.

Usually they run without the cells that take long (`tests/notebooks.py`); `pytest -m slow
tests/test_notebooks.py` runs them whole, each in a kernel of its own.
"""

import os
import subprocess
import sys
from pathlib import Path

import nbformat
import pytest
from nbclient import NotebookClient

from tests.notebooks import NOTEBOOKS, quick_cells

ROOT = Path(__file__).parents[1]
NAMES = [path.stem for path in NOTEBOOKS]
# Each takes one to five minutes; CI runs the main job as a command.
MARKED = [pytest.param(path, marks=pytest.mark.slow) for path in NOTEBOOKS]
LARGEST = 600_000
"""Bytes of a notebook file, pictures included."""


def test_there_are_fifteen_notebooks():
    assert len(NOTEBOOKS) == 15


@pytest.mark.parametrize("path", NOTEBOOKS, ids=NAMES)
def test_outputs_are_committed(path):
    notebook = nbformat.read(path, as_version=4)
    nbformat.validate(notebook)
    code = [cell for cell in notebook.cells if cell.cell_type == "code"]
    assert any("assert" in cell.source for cell in code)
    assert all(cell.outputs for cell in code)
    assert all(output.output_type != "error" for cell in code for output in cell.outputs)
    assert [cell.execution_count for cell in code] == list(range(1, len(code) + 1))
    assert path.stat().st_size < LARGEST


def test_what_is_quick_in_every_notebook_runs(tmp_path):
    # One process of its own for all: no types are checked there, as in a kernel.
    done = subprocess.run(
        [sys.executable, "-m", "tests.notebooks"],
        cwd=tmp_path,
        capture_output=True,
        text=True,
        env={**os.environ, "PYTHONPATH": str(ROOT)},
    )
    assert done.returncode == 0, done.stderr[-3000:]
    assert done.stdout.splitlines() == NAMES


def test_what_needs_a_long_cell_is_left_out():
    assert len(quick_cells(NOTEBOOKS[4])) == 4
    assert not any("winner" in source for source in quick_cells(NOTEBOOKS[0]))


@pytest.mark.parametrize("path", MARKED, ids=NAMES)
@pytest.mark.filterwarnings("ignore::DeprecationWarning")  # of the kernel's own client
def test_notebook_runs(path, tmp_path):
    notebook = nbformat.read(path, as_version=4)
    NotebookClient(notebook, timeout=600, resources={"metadata": {"path": str(tmp_path)}}).execute()
