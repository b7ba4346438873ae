"""Stored results of the benchmarks are of this version, and the tables that pages show are theirs."""

import json
import math

import numpy as np
import pytest

import tpd
from tests.benchmarks import aims, stored

FILES = sorted(stored.RESULTS.glob("*.json"))
ABOUT = ("version", "date", "machine", "cores", *stored.PACKAGES, "command", "seed", "seconds")


@pytest.mark.parametrize("path", FILES, ids=lambda p: p.stem)
def test_a_stored_result_is_of_this_version(path):
    found = stored.read(path.stem)
    assert path.stem in stored.NAMES
    assert tuple(found.about) == ABOUT
    assert found.about["version"] == tpd.__version__, f"python -m tests.benchmarks {path.stem}"
    assert found.rows


def test_the_tables_of_every_page_are_those_of_the_files():
    for path, text in stored.pages().items():
        assert path.read_text(encoding="utf-8") == text, f"{path.name}: python -m tests.benchmarks --draw"


def test_a_record_takes_one_line_and_is_read_back():
    rows = [{"a": np.float64(1.23456789), "b": [math.inf, 2]}, {"a": math.nan, "b": np.arange(2)}]
    text = stored.compact({"about": {"cores": 2}, "rows": stored.plain(rows)})
    assert json.loads(text)["rows"] == [{"a": 1.235, "b": [None, 2]}, {"a": None, "b": [0, 1]}]
    assert '{"a": 1.235, "b": [null, 2]},' in text.splitlines()


def test_stored_results_are_drawn_and_become_stale_with_the_version(tmp_path, monkeypatch):
    monkeypatch.setattr(stored, "RESULTS", tmp_path)
    assert stored.is_stale("commands")
    assert "Not measured" in stored.drawn("commands")
    rows = [{"command": name, "first": 50.0, "later": 3.0} for name in ("tpd optimise", "tpd map")]
    stored.store("commands", rows, 1.0)
    assert not stored.is_stale("commands")
    assert "| `tpd map` | 50.0 | 3.0 |" in stored.drawn("commands")
    lines = {line.split(" | ")[0]: line for line in aims.aims().splitlines()}
    assert lines["| `tpd optimise`, later"].endswith("| 3.0 s | reached |")
    assert "| 50.0 s | Limit: as measured" in lines["| `tpd optimise`, first call"]
    monkeypatch.setattr(tpd, "__version__", "0.0.0")
    assert stored.is_stale("commands")
