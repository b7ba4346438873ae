"""Stored results of the benchmarks are not older than the code, or say so, and pages show their tables."""

import json
import math

import numpy as np
import pytest

import tpd
from tests.benchmarks import aims, stored

FILES = sorted(stored.RESULTS.glob("*.json"))
ABOUT = (
    "version",
    "commit",
    "code",
    "date",
    "machine",
    "cores",
    *stored.PACKAGES,
    "command",
    "seed",
    "seconds",
)


@pytest.mark.parametrize("path", FILES, ids=lambda p: p.stem)
def test_a_stored_result_is_not_older_than_the_modules_it_measures_unless_it_is_marked(path):
    found = stored.read(path.stem)
    assert path.stem in stored.NAMES
    assert tuple(found.about) == ABOUT
    assert found.rows
    if found.about["code"] != stored.OLDER:
        changed = f"{', '.join(stored.module(path.stem).MEASURES)} changed since {found.about['commit']}"
        remedy = f"python -m tests.benchmarks {path.stem}, or python -m tests.benchmarks --mark"
        assert not stored.is_stale(path.stem), f"{changed}: {remedy}"
        assert found.about["version"] == tpd.__version__


@pytest.mark.parametrize("name", stored.NAMES)
def test_a_benchmark_names_modules_that_exist(name):
    assert len(stored.code(name)) == 12


def test_the_hash_of_a_benchmark_changes_with_the_source_of_its_modules_only(tmp_path, monkeypatch):
    (tmp_path / "tpd" / "answers").mkdir(parents=True)
    for name in ("statistics", "fragility", "paired"):
        (tmp_path / "tpd" / "answers" / f"{name}.py").write_text("x = 1\n", encoding="utf-8")
    monkeypatch.setattr(stored, "ROOT", tmp_path)
    before = stored.code("intervals"), stored.code("power")
    (tmp_path / "tpd" / "answers" / "paired.py").write_text(
        '"""A."""\n# b\nx = 1\n"""C."""', encoding="utf-8"
    )
    assert before == (stored.code("intervals"), stored.code("power"))
    (tmp_path / "tpd" / "answers" / "paired.py").write_text("x = 2\n", encoding="utf-8")
    assert stored.code("intervals") == before[0]
    assert stored.code("power") != before[1]
    (tmp_path / "tpd" / "answers" / "paired.py").unlink()
    with pytest.raises(ValueError, match="has answers/paired"):
        stored.code("power")


def test_the_tables_of_every_page_equal_the_stored_results():
    for path, text in stored.pages().items():
        assert path.read_text(encoding="utf-8") == text, f"{path.name}: python -m tests.benchmarks --draw"


def test_a_stored_row_takes_one_line_and_is_read_back():
    rows = [{"a": np.float64(1.23456789), "b": [math.inf, 2]}, {"a": math.nan, "b": np.arange(2)}]
    text = stored.compact({"about": {"cores": 2}, "rows": stored.plain(rows)})
    assert json.loads(text)["rows"] == [{"a": 1.235, "b": [None, 2]}, {"a": None, "b": [0, 1]}]
    assert '{"a": 1.235, "b": [null, 2]},' in text.splitlines()


def test_stored_results_are_drawn_and_become_stale_with_the_code(tmp_path, monkeypatch):
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
    assert stored.OLDER not in aims.machine()
    monkeypatch.setattr(stored, "code", lambda name: "another")
    assert stored.is_stale("commands")
    assert stored.mark() == ["commands"]
    assert stored.read("commands").rows == stored.plain(rows)
    assert "The results of commands are older than the code." in aims.machine()
