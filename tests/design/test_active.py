"""Conditions, limits and bounds that hold a design."""

import dataclasses
from copy import copy

import numpy as np
import pytest

import tpd
from tests.design.conftest import BAND
from tests.design.test_objective import orbits
from tpd.design.active import active


@pytest.fixture
def end(search):
    """A search of one end with weights and excesses that a test may change."""
    out, g = copy(search), search.groups[1]
    one = g._replace(
        x=np.full((1, 3), 0.5),
        local=g.local.at(slice(0, 1))._replace(limit=np.full((1, g.local.limit.shape[1]), -0.5)),
        weights=(np.zeros((1, 5)), np.zeros((1, g.local.limit.shape[1]))),
    )
    out.groups = [one]
    return out


def test_nothing_holds_a_design_in_the_middle(end):
    assert active(end, 0, 1e-3) == ()


def test_conditions_are_listed_by_their_weight(end):
    end.groups[0].weights[0][0] = [0.3, 0.0, 0.01, 0.69, 0.0]
    assert [str(a) for a in active(end, 0, 1e-3)] == [
        f"tilt at {BAND.label(3)} (0.69)",
        f"tilt at {BAND.label(0)} (0.30)",
    ]
    end.objective = dataclasses.replace(end.objective, risk=tpd.Risk.expected())
    assert active(end, 0, 1e-3) == (), "in a mean all weigh alike"


def test_limits_are_listed_by_weight_and_by_how_near_they_are(end):
    g = end.groups[0]
    g.weights[1][0, 6] = 2.0
    g.local.limit[0, 3] = 1e-5 - 5e-4
    g.local.limit[0, 4] = -2e-3
    found = active(end, 0, 1e-3)
    assert [(a.kind, a.name, a.condition) for a in found] == [
        ("limit", "reserve", BAND.label(1)),
        ("limit", "stroke", BAND.label(3)),
    ]
    assert found[0].weight == 2.0


def test_bounds_are_listed_with_their_values(end):
    end.groups[0].x[0] = [1.0, 0.5, 0.0]
    assert [str(a) for a in active(end, 0, 1e-3)] == [
        "upper bound of the mass ratio, 0.2",
        "lower bound of the damping ratio, 0.05",
    ]


def test_without_limits_none_is_listed(search):
    free = copy(search)
    free.objective = orbits(limits=())
    g = search.groups[1]
    empty = g.local._replace(limit=g.local.limit[:, :0], limit_slope=g.local.limit_slope[:, :0])
    free.groups = [g._replace(local=empty, weights=(g.weights[0], g.weights[1][:, :0]))]
    assert "limit" not in {a.kind for a in active(free, 0, 1e-3)}
