"""Every notebook runs from top to bottom, its assertions included, and has the outputs of such a run."""

from pathlib import Path

import nbformat
import pytest
from nbclient import NotebookClient

NOTEBOOKS = sorted((Path(__file__).parents[1] / "notebooks").glob("*.ipynb"))
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


@pytest.mark.parametrize("path", MARKED, ids=NAMES)
@pytest.mark.filterwarnings("ignore::DeprecationWarning")  # of the kernel's own client
def test_notebook_runs(path, tmp_path):
    notebook = nbformat.read(path, as_version=4)
    NotebookClient(notebook, timeout=600, resources={"metadata": {"path": str(tmp_path)}}).execute()
