"""Problems: defaults, the space within a limit on the mass, the objective that belongs to the inputs."""

import dataclasses

import numpy as np
import pytest

import tpd
from tpd.answers.attractors import StartKind
from tpd.design.criteria import DEFAULT_LIMITS
from tpd.design.problem import Problem

SCENE = tpd.paper_scene()
BAND = tpd.Conditions.band(SCENE, 2.0, 3.5, 5)
ALONE = tpd.Conditions.exactly()
LOSSY = tpd.Scene(dataclasses.replace(SCENE.block, friction=0.0, restitution="housner"), SCENE.motion)


def problem(scene=SCENE, **given) -> Problem:
    return Problem.of(scene, **given)


def test_smoothed_signs_are_descended_on_over_every_orbit():
    made = problem(conditions=BAND)
    assert isinstance(made.method, tpd.Descent)
    assert isinstance(made.method.model, tpd.Smoothed)
    assert made.starts.kind is StartKind.any
    assert not made.objective.rest_counts
    assert problem(conditions=BAND, starts=tpd.Starts.rest()).objective.rest_counts
    assert made.objective.limits == DEFAULT_LIMITS
    assert made.objective.risk == tpd.Risk.worst()
    assert made.space == tpd.DesignSpace()


def test_without_conditions_the_search_is_over_a_neighbourhood():
    made = problem()
    around = tpd.Conditions.around(SCENE)
    assert len(made.objective.conditions) == 10
    np.testing.assert_array_equal(made.objective.conditions.factor_rows(), around.factor_rows())
    assert np.all(np.isnan(made.orbits.geometry.bare_tilt)), "nothing is solved yet"
    assert np.all(np.isfinite(made.objective.geometry.bare_tilt)), "worsening is asked for"


def test_impacts_are_smoothed_unless_they_take_nearly_all():
    assert isinstance(problem(LOSSY).method.model, tpd.Smoothed)
    almost = dataclasses.replace(LOSSY.block, restitution=0.05)
    assert isinstance(problem(tpd.Scene(almost, SCENE.motion)).method.model, tpd.Piecewise)
    none = tpd.Scene(dataclasses.replace(LOSSY.block, restitution=5e-4), SCENE.motion)
    with pytest.raises(ValueError, match=r"`e` must be between 0\.001 and 1 in the smoothed model"):
        problem(none, method=tpd.Descent(model=tpd.Smoothed()))


def test_no_bob_of_a_space_throws_the_block_back():
    """Housner's restitution has no value beyond 4.667 block masses; a space ends at one."""
    wide = tpd.Block(width=0.5, height=1.0, mass=10.0, restitution="housner", cavity_width=0.5)
    scene, space = tpd.Scene(wide, SCENE.motion), tpd.DesignSpace(mass_ratio=(0.1, 1.0))
    assert problem(scene, space=space, conditions=ALONE).space == space
    assert problem(scene, space=space, conditions=tpd.Conditions.scatter(64, 0, mass=0.5)).space == space
    with pytest.raises(ValueError, match="`mass_ratio` must be an interval low < high within 0 to 1"):
        tpd.DesignSpace(mass_ratio=(0.1, 4.7))


@pytest.mark.mends("a solid block had a cavity as wide as itself")
def test_room_is_asked_for_in_a_cavity_that_is_stated():
    solid = tpd.Scene(dataclasses.replace(SCENE.block, cavity_width=None), SCENE.motion)
    said = r"`cavity_width`.*must be given, but is not.*`Block`.*`Room`"
    for limits in (None, [tpd.limits.Room()]):
        with pytest.raises(ValueError, match=said):
            problem(solid, limits=limits)
    record = tpd.Record(np.sin(np.arange(100.0)), 0.01)
    with pytest.raises(ValueError, match=r"`cavity_width`.*must be given, but is not"):
        tpd.optimise(solid.block, conditions=tpd.Conditions.records([record]))
    assert problem(solid, limits=tpd.limits.POINT_BOB).scene is solid


@pytest.mark.mends("factors on the amplitude could make any acceleration")
def test_conditions_that_no_ground_makes_are_asked_back():
    with pytest.raises(ValueError, match=r"must make at most 10 g, but 1\.5 m at 2\.5 Hz make 37\.7 g"):
        problem(conditions=tpd.Conditions.amplitudes(1.0, 100.0))


def test_a_limit_on_the_mass_narrows_the_space():
    made = problem(limits=[tpd.limits.Mass(0.8112)])
    np.testing.assert_allclose(made.space.mass_ratio, (0.01, 0.05))
    assert made.objective.space == made.space
    assert problem(limits=[tpd.limits.Mass(100.0)]).space == tpd.DesignSpace()
    with pytest.raises(ValueError, match=r"`mass` must be above the least bob .* but is 0\.1 kg"):
        problem(limits=[tpd.limits.Mass(0.1)])


@pytest.mark.parametrize(
    ("given", "message"),
    [
        ({"starts": tpd.Starts(size=6)}, r"`starts` of a design must be Starts.any\(\) or Starts.rest\(\)"),
        (
            {"scene": LOSSY, "conditions": tpd.Conditions.scatter(4, friction=0.1)},
            "`friction` cannot scatter by a share of itself: it is 0",
        ),
    ],
)
def test_what_makes_no_sense_is_refused(given, message):
    with pytest.raises(ValueError, match=message):
        problem(**given)
