"""Seismic hazard of a site: how often the ground motion exceeds each intensity, on average per year."""

from __future__ import annotations

import warnings
from dataclasses import dataclass
from typing import Any, NamedTuple

import numpy as np

from tpd.core import checks
from tpd.core.formatting import number

HOW_TO = "State `levels` and `rates` in [hazard] for the annual rate of overturning"
"""Sentence for results without a hazard, without its full stop."""
_STEP = 1e-6
"""Dispersion of a curve that is almost a step."""
MOST_DISPERSION = 10.0
"""Largest dispersion of a curve. A larger one spreads the capacity over more than ten orders of magnitude."""
_FREQUENT = 0.004
"""Annual rate of the last level from which a warning appears. Published curves reach return periods of 475
years."""
_UNUSUAL, _IMPOSSIBLE = 5000.0, 1000.0
"""Return periods of an implausible level: a shorter one is unusual, or impossible."""
_WAYS = ("rates", "return_periods", "probabilities")
"""Fields of which exactly one states how often a level is exceeded."""


class Measure(NamedTuple):
    """Quantity of a ground motion, and the size of the unit in which it is stated."""

    quantity: str
    """Name of the quantity: PGA, PGV, or Sa with its period."""
    size: float
    """Size of the unit in g or m/s."""
    unit: str = ""
    """Name of the unit."""


@checks.keywords
@dataclass(frozen=True, kw_only=True)
class Hazard:
    """Annual rates at which the ground motion at a site exceeds intensity levels.

    Between two levels the rate follows a straight line over logarithmic axes. The first and the last line
    continue beyond the levels. The exceedances are stated by exactly one of `rates`, `return_periods`, and
    `probabilities` with `years`. All become `rates`, and the other fields None.

    Raises:
        ValueError: there are fewer than two levels, levels do not increase, rates do not fall, a number is
            not positive, the intensity is unknown, a spectral acceleration has no period, the exceedances
            are stated twice or not at all, or the levels are implausible in their unit.

    Example:
        >>> import tpd
        >>> hazard = tpd.Hazard(levels=[0.1, 1.0], rates=[0.02, 6.3e-5])
        >>> round(1.0 / hazard.annual_rate(0.6, 0.4))
        2681
    """

    levels: tuple[float, ...]
    """Intensity levels, increasing: PGA and spectral accelerations in g, PGV in m/s."""
    rates: tuple[float, ...] | None = None
    """Mean number of exceedances of each level per year, falling. The rate of a return period of 475 years is
    1/475."""
    return_periods: tuple[float, ...] | None = None
    """Return period of each level in years, increasing, instead of `rates`."""
    probabilities: tuple[float, ...] | None = None
    """Probability that each level is exceeded in `years`, falling, instead of `rates`: 0.1 is 10 %."""
    years: checks.Real | None = None
    """Number of years of the `probabilities`, usually 50."""
    intensity: str = "pga"
    """Intensity measure of the levels: pga, pgv, or sa, the spectral acceleration with 5 % damping."""
    period: checks.Real | None = None
    """Period of the spectral acceleration, s."""

    def __post_init__(self) -> None:
        checks.one_of("intensity", self.intensity, ("pga", "pgv", "sa"))
        if (self.intensity == "sa") == (self.period is None):
            wrong = f"it is {self.period} and the intensity is {self.intensity}"
            raise ValueError(f"`period` (s) must be stated with the intensity sa, and only then, but {wrong}")
        if self.period is not None:
            checks.positive("period", self.period, 1e-3, 1e3, " s")
        levels = checks.positive("levels", checks.increasing("levels", self.levels), every=True)
        rates = self._yearly(levels.shape)
        # Tuples make two hazards with the same numbers equal.
        numbers = {"levels": tuple(levels.tolist()), "rates": tuple(rates.tolist())}
        for name, value in (dict.fromkeys((*_WAYS, "years")) | numbers).items():
            object.__setattr__(self, name, value)
        # Published curves end at high levels that almost never occur: a high level is implausible only if it
        # occurs often.
        usual, unit = checks.PLAUSIBLE[self.intensity]
        x, y, at = np.log(levels), np.log(rates), np.log(usual)
        i = np.clip(np.searchsorted(x, at), 1, len(x) - 1)
        years = np.exp(min((y[i] - y[i - 1]) / (x[i] - x[i - 1]) * (x[i] - at) - y[i], 100.0))
        wrong = f"at this site the {self.measure.quantity} exceeds {usual:g} {unit} once in"
        text = f"{wrong} {number(years, 3)} years, which is implausible: are `levels` in {unit}?"
        if years < _IMPOSSIBLE:
            raise ValueError(text)
        if rates[0] > 1.0 or rates[-1] > _FREQUENT:
            wrong = f"the ground exceeds the levels {', '.join(map('{:g}'.format, rates))} times a year"
            warnings.warn(f"{wrong}: are the `rates` probabilities in many years?", stacklevel=3)
        elif years < _UNUSUAL:
            warnings.warn(text, stacklevel=3)

    def _yearly(self, shape: tuple[int, ...]) -> np.ndarray:
        """Return the annual rates of exceedance from the only field that states them."""
        stated = [name for name in _WAYS if getattr(self, name) is not None]
        if len(stated) != 1:
            have = " and ".join(f"`{name}`" for name in stated) or "none of them"
            raise ValueError(f"exactly one of `{'`, `'.join(_WAYS)}` must be stated, but it is {have}")
        (way,) = stated
        if (way == "probabilities") == (self.years is None):
            wrong = f"it is {self.years} and the exceedances are `{way}`"
            raise ValueError(f"`years` must be stated with `probabilities`, and only then, but {wrong}")
        # A rate of zero at the last level would have no logarithm, and a constant rate no intensity.
        of = f"{shape[0]} {way.replace('_', ' ')}{' per year' * (way == 'rates')}, one for each level"
        x = checks.positive(way, checks.array(way, getattr(self, way), shape, of), every=True)
        if way == "probabilities" and np.any(x >= 1.0):
            raise ValueError(f"`{way}` must be below 1 (10 % is 0.1), but are {checks.quote(x)}")
        sign = 1.0 if way == "return_periods" else -1.0
        if not np.all(sign * np.diff(x) > 0.0):
            wanted = "increase" if sign > 0.0 else "fall"
            raise ValueError(f"`{way}` must {wanted} from level to level, but are {checks.quote(x)}")
        if way == "probabilities":
            return -np.log1p(-x) / checks.positive("years", self.years, 1.0, 1e4)
        return x if way == "rates" else 1.0 / x

    @property
    def measure(self) -> Measure:
        """Quantity and unit of the levels."""
        name = self.intensity.upper() if self.period is None else f"Sa({self.period:g} s)"
        return Measure(name, 1.0, checks.PLAUSIBLE[self.intensity][1])

    def factor(self, other: Measure) -> float:
        """Return the factor that converts intensities of a measure to the unit of the levels.

        Raises:
            ValueError: the intensities are of another quantity.
        """
        checks.instance("other", other, Measure, ": use the `measure` of a fragility")
        if other.quantity != self.measure.quantity:
            two = f"{self.measure.quantity} in {self.measure.unit} and {other.quantity}"
            same = "hazard and ground motions must have the same `intensity`"
            raise ValueError(f"{same}, but they have {two}: state `scales` in this measure")
        return other.size

    def exceeding(self, levels: Any) -> Any:
        """Return the annual rates at which the intensity exceeds levels of any shape."""
        # A damage state without dispersion is reached whenever the intensity exceeds its median.
        return self.annual_rate(levels, _STEP)

    def level(self, rate: float) -> float:
        """Return the level that is exceeded at an annual rate, on the lines of the curve.

        Example:
            >>> import tpd
            >>> hazard = tpd.Hazard(levels=[0.1, 1.0], return_periods=[100.0, 10000.0])
            >>> round(hazard.level(1.0 / 1000.0), 4)
            0.3162
        """
        assert self.rates is not None
        x, y, at = np.log(self.levels), np.log(self.rates), np.log(checks.positive("rate", rate))
        i = int(np.clip(np.searchsorted(-y, -at), 1, len(y) - 1))
        return float(np.exp(x[i] + (at - y[i]) * (x[i] - x[i - 1]) / (y[i] - y[i - 1])))

    def annual_rate(self, median: Any, dispersion: Any) -> Any:
        """Return the annual rate of a damage state with a lognormal fragility curve.

        It is the integral of Phi(ln(s/median)/dispersion) over the falling rate of exceedance, in closed
        form. JAX can differentiate it with respect to both arguments: arrays of JAX give an array of JAX.

        Args:
            median: median intensity of the damage state, in the unit of the levels.
            dispersion: standard deviation of the logarithm of the intensity.

        Raises:
            ValueError: an argument is not positive and finite, or the dispersion is above 10.
        """
        # SciPy takes a while to load, and a job is read without it.
        from scipy.special import log_ndtr

        np_: Any = np
        if any(map(checks.is_jax, (median, dispersion))):
            import jax.numpy as np_
            from jax.scipy.special import log_ndtr
        theta, beta = checks.positive("median", median, every=True), dispersion
        checks.positive("dispersion", beta, 0.0, MOST_DISPERSION, every=True)
        both = np_.broadcast_arrays(theta, beta)
        theta, beta = (number[..., None] for number in both)
        # In a range H = exp(y0 - m (x - x0)) with x = ln s. Multiplied by the density of the curve, this is
        # again a normal density over z = (x - ln theta)/beta, shifted by m beta. The first and the last range
        # have one end.
        x, y = np.log(self.levels), np.log(np.array(self.rates))
        m = -np.diff(y) / np.diff(x)
        m, x0, y0 = np.concatenate([m[:1], m, m[-1:]]), np.append(x[0], x), np.append(y[0], y)
        m, x, x0, y0 = (number.reshape((1,) * (theta.ndim - 1) + (-1,)) for number in (m, x, x0, y0))
        shift, z = m * beta, (x - np_.log(theta)) / beta
        low, high = z + shift[..., 1:], z + shift[..., :-1]
        # Phi(b) - Phi(a) = Phi(-a) - Phi(-b): above the median the second form loses no digits.
        a, b = low[..., :-1], high[..., 1:]
        large, small = (log_ndtr(np_.where(a > 0.0, -p, q)) for p, q in ((a, b), (b, a)))
        inner = large + np_.log(-np_.expm1(small - large))
        logs = np_.concatenate([log_ndtr(high[..., :1]), inner, log_ndtr(-low[..., -1:])], axis=-1)
        # The sum of the logarithms is finite also where a factor alone would overflow.
        with np.errstate(over="ignore"):
            return np_.exp(y0 + m * (x0 - np_.log(theta)) + 0.5 * shift**2 + logs).sum(axis=-1)
