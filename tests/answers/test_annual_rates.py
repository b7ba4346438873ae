"""Annual rates of overturning: values, paired bootstrap, outcomes without a curve, and sentences."""

import math
import re

import numpy as np
import pytest

import tpd
from tests.answers.test_fragility import PENDULUM, RECORDS, STATUE
from tests.scene.test_hazard import SITE
from tpd.answers.annual_rates import AnnualRates, rates_of_outcomes
from tpd.answers.fragility import Fragility, fit_lognormal

STRIPES = np.array([0.15, 0.25, 0.4, 0.6, 0.9, 1.3])


@pytest.fixture(autouse=True)
def few(monkeypatch) -> None:
    """Let the bootstrap have few resamples, because the tests compare it with itself."""
    monkeypatch.setattr("tpd.answers.annual_rates.RESAMPLES", 200)


def outcomes(seed: int = 0, motions: int = 44, factor: float = 1.4) -> np.ndarray:
    """Outcomes of motions at all stripes without a pendulum and with it, which needs stronger motions."""
    rng = np.random.default_rng(seed)
    capacity = 0.5 * np.exp(0.5 * rng.standard_normal((motions, 1)))
    return np.array([capacity < STRIPES, factor * capacity < STRIPES], float)


def rates(hits: np.ndarray, **more) -> AnnualRates:
    quakes = more.pop("quakes", np.arange(hits.shape[1]) // 2)
    return rates_of_outcomes(SITE, STRIPES, hits, quakes, more.pop("seed", 0))


@pytest.fixture(scope="module")
def curves() -> Fragility:
    scales = [0.8, 1.5, 3.0, 6.0, 12.0]
    return tpd.fragility(STATUE, RECORDS, scales=scales, pendulum=PENDULUM, nonlinear=False)


def test_annual_rates_follow_from_the_fitted_fragility_curves():
    of = rates(outcomes())
    for hit, rate in zip(outcomes(), of.cases, strict=True):
        fit = fit_lognormal(STRIPES, hit)
        assert rate.mean == SITE.annual_rate(fit.median, fit.dispersion)
        assert rate.low < rate.mean < rate.high
    assert of.years == tuple(1.0 / rate.mean for rate in of.cases)
    assert of.in_50_years == pytest.approx([1.0 - math.exp(-50.0 * rate.mean) for rate in of.cases])
    assert (of.without_pendulum, of.with_pendulum) == of.cases
    assert of.ratio.mean == of.cases[1].mean / of.cases[0].mean


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
    assert "bootstrap" not in str(of)


def test_the_rate_of_a_block_that_never_overturns_is_bounded():
    hits = outcomes()
    hits[1] = 0.0
    of = rates(hits)
    assert math.isnan(of.with_pendulum.mean)
    assert math.isnan(of.ratio.mean)
    assert (of.with_pendulum.low, of.with_pendulum.high) == (0.0, SITE.exceeding(1.3))
    assert 0.0 < of.ratio.high < 1.0
    assert of.without_fit == 200
    years = "years that the outcomes allow: 38000 to infinite; dispersion of the curve: unknown"
    assert f"at an unknown annual rate with it ({years})" in str(of)


def test_a_share_that_does_not_grow_with_intensity_has_no_rate():
    of = rates(outcomes()[:, :, ::-1])
    assert math.isnan(of.without_pendulum.mean)
    assert "interval unknown; dispersion of the curve: the share does not grow with the intensity" in str(of)


def test_separated_outcomes_lie_between_the_rates_of_two_stripes():
    hits = np.repeat([(STRIPES > 0.5).astype(float)], 44, axis=0)[None]
    of = rates(hits)
    assert of.ratio is None
    assert (of.without_pendulum.low, of.without_pendulum.high) == (SITE.exceeding(0.6), SITE.exceeding(0.4))
    assert str(of).startswith(
        "The block overturns at an unknown annual rate (years that the outcomes allow: "
    )


def test_the_text_states_return_period_ratio_and_probability():
    of = rates(outcomes())
    first, ratio, kind = of.sentences[:3]
    number = r"[\d.]+"
    case = rf"once in {number} years {{}} \(95 % interval {number} to {number}, {number} % in 50 years\)"
    cases = " and ".join(case.format(name) for name in ("without the pendulum", "with it"))
    assert re.fullmatch(f"The block overturns {cases}", first)
    times = rf"{number} times that without it \(95 % interval {number} to {number}\)"
    assert re.fullmatch(f"The rate with the pendulum is {times}", ratio)
    assert "paired bootstrap (200 resamples of 22 earthquakes, seed 0)" in kind


def test_the_text_states_the_extrapolated_share_of_the_rate():
    assert max(rates(outcomes()).extrapolated) < 0.1
    assert "extrapolated" not in str(rates(outcomes()))
    of = rates_of_outcomes(SITE, 3.0 * STRIPES, outcomes(), np.arange(44) // 2, 0)
    assert min(of.extrapolated) > 0.1
    shares = " and ".join(f"{100 * x:.0f} %" for x in of.extrapolated)
    beyond = "it comes from a PGA beyond the levels of the runs or of the hazard"
    assert f"{shares} of the rate is extrapolated: {beyond}" in of.sentences
    assert "Levels of the runs far above the last level of the hazard, 1.2 g: 2.7, 3.9 g" in of.sentences
    # The stripes are above all levels of the hazard.
    assert rates_of_outcomes(SITE, 20.0 * STRIPES, outcomes(), np.arange(44) // 2, 0).extrapolated == (
        1.0,
        1.0,
    )


def test_a_fragility_in_another_unit_is_converted(curves):
    of = tpd.annual_rates(curves, SITE)
    unit = float(STATUE.slenderness)
    assert of.stripes == pytest.approx(unit * curves.stripes)
    fit = curves.without_pendulum["overturned"].fit
    assert of.without_pendulum.mean == pytest.approx(SITE.annual_rate(unit * fit.median, fit.dispersion))
    assert repr(of) == str(of)
