"""The search on the nonlinear equations: when it is wanted, and on what."""

import numpy as np
import pytest

import tpd
from tests.design.conftest import SCENE
from tests.design.test_followed import followed
from tests.design.test_objective import GOOD, orbits
from tpd.analysis.attractors import StartKind
from tpd.design.nonlinear_search import nonlinear_objective, wanted
from tpd.design.result import DesignStatus

ALONE = tpd.Conditions()


def test_its_objective_is_the_nonlinear_motion_from_rest():
    objective = nonlinear_objective(orbits(conditions=ALONE, limits=(tpd.limits.Stroke(0.5),)))
    assert isinstance(objective.model, tpd.Segmented)
    assert objective.starts.kind is StartKind.rest
    mass, length, damping = GOOD[0]
    p = SCENE.parameters(SCENE.pendulum(mass_ratio=mass, length_ratio=length, damping_ratio=damping))
    settled = tpd.steady_state(p, model=tpd.Segmented(lyapunov_periods=0))
    e = objective.evaluate(GOOD)
    assert tpd.status_name(settled.status) == "rocking"
    assert e.tilt.item() == pytest.approx(float(settled.amplitude) / p.nu, rel=1e-9)
    assert e.stroke.item() == pytest.approx(float(settled.stroke), rel=1e-9)
    for axis in range(3):
        step = 1e-4 * GOOD[0, axis]
        moved = GOOD.repeat(2, axis=0)
        moved[:, axis] += [-step, step]
        sides = objective.evaluate(moved)
        for name in ("tilt", "stroke"):
            size, slope = getattr(sides, name), getattr(e, f"{name}_slope")
            expected = (size[1, 0] - size[0, 0]) / (2.0 * step)
            np.testing.assert_allclose(slope[0, 0, axis], expected, rtol=1e-3, atol=1e-5)


def test_a_reserve_that_the_linear_search_kept_to_is_still_a_limit():
    o = orbits(conditions=ALONE)
    on = nonlinear_objective(o)
    assert on.constraint_names() == o.constraint_names()
    assert on.orbits is o
    smoothed = followed(tpd.Smoothed(), tpd.Starts.rest(), ALONE, closed=False)
    assert "reserve" not in nonlinear_objective(smoothed).constraint_names()
    assert "reserve" in nonlinear_objective(followed(tpd.Piecewise(), tpd.Starts(), ALONE)).constraint_names()


def test_it_is_wanted_where_the_nonlinear_equations_may_know_better():
    one, several = orbits(conditions=ALONE), orbits()
    for status in DesignStatus:
        assert wanted(status, [], one) is (status is not DesignStatus.found)
        assert not wanted(status, [], several), "nothing was refused by the nonlinear equations"
    on = nonlinear_objective(one)
    assert not wanted(DesignStatus.refused, [], on), "it was searched on them already"
    many = orbits(conditions=tpd.Conditions.scatter(33, friction=0.1))
    assert not wanted(DesignStatus.none_feasible, [], many)
