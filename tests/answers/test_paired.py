"""Paired runs: verdicts on ensembles, and the benefit of known outcomes, its interval, and harm."""

import dataclasses

import numpy as np
import pytest

import tpd
from tpd.answers.ensemble import Ensemble, Outcomes, outcomes
from tpd.answers.paired import Benefit, Verdict, benefit_of, severity
from tpd.answers.statistics import fall

NU = 0.25
PENDULUM = tpd.Pendulum(mass=3.2448, length=0.203, damping_ratio=0.1)


def runs(tilt) -> Outcomes:
    """Runs of these settled tilts over nu: 0 is rest, infinity an overturning, NaN no answer."""
    tilt = np.asarray(tilt, dtype=float)
    status = np.where(np.isinf(tilt), "overturned", np.where(tilt == 0.0, "rest", "rocking"))
    status = np.where(np.isnan(tilt), "failed", status)
    none = np.zeros_like(tilt)
    sizes = {"peak": tilt * NU, "amplitude": tilt * NU, "peak_stroke": none, "stroke": none}
    return Outcomes(ensemble=Ensemble(size=len(tilt), seed=0), status=status, ramp=none, **sizes)


def compared(hung, bare, condition=None, **more) -> Benefit:
    condition = np.zeros(len(hung), int) if condition is None else np.asarray(condition)
    return benefit_of(Verdict(hung=runs(hung), bare=runs(bare)), NU, condition, **more)


def test_the_papers_block_is_safer_with_its_pendulum():
    asked, small = (tpd.paper_scene(), PENDULUM), tpd.Ensemble(size=96, periods=60)
    linear, nonlinear = (tpd.verdict(*asked, ensemble=small, equations=e) for e in ("linear", "nonlinear"))
    for found, equations in ((linear, "linear"), (nonlinear, "nonlinear")):
        assert found.equations == found.hung.equations == found.bare.equations == equations
        assert found.worse < found.better
        assert not found.harms
        head = f"Ensemble of 96 runs of up to 60 periods, seed 0, {equations} equations"
        assert str(found.bare).splitlines()[0] == head
        assert found.table().startswith(f"{equations} equations")
    assert linear.hung.overturned.high < linear.bare.overturned.low
    assert "growing for 2 s" in linear.table()
    assert str(linear.bare.overturned) in linear.table()
    assert str(linear) == f"{linear.table()}\n{linear.objection}"
    assert f"{linear.bare.overturned}" in str(linear.bare).splitlines()[1]
    assert linear.bare._repr_html_() == f"<pre>{linear.bare}</pre>"
    # Chaotic motions: single runs differ, shares by two standard errors of 96 runs at most.
    assert abs(np.mean(nonlinear.bare.lost) - np.mean(linear.bare.lost)) < 0.15
    np.testing.assert_array_equal(nonlinear.hung.ramp, linear.hung.ramp)
    with pytest.raises(ValueError, match="`bare` must be by the linear equations, but is by the nonlinear"):
        tpd.verdict(*asked, ensemble=small, bare=nonlinear.bare)


def test_a_verdict_on_parameters_is_on_the_block_with_their_pendulum_and_without():
    few = tpd.Ensemble(size=4, periods=20)
    p = tpd.paper_scene().parameters(PENDULUM)
    both = tpd.verdict(p, ensemble=few)
    np.testing.assert_array_equal(both.hung.peak, outcomes(p, ensemble=few).peak)
    np.testing.assert_array_equal(both.bare.peak, outcomes(dataclasses.replace(p, mu=0.0), ensemble=few).peak)


def test_harm_is_a_difference_beyond_luck():
    def judged_by(only_hung, only_bare):
        run = np.arange(100)
        hung, bare = run < only_hung, (run >= 50) & (run < 50 + only_bare)
        both = Verdict(hung=runs(np.where(hung, np.inf, 0.4)), bare=runs(np.where(bare, np.inf, 0.4)))
        assert (both.worse, both.better) == (only_hung, only_bare)
        return both

    assert [judged_by(*n).harms for n in ((5, 0), (4, 0), (5, 5), (0, 20))] == [True, False, False, False]
    found = judged_by(5, 0)
    assert "5 of 100 runs of the ensemble overturn with the pendulum only" in found.objection
    assert found.chance_in_words.endswith("Would chance alone do this? It may: p = 0.062.")
    assert judged_by(5, 5).chance_in_words.startswith("As many runs overturn with the pendulum only")
    assert judged_by(0, 20).chance_in_words.endswith("Hardly: p = 1.9e-06.")


@pytest.mark.mends("runs without an answer were not named in the results of an ensemble")
def test_runs_without_an_answer_are_named():
    known = runs(np.full(20, 0.4))
    assert "without an answer" not in str(Verdict(hung=known, bare=known))
    names = ["event_bound"] * 3 + ["failed"], ["event_bound"]
    hung, bare = (
        dataclasses.replace(known, status=np.array([*some, *known.status[len(some) :]])) for some in names
    )
    found = Verdict(hung=hung, bare=bare)
    assert found.objection.endswith("; 4 with the pendulum and 1 without it have no answer")
    (row,) = (line for line in found.table().splitlines() if "without an answer" in line)
    assert row.split()[-2:] == ["4", "1"]
    assert str(hung).splitlines()[-1].split() == ["runs", "without", "an", "answer", "4"]


def test_severity_is_the_tilt_over_nu_and_one_where_the_block_overturns():
    found = severity(runs([0.0, 0.3, 1.4, np.inf, np.nan]), NU)
    np.testing.assert_allclose(found, [0.0, 0.3, 1.0, 1.0, np.nan], rtol=1e-15)
    odd = dataclasses.replace(runs([0.3]), amplitude=np.array([np.nan]))
    assert severity(odd, NU).tolist() == [1.0]


def test_every_size_of_known_runs():
    hung = np.array([0.0, 0.0, 0.1, 0.1, 0.2, 0.2, 0.3, 0.3, 0.4, np.inf])
    bare = np.array([0.0, 0.2, 0.2, 0.2, 0.4, 0.4, 0.6, 0.6, np.inf, np.inf])
    found = compared(hung, bare)
    assert found.value == pytest.approx(1.0 - 2.6 / 4.6, rel=1e-12)
    assert found.low < found.value < found.high
    assert found.runs == 10
    known = {
        "mean severity": (0.26, 0.46),
        "median severity": (0.2, 0.4),
        "worst severity": (1.0, 1.0),
        "overturned": (0.1, 0.2),
        "at rest": (0.2, 0.1),
    }
    assert {c.name: (c.with_it, c.without) for c in found.changes} == {
        name: pytest.approx(sizes) for name, sizes in known.items()
    }
    for c in found.changes:
        assert c.difference == pytest.approx(c.with_it - c.without)
        # Of a median and of the worst tenth there is no interval.
        assert np.isnan(c.low) if c.name[:5] in ("media", "worst") else c.low <= c.difference <= c.high
    assert found.worse_conditions == ()
    assert not found.rests_less
    assert str(found).startswith("43% less tilt (95 % interval ")
    found = compared(np.arange(40) / 50, np.full(40, 0.9))
    worst = next(c for c in found.changes if c.name == "worst severity")
    assert worst.with_it == pytest.approx(np.mean([36, 37, 38, 39]) / 50)


def test_a_benefit_is_the_fall_of_the_mean_severity_of_pairs():
    bare = np.random.default_rng(1).uniform(0.05, 0.95, 50)
    hung = 0.7 * bare + np.random.default_rng(2).uniform(0.0, 0.1, 50)
    found, known = compared(hung, bare), fall(hung, bare)
    assert (found.value, found.low, found.high) == pytest.approx((known.mean, known.low, known.high))
    worse = compared([0.5, 0.45, 0.55, 0.5] * 50, [0.4] * 200)
    assert str(worse).startswith("25% more tilt (95 % interval ")
    assert worse.high <= 0.0
    assert "-" not in str(worse)


@pytest.mark.mends("runs that all ended alike had intervals without a width")
@pytest.mark.parametrize(
    ("hung", "bare", "value"),
    [(0.0, 0.0, 0.0), (np.inf, np.inf, 0.0), (0.0, np.inf, 1.0), (0.4, 0.0, -20.0), (np.inf, 0.5, -1.0)],
    ids=["all rest", "all lost", "none lost", "none to rest", "all to lost"],
)
def test_runs_that_end_alike_have_a_benefit_that_is_a_number(hung, bare, value):
    found = compared([hung] * 8, [bare] * 8)
    assert found.value == value
    assert found.low < value <= found.high <= 1.0
    assert found.high - found.low > 0.4
    assert all(np.isfinite([c.with_it, c.without]).all() for c in found.changes)
    # Runs that end in any other way may be missing from the sample, with a share of up to 0.28.
    for c in (found.changes[0], *found.changes[3:]):
        assert c.low < max(-1.0, c.difference - 0.28 * (1.0 + c.difference)) + 1e-9
        assert c.high > min(1.0, c.difference + 0.28 * (1.0 - c.difference)) - 1e-9


@pytest.mark.mends("runs without an answer counted as overturned, or by the tilt of their last period")
@pytest.mark.parametrize("name", ["failed", "event_bound"])
def test_runs_without_an_answer_are_left_out_and_counted(name):
    def unknown(x, **changes):
        return dataclasses.replace(x, status=np.where(x.status == "failed", name, x.status), **changes)

    hung, bare = runs([0.1, np.nan, 0.1, np.nan, 0.2]), runs([0.4, 0.4, np.nan, np.nan, np.inf])
    last = np.array([0.1, 0.1, 0.1, 0.1, 0.2]) * NU
    pair = Verdict(hung=unknown(hung, amplitude=last), bare=unknown(bare))
    found = benefit_of(pair, NU, np.array([0, 0, 0, 0, 1]))
    # Two pairs are left: 0.1 and 0.2 with the pendulum, 0.4 and 1 without.
    assert found.value == pytest.approx(1.0 - 0.3 / 1.4)
    assert (found.runs, found.undecided) == (2, 3)
    np.testing.assert_allclose(found.by_condition, [[0.1, 0.2], [0.4, 1.0]])
    assert (pair.worse, pair.better) == (0, 1)
    assert pair.hung.overturned.value == 0.0
    # Each unknown run overturned with the pendulum and rested without it, and the other way about.
    against, favour = (end.value for end in found.ends)
    assert against == pytest.approx(1.0 - (0.1 + 1.0 + 0.1 + 1.0 + 0.2) / (0.4 + 0.4 + 0.0 + 0.0 + 1.0))
    assert favour == pytest.approx(1.0 - (0.1 + 0.0 + 0.1 + 0.0 + 0.2) / (0.4 + 0.4 + 1.0 + 1.0 + 1.0))


def test_no_run_or_one_has_an_answer_of_its_own():
    found = compared([np.nan] * 4, [0.3] * 4)
    assert np.isnan(found.value)
    assert (found.runs, found.undecided, str(found)) == (0, 4, "unknown")
    assert [end.value for end in found.ends] == [pytest.approx(-0.7 / 0.3), 1.0]
    one = compared([0.2], [0.4])
    assert (one.value, one.runs, str(one), one.worse_conditions) == (0.5, 1, "50% less tilt", ())
    assert np.isnan(one.low)


def test_a_condition_is_worse_where_its_pairs_show_it():
    condition = np.repeat([0, 1, 2, 3], 16)
    noise = np.random.default_rng(3).uniform(-0.02, 0.02, 64)
    hung, bare = np.array([0.2, 0.309, 0.36, 0.3])[condition] + noise, np.full(64, 0.3)
    # One run in sixteen that is lost is no fact about its condition.
    hung[-1] = np.inf
    found = compared(hung, bare, condition, share=0.05)
    assert found.worse_conditions == (2,)
    means = [np.minimum(hung, 1.0)[condition == i].mean() for i in range(4)]
    np.testing.assert_allclose(found.by_condition, [means, [0.3] * 4])
    assert compared(hung, bare, condition, share=0.5).worse_conditions == ()
    # Next to a bare block at rest a small tilt is no worse condition.
    condition = np.repeat([0, 1], 8)
    small = np.where(condition == 0, 0.0005, 0.01) * np.tile([0.9, 1.1], 8)
    assert compared(small, np.zeros(16), condition).worse_conditions == (1,)
    with_it, without = compared([0.1, 0.1], [0.2, 0.2], [0, 2]).by_condition
    np.testing.assert_allclose([with_it, without], [[0.1, np.nan, 0.1], [0.2, np.nan, 0.2]])


@pytest.mark.mends("with runs enough a pendulum was refused that kept hardly a run from rest")
@pytest.mark.parametrize(
    ("fewer", "more", "both", "others", "said"),
    [
        (5, 0, 0, 400, True),
        (4, 0, 0, 400, False),
        (8, 8, 0, 400, False),
        (8, 0, 41, 400, False),
        (12, 0, 37, 400, True),
        (60, 0, 940, 4000, False),
    ],
)
def test_rests_less_where_significantly_fewer_rest_than_nine_tenths(fewer, more, both, others, said):
    hung = np.array([0.1] * fewer + [0.0] * (more + both) + [0.1] * others)
    bare = np.array([0.0] * fewer + [0.1] * more + [0.0] * both + [0.1] * others)
    assert compared(hung, bare).rests_less is said
