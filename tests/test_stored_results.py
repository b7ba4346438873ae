"""Stored results of the benchmarks: one line a record, and nothing is lost between writing and drawing."""

import json
import math

import numpy as np

from tests.benchmarks import proof_runs
from tests.benchmarks.precision.measure import Row, plain, read
from tests.benchmarks.tables import compact


def test_a_record_takes_one_line_and_is_read_back():
    content = {
        "about": {"date": "today", "cores": "2"},
        "widths": [0.1, 0.2],
        "rows": [{"a": 1}, {"a": 2}],
        "none": {},
    }
    text = compact(content)
    assert json.loads(text) == content
    assert text.splitlines().count('{"a": 1},') == 1
    assert '"widths": [0.1, 0.2],' in text.splitlines()


def test_rows_with_numbers_that_are_not_finite_are_read_back():
    rows = [
        Row("bare", "value", "ours", True, "none", 0.0, error=math.inf, note="no number"),
        Row("bare", "value", "theirs", False, "rtol", 1e-3, error=1e-5, cold=2.0, warm=0.5),
    ]
    again = read(json.loads(compact({"rows": plain(rows)}))["rows"])
    assert repr(again) == repr(rows)


def test_stored_runs_of_the_proof_have_the_tables_of_the_measured_ones(tmp_path, monkeypatch):
    monkeypatch.setattr(proof_runs, "RESULTS", tmp_path / "proof.json")
    monkeypatch.setattr(proof_runs, "VERSIONS", ("numpy",))
    rng = np.random.default_rng(0)

    def run() -> proof_runs.Run:
        return proof_runs.Run(1 + np.arange(300), np.minimum.accumulate(1.0 + rng.random(300)), 1.5)

    runs = {"a problem": {name: [run(), run(), run()] for name in ("ours", "random", "grid")}}
    proof_runs.store(runs, {"steps": 16})
    again = proof_runs.stored()
    assert proof_runs.table(again["a problem"]) == proof_runs.table(runs["a problem"])
    assert len(again["a problem"]["ours"][0].best) < 30
