"""The search under ground motions where runs have no answer."""

import numpy as np
import pytest

import tpd
from tpd.design.ground import objective as module
from tpd.design.ground import search
from tpd.design.ground.search import GroundSearch, Searcher

DESIGN = np.array([[0.12, 0.4, 0.5]])


def test_a_search_leaves_runs_without_an_answer_out(objective, monkeypatch):
    monkeypatch.setattr(module, "MAX_EVENTS", 200)
    space = tpd.DesignSpace(damping_ratio=(0.05, 1.0))
    s = Searcher(objective, tpd.Risk.expected(), space, GroundSearch(starts=6, steps=2), 0)
    s.run()
    runs = objective.evaluate(s.found.designs)
    value = runs.severity
    known = ~runs.undecided
    assert np.any(~known)
    np.testing.assert_array_equal(s.found.undecided, np.sum(~known, axis=1))
    for row, value_row, known_row in zip(s.found.value, value, known, strict=True):
        assert row == pytest.approx(value_row[known_row].mean())


def test_a_design_of_which_no_run_has_an_answer_is_never_the_best(objective):
    space = tpd.DesignSpace(damping_ratio=(0.05, 1.0))
    s = Searcher(objective, tpd.Risk.expected(), space, GroundSearch(starts=6, steps=0), 0)
    s.run()
    s.found.value[0] = np.nan
    s._fit(full=True)
    assert not s.found.feasible[0]
    assert s.best() != 0
    assert len(s.surface.seen.value) == 5
    np.testing.assert_array_equal(
        search.risk_of_known(tpd.Risk.worst(), np.array([[np.nan, 0.2, 0.1], [np.nan] * 3])), [0.2, np.nan]
    )
