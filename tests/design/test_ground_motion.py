"""Problems under ground motions: groups of whole earthquakes, single motions, and what is no harmonic."""

import dataclasses
import math

import numpy as np
import pytest

import tpd
from tests.designs import BLOCK, noise, records
from tpd.design.ground_motion import GroundMotionProblem, Role, grouped, isolation_period, motion_factors
from tpd.design.problem import Variation
from tpd.design.reasons import DesignStatus, ReasonKind, reduced
from tpd.design.validate import validate
from tpd.scene.ground_motion import earthquakes_of, events_of

DESIGN = np.array([0.12, 0.4, 0.5])
RECORDS = records()

UNSCATTERED = tpd.Ensemble(friction=0.0, restitution=0.0, damping=0.0, slenderness=0.0, mass=0.0, length=0.0)


def problem(motions=RECORDS, scales=(1.3, 2.0, 5.0), block=BLOCK, **given) -> GroundMotionProblem:
    limits = (tpd.limits.Stroke(), tpd.limits.Clearance())
    return GroundMotionProblem.of(
        block, tpd.Conditions.records(motions, scales), **({"limits": limits} | given)
    )


def test_search_and_validation_records_share_no_earthquake():
    for seed in range(5):
        tuned, held = grouped(RECORDS, 0.5, seed)
        assert (tuned.role, held.role) == (Role.tuned, Role.validation)
        assert not set(events_of(tuned.motions)) & set(events_of(held.motions))
        assert not set(tuned.events) & set(held.events)
        assert (len(tuned.motions), len(held.motions)) == (10, 10)
    assert len(grouped(RECORDS, 0.0, 0)) == 1
    others = grouped(RECORDS[:4], {"others": RECORDS[2:8]}, 0)
    assert [m.name for m in others[1].motions] == [m.name for m in RECORDS[4:8]]
    with pytest.raises(ValueError, match="it uses all"):
        grouped(RECORDS[:2], 0.5, 0)
    with pytest.raises(ValueError, match="earthquakes that the search does not use"):
        grouped(RECORDS[:2], {"same": RECORDS[:2]}, 0)


def test_an_earthquake_has_one_number_in_all_groups():
    """Copies of one record, scaled, are one earthquake."""
    tuned, a, b, c = (noise(i) for i in range(4))
    groups = grouped([tuned], {"x": [a, b], "y": [b.scaled(3.0), c]}, 0)
    assert groups[1].events[1] == groups[2].events[0]
    assert len({*groups[0].events, *groups[1].events, *groups[2].events}) == 4
    assert earthquakes_of((a, a.scaled(2.0), b)).tolist() in ([0, 0, 1], [1, 1, 0])


@pytest.mark.parametrize(
    ("motions", "validation_share", "evidence"),
    [
        (RECORDS, 0.5, "recommended"),
        (RECORDS[:18], 0.5, "too_few"),
        (RECORDS, 0.0, "tuned_only"),
        (RECORDS[:10], None, "recommended"),
        (RECORDS[:8], None, "too_few"),
        (RECORDS[:2], None, "too_few"),
        (RECORDS[:10], {"a": RECORDS[:18]}, "too_few"),
    ],
)
def test_a_verdict_needs_five_earthquakes_for_search_and_for_validation(motions, validation_share, evidence):
    assert problem(motions, validation_share=validation_share).passing_status is DesignStatus[evidence]


def test_the_conditions_of_a_problem_contain_the_search_records_only():
    made = problem(seed=3, validation_share=0.5)
    tuned, held = made.groups
    assert made.conditions.motions == tuned.motions
    assert made.scene.excitation is tuned.motions[0]
    assert (made.attempts, made.has_earthquakes, made.allowed) == (2, True, 0.1)
    again = GroundMotionProblem.of(
        made.inputs.pop("scene"), **{k: v for k, v in made.inputs.items() if k != "scene"}
    )
    assert [g.motions for g in again.groups] == [g.motions for g in (tuned, held)]
    assert again.inputs["validation_share"] == {"validation records": held.motions}
    assert problem(validation_share=0.0).inputs["validation_share"] == 0.0
    assert problem().inputs["validation_share"] is None


def test_trial_runs_equal_single_transients():
    # Without scatter, which the trials share with the validation runs.
    made = problem(RECORDS[:4], validation_share=0.0, ensemble=UNSCATTERED)
    found, with_it = made.trial_runs(DESIGN, 0), made.pendulum(DESIGN)
    factors = motion_factors(made.scene, made.conditions)
    for i, which in enumerate(made.conditions.which):
        motion = made.conditions.motions[int(which)].scaled(float(factors[i]))
        one = tpd.transient(tpd.Scene(BLOCK, motion), with_it)
        assert found.is_overturned[i] == (tpd.status_name(one.status) == "overturned")
        if not found.is_overturned[i]:
            assert found.severity[i] == pytest.approx(
                min(1.0, float(one.tilt / BLOCK.slenderness)), rel=1e-10
            )
            assert found.rod_angle[i] == pytest.approx(float(one.rod_angle), rel=1e-10)
    assert found.is_overturned.any()
    assert found.stands.any()
    assert found.equations == "linear"
    alone = made.trial_runs(None, 0)
    np.testing.assert_array_equal(alone.nu, found.nu)


def test_both_cases_of_a_validation_run_have_equal_scatter():
    made = problem(ensemble=tpd.Ensemble(restitution=0.02), validation_share=0.5)
    found = made.paired_runs(DESIGN, 5)
    assert found.labels == ("search records", "validation records")
    assert found.group.tolist() == [0] * 160 + [1] * 160
    np.testing.assert_array_equal(found.counted, found.group == 1)
    assert len(np.unique(found.cluster)) == 10
    np.testing.assert_array_equal(found.with_pendulum.nu, found.without_pendulum.nu)
    assert 0.01 < np.ptp(found.with_pendulum.nu) / float(BLOCK.slenderness) <= 0.04
    other = made.paired_runs(DESIGN, 6)
    assert not set(found.with_pendulum.nu) & set(other.with_pendulum.nu)
    alone = problem(validation_share=0.0).paired_runs(DESIGN, 5)
    assert alone.counted is None
    # One more condition is on top of all others.
    more = made.paired_runs(DESIGN, 5, Variation(more=tpd.Conditions({"mass": np.array([1.5])})))
    np.testing.assert_allclose(more.with_pendulum.mu, 1.5 * found.with_pendulum.mu)


def test_each_record_has_one_level_in_each_of_sixteen_strata():
    made = problem(RECORDS[:6], (1.5, 2.0, 4.0))
    levels = made._every_motion().column("amplitude").reshape(6, 16)
    edges = np.geomspace(1.5, 4.0, 17)
    assert np.all((levels >= edges[:-1]) & (levels <= edges[1:]))
    # Each record has other levels, which do not depend on the order of the records or on a seed.
    assert len(np.unique(levels)) == levels.size
    other = problem(RECORDS[5::-1], (4.0, 1.5), seed=3)._every_motion(made.scatter, 7)
    np.testing.assert_array_equal(other.column("amplitude").reshape(6, 16)[::-1], levels)
    assert list(made.levels)[:2] == ["1.5 to 1.59", "1.59 to 1.7"]
    assert [rows.sum() for rows in made.levels.values()] == [6] * 16
    # Linear runs compare variations at the stated levels, and a single level has no strata.
    linear = made.paired_runs(DESIGN, 0, Variation(equations="linear"))
    assert (linear.pairs, linear.annual_rates) == (18, None)
    one = problem(RECORDS[:6], (2.0,))
    assert (one.limit_runs, one.levels) == (6, {})
    assert set(one._every_motion().column("amplitude")) == {2.0}


def test_the_sentence_on_pulses_has_the_shortest_period_and_the_smallest_peak_that_overturn():
    pulses = [tpd.Pulse.ricker(acceleration=4.0, frequency=1.0 / period) for period in (0.7, 1.0, 1.5, 2.0)]
    conditions = tpd.Conditions.records(pulses, (0.9, 1.1), intensity="scale")
    given = {"limits": (), "validation_share": 0.0, "ensemble": UNSCATTERED}
    made = GroundMotionProblem.of(BLOCK, conditions, **given)
    runs = made.validation_runs(None, 0)
    rows = [
        (1.0 / pulses[i // 16].frequency, made.stated_motions[i].pga)
        for i in np.flatnonzero(runs.is_overturned)
    ]
    period, pga = map(min, zip(*rows, strict=True))
    assert 0.7 < period < 2.0
    least = f"a period of {period:g} s and from a PGA of {pga / 9.80665:.3g} g on, in {len(rows)} of 64 runs"
    assert made.first_overturning(runs) == f"pulses overturn the block from {least}"
    none = dataclasses.replace(runs, outcome=np.zeros_like(runs.outcome))
    assert made.first_overturning(none) == "no pulse of the band overturns the block"
    assert problem().first_overturning(runs) == ""


def test_the_sign_of_a_motion_has_no_effect_because_block_and_pendulum_are_symmetric():
    tilts = []
    for sign in (1.0, -1.0):
        motions = [record.scaled(sign) for record in RECORDS[:3]]
        made = problem(motions, (1.3, 2.0), validation_share=0.0, ensemble=UNSCATTERED)
        tilts.append(made.trial_runs(DESIGN, 0, "nonlinear").tilt)
    np.testing.assert_allclose(*tilts, rtol=1e-9)


def test_runs_without_a_result_count_neither_as_overturned_nor_as_rest(monkeypatch):
    made = problem(RECORDS[:4], validation_share=0.0)
    whole = made.paired_runs(DESIGN, 5)
    monkeypatch.setattr("tpd.design.ground_motion.MAX_EVENTS", 160)
    few = made.paired_runs(DESIGN, 5)
    assert whole.undecided == 0 < few.undecided
    unknown = few.with_pendulum.is_unanswered
    assert not np.any(few.with_pendulum.is_overturned & unknown)
    assert np.all(np.isnan(few.with_pendulum.severity) == unknown)
    np.testing.assert_array_equal(few.severity[0, ~unknown], whole.severity[0, ~unknown])
    assert few.pairs == len(few.group) - few.undecided
    assert len(few.ends) == 2


def test_the_strongest_records_have_the_largest_rod_angle_of_surviving_runs():
    made = problem(RECORDS[:4], validation_share=0.0, ensemble=UNSCATTERED)
    runs, found = made.trial_runs(DESIGN, 0), made.strongest_motions(DESIGN)
    assert len(found) == runs.stands.sum()
    one = tpd.transient(tpd.Scene(BLOCK, found[0]), made.pendulum(DESIGN))
    assert float(one.rod_angle) == pytest.approx(runs.rod_angle[runs.stands].max(), rel=1e-10)


@pytest.mark.parametrize(
    ("given", "message"),
    [
        (
            {"requirements": tpd.limits.Requirements(wall_contacts=0.2), "ensemble": tpd.Ensemble(size=4)},
            "`ensemble.size` needs harmonics",
        ),
        (
            {"limits": (tpd.limits.Reserve(),)},
            "`limits` under ground motions must be Stroke, .*Clearance, but has",
        ),
        ({"validation_share": 1.5}, "`validation_share` must be between 0 and 0.9"),
        ({"block": dataclasses.replace(BLOCK, cavity_width=None)}, "`cavity_width`"),
        ({"limits": (tpd.limits.Mass(0.01),)}, "the limit `mass` must be above the smallest point mass"),
    ],
)
def test_settings_without_effect_or_out_of_range_are_rejected(given, message):
    with pytest.raises(ValueError, match=message):
        problem(**given)


COLUMN = tpd.Block(width=0.9, height=6.0, mass=2500.0, restitution=0.93, cavity_width=0.6)


def test_a_search_with_few_records_keeps_the_limit_on_clearance():
    conditions = tpd.Conditions.records([noise(i) for i in range(6)], (1.5, 2.5))
    found = tpd.optimise(COLUMN, conditions=conditions, method=tpd.GroundSearch(designs=16, steps=8))
    assert 0 < found.trials.feasible.sum() < len(found.trials.feasible)
    assert np.all(found.trials.sizes[found.trials.feasible] < 1.05)
    assert [v.over_limit for v in found.validated] == [0.0]
    assert found.usage["clearance"] < 1.0


def test_a_trial_has_at_least_192_runs_if_the_blocks_vary():
    made = problem(RECORDS[:4], validation_share=0.0)
    found = made.trial_runs(DESIGN, 0)
    assert len(found.nu) == 192
    assert len(np.unique(found.nu)) == 192
    np.testing.assert_array_equal(np.bincount(found.condition.astype(int)), 48)


SITE = tpd.Hazard(levels=[0.1, 0.4, 1.5], rates=[0.02, 1e-3, 1e-5])


def with_hazard(hazard=SITE, scales=(1.3, 2.0, 5.0), **given) -> GroundMotionProblem:
    conditions = tpd.Conditions.records(RECORDS, scales, hazard=hazard)
    return GroundMotionProblem.of(BLOCK, conditions, ensemble=UNSCATTERED, **given)


def test_annual_rates_come_from_the_counted_validation_runs():
    p = with_hazard(validation_share=0.5)
    runs = p.paired_runs(DESIGN, 0)
    rates = runs.annual_rates
    # The benefit counts 10 motions of 5 earthquakes at 16 levels of PGA over g tan(alpha).
    assert rates.earthquakes == 5
    edges = np.geomspace(1.3, 5.0, 17) * float(BLOCK.slenderness)
    np.testing.assert_allclose(rates.edges, edges)
    for rate, case in zip(rates.cases, (runs.without_pendulum, runs.with_pendulum), strict=True):
        share = case.is_overturned[runs.counted].reshape(10, 16).mean(axis=0)
        above = SITE.exceeding(edges)
        # The share of the last level also counts above it.
        expected = share @ -np.diff(above) + share[-1] * above[-1]
        assert rate.mean == pytest.approx(expected, rel=1e-12)
    assert p.yearly(rates) == rates.sentences
    # All motions count without a pendulum, because none of them was used.
    alone = p.annual_rates([runs.without_pendulum])
    assert (alone.earthquakes, alone.ratio) == (10, None)


RATE = tpd.limits.Requirements(reduce="rate")


def test_a_required_rate_needs_a_hazard_and_two_levels():
    assert with_hazard(requirements=RATE).requirements.reduce == "rate"
    message = r"ground motions of 2 levels \(`scales`\) or more, but there are "
    for given, have in (
        ({"hazard": None}, "several levels and no hazard"),
        ({"scales": (1.3,)}, "no levels and a"),
    ):
        with pytest.raises(ValueError, match=message + have):
            with_hazard(**given, requirements=RATE)
    with pytest.raises(ValueError, match=message + "no levels and no hazard"):
        tpd.optimise(tpd.paper_scene(), limits=tpd.limits.POINT_BOB, requirements=RATE)


def test_a_required_rate_determines_the_verdict():
    p = with_hazard(requirements=RATE, limits=(tpd.limits.Stroke(1.5),))
    result = validate(p, DESIGN)
    assert result.measure == "rate"
    of = result.deciding_runs.annual_rates.ratio
    falls = of.high < 1.0 and 1.0 - of.mean >= 0.1 and 1.0 - of.high >= 0.05
    assert (ReasonKind.too_little_benefit not in {reason.kind for reason in result.reasons}) == falls
    assert "rate of overturning" in reduced(result.deciding_runs, "rate")


def test_the_design_does_not_depend_on_the_order_of_the_records():
    """Designs and numbers agree in every bit."""
    motions = RECORDS[:12]
    order = np.random.default_rng(3).permutation(12)
    found = []
    for listed, scales in ((motions, (1.5, 3.0)), ([motions[i] for i in order], (3.0, 1.5))):
        given = {"conditions": tpd.Conditions.records(listed, scales), "limits": ()}
        found.append(tpd.optimise(BLOCK, method=tpd.GroundSearch(designs=5, steps=2), **given))
    first, second = found
    assert first.status is second.status
    np.testing.assert_array_equal(first.trials.designs, second.trials.designs)
    np.testing.assert_array_equal(first.trials.value, second.trials.value)
    assert first.refusals == second.refusals
    # The runs keep the order of the list, so their sums may be rounded differently.
    for end in ("mean", "low", "high"):
        numbers = [getattr(d.runs.benefit, end) for d in found]
        assert numbers[0] == pytest.approx(numbers[1], rel=1e-12)
    tilts = (np.sort(d.runs.with_pendulum.tilt) for d in found)
    np.testing.assert_array_equal(*tilts)


@pytest.mark.parametrize(("acceleration", "expected"), [(1e9, 0.0), (1e-9, math.inf)])
def test_a_spectrum_that_never_crosses_an_acceleration_has_no_isolation_period(acceleration, expected):
    assert isolation_period(tpd.records.el_centro(), acceleration) == expected


def test_the_usual_level_is_that_of_the_code_or_the_lowest_of_the_job():
    level, words = with_hazard().usual_level
    assert SITE.exceeding(level) == pytest.approx(1.0 / 475.0)
    assert words == "once in 475 years"
    made = problem(RECORDS[:6], (4.0, 1.5))
    level, words = made.usual_level
    # The levels are PGA over g tan(alpha), so that all motions have one peak.
    assert (level, words) == (pytest.approx(1.5 * float(BLOCK.slenderness)), "lowest level")
