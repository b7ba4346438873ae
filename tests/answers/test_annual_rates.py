"""Annual rates of overturning: values, paired bootstrap, runs without a result, and sentences."""

import itertools
import math
import re

import numpy as np
import pytest

import tpd
from tests.answers.test_fragility import PENDULUM, RECORDS, STATUE
from tests.scene.test_hazard import SITE
from tpd.answers.annual_rates import AnnualRates, rates_of_outcomes
from tpd.answers.fragility import Fragility

EDGES = np.geomspace(0.12, 1.5, 17)
LEVELS = np.sqrt(EDGES[:-1] * EDGES[1:])


@pytest.fixture(autouse=True)
def few(monkeypatch) -> None:
    """Let the bootstrap have few resamples, because the tests compare it with itself."""
    monkeypatch.setattr("tpd.answers.annual_rates.RESAMPLES", 200)


def outcomes(seed: int = 0, motions: int = 44, factor: float = 1.4) -> np.ndarray:
    """Outcomes of motions at all levels without a pendulum and with it, which needs stronger motions."""
    rng = np.random.default_rng(seed)
    capacity = 0.5 * np.exp(0.5 * rng.standard_normal((motions, 1)))
    return np.array([capacity < LEVELS, factor * capacity < LEVELS], float)


def rates(hits: np.ndarray, edges=EDGES, quakes=None) -> AnnualRates:
    return rates_of_outcomes(SITE, edges, hits, np.arange(hits.shape[1]) // 2 if quakes is None else quakes)


@pytest.fixture(scope="module")
def curves() -> Fragility:
    scales = [0.8, 1.5, 3.0, 6.0, 12.0]
    return tpd.fragility(STATUE, RECORDS, scales=scales, pendulum=PENDULUM, nonlinear=False)


def test_annual_rates_are_weighted_sums_that_approach_those_of_the_true_curve():
    of = rates(outcomes())
    for hit, rate in zip(outcomes(), of.cases, strict=True):
        expected = sum(
            hit[:, i].mean() * (SITE.exceeding(a) - SITE.exceeding(b))
            for i, (a, b) in enumerate(itertools.pairwise([*EDGES[:-1], 1e9]))
        )
        assert rate.mean == pytest.approx(expected, rel=1e-9)
        assert rate.low < rate.mean < rate.high
    assert of.years == tuple(1.0 / rate.mean for rate in of.cases)
    assert of.in_50_years == pytest.approx([1.0 - math.exp(-50.0 * rate.mean) for rate in of.cases])
    assert (of.without_pendulum, of.with_pendulum) == of.cases
    assert of.ratio.mean == of.cases[1].mean / of.cases[0].mean
    # The capacities are lognormal, so the rate of many motions is known in closed form.
    many = rates(outcomes(1, 20_000), quakes=np.arange(20_000) % 4)
    for rate, median in zip(many.cases, (0.5, 0.7), strict=True):
        assert rate.mean == pytest.approx(SITE.annual_rate(median, 0.5), rel=0.03)


def test_the_resamples_of_both_cases_are_paired():
    # The same motions have the same effect in both cases, so the ratio varies less than two independent
    # rates do.
    of = rates(outcomes())
    spread = [math.log(x.high / x.low) for x in (*of.cases, of.ratio)]
    assert spread[2] < 0.6 * math.hypot(*spread[:2])
    assert of.ratio.high < 1.0


def test_the_interval_of_the_rate_ratio_has_its_stated_coverage():
    # 22 earthquakes of two motions that are equal, so motions alone would give a narrow interval.
    true = rates(outcomes(99, 4000), quakes=np.arange(4000) % 2).ratio.mean
    inside = 0
    for seed in range(8):
        rng = np.random.default_rng([seed, 1])
        hits = outcomes(99, 4000)[:, np.repeat(rng.integers(4000, size=22), 2)]
        of = rates(hits).ratio
        inside += of.low <= true <= of.high
    assert inside >= 6


def test_the_rate_ratio_of_few_earthquakes_has_no_interval():
    of = rates(outcomes(motions=8))
    assert of.earthquakes == 4
    assert (of.ratio.low, of.ratio.high) == (0.0, math.inf)
    assert "(interval unknown" in str(of)


def test_a_block_that_never_overturns_has_a_rate_of_zero():
    hits = outcomes()
    hits[1] = 0.0
    of = rates(hits)
    assert (of.with_pendulum.mean, of.ratio.mean, of.years[1]) == (0.0, 0.0, math.inf)
    assert "and in no run with it" in str(of)


def test_runs_without_a_result_widen_the_interval():
    hits = outcomes()
    known = rates(hits)
    hits[:, ::3, 6:9] = np.nan
    of = rates(hits)
    assert of.without_pendulum.low < known.without_pendulum.low
    assert of.without_pendulum.high > known.without_pendulum.high
    assert 0.0 < of.without_pendulum.mean < math.inf


def test_a_level_without_any_result_makes_the_rate_unknown():
    hits = outcomes()
    hits[:, :, 6] = np.nan
    of = rates(hits)
    assert math.isnan(of.without_pendulum.mean)
    assert 0.0 < of.without_pendulum.low < of.without_pendulum.high < math.inf
    assert math.isnan(of.ratio.mean)
    said = str(of)
    assert said.count("at an unknown annual rate") == 2
    assert "in no run" not in said
    assert "nan" not in said


def test_the_text_states_return_period_ratio_and_probability():
    of = rates(outcomes())
    first, ratio, beyond = of.sentences
    number = r"[\d.]+"
    case = rf"once in {number} years {{}} \(95 % interval {number} to {number}, {number} % in 50 years\)"
    cases = " and ".join(case.format(name) for name in ("without the pendulum", "with it"))
    assert re.fullmatch(f"The block overturns {cases}", first)
    times = rf"{number} times that without it \(95 % interval {number} to {number}\)"
    assert re.fullmatch(f"The rate with the pendulum is {times}", ratio)
    shares = [f"{100.0 * x:.0f} %" for x in of.beyond]
    above = of.shares[:, -1] * SITE.exceeding(1.5)
    assert of.beyond == pytest.approx(above / [rate.mean for rate in of.cases])
    assert beyond == f"{' and '.join(shares)} of the rate comes from intensities above the last level, 1.5 g"


def test_the_text_advises_other_levels_if_they_cut_off_a_part_of_the_rate():
    few = rates(outcomes()[:, :, :8], EDGES[:9])
    assert str(few).endswith("above the last level, 0.424 g: state higher levels.")
    few = rates(outcomes()[:, :, 8:], EDGES[8:])
    low = "Intensities below the first level do not count, but "
    assert re.search(
        low + r"\d+ % of the runs near the first level, 0.424 g, overturn: state lower", str(few)
    )


def test_a_fragility_in_another_unit_is_converted(curves):
    of = tpd.annual_rates(curves, SITE)
    unit = float(STATUE.slenderness)
    x = unit * curves.stripes
    np.testing.assert_allclose(of.edges, [x[0], *np.sqrt(x[:-1] * x[1:]), x[-1]])
    share = curves.without_pendulum["overturned"].shares
    np.testing.assert_array_equal(of.shares[0], share)
    assert repr(of) == str(of)
