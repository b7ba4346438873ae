"""Conditions, limits and bounds that hold a design."""

import dataclasses

import numpy as np
import pytest

import tpd
from tests.design.conftest import BAND
from tests.design.test_objective import orbits
from tpd.design.verify import active


@pytest.fixture
def end(search):
    """One end with weights and excesses that a test may change."""
    one, limits = search.groups[1], search.groups[1].local.limit.shape[1]
    local = one.local.at(slice(0, 1))._replace(limit=np.full((1, limits), -0.5))
    return one._replace(
        x=np.full((1, 3), 0.5), local=local, weights=(np.zeros((1, 5)), np.zeros((1, limits)))
    )


def test_nothing_holds_a_design_in_the_middle(search, end):
    assert active(search.objective, end, 1e-3) == ()


def test_conditions_are_listed_by_their_weight(search, end):
    end.weights[0][0] = [0.3, 0.0, 0.01, 0.69, 0.0]
    assert [str(a) for a in active(search.objective, end, 1e-3)] == [
        f"tilt at {BAND.label(3)} (0.69)",
        f"tilt at {BAND.label(0)} (0.30)",
    ]
    mean = dataclasses.replace(search.objective, risk=tpd.Risk.expected())
    assert active(mean, end, 1e-3) == (), "in a mean all weigh alike"


def test_limits_are_listed_by_weight_and_by_how_near_they_are(search, end):
    end.weights[1][0, 6] = 2.0
    end.local.limit[0, 3] = 1e-5 - 5e-4
    end.local.limit[0, 4] = -2e-3
    found = active(search.objective, end, 1e-3)
    assert [(a.kind, a.name, a.condition) for a in found] == [
        ("limit", "reserve", BAND.label(1)),
        ("limit", "stroke", BAND.label(3)),
    ]
    assert found[0].weight == 2.0


def test_bounds_are_listed_with_their_values(search, end):
    end.x[0] = [1.0, 0.5, 0.0]
    assert [str(a) for a in active(search.objective, end, 1e-3)] == [
        "upper bound of the mass ratio, 0.2",
        "lower bound of the damping ratio, 0.05",
    ]


def test_without_limits_none_is_listed(end):
    empty = end.local._replace(limit=end.local.limit[:, :0], limit_slope=end.local.limit_slope[:, :0])
    free = end._replace(local=empty, weights=(end.weights[0], end.weights[1][:, :0]))
    assert active(orbits(limits=()), free, 1e-3) == ()
