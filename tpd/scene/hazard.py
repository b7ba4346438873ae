"""Seismic hazard of a site: how often the ground motion exceeds each intensity, on average per year."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any, NamedTuple

import numpy as np

from tpd.core import checks
from tpd.formats.channel import STANDARD_GRAVITY

HOW_TO = "State `levels` and `rates` in [hazard] to learn once in how many years the block overturns"
"""Sentence for results without a hazard, without its full stop."""
_STEP = 1e-6
"""Dispersion of a curve that is almost a step."""


class Measure(NamedTuple):
    """Quantity of a ground motion, and the size of the unit in which it is stated."""

    quantity: str
    """Name of the quantity: PGA, PGV, or Sa with its period."""
    si: float
    """Size of the unit in m/s^2 or m/s."""
    unit: str = ""
    """Name of the unit."""


@checks.keywords
@dataclass(frozen=True, kw_only=True)
class Hazard:
    """Annual rates at which the ground motion at a site exceeds intensity levels.

    Between two levels the rate follows a straight line over logarithmic axes. The first and the last line
    continue beyond the levels.

    Raises:
        ValueError: there are fewer than two levels, levels do not increase, rates do not fall, a number is
            not positive, the intensity is unknown, or a spectral acceleration has no period.

    Example:
        >>> import tpd
        >>> hazard = tpd.Hazard(levels=[0.1, 1.0], rates=[0.02, 6.3e-5], intensity="pga_g")
        >>> round(1.0 / hazard.annual_rate(0.6, 0.4))
        2681
    """

    levels: tuple[float, ...]
    """Intensity levels, increasing. In Python "pga" is in m/s^2 and "pga_g" in g; in a job file PGA and
    spectral accelerations are in g, and PGV is in m/s."""
    rates: tuple[float, ...]
    """Mean number of exceedances of each level per year, falling. The rate of a return period of 475 years is
    1/475."""
    intensity: str = "pga"
    """Intensity measure of the levels: pga, pgv, or sa, the spectral acceleration with 5 % damping."""
    period: checks.Real | None = None
    """Period of the spectral acceleration, s."""

    def __post_init__(self) -> None:
        checks.one_of("intensity", self.intensity, ("pga", "pga_g", "pgv", "sa", "sa_g"))
        if self.intensity.startswith("sa") == (self.period is None):
            wrong = f"it is {self.period} and the intensity is {self.intensity}"
            raise ValueError(f"`period` (s) must be stated with the intensity sa, and only then, but {wrong}")
        if self.period is not None:
            checks.positive("period", self.period, 1e-3, 1e3, " s")
        levels = checks.positive("levels", checks.increasing("levels", self.levels), every=True)
        # A rate of zero at the last level would have no logarithm, and a constant rate no intensity.
        of = f"{len(levels)} rates per year, one for each level"
        rates = checks.positive("rates", checks.array("rates", self.rates, levels.shape, of), every=True)
        if not np.all(np.diff(rates) < 0.0):
            raise ValueError(f"`rates` must fall from level to level, but are {checks.shown(rates)}")
        # Tuples make two hazards with the same numbers equal.
        for name, numbers in (("levels", levels), ("rates", rates)):
            object.__setattr__(self, name, tuple(numbers.tolist()))

    @property
    def measure(self) -> Measure:
        """Quantity and unit of the levels."""
        name = self.intensity.removesuffix("_g").upper() if self.period is None else f"Sa({self.period:g} s)"
        unit = "g" if self.intensity.endswith("_g") else "m/s" if name == "PGV" else "m/s^2"
        return Measure(name, STANDARD_GRAVITY if unit == "g" else 1.0, unit)

    @property
    def table(self) -> dict[str, Any]:
        """Keys of the hazard in a job file, where accelerations are in g."""
        size = STANDARD_GRAVITY if self.measure.unit == "m/s^2" else 1.0
        levels = [float(f"{x / size:.12g}") for x in self.levels]
        return vars(self) | {"levels": levels, "intensity": self.intensity.removesuffix("_g")}

    def factor(self, other: Measure) -> float:
        """Return the factor that converts intensities of a measure to the unit of the levels.

        Raises:
            ValueError: the intensities are of another quantity.
        """
        if other.quantity != self.measure.quantity:
            two = f"{self.measure.quantity} in {self.measure.unit} and {other.quantity}"
            same = "hazard and ground motions must have the same `intensity`"
            raise ValueError(f"{same}, but they have {two}: state `scales` in this measure")
        return other.si / self.measure.si

    def exceeding(self, levels: Any) -> Any:
        """Return the annual rates at which the intensity exceeds levels of any shape."""
        # A damage state without dispersion is reached whenever the intensity exceeds its median.
        return self.annual_rate(levels, _STEP)

    def annual_rate(self, median: Any, dispersion: Any) -> Any:
        """Return the annual rate of a damage state with a lognormal fragility curve.

        It is the integral of Phi(ln(s/median)/dispersion) over the falling rate of exceedance, in closed
        form. JAX can differentiate it with respect to both arguments: arrays of JAX give an array of JAX.

        Args:
            median: median intensity of the damage state, in the unit of the levels.
            dispersion: standard deviation of the logarithm of the intensity.

        Raises:
            ValueError: an argument is not positive and finite.
        """
        # SciPy takes a while to load, and a job is read without it.
        from scipy.special import log_ndtr

        np_: Any = np
        if any(map(checks.is_jax, (median, dispersion))):
            import jax.numpy as np_
            from jax.scipy.special import log_ndtr
        theta, beta = checks.positive("median", median, every=True), dispersion
        both = np_.broadcast_arrays(theta, checks.positive("dispersion", beta, every=True))
        theta, beta = (number[..., None] for number in both)
        # In a range H = exp(y0 - m (x - x0)) with x = ln s. Multiplied by the density of the curve, this is
        # again a normal density over z = (x - ln theta)/beta, shifted by m beta. The first and the last range
        # have one end.
        x, y = np.log(self.levels), np.log(self.rates)
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
