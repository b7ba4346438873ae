"""Survey: designs followed from rest, their order, and those that fit the block."""

import dataclasses
from types import SimpleNamespace

import numpy as np
import pytest

import tpd
from tests.design.conftest import BAND, SCENE, WIDE
from tests.design.test_objective import GOOD, orbits
from tpd.design.survey import ON_THE_WAY, Survey, fitting, followed, survey
from tpd.design.verify import motions_from_rest as from_rest
from tpd.models.compiled_nonlinear import settle_nonlinear
from tpd.scene.bob import THICKEST, Bob
from tpd.scene.conditions import under_all

BARE = np.array([0.4, 0.2])
NONE = np.array([[0.0, 0.3, 0.1]])


def made(severity, **excess) -> Survey:
    severity = np.asarray(severity, dtype=float)
    return Survey(
        designs=np.arange(3.0 * len(severity)).reshape(-1, 3),
        severity=severity,
        bare=BARE,
        excess={name: np.asarray(x, dtype=float) for name, x in excess.items()},
        equations="linear",
    )


def test_what_is_above_the_bare_block_by_more_than_a_twentieth_counts_twice():
    found = made([[0.1, 0.1], [0.42, 0.21], [0.5, 0.2], [1.0, 1.0]], stroke=np.zeros(4))
    expected = np.array([0.1, 0.315, 0.35 + 0.04, 1.0 + 0.5 * (0.58 + 0.79)])
    np.testing.assert_allclose(found.score, expected)
    worst = dataclasses.replace(found, risk=tpd.Risk.worst())
    np.testing.assert_allclose(worst.score, expected + 0.5 * np.array([0.0, 0.105, 0.15, 0.0]))
    # The bare block scores 0.3, and 0.35 where the worst condition counts.
    np.testing.assert_array_equal(found.helps, [True, False, False, False])
    np.testing.assert_array_equal(worst.helps, [True, False, False, False])
    assert found.better == 1


def test_a_design_keeps_where_it_breaks_no_limit_and_the_block_stands_somewhere():
    found = made(
        [[0.1, 0.1], [0.1, 0.1], [1.0, 0.9], [1.0, 1.0]],
        stroke=[0.0, 1e-6, -0.1, -0.1],
        room=[-0.1, 0.2, -0.1, -0.1],
    )
    np.testing.assert_array_equal(found.broken, [0, 2, 0, 0])
    np.testing.assert_array_equal(found.keeps, [True, False, True, False])
    np.testing.assert_array_equal(made([[0.1, 0.1]]).broken, [0]), "without limits"


def test_the_best_design_without_a_limit():
    found = made([[0.3, 0.3], [0.2, 0.2], [0.1, 0.1]], stroke=[-0.1, -0.1, 0.5], room=[-0.1, 0.3, 0.3])
    names = (), ("room",), ("stroke",), ("room", "stroke")
    assert [found.best_without(*each) for each in names] == [0, 1, 0, 2]
    assert made([[0.1, 0.1]], stroke=[0.5]).best_without("room") is None


def test_designs_that_keep_to_the_limits_come_first_and_then_the_best():
    found = made([[0.1, 0.1], [0.3, 0.3], [0.2, 0.2], [0.05, 0.05]], stroke=[0.5, -0.3, -0.1, 0.1]).ordered()
    np.testing.assert_allclose(found.severity[:, 0], [0.2, 0.3, 0.05, 0.1])
    both = found.joined(made([[0.25, 0.25]], stroke=[-1.0])).ordered()
    np.testing.assert_allclose(both.severity[:, 0], [0.2, 0.25, 0.3, 0.05, 0.1])
    np.testing.assert_allclose(both.excess["stroke"], [-0.1, -1.0, -0.3, 0.1, 0.5])
    assert both.equations == "linear"
    # A block that overturns everywhere comes last, whatever its bob does.
    found = made([[1.0, 1.0], [0.9, 0.9], [1.0, 0.2]], stroke=[-0.5, 0.3, 0.2]).ordered()
    np.testing.assert_allclose(found.severity, [[0.9, 0.9], [1.0, 0.2], [1.0, 1.0]])


@pytest.mark.parametrize("heavy", [False, True])
def test_designs_over_the_space_fit_the_block_at_rest_or_come_last(heavy):
    """In a block of 200 kg few bobs of the space fit."""
    bob = Bob(shape="cylinder", aspect=4.0) if heavy else Bob()
    block = dataclasses.replace(SCENE.block, mass=200.0) if heavy else SCENE.block
    o = orbits(scene=tpd.Scene(block, SCENE.motion), limits=(tpd.limits.Stroke(), tpd.limits.Room(bob)))
    designs = fitting(o, seed=3)
    np.testing.assert_array_equal(designs, fitting(o, seed=3))
    units = WIDE.scaled(designs)
    assert np.all((units >= 0.0) & (units <= 1.0))
    radius, rod = bob.radius(o.geometry.mass(designs)), o.geometry.rod(designs)
    fits = ((radius <= o.geometry.wall) & (bob.slimness * radius <= THICKEST * rod)).all(axis=1)
    assert fits[0]
    assert bool(fits.all()) is not heavy
    assert np.all(np.diff(fits.astype(int)) <= 0)
    spread = WIDE.scaled(fitting(orbits(limits=()), seed=0))
    assert spread.shape == units.shape == (512, 3)
    assert np.all((spread.min(axis=0) < 0.01) & (spread.max(axis=0) > 0.99)), "without a room"


def test_designs_are_followed_from_rest_under_every_condition():
    """The linear equations are those of the verification's first step."""
    limits = (tpd.limits.Stroke(0.4), tpd.limits.Room())
    o, counts = orbits(limits=limits), []
    designs = np.concatenate([GOOD, [[0.02, 0.2, 0.1]]])
    found = followed(o, designs, 100, "linear", lambda *e: counts.append(e))
    np.testing.assert_array_equal(found.designs, designs)
    nu, room = float(o.p.nu), 0.5 * SCENE.block.width
    bare = from_rest(o.p, NONE[0], BAND, 100).amplitude
    np.testing.assert_allclose(found.bare, np.minimum(bare / nu, 1.0), rtol=1e-9)
    for i, design in enumerate(designs):
        way = from_rest(o.p, design, BAND, 100)
        np.testing.assert_allclose(found.severity[i], np.minimum(way.amplitude / nu, 1.0), rtol=1e-9)
        stands = np.isfinite(way.amplitude)
        stroke, angle = way.stroke[stands].max(), (way.peak + way.peak_stroke)[stands].max()
        assert found.excess["stroke"][i] == pytest.approx(stroke / 0.4 - 1.0, rel=1e-9)
        reach = Bob().reach(design[0] * SCENE.block.mass, design[1] * SCENE.block.half_height, angle)
        assert found.excess[ON_THE_WAY][i] == pytest.approx(reach / room - 1.0, rel=1e-9)
    assert set(found.excess) == {"stroke", "room", "thickness", ON_THE_WAY}
    assert np.all(found.excess[ON_THE_WAY] >= found.excess["room"] - 1e-12)
    assert counts[-1] == (3, 3)


@pytest.mark.mends("runs without an answer counted by what they had reached")
def test_a_run_without_an_answer_speaks_against_a_pendulum_and_not_for_it(monkeypatch):
    size = np.full(len(BAND) * (1 + len(GOOD)), 0.01)
    known = dict.fromkeys(("amplitude", "stroke", "peak", "peak_stroke"), size)
    unknown = SimpleNamespace(status=np.full(size.shape, "event_bound"), **known)
    monkeypatch.setattr("tpd.design.survey.settle_nonlinear", lambda *_, **__: unknown)
    monkeypatch.setattr("tpd.design.survey.names_of", lambda status: status)
    found = followed(orbits(limits=(tpd.limits.Stroke(0.4),)), GOOD, 40, "nonlinear", None)
    np.testing.assert_array_equal(found.severity, 1.0)
    assert np.all(found.bare < 1.0)
    assert not found.keeps.any()


def test_a_block_that_overturns_breaks_no_limit_on_the_bob():
    o = orbits(conditions=tpd.Conditions.amplitudes(6.0, 7.0), limits=(tpd.limits.Stroke(0.5),))
    found = followed(o, GOOD, 40, "nonlinear", None)
    np.testing.assert_array_equal([*found.severity, found.bare], 1.0)
    assert found.excess["stroke"].tolist() == [-1.0]
    assert not found.keeps[0]


def test_the_nonlinear_survey_is_by_the_nonlinear_equations():
    o = orbits(conditions=tpd.Conditions(), limits=(tpd.limits.Stroke(0.5),))
    found, linear = (followed(o, GOOD, 40, name, None) for name in ("nonlinear", "linear"))
    q = under_all(o.p, np.concatenate([NONE, GOOD]), o.conditions)
    settled = settle_nonlinear(q, np.zeros((2, 4)), periods=40, rtol=1e-9)
    severity = np.asarray(settled.amplitude) / SCENE.block.slenderness
    assert [found.bare.item(), found.severity.item()] == pytest.approx(severity, rel=1e-5)
    assert abs(linear.severity.item() - found.severity.item()) > 1e-3


def test_a_survey_goes_from_many_linear_designs_to_few_nonlinear_ones():
    limits, events = (tpd.limits.Stroke(1.0),), []
    o = orbits(conditions=tpd.Conditions.band(SCENE, 2.4, 2.6, 2), limits=limits)
    first, last = survey(o, GOOD, 20, 0, lambda *e: events.append(e))
    assert (first.equations, last.equations) == ("linear", "nonlinear")
    assert any(np.array_equal(x, GOOD[0]) for x in first.designs), "what searches met is among them"
    assert len(first.designs) > 512 > len(last.designs) > 64
    for found in (first, last):
        kept = found.keeps
        assert kept.any()
        assert np.all(np.diff(kept.astype(int)) <= 0)
        assert np.all(np.diff(np.round(found.score[kept], 3)) >= 0.0)
        units = WIDE.scaled(found.designs)
        assert np.all((units >= -1e-12) & (units <= 1.0 + 1e-12))
    done, total = np.array(events).T
    assert np.all(np.diff(done) >= 0)
    assert done[-1] <= total[-1]


def test_motions_from_rest_are_counted_and_the_bob_has_its_reach():
    room = {"room": [-0.2], ON_THE_WAY: [0.05]}
    found = dataclasses.replace(made([[0.3, 1.0, 0.5]], **room), bare=np.array([1.0, 0.6, 0.4]))
    assert found.told == (
        "By the linear equations from rest, of 3 conditions: 1 overturn the block with the pendulum, 1 "
        "without; under 2 it rocks more with it. The bob comes to 80% of the wall's distance once settled, "
        "105% before."
    )
    assert made([[1.0, 1.0]], **room).told.endswith("under 2 it rocks more with it.")
    assert made([[0.1, 0.1]]).told.endswith("under 0 it rocks more with it.")
