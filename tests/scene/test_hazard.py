"""Seismic hazard: the closed form of the annual rate, its derivatives, and inputs that are rejected."""

import re
from itertools import pairwise

import jax
import jax.numpy as jnp
import numpy as np
import pytest
from scipy.integrate import quad

import tpd
from tpd.scene.hazard import Measure

LEVELS, RATES = [0.05, 0.1, 0.2, 0.3, 0.5, 0.8, 1.2], [6e-2, 2.2e-2, 6e-3, 2.4e-3, 6.5e-4, 1.5e-4, 3.5e-5]
SITE = tpd.Hazard(levels=LEVELS, rates=RATES)


def by_quadrature(hazard: tpd.Hazard, median: float, dispersion: float) -> float:
    """The integral of the rate of exceedance over the density of the capacity, piece by piece."""
    levels, rates = (np.log(x) for x in (hazard.levels, hazard.rates))
    slopes = np.diff(rates) / np.diff(levels)

    def term(z: float) -> float:
        x = np.log(median) + dispersion * z
        i = int(np.clip(np.searchsorted(levels, x) - 1, 0, len(slopes) - 1))
        return np.exp(rates[i] + slopes[i] * (x - levels[i]) - 0.5 * z * z) / np.sqrt(2.0 * np.pi)

    kinks = (levels - np.log(median)) / dispersion
    ends = np.unique(np.clip([-14.0, *kinks, 14.0], -14.0, 14.0))
    return sum(quad(term, a, b, epsabs=0.0, epsrel=1e-12)[0] for a, b in pairwise(ends))


def test_the_rate_of_a_hazard_curve_equals_a_quadrature():
    assert SITE.annual_rate(0.6, 0.4) == pytest.approx(6.4984241230e-4, rel=1e-10)
    for at in ((0.6, 0.4), (0.15, 0.2), (2.5, 0.6), (0.02, 0.3)):
        assert SITE.annual_rate(*at) == pytest.approx(by_quadrature(SITE, *at), rel=1e-10)
    # A power law has a closed form.
    rate = tpd.Hazard(levels=[0.1, 1.0], rates=[4e-4 * 0.1**-2.5, 4e-4]).annual_rate(0.6, 0.4)
    assert rate == pytest.approx(4e-4 * 0.6**-2.5 * np.exp(0.5 * (2.5 * 0.4) ** 2), rel=1e-13)


def test_without_dispersion_the_rate_equals_the_hazard_at_the_median():
    assert SITE.exceeding(np.array(LEVELS)) == pytest.approx(RATES, rel=1e-6)
    assert SITE.exceeding(np.sqrt(0.5 * 0.8)) == pytest.approx(np.sqrt(6.5e-4 * 1.5e-4), rel=1e-9)


@pytest.mark.parametrize(("median", "dispersion"), [(0.6, 0.4), (3.0, 0.7), (1e4, 0.05), (0.6, 3.0)])
def test_gradients_of_the_rate_equal_finite_differences(median, dispersion):
    at = jnp.array([median, dispersion])
    slopes = jax.jit(jax.grad(lambda x: SITE.annual_rate(x[0], x[1])))(at)
    for i, h in enumerate(1e-5 * np.array([median, dispersion])):
        # A central difference of this step has a relative error of about 1e-9.
        step = h * np.eye(2)[i]
        difference = np.subtract(*(float(SITE.annual_rate(*(np.array(at) + x))) for x in (step, -step)))
        assert slopes[i] == pytest.approx(difference / (2.0 * h), rel=1e-6)
    many = SITE.annual_rate(jnp.array([[median], [0.6]]), jnp.array([dispersion, 0.4]))
    assert isinstance(many, jax.Array)
    assert many.shape == (2, 2)
    assert float(many[0, 0]) == pytest.approx(SITE.annual_rate(median, dispersion), rel=1e-13)
    assert isinstance(SITE.annual_rate(0.6, 0.4), float)


def test_the_unit_of_a_hazard_follows_from_its_intensity():
    assert SITE.measure == Measure("PGA", 1.0, "g")
    assert SITE.factor(Measure("PGA", 0.2)) == 0.2
    assert tpd.Hazard(levels=[0.01, 0.0101], rates=[1e-2, 1e-5]).rates == (1e-2, 1e-5)
    spectral = tpd.Hazard(levels=LEVELS, rates=RATES, intensity="sa", period=0.5)
    assert spectral.measure == Measure("Sa(0.5 s)", 1.0, "g")
    message = "must have the same `intensity`, but they have PGA in g and Sa(0.5 s)"
    with pytest.raises(ValueError, match=re.escape(message)):
        SITE.factor(spectral.measure)


def test_return_periods_and_probabilities_become_rates():
    levels = [0.07, 0.16, 0.33]
    of = tpd.Hazard(levels=levels, probabilities=[0.5, 0.1, 0.02], years=50)
    assert of.rates == pytest.approx([0.013863, 0.0021072, 0.00040405], rel=1e-4)
    assert (of.probabilities, of.return_periods, of.years) == (None, None, None)
    assert tpd.Hazard(levels=levels, return_periods=1.0 / np.array(of.rates)).rates == pytest.approx(of.rates)


def test_an_unusual_hazard_gets_a_question():
    for levels, rates, message in (
        # Numbers in m/s^2, and probabilities in 50 years as rates.
        ([0.3, 0.8, 1.6], [0.014, 0.0021, 4e-4], "once in 4[0-9]+ years.*`levels` in g"),
        ([0.07, 0.33], [0.5, 0.02], r"0\.5, 0\.02 times a year: are the `rates` prob"),
        ([0.01, 0.33], [1.5, 1e-3], "are the `rates` probabilities in many years"),
    ):
        with pytest.warns(UserWarning, match=message):
            tpd.Hazard(levels=levels, rates=rates)


WRONG = (
    ({"levels": [0.1], "rates": [0.01]}, "`levels` must be a vector of 2 or more increasing numbers"),
    ({"levels": [0.2, 0.1]}, "`levels` must be a vector of 2 or more increasing numbers"),
    ({"levels": [0.0, 0.1]}, "`levels` must be positive and finite"),
    ({"levels": [0.1, np.nan]}, "increasing numbers, all finite, but is [0.1, nan]"),
    ({"rates": [0.01, 0.01]}, "`rates` must fall from level to level, but are [0.01 0.01]"),
    ({"rates": [0.01, 0.0]}, "`rates` must be positive and finite"),
    ({"rates": [0.01]}, "`rates` must be 2 rates per year, one for each level"),
    ({"intensity": "pga_star"}, "`intensity` must be one of pga, pgv, sa, but is 'pga_star'"),
    ({"intensity": "pga_g"}, "is 'pga_g'; it is now called `pga`"),
    ({"intensity": "sa"}, "`period` (s) must be stated with the intensity sa, and only then"),
    ({"period": 1.0}, "only then, but it is 1.0 and the intensity is pga"),
    ({"intensity": "sa", "period": 0.0}, "`period` must be positive and finite, but is 0"),
    # Levels in per cent, m/s^2 and gal, and a velocity in cm/s.
    ({"levels": [7.0, 33.0]}, "the PGA exceeds 2 g once in"),
    ({"levels": [1.57, 3.24], "rates": [0.0021, 4e-4]}, "which is implausible: are `levels` in g?"),
    ({"levels": [16.0, 33.0], "intensity": "pgv"}, "the PGV exceeds 3 m/s once in"),
    ({"return_periods": [475, 2475]}, "must be stated, but it is `rates` and `return_periods`"),
    ({"rates": None}, "exactly one of `rates`, `return_periods`, `probabilities` must be stated"),
    ({"rates": None, "return_periods": [475, 72]}, "`return_periods` must increase from level to"),
    ({"rates": None, "probabilities": [0.1, 0.02]}, "`years` must be stated with `probabilities`, and"),
    ({"rates": None, "probabilities": [10, 2], "years": 50}, "must be below 1 (10 % is 0.1), but are"),
    ({"years": 50}, "and only then, but it is 50 and the exceedances are `rates`"),
)


def test_invalid_hazards_and_capacities_are_rejected_in_one_sentence():
    for change, message in WRONG:
        with pytest.raises(ValueError, match=re.escape(message)) as error:
            tpd.Hazard(**{"levels": [0.1, 0.2], "rates": [0.01, 0.001]} | change)
        assert "\n" not in str(error.value)
    for median, dispersion in ((0.0, 0.4), (0.6, 0.0), (np.nan, 0.4), (0.5, 1e300)):
        with pytest.raises(ValueError, match=r"must be (positive and finite|between)"):
            SITE.annual_rate(median, dispersion)
