"""Objective over the motions that starts reach: brute force, derivatives, and the models."""

import dataclasses

import jax.numpy as jnp
import numpy as np
import pytest

import tpd
from tests.design.conftest import SCENE, WIDE
from tests.design.test_objective import GOOD, orbits
from tests.reference import exact
from tpd.core.conditions import under
from tpd.design.followed import Followed
from tpd.design.objective import NONE, ROCKING

GENTLE = tpd.Conditions.band(SCENE, 2.2, 2.8, 2) * tpd.Conditions.amplitudes(0.85)
LIMITS = (tpd.limits.Stroke(0.5), tpd.limits.RelativeStroke(0.8), tpd.limits.Reserve(0.05))


def followed(model, starts, conditions=GENTLE, closed=True) -> Followed:
    o = orbits(conditions=conditions, limits=LIMITS)
    common = o.p, o.conditions, o.space, o.risk, o.limits, o.geometry
    return Followed(*common, model=model, starts=starts, orbits=o if closed else None)


@pytest.fixture(scope="module")
def both():
    """Over what eight starts reach, the worst and the mean: one rests, two overturn, the others rock."""
    model = tpd.Piecewise(max_periods=500, lyapunov_periods=0)
    few = {"size": 8, "seed": 1, "tilt": 0.5, "tilt_rate": 0.2}
    return [followed(model, tpd.Starts(**few, worst=worst)) for worst in (True, False)]


def test_what_starts_reach_is_what_each_of_them_settles_into(both):
    worst, mean = (o.evaluate(GOOD) for o in both)
    for i, factors in enumerate(GENTLE.factor_rows()):
        q = under(SCENE.parameters(), jnp.asarray(GOOD[0]), factors)
        margin, merits, tilts, strokes, lost = float(tpd.closed_form.uplift(q).margin), [], [], [], []
        for y0 in both[0].starts.states(float(q.nu)):
            end = exact([q.nu, q.mu, q.lam, q.zeta, q.k, q.f, q.xi], y0)
            lost.append(end.status == "overturned")
            tilt = end.amplitude / float(q.nu)
            merits.append(2.0 - margin if lost[-1] else -margin if end.status == "rest" else tilt)
            if not lost[-1]:
                tilts.append(tilt)
                strokes.append(end.stroke)
        assert worst.merit[0, i] == pytest.approx(max(merits), rel=1e-9)
        assert mean.merit[0, i] == pytest.approx(np.mean(merits), rel=1e-9)
        for e in (worst, mean):
            assert e.lost[0, i] == pytest.approx(np.mean(lost))
            assert e.tilt[0, i] == pytest.approx(max(tilts), rel=1e-9)
            assert e.stroke[0, i] == pytest.approx(max(strokes), rel=1e-9)


def test_slopes_over_what_starts_reach_are_those_of_differences(both):
    for objective in both:
        e = objective.evaluate(GOOD)
        for axis in range(3):
            step = 1e-4 * GOOD[0, axis]
            moved = GOOD.repeat(2, axis=0)
            moved[:, axis] += [-step, step]
            sides = objective.evaluate(moved)
            for name in ("merit", "stroke", "tilt"):
                size, slope = getattr(sides, name), getattr(e, f"{name}_slope")
                expected = (size[1] - size[0]) / (2.0 * step)
                np.testing.assert_allclose(slope[0, :, axis], expected, rtol=1e-5, atol=1e-7)


def test_the_closed_form_states_the_reserve_and_moves_with_the_conditions(both):
    objective = both[0]
    assert objective.holds_reserve
    assert objective.constraint_names() == ["stroke", "relative_stroke", "reserve"]
    np.testing.assert_array_equal(objective.evaluate(GOOD).reserve, objective.orbits.evaluate(GOOD).reserve)
    alone = objective.over(tpd.Conditions())
    assert len(alone.orbits.conditions) == 1
    assert alone.evaluate(GOOD).reserve.shape == (1, 1)
    without = dataclasses.replace(objective, orbits=None)
    assert not without.holds_reserve
    assert without.constraint_names() == ["stroke", "relative_stroke"]


def test_where_every_start_overturns_the_slope_leads_out():
    hard = tpd.Conditions.amplitudes(6.0)
    objective = followed(tpd.Piecewise(max_periods=200), tpd.Starts.rest(), hard, closed=False)
    e = objective.evaluate(GOOD)
    assert e.kind.item() == NONE
    assert e.lost.item() == 1.0
    assert e.tilt.item() == e.multiplier.item() == np.inf
    assert e.merit.item() == pytest.approx(2.0 - e.margin.item())
    assert np.any(e.merit_slope != 0.0)
    value, slope = objective.constraints(e)
    assert np.isfinite(value).all()
    assert np.isfinite(slope).all()


@pytest.mark.parametrize(
    ("model", "rtol"),
    [
        (tpd.Piecewise(max_periods=200, lyapunov_periods=0), 1e-9),
        (tpd.Smoothed(max_periods=200), 3e-3),
    ],
    ids=["piecewise", "smoothed"],
)
def test_from_rest_the_motion_is_that_of_the_steady_state(model, rtol):
    design = np.array([[0.05, 0.2, 0.1]])
    objective = followed(model, tpd.Starts.rest(), tpd.Conditions(), closed=False)
    e = objective.evaluate(design)
    p = SCENE.parameters(SCENE.pendulum(mass_ratio=0.05, length_ratio=0.2, damping_ratio=0.1))
    s = tpd.steady_state(p)
    assert e.kind.item() == ROCKING
    assert e.tilt.item() == pytest.approx(float(s.amplitude) / p.nu, rel=rtol)
    assert e.stroke.item() == pytest.approx(float(s.stroke), rel=rtol)
    assert e.multiplier.item() == pytest.approx(float(s.multiplier), rel=0.05)
    assert e.unsettled.item() == 0.0
    assert objective.space is WIDE
