"""Paired runs: the benefit of known outcomes, its interval, harm, and runs without a result."""

import dataclasses
import math
from types import SimpleNamespace

import numpy as np
import pytest

import tpd
from tests.benchmarks import stored
from tests.designs import outcomes, paired
from tpd.answers.ensemble import outcomes as followed
from tpd.answers.statistics import Interval

PENDULUM = tpd.Pendulum(mass=3.2448, length=0.203, damping_ratio=0.1)


def with_ratio(mean: float, low: float, high: float, **more):
    """Return paired runs with this ratio of the annual rates."""
    rates = SimpleNamespace(ratio=Interval(mean, low, high))
    return paired([0.1] * 4, [0.2] * 4, annual=lambda runs: rates, **more)


@pytest.mark.parametrize(
    ("ratio", "reduction", "is_enough"),
    [
        ((0.6, 0.4, 0.9), (0.4, 0.1, 0.6), True),
        ((0.6, 0.4, 1.0), (0.4, 0.0, 0.6), False),
        ((0.95, 0.93, 0.97), (0.05, 0.03, 0.07), False),
        # An unknown rate has not fallen, whatever its ends are.
        ((math.nan, 0.0, 0.7), (math.nan, 0.3, 1.0), False),
        ((math.nan, 0.0, math.inf), (math.nan, -math.inf, 1.0), False),
    ],
)
def test_a_rate_is_reduced_if_the_interval_of_the_ratio_is_below_one(ratio, reduction, is_enough):
    runs = with_ratio(*ratio)
    of, is_significant = runs.reduction("rate")
    assert (of.mean, of.low, of.high) == pytest.approx(reduction, nan_ok=True)
    assert is_significant == (ratio[2] < 1.0)
    assert (runs.excess_reduction("rate", 0.1, 0.05) >= 0.0) == is_enough
    assert paired([0.1], [0.2]).annual_rates is None


def means(runs) -> list:
    """Mean severity of every part, with the pendulum and without."""
    return [[getattr(part, f"{case}_pendulum") for part in runs.parts] for case in ("with", "without")]


def test_the_pendulum_reduces_the_tilt_of_the_block_of_the_paper():
    asked, small = (tpd.paper_scene(), PENDULUM), tpd.Ensemble(size=96, periods=60)
    linear, nonlinear = (
        tpd.paired_runs(*asked, ensemble=small, equations=e) for e in ("linear", "nonlinear")
    )
    for found, equations in ((linear, "linear"), (nonlinear, "nonlinear")):
        assert found.with_pendulum.equations == found.without_pendulum.equations == equations
        assert found.description == f"96 paired runs of the {equations} model, seed 0"
        worse, better = found.only
        assert worse < better
        assert not found.overturns_more
        assert found.benefit.low > 0.0
        assert found.table().startswith(f"{equations} model")
    assert linear.with_pendulum.share_overturned.high < linear.without_pendulum.share_overturned.low
    assert "after a disturbance" in linear.table()
    assert str(linear.without_pendulum.share_overturned) in linear.table()
    assert str(linear) == "\n".join([linear.table(), linear.benefit_in_words, linear.overturning_in_words])
    # Chaotic motions: single runs differ, shares by two standard errors of 96 runs at most.
    shares = (o.without_pendulum.share_overturned.value for o in (nonlinear, linear))
    assert abs(np.subtract(*shares)) < 0.15
    for name in ("growth", "nu"):
        with_it, without = (getattr(o, name) for o in (linear.with_pendulum, linear.without_pendulum))
        np.testing.assert_array_equal(with_it, without)
        np.testing.assert_array_equal(with_it, getattr(nonlinear.with_pendulum, name))


def test_paired_runs_of_parameters_have_both_cases():
    few = tpd.Ensemble(size=4, periods=20)
    p = tpd.paper_scene().parameters(PENDULUM)
    both = tpd.paired_runs(p, ensemble=few)
    np.testing.assert_array_equal(both.with_pendulum.tilt, followed(p, ensemble=few).tilt)
    alone = followed(dataclasses.replace(p, mu=0.0), ensemble=few)
    np.testing.assert_array_equal(both.without_pendulum.tilt, alone.tilt)
    with pytest.raises(ValueError, match="`mu` must be positive"):
        tpd.paired_runs(tpd.paper_scene().parameters())
    with pytest.raises(ValueError, match="`pendulum` must be a Pendulum"):
        tpd.paired_runs(tpd.paper_scene())


@pytest.mark.parametrize(
    ("only", "harm"), [((5, 0), True), ((4, 0), False), ((5, 5), False), ((0, 20), False)]
)
def test_more_overturning_must_be_significant_by_mcnemar(only, harm):
    """McNemar's test: 5 runs of one kind and none of the other have a chance of 1 / 32."""
    run, (worse, better) = np.arange(100), only
    with_it, without = run < worse, (run >= 50) & (run < 50 + better)
    found = paired(np.where(with_it, np.inf, 0.4), np.where(without, np.inf, 0.4))
    assert (found.only, found.overturns_more) == (only, ("", *only, 100) if harm else None)
    head = f"{worse} runs overturn only with the pendulum and {better} only without it"
    ends = {
        5: ": not statistically significant (p = 0.062).",
        4: ": not statistically significant (p = 0.12).",
        0: ": statistically significant (p = 1.9e-06).",
    }
    assert found.overturning_in_words == head + ("." if worse == better else ends[worse])


def test_runs_of_one_earthquake_count_as_one_observation():
    """Ten runs more overturn: of ten earthquakes each one that is harm, of one earthquake it is nothing."""
    lost = np.where(np.arange(40) < 10, np.inf, 0.4)
    cases = {"independent": np.arange(40), "one": np.r_[np.zeros(10, int), np.arange(1, 31)]}
    found = {name: paired(lost, np.full(40, 0.4), cluster=c) for name, c in cases.items()}
    assert found["independent"].overturns_more
    assert not found["one"].overturns_more
    assert found["one"].benefit.high - found["one"].benefit.low > (
        found["independent"].benefit.high - found["independent"].benefit.low
    )
    assert found["one"].description.endswith("40 paired runs of the nonlinear model, seed 0, 31 earthquakes")
    # Harm to one group is harm, though all runs together show none.
    group, cluster = np.repeat([0, 1], 40), np.arange(80)
    with_it = np.where((group == 0) & (np.arange(80) < 10), np.inf, 0.4)
    without = np.where((group == 1) & (np.arange(80) < 60), np.inf, 0.4)
    both = paired(with_it, without, group, cluster=cluster)
    assert both.only == (10, 20)
    assert both.overturns_more == ("condition 0", 10, 0, 40)
    assert not paired(with_it, without, np.zeros(80, int), cluster=cluster).overturns_more


def test_the_benefit_uses_the_validation_runs_and_the_harm_all_runs():
    with_it, without = [0.1] * 20 + [np.inf] * 20, [0.4] * 40
    found = paired(with_it, without, [0] * 20 + [1] * 20, counted=np.arange(40) < 20)
    assert found.benefit.mean == pytest.approx(0.75)
    assert found.pairs == 20
    assert found.change("overturned").with_pendulum == 0.0
    assert found.only == (20, 0)
    assert found.overturns_more
    assert [part.label for part in found.worse_parts] == ["condition 1"]


def test_runs_without_a_result_are_left_out_and_counted():
    nan = np.nan
    with_it, without = [0.1, nan, 0.1, nan, 0.2], [0.4, 0.4, nan, nan, np.inf]
    found = paired(with_it, without, [0, 0, 0, 0, 1])
    # Two pairs remain: 0.1 and 0.2 with the pendulum, 0.4 and 1 without.
    assert found.benefit.mean == pytest.approx(1.0 - 0.3 / 1.4)
    assert (found.pairs, found.undecided, found.only) == (2, 3, (0, 1))
    np.testing.assert_allclose(means(found), [[0.1, 0.2], [0.4, 1.0]])
    assert found.with_pendulum.share_overturned.value == 0.0
    (row,) = (line for line in found.table().splitlines() if "without a result" in line)
    assert row.split()[-2:] == ["2", "2"]
    # Wide cells keep a gap.
    (row,) = (line for line in paired([np.inf], [np.inf]).table().splitlines() if line.startswith("largest"))
    assert row.split()[-6:] == ["overturns"] * 6
    assert found.summary()["undecided"] == 3
    # Each of them overturned with the pendulum and rested without it, and the other way about.
    against, favour = (end.benefit.mean for end in found.ends)
    assert against == pytest.approx(1.0 - (0.1 + 1.0 + 0.1 + 1.0 + 0.2) / (0.4 + 0.4 + 0.0 + 0.0 + 1.0))
    assert favour == pytest.approx(1.0 - (0.1 + 0.0 + 0.1 + 0.0 + 0.2) / (0.4 + 0.4 + 1.0 + 1.0 + 1.0))
    whole = paired([0.1], [0.2])
    assert whole.ends == ()
    assert "without a result" not in str(whole)


def test_the_benefit_of_no_pair_is_unknown_and_of_one_pair_has_no_interval():
    found = paired([np.nan] * 4, [0.3] * 4)
    assert np.isnan(found.benefit.mean)
    assert (found.pairs, found.undecided, found.benefit_in_words) == (0, 4, "benefit unknown")
    assert [end.benefit.mean for end in found.ends] == [pytest.approx(-0.7 / 0.3), 1.0]
    one = paired([0.2], [0.4])
    assert (one.benefit.mean, one.pairs, one.benefit_in_words) == (0.5, 1, "50 % less tilt")
    assert (one.worse_parts, np.isfinite(one.benefit.low)) == ((), False)
    assert paired([0.4] * 40, [0.0] * 40).benefit.mean == pytest.approx(-20.0)


def test_severity_is_the_tilt_divided_by_nu_and_one_after_overturning():
    found = outcomes([0.0, 0.3, 1.4, np.inf, np.nan])
    np.testing.assert_allclose(found.severity, [0.0, 0.3, 1.0, 1.0, np.nan], rtol=1e-15)
    odd = dataclasses.replace(outcomes([0.3]), settled_tilt=np.array([np.nan]))
    assert odd.severity.tolist() == [1.0]
    # Each run by the slenderness of its own block.
    np.testing.assert_allclose(dataclasses.replace(found, nu=2.0 * found.nu).severity[:3], [0.0, 0.15, 0.7])


def test_every_change_of_hand_made_runs_has_its_known_value():
    with_it = np.array([0.0, 0.0, 0.1, 0.1, 0.2, 0.2, 0.3, 0.3, 0.4, np.inf])
    without = np.array([0.0, 0.2, 0.2, 0.2, 0.4, 0.4, 0.6, 0.6, np.inf, np.inf])
    found = paired(with_it, without)
    assert found.benefit.mean == pytest.approx(1.0 - 2.6 / 4.6, rel=1e-12)
    assert found.benefit.low < found.benefit.mean < found.benefit.high
    known = {
        "mean tilt": (0.26, 0.46),
        "median tilt": (0.2, 0.4),
        "worst tilt": (1.0, 1.0),
        "overturned": (0.1, 0.2),
        "at rest": (0.2, 0.1),
    }
    assert {c.name: (c.with_pendulum, c.without_pendulum) for c in found.changes} == {
        name: pytest.approx(sizes) for name, sizes in known.items()
    }
    for c in found.changes:
        assert c.difference == pytest.approx(c.with_pendulum - c.without_pendulum)
        # Of a median and of the worst tenth there is no interval.
        assert np.isnan(c.low) if c.name[:5] in ("media", "worst") else c.low <= c.difference <= c.high
    assert (found.worse_parts, found.rests_less) == ((), False)
    assert found.benefit_in_words.startswith("43 % less tilt (95 % interval ")
    worst = paired(np.arange(40) / 50, np.full(40, 0.9)).change("worst tilt")
    assert worst.with_pendulum == pytest.approx(np.mean([36, 37, 38, 39]) / 50)


def test_a_group_is_worse_only_if_its_pairs_prove_it():
    group = np.repeat([0, 1, 2, 3], 16)
    noise = np.random.default_rng(3).uniform(-0.02, 0.02, 64)
    with_it, without = np.array([0.2, 0.309, 0.36, 0.3])[group] + noise, np.full(64, 0.3)
    # One run in sixteen that is lost proves nothing about its group.
    with_it[-1] = np.inf
    found = paired(with_it, without, group, worse=0.05)
    assert [part.label for part in found.worse_parts] == ["condition 2"]
    expected = [np.minimum(with_it, 1.0)[group == i].mean() for i in range(4)]
    np.testing.assert_allclose(means(found), [expected, [0.3] * 4])
    assert found.summary()["worse_groups"] == ["condition 2"]
    assert paired(with_it, without, group, worse=0.5).worse_parts == ()
    # Next to a block at rest a small tilt is no worse group; and the largest increase comes first.
    group = np.repeat([0, 1, 2], 8)
    small = np.array([0.0005, 0.01, 0.02])[group] * np.tile([0.9, 1.1], 12)
    worse = paired(small, np.zeros(24), group).worse_parts
    assert [part.label for part in worse] == ["condition 2", "condition 1"]
    np.testing.assert_allclose(
        means(paired([0.1, 0.1], [0.2, 0.2], [0, 2])), [[0.1, np.nan, 0.1], [0.2, np.nan, 0.2]]
    )


KINDS = "sudden start from rest", "growth over 10 periods"


def test_harm_after_sudden_starts_is_reported_despite_a_lower_mean():
    """Half of the runs start suddenly. There the tilt rises from 0.4 to 0.5; it falls to 0.1 elsewhere."""
    growth = np.tile([0.0, 10.0], 256)
    found = paired(np.where(growth == 0.0, 0.5, 0.1), np.full(512, 0.4))
    assert len(found.parts) == 1
    assert not found.worse_parts
    grown = (dataclasses.replace(o, growth=growth) for o in (found.with_pendulum, found.without_pendulum))
    found = dataclasses.replace(found, **dict(zip(("with_pendulum", "without_pendulum"), grown, strict=True)))
    assert found.benefit.mean == pytest.approx(0.25)
    assert [part.label for part in found.parts] == ["condition 0", *KINDS]
    (worse,) = found.worse_parts
    assert (worse.label, int(worse.rows.sum())) == (KINDS[0], 256)
    assert (worse.with_pendulum, worse.without_pendulum) == pytest.approx((0.5, 0.4))
    # The pendulum helps only after the slow start.
    assert [part.label for part in found.starts_without_benefit] == [KINDS[0]]
    assert found.summary()["worse_groups"] == [KINDS[0]]


@pytest.mark.parametrize(
    ("fewer", "more", "both", "others", "saved", "less"),
    [
        (5, 0, 0, 400, 0, True),
        (4, 0, 0, 400, 0, False),
        (8, 8, 0, 400, 0, False),
        (8, 0, 41, 400, 0, False),
        (12, 0, 37, 400, 0, True),
        (60, 0, 940, 4000, 0, False),
        # More runs do not overturn any more.
        (12, 0, 37, 400, 12, True),
        (12, 0, 37, 400, 13, False),
    ],
)
def test_rests_less_is_true_if_significantly_fewer_runs_rest(fewer, more, both, others, saved, less):
    with_it = np.array([0.1] * fewer + [0.0] * (more + both) + [0.1] * (others + saved))
    without = np.array([0.0] * fewer + [0.1] * more + [0.0] * both + [0.1] * others + [np.inf] * saved)
    assert paired(with_it, without).rests_less is less


def test_the_stored_shares_of_recommended_pendulums_show_power_without_false_recommendations():
    rows = stored.read("power").rows
    for row in rows:
        # A pendulum whose true reduction is below 5 % is hardly ever recommended.
        assert max(row["rule false"], row["cross false"], row["more false"]) <= 0.01
        if row["measure"] == "tilt" and row["truth"] > 0.14:
            assert row["rule"] >= 0.9
            assert row["cross"] >= row["half"]
    # The same earthquakes for search and validation recommend pendulums with too small a benefit.
    small = [row for row in rows if row["measure"] == "tilt" and row["searched"] < 0.1]
    assert max(row["same"] for row in small) > max(row["cross"] for row in small)
