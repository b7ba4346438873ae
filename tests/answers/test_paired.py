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
SMALL = tpd.Ensemble(size=96, periods=60)


def runs(tilt) -> Outcomes:
    """Runs of these settled tilts over nu: 0 is rest, infinity an overturning, NaN no answer."""
    tilt = np.asarray(tilt, dtype=float)
    status = np.where(np.isinf(tilt), "overturned", np.where(tilt == 0.0, "rest", "rocking"))
    status = np.where(np.isnan(tilt), "failed", status)
    angle = tilt * NU
    zero = np.zeros_like(tilt)
    return Outcomes(
        ensemble=Ensemble(size=len(tilt)), status=status, peak=angle, amplitude=angle, peak_stroke=zero,
        stroke=zero, ramp=zero,
    )  # fmt: skip


def compared(hung, bare, condition=None, **more) -> Benefit:
    condition = np.zeros(len(hung), int) if condition is None else np.asarray(condition)
    return benefit_of(Verdict(hung=runs(hung), bare=runs(bare)), NU, condition, **more)


@pytest.fixture(scope="module")
def judged() -> tuple[Verdict, Verdict]:
    """Of the paper's block, by the linear and by the nonlinear equations."""
    linear, nonlinear = (
        tpd.verdict(tpd.paper_scene(), PENDULUM, ensemble=SMALL, equations=equations)
        for equations in ("linear", "nonlinear")
    )
    return linear, nonlinear


def test_the_papers_block_is_safer_with_its_pendulum(judged):
    linear, nonlinear = judged
    for found, equations in zip(judged, ("linear", "nonlinear"), strict=True):
        assert found.equations == found.hung.equations == found.bare.equations == equations
        assert found.worse < found.better
        assert not found.harms
        head = f"Ensemble of 96 runs of up to 60 periods, seed 0, {equations} equations"
        assert str(found.bare).splitlines()[0] == head
        assert found.table().startswith(f"{equations} equations")
    assert linear.hung.overturned.high < linear.bare.overturned.low
    table = linear.table()
    assert "growing for 2 s" in table
    assert str(linear.bare.overturned) in table
    assert str(linear) == f"{table}\n{linear.objection}"
    assert f"{linear.bare.overturned}" in str(linear.bare).splitlines()[1]
    assert linear.bare._repr_html_() == f"<pre>{linear.bare}</pre>"
    # Chaotic motions: single runs differ, shares by two standard errors of 96 runs at most.
    assert abs(np.mean(nonlinear.bare.lost) - np.mean(linear.bare.lost)) < 0.15
    np.testing.assert_array_equal(nonlinear.hung.ramp, linear.hung.ramp)
    with pytest.raises(ValueError, match="`bare` must be by the linear equations, but is by the nonlinear"):
        tpd.verdict(tpd.paper_scene(), PENDULUM, ensemble=SMALL, bare=nonlinear.bare)


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
    sizes = {c.name: (c.with_it, c.without) for c in found.changes}
    assert sizes == {
        "mean severity": (pytest.approx(0.26), pytest.approx(0.46)),
        "median severity": (pytest.approx(0.2), pytest.approx(0.4)),
        "worst severity": (1.0, 1.0),
        "overturned": (pytest.approx(0.1), pytest.approx(0.2)),
        "at rest": (pytest.approx(0.2), pytest.approx(0.1)),
    }
    for c in found.changes:
        assert c.difference == pytest.approx(c.with_it - c.without)
        # Of a median and of the worst tenth there is no interval.
        assert np.isnan(c.low) if c.name[:5] in ("media", "worst") else c.low <= c.difference <= c.high
    assert found.worse_conditions == ()
    assert not found.rests_less
    assert str(found).startswith("43% less tilt (95 % interval ")


def test_the_worst_severity_is_the_mean_of_the_worst_tenth():
    found = compared(np.arange(40) / 50, np.full(40, 0.9))
    worst = next(c for c in found.changes if c.name == "worst severity")
    assert worst.with_it == pytest.approx(np.mean([36, 37, 38, 39]) / 50)


def test_a_benefit_is_the_fall_of_the_mean_severity_of_pairs():
    """A pendulum that takes a tenth off every tilt does so with certainty, however the tilts scatter."""
    bare = np.random.default_rng(1).uniform(0.05, 0.95, 50)
    found = compared(0.9 * bare, bare)
    assert (found.low, found.high) == (pytest.approx(0.1, rel=1e-9), pytest.approx(0.1, rel=1e-9))
    hung = 0.7 * bare + np.random.default_rng(2).uniform(0.0, 0.1, 50)
    found, known = compared(hung, bare), fall(hung, bare)
    assert (found.value, found.low, found.high) == pytest.approx((known.mean, known.low, known.high))


@pytest.mark.parametrize(
    ("hung", "bare", "value"),
    [
        ([0.0] * 8, [0.0] * 8, 0.0),
        ([np.inf] * 8, [np.inf] * 8, 0.0),
        ([0.0] * 8, [np.inf] * 8, 1.0),
        ([0.0] * 8, [0.4] * 8, 1.0),
        ([0.4] * 8, [0.0] * 8, -20.0),
        ([np.inf] * 8, [0.5] * 8, -1.0),
    ],
    ids=["all rest", "all lost", "none lost", "all to rest", "none to rest", "all to lost"],
)
def test_runs_that_end_alike_have_a_benefit_that_is_a_number(hung, bare, value):
    found = compared(hung, bare)
    assert (found.value, found.low, found.high) == (value, value, value)
    assert all(np.isfinite([c.with_it, c.without]).all() for c in found.changes)


@pytest.mark.mends("runs without an answer counted as overturned, or by the tilt of their last period")
def test_runs_without_an_answer_are_left_out_and_counted():
    hung, bare = [0.1, np.nan, 0.1, np.nan, 0.2], [0.4, 0.4, np.nan, np.nan, np.inf]
    for name in ("failed", "event_bound"):
        pair = Verdict(hung=runs(hung), bare=runs(bare))
        unknown = [np.where(x.status == "failed", name, x.status) for x in (pair.hung, pair.bare)]
        pair = Verdict(
            hung=dataclasses.replace(pair.hung, status=unknown[0], amplitude=np.full(5, 0.1 * NU)),
            bare=dataclasses.replace(pair.bare, status=unknown[1]),
        )
        pair.hung.amplitude[4] = 0.2 * NU
        found = benefit_of(pair, NU, np.array([0, 0, 0, 0, 1]))
        # Two pairs are left: 0.1 and 0.2 with the pendulum, 0.4 and 1 without.
        assert found.value == pytest.approx(1.0 - 0.3 / 1.4)
        assert (found.runs, found.undecided) == (2, 3)
        np.testing.assert_allclose(found.by_condition, [[0.1, 0.2], [0.4, 1.0]])
        assert (pair.worse, pair.better) == (0, 1)
        assert pair.hung.overturned.value == 0.0
        against, favour = found.ends
        assert against.value == pytest.approx(
            1.0 - (0.1 + 1.0 + 0.1 + 1.0 + 0.2) / (0.4 + 0.4 + 0.0 + 0.0 + 1.0)
        )
        assert favour.value == pytest.approx(
            1.0 - (0.1 + 0.0 + 0.1 + 0.0 + 0.2) / (0.4 + 0.4 + 1.0 + 1.0 + 1.0)
        )


def test_a_benefit_of_nothing_but_runs_without_an_answer_is_unknown():
    found = compared([np.nan] * 4, [0.3] * 4)
    assert np.isnan(found.value)
    assert (found.runs, found.undecided) == (0, 4)
    assert str(found) == "unknown"
    assert [end.value for end in found.ends] == [pytest.approx(-0.7 / 0.3), 1.0]


def test_one_run_is_answered():
    found = compared([0.2], [0.4])
    assert (found.value, found.runs) == (0.5, 1)
    assert np.isnan(found.low)
    assert str(found) == "50% less tilt"
    assert found.worse_conditions == ()


def test_a_condition_is_worse_where_its_pairs_show_it():
    condition = np.repeat([0, 1, 2, 3], 16)
    noise = np.random.default_rng(3).uniform(-0.02, 0.02, 64)
    bare = np.full(64, 0.3)
    hung = np.array([0.2, 0.309, 0.36, 0.3])[condition] + noise
    # One run in sixteen that is lost is no fact about its condition.
    hung[-1] = np.inf
    found = compared(hung, bare, condition, share=0.05)
    assert found.worse_conditions == (2,)
    with_it, without = found.by_condition
    np.testing.assert_allclose(without, 0.3)
    means = [np.minimum(hung, 1.0)[condition == i].mean() for i in range(4)]
    np.testing.assert_allclose(with_it, means)
    assert compared(hung, bare, condition, share=0.5).worse_conditions == ()


def test_next_to_a_bare_block_at_rest_a_small_tilt_is_no_worse_condition():
    condition = np.repeat([0, 1], 8)
    hung = np.where(condition == 0, 0.0005, 0.01)
    assert compared(hung, np.zeros(16), condition).worse_conditions == (1,)


def test_a_condition_without_runs_has_no_size():
    with_it, without = compared([0.1, 0.1], [0.2, 0.2], [0, 2]).by_condition
    np.testing.assert_allclose(with_it, [0.1, np.nan, 0.1])
    np.testing.assert_allclose(without, [0.2, np.nan, 0.2])


@pytest.mark.parametrize(
    ("fewer", "more", "both", "said"),
    [
        (5, 0, 0, True),
        (4, 0, 0, False),
        (8, 8, 0, False),
        (2, 9, 0, False),
        (8, 0, 41, False),
        (12, 0, 37, True),
    ],
)
def test_rests_less_where_significantly_fewer_runs_end_at_rest_than_nine_tenths(fewer, more, both, said):
    hung = np.array([0.1] * fewer + [0.0] * (more + both) + [0.1] * 400)
    bare = np.array([0.0] * fewer + [0.1] * more + [0.0] * both + [0.1] * 400)
    assert compared(hung, bare).rests_less is said


@pytest.mark.mends("with runs enough a pendulum was refused that kept hardly a run from rest")
def test_ten_times_the_runs_refuse_nothing_that_is_small():
    hung, bare = np.array([0.1] * 60 + [0.0] * 940 + [0.1] * 4000), np.array([0.0] * 1000 + [0.1] * 4000)
    assert not compared(hung, bare).rests_less


def test_a_harm_is_told_as_more_tilt():
    worse = compared([0.5, 0.45, 0.55, 0.5], [0.4, 0.4, 0.4, 0.4])
    assert str(worse).startswith("25% more tilt (95 % interval ")
    assert worse.high <= 0.0
    assert "-" not in str(worse)
