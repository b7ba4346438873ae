"""Problems under harmonic excitation: defaults, exact motions, and the runs that evaluate and validate."""

import dataclasses

import numpy as np
import pytest

import tpd
from tests.design.conftest import BAND, SCENE, WIDE
from tpd.answers.attractors import StartKind
from tpd.core.progress import unreported
from tpd.design.harmonic import VALIDATION_RUNS, HarmonicProblem
from tpd.design.problem import Variation
from tpd.design.reasons import DesignStatus
from tpd.limits import DEFAULT_LIMITS

LOSSY = tpd.Scene(dataclasses.replace(SCENE.block, friction=0.0, restitution="housner"), SCENE.excitation)
DESIGN = np.array([0.15, 0.26, 0.35])
POINT = {"limits": tpd.limits.POINT_BOB, "ensemble": tpd.Ensemble(size=32, periods=20)}


def problem(scene=SCENE, **given) -> HarmonicProblem:
    return HarmonicProblem.of(scene, **given)


def test_default_conditions_surround_the_excitation_and_default_limits_are_complete():
    made = problem()
    around = tpd.Conditions.around(SCENE)
    np.testing.assert_array_equal(made.conditions.factor_rows(), around.factor_rows())
    assert isinstance(made.model, tpd.Smoothed)
    assert (made.starts.kind, made.objective) == (StartKind.any, tpd.limits.Settling())
    assert (made.limits, made.risk, made.space) == (DEFAULT_LIMITS, tpd.Risk.cvar(), tpd.DesignSpace())
    assert (made.ensemble.size, made.ensemble.seed) == (VALIDATION_RUNS, 0)
    assert problem(seed=4).ensemble.seed == 4
    assert problem(seed=4, ensemble=tpd.Ensemble(seed=2)).ensemble.seed == 2
    assert not made.orbits.rest_counts
    assert problem(starts=tpd.Starts.rest()).orbits.rest_counts
    assert np.all(np.isfinite(made.orbits.geometry.tilt_without_pendulum)), "the limit on worsening needs it"
    assert (made.passing_status, made.allowed) == (DesignStatus.recommended, 0.01)
    # The runs, and not only the settled orbits, must keep to the limits on the motion.
    assert [limit.name for limit in made.run_limits] == ["stroke", "clearance"]


def test_the_search_uses_the_linear_model_if_restitution_is_nearly_zero():
    assert isinstance(problem(LOSSY).model, tpd.Smoothed)
    almost = dataclasses.replace(LOSSY.block, restitution=0.05)
    assert isinstance(problem(tpd.Scene(almost, SCENE.excitation)).model, tpd.Piecewise)
    none = tpd.Scene(dataclasses.replace(LOSSY.block, restitution=5e-4), SCENE.excitation)
    with pytest.raises(ValueError, match=r"`e` must be between 0\.001 and 1 in the smoothed model"):
        problem(none, method=tpd.Descent(model=tpd.Smoothed()))
    for model in (tpd.Nonlinear(), tpd.Smoothed(terms=tpd.Terms.parametric)):
        with pytest.raises(ValueError, match=r"`model` must be Smoothed\(\) with linear terms, or Piecewise"):
            problem(LOSSY, method=tpd.Descent(model=model))


@pytest.mark.parametrize(
    ("given", "message"),
    [
        ({"starts": tpd.Starts(size=6)}, r"`starts` of a design must be Starts.any\(\) or Starts.rest\(\)"),
        (
            {"scene": tpd.Scene(SCENE.block, tpd.Pulse.one_sine(acceleration=1.0, frequency=1.0))},
            "a Harmonic",
        ),
        ({"ensemble": tpd.Ensemble(restitution=0.1)}, "`restitution` can vary only if it is a number"),
        ({"limits": (tpd.limits.Tilt(0.1), tpd.limits.Tilt(0.2))}, "but has two of Tilt"),
    ],
)
def test_settings_of_a_problem_out_of_range_are_rejected(given, message):
    with pytest.raises(ValueError, match=message):
        problem(**given)


def test_settled_tilts_of_a_problem_equal_the_steady_state():
    made = problem(conditions=BAND, **POINT)
    found = made.exact(DESIGN)
    for i, factor in enumerate(BAND.column("frequency")):
        motion = dataclasses.replace(SCENE.excitation, frequency=SCENE.excitation.frequency * factor)
        scene = dataclasses.replace(SCENE, excitation=motion)
        s = tpd.steady_state(scene.parameters(made.pendulum(DESIGN)))
        assert found.status[i] == tpd.status_name(s.status)
        assert found.settled_tilt[i] == pytest.approx(float(s.amplitude), rel=1e-12, abs=1e-9)
        assert found.settled_swing[i] == pytest.approx(float(s.swing), rel=1e-7)
    assert np.all(found.tilt >= 0.999 * found.settled_tilt)
    assert found.value == pytest.approx(made.risk.of(found.orbits.remaining[0]))
    hard = problem(conditions=tpd.Conditions.amplitudes(1.0, 5.0), **POINT).without_pendulum
    assert hard.status.tolist() == ["rocking", "overturned"]
    assert hard.settled_tilt[0] == pytest.approx(0.0833335, abs=1e-4)
    assert hard.settled_tilt[1] == hard.settled_swing[1] == hard.tilt[1] == np.inf


def test_a_block_needs_no_pendulum_only_if_it_rests_under_all_conditions():
    # The block lifts at nu + k = 0.3, and the excitation has 0.377 (more digits below).
    size = float(SCENE.parameters().f)
    for factors, rests in (((0.03, 0.06), True), ((0.5, 0.79), True), ((0.03, 0.8), False)):
        made = problem(conditions=tpd.Conditions.amplitudes(*factors), **POINT)
        assert (made.needs_none is DesignStatus.no_uplift) is rests
        assert made.at_rest.safety_factor == pytest.approx(0.3 / (size * factors[1]))
    # At 0.79 of its size a push makes the block rock for good, and yet the excitation does not lift it.
    assert np.any(
        problem(conditions=tpd.Conditions.amplitudes(0.79), **POINT).without_pendulum.orbits.tilt > 0.0
    )


def test_sizes_without_runs_are_ratios_of_orbit_and_bob_to_their_limits():
    limits = (tpd.limits.Reserve(20.0), tpd.limits.Clearance(), tpd.limits.Worsening())
    made = problem(space=WIDE, conditions=BAND, limits=limits)
    found = made.fixed_sizes(np.array([DESIGN, [0.05, 1.95, 0.2]]))
    assert set(found) == {"clearance", "thickness", "depth", "worsening", "reserve"}
    # The reserve is at most about one, so no rocking design has twenty of it.
    assert np.all(found["reserve"] > 1.0)
    e = made.orbits.evaluate(DESIGN[None])
    assert found["reserve"][0] == pytest.approx(2.0 - e.reserve.min() / 20.0)
    runs = made.trial_runs(DESIGN, 3)
    assert set(made.sizes_in_runs(DESIGN, runs)) == {"clearance"}


def test_descents_use_a_part_of_many_conditions_and_the_runs_use_all():
    few = tpd.Descent(searches=2, screening=16, steps=2, corrections=0, polish=2, model=tpd.Piecewise())
    conditions = tpd.Conditions.scatter(66, 0, friction=0.1)
    made = problem(space=WIDE, conditions=conditions, method=few, **POINT)
    found = made.improver(DESIGN, unreported)
    assert found.search.description.endswith(" under 64 of the 66 conditions")
    assert (len(found.searched.conditions), len(found.orbits.conditions)) == (64, 66)
    # A descent starts from the first guess, and trial runs show its angles as well.
    np.testing.assert_array_equal(found.search.screened[0], DESIGN)
    np.testing.assert_allclose(found.search.paths[0][0], DESIGN, rtol=1e-12)
    np.testing.assert_array_equal(found.designs[0], DESIGN)
    low, high = WIDE.bounds
    assert np.all((found.designs >= low - 1e-12) & (found.designs <= high + 1e-12))


def test_validation_runs_use_half_of_the_ensemble_and_the_nonlinear_equations():
    events, made = [], problem(conditions=BAND, requirements=tpd.limits.Requirements(worse=0.2), **POINT)
    found = made.paired_runs(DESIGN, 7, progress=lambda *e: events.append(e))
    assert found.with_pendulum.equations == found.without_pendulum.equations == "nonlinear"
    assert (len(found.group), len(found.labels), found.worse) == (16, 5, 0.2)
    assert found.with_pendulum.seed == found.without_pendulum.seed == 7
    np.testing.assert_array_equal(found.with_pendulum.nu, found.without_pendulum.nu)
    assert found.cluster is None
    assert {stage for stage, *_ in events} == {"validation runs"}
    linear = made.paired_runs(
        DESIGN, 7, Variation(equations="linear", more=tpd.Conditions({"mass": np.array([1.5])}))
    )
    assert linear.with_pendulum.equations == "linear"
    assert linear.with_pendulum.mu[0] == pytest.approx(1.5 * 0.15)


def test_excitations_are_ordered_by_the_bob_angle():
    """Not the strongest excitation, but the one near the pendulum's own frequency."""
    made = problem(conditions=BAND, **POINT)
    swing = made.orbits.evaluate(DESIGN[None]).swing[0]
    frequencies = SCENE.excitation.frequency * BAND.column("frequency")
    found = made.strongest_motions(DESIGN)
    expected = frequencies[np.argsort(-swing)]
    np.testing.assert_allclose([float(m.frequency) for m in found], expected)
