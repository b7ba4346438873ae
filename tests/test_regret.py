"""Arithmetic of the benchmark `regret`, on designs and values that are made up."""

from typing import Any

import numpy as np
import pytest

import tpd
from tests.benchmarks import regret

OWN = np.array([[0.01, 0.1, 0.05], [0.04, 0.9, 0.2]])
SCENE = {"scene": "tower", "kind": "scene", "code": "a", "measure": "overturned", "allowed": 0.01}
SCENE |= {"wider": {"own": [], "wide": ["own"], "damping": ["own"]}, "overturned": 0.3, "tilt": 0.4}


def design(value: float, within: tuple[str, ...], over: float = 0.0, **more: Any) -> dict:
    row = {"scene": "tower", "kind": "best", "code": "a", "status": "recommended"}
    row |= {"design": [repr(value), "0.2", "0.1"], "within": list(within), "overturned": value, "tilt": 0.5}
    return row | {"over": over, "no_result": 0.0, "runs": 8} | more


def search(space: str, seed: int, value: float, **more: Any) -> dict:
    return design(value, (space,), kind="search", space=space, seed=seed, **more)


def best(rows: list[dict], space: str) -> float | None:
    row = regret.best_of(rows, "tower", space)
    return None if row is None else row["overturned"]


def only(rows: list[dict], space: str) -> dict:
    (row,) = (r for r in regret.summary(rows) if r["space"] == space)
    return row


def test_the_wide_space_has_twice_the_logarithmic_width_and_contains_narrower_spaces():
    ends = regret.ends_of("wide", OWN)
    assert ends[:, 0] == pytest.approx([0.005, 0.08])
    assert ends[:, 2] == pytest.approx([0.025, 0.4])
    assert ends[1, 1] == 2.0
    assert np.array_equal(regret.ends_of("own", OWN), OWN)
    assert np.array_equal(regret.ends_of("damping", OWN), [OWN[0], [0.04, 0.9, 2.0]])
    assert regret.contains(OWN, OWN[1])
    assert not regret.contains(OWN, OWN[1] * [1.0, 1.0, 1.001])
    own, wide, damping = (regret.ends_of(space, OWN) for space in regret.SPACES)
    assert regret.contains(wide, own)
    assert regret.contains(damping, own)
    assert not regret.contains(wide, damping)
    assert not regret.contains(own, wide)


def test_the_best_design_of_a_space_can_come_from_a_narrower_space():
    rows = [SCENE, design(0.09, ("own", "wide"), over=0.02), design(0.08, ("own",), status="not_recommended")]
    assert best(rows, "own") is None
    rows += [
        design(0.12, ("own", "wide", "damping")),
        design(0.10, ("wide",)),
        design(0.05, ("own",), no_result=0.1),
    ]
    assert best(rows, "own") == 0.12
    assert best(rows, "wide") == 0.10
    assert best(rows, "damping") == 0.12
    tilt = [SCENE | {"measure": "tilt"}, *rows[1:], design(0.2, ("own",), tilt=0.3)]
    assert best(tilt, "own") == 0.2


def test_the_regret_is_the_difference_from_the_best_known_value():
    rows = [SCENE, search("own", 0, 0.13), search("own", 1, 0.11), design(0.10, ("own", "wide"))]
    found = only(rows, "own")
    assert found["regret"] == pytest.approx([0.03, 0.01])
    assert (found["worst"], found["missed"], found["loss"]) == (pytest.approx(0.03), 0, None)
    found = only([*rows, search("own", 2, 0.02, status="not_recommended")], "own")
    assert found["regret"][2] == np.inf
    assert (found["worst"], found["missed"]) == (pytest.approx(0.03), 1)
    # Nothing is missed if no design exists.
    found = only([SCENE, search("own", 0, 0.02, status="not_recommended")], "own")
    assert (found["worst"], found["missed"], found["regret"]) == (None, 0, [np.inf])


def test_a_wider_space_is_compared_with_a_narrower_one_at_the_same_seed():
    rows = [SCENE, search("own", 0, 0.10), search("own", 1, 0.14), search("own", 2, 0.1, status="undecided")]
    wide = [search("wide", 0, 0.12), search("wide", 1, 0.11), search("wide", 2, 0.15)]
    assert only(rows + wide, "wide")["loss"] == pytest.approx(0.02)
    assert only(rows + wide, "own")["loss"] is None
    nothing = search("wide", 1, 0.11, status="not_recommended")
    assert only([*rows, nothing], "wide")["loss"] == np.inf


def test_the_table_marks_regrets_above_one_point_and_lists_searches_without_a_design():
    rows = [
        SCENE,
        search("own", 0, 0.10),
        search("wide", 0, 0.12),
        search("wide", 1, 0.2, status="undecided"),
    ]
    first, *_, last = regret.table(rows).split("\n\n")
    own, wide = first.splitlines()[2:]
    assert "| 10.00% | 0.00 | 0.00 | yes |  |  |" in own
    assert "| 12.00%, 20.00% | 0.00, none | 0.00 | no, 1 recommend nothing | 2.00 | yes |" in wide
    assert last.endswith("| tower | wide | 1 | undecided | 20.00% |")


class Constant(regret.Case):
    """Scene in which every design has the same value."""

    def value(self, design: np.ndarray | None, runs: int, seed: int) -> regret.Value:
        return regret.Value(0.3 if design is None else 0.2, 0.4, 0.0, 0.0, runs)


def test_a_change_of_the_code_drops_searches_and_evaluates_the_best_designs_again():
    bounds = zip(("mass_ratio", "length_ratio", "damping_ratio"), map(tuple, OWN.T.tolist()), strict=True)
    settings = {"requirements": tpd.limits.Requirements()}
    case = Constant(tpd.paper_scene(), settings, tpd.DesignSpace(**dict(bounds)), runs=8)
    old = search("own", 0, 0.1) | {"design": ["0.02", "0.2", "0.1"]}
    ledger = regret.Ledger([SCENE, old], "b")
    ledger.begin("tower", case)
    scene, again = ledger.pruned()
    assert (scene["measure"], scene["overturned"], scene["wider"]["wide"]) == ("overturned", 0.3, ["own"])
    assert (again["kind"], again["overturned"], again["code"]) == ("best", 0.2, "b")
    assert again["within"] == ["own", "wide", "damping"]
    assert ledger.design("tower", case, np.array([0.02, 0.2, 0.1]))["overturned"] == 0.2
