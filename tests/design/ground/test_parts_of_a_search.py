"""Severity, surface, groups and intervals: each alone."""

import numpy as np
import pytest

import tpd
from tpd.answers.intervals import Interval
from tpd.answers.probit import Lognormal
from tpd.design.ground import design
from tpd.design.ground.judgement import Judged, Pairs, Role, events_of, grouped
from tpd.design.ground.objective import Runs, check_ground_limits
from tpd.design.surface import Observations, fit


def test_an_overturning_counts_as_one_and_what_is_not_known_as_nothing():
    tilt = np.array([[0.4, 1.2, np.inf, np.nan]])
    np.testing.assert_array_equal(
        Runs(tilt, tilt, tilt, np.isinf(tilt), np.isnan(tilt)).severity, [[0.4, 1.0, 1.0, np.nan]]
    )


def test_a_surface_finds_a_trend_below_noise():
    rng = np.random.default_rng(1)
    at = rng.random((40, 2))

    def bowl(x):
        return np.sum((x - [0.3, 0.7]) ** 2, axis=1)

    noisy = bowl(at) + 0.02 * rng.standard_normal(40)
    probe = rng.random((200, 2))
    without = fit(Observations(at, noisy), seed=0)
    mean, deviation = without.at(probe)
    assert np.sqrt(np.mean((mean - bowl(probe)) ** 2)) < 0.02
    assert 0.01 < without.spread * np.exp(without.numbers[-1]) < 0.04
    assert np.mean(np.abs(mean - bowl(probe)) < 2.0 * deviation) > 0.8


def test_an_earthquake_is_on_one_side_only(records):
    for seed in range(5):
        tuned, held = grouped(records, 0.5, seed)
        assert tuned.role is Role.tuned
        assert held.role is Role.held_out
        assert not set(events_of(tuned.motions)) & set(events_of(held.motions))
        assert len(tuned.motions) + len(held.motions) == len(records)
        assert len(held.motions) == 10
    assert len(grouped(records, 0.0, 0)) == 1
    others = grouped(records[:4], {"others": records[2:8]}, 0)
    assert [m.name for m in others[1].motions] == [m.name for m in records[4:8]]
    with pytest.raises(ValueError, match="all are held out"):
        grouped(records[:2], 0.5, 0)
    with pytest.raises(ValueError, match="other earthquakes"):
        grouped(records[:2], {"same": records[:2]}, 0)


def test_the_verdict_follows_from_intervals_and_the_least_benefit():
    def group(role, shift, low, high):
        interval = Interval(shift, low, high)
        n, clusters = 12, np.repeat(np.arange(6), 2)
        spread = np.tile([0.01, -0.01], 6)
        pair = np.stack([np.full(n, 0.5), 0.5 + shift + spread])
        runs = Pairs(pair, pair, clusters)
        none = Lognormal(1.0, 0.3, np.zeros((2, 2)), False)
        return Judged(
            name="",
            role=role,
            motions=6,
            events=6,
            stripes=np.array([1.0, 2.0]),
            counts=(np.zeros(2), np.zeros(2)),
            unknown=(np.zeros(2), np.zeros(2)),
            overturned=(0.5, 0.5 + shift),
            difference=interval,
            linear=interval,
            tilt=interval,
            strikes=0.0,
            linear_strikes=0.0,
            changed=0.0,
            undecided=0,
            fits=(none, none),
            runs=runs,
        )

    def verdict(groups, at_least):
        return design.verdict_of(groups, tpd.limits.Worth(at_least=at_least, strikes=0.1))

    tuned, held = Role.tuned, Role.held_out
    good, harm = group(held, -0.2, -0.3, -0.1), group(held, 0.2, 0.1, 0.3)
    assert verdict((group(tuned, -0.2, -0.3, -0.1),), 0.1).status.name == "tuned_only"
    assert verdict((group(tuned, -0.2, -0.3, -0.1), good), 0.1).status.name == "found"
    assert verdict((group(tuned, -0.2, -0.3, -0.1), good), 0.5).status.name == "refused"
    assert verdict((group(tuned, -0.2, -0.3, -0.1), good, harm), 0.1).status.name == "refused"
    assert verdict((group(tuned, 0.2, 0.1, 0.3), good), 0.1).status.name == "refused"
    said = [
        verdict((group(tuned, -0.2, -0.3, -0.1), x), least).reasons[0]
        for x, least in ((good, 0.5), (harm, 0.1), (group(held, 0.0, -0.1, 0.1), 0.1))
    ]
    words = "were asked for", "overturns more often", "no benefit is significant"
    assert all(x in reason for x, reason in zip(words, said, strict=True))
    nothing = group(held, 0.0, -0.1, 0.1)
    assert verdict((group(tuned, -0.2, -0.3, -0.1), nothing), 0.1).status.name == "refused"


def test_conditions_of_records_are_every_motion_at_every_scale(records):
    scatter = {"slenderness": 0.02, "damping": 0.2}
    c = tpd.Conditions.records(records[:3], (1.0, 2.0), scatter=scatter, samples=2, seed=4)
    assert len(c) == 12
    assert np.asarray(c.which).tolist() == sorted([0, 1, 2] * 4)
    assert c.column("amplitude").tolist() == [1.0, 1.0, 2.0, 2.0] * 3
    assert np.ptp(c.column("slenderness")) > 0.03
    both = tpd.Conditions.records(records[:2], (1.0,)) * tpd.Conditions.amplitudes(1.0, 1.5)
    assert both.column("amplitude").tolist() == [1.0, 1.5] * 2
    assert np.asarray(both.which).tolist() == [0, 0, 1, 1]
    with pytest.raises(ValueError, match="only one of two sets"):
        both * both
    with pytest.raises(ValueError, match="at least one ground motion"):
        tpd.Conditions.records([])
    with pytest.raises(ValueError, match="`intensity`"):
        tpd.Conditions.records(records, intensity="magnitude")
    train = tpd.Conditions.records([tpd.Harmonic(amplitude=0.01, frequency=1.0)]).motions[0]
    assert float(train.pga) == pytest.approx(0.01 * (2.0 * np.pi) ** 2)
    assert float(train.duration) == pytest.approx(40.0)


def test_limits_of_settled_motions_are_refused():
    assert len(check_ground_limits((tpd.limits.Room(), tpd.limits.Stroke()))) == 2
    with pytest.raises(ValueError, match="limits"):
        check_ground_limits((tpd.limits.Reserve(),))
