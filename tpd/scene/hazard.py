"""Seismic hazard of a site: how often the ground motion exceeds each intensity, on average per year."""

from __future__ import annotations

from dataclasses import dataclass, replace
from typing import Any, NamedTuple

import numpy as np

from tpd.core import checks
from tpd.formats.channel import STANDARD_GRAVITY

_STEP = 1e-6
"""Dispersion of a curve that is almost a step."""


class Measure(NamedTuple):
    """Quantity of a ground motion, and the size of the unit in which it is stated."""

    quantity: str
    """Name of the quantity: PGA, PGV, or Sa with its period."""
    si: float
    """Size of the unit in m/s^2 or m/s."""


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
        2714
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
            checks.set_checked(self, checks.positive, "period", 1e-3, 1e3, " s")
        levels = checks.positive("levels", checks.increasing("levels", self.levels), every=True)
        of = f"{len(levels)} rates per year, one for each level"
        rates = checks.positive("rates", checks.array("rates", self.rates, levels.shape, of), every=True)
        if not np.all(np.diff(rates) < 0.0):
            raise ValueError(f"`rates` must fall from level to level, but are {checks.shown(rates)}")
        # Tuples make two hazards with the same numbers equal.
        for name, numbers in (("levels", levels), ("rates", rates)):
            object.__setattr__(self, name, tuple(numbers.tolist()))

    @property
    def unit(self) -> str:
        """Unit of the levels."""
        return "g" if self.intensity.endswith("_g") else "m/s" if self.intensity == "pgv" else "m/s^2"

    @property
    def measure(self) -> Measure:
        """Quantity of the levels."""
        name = self.intensity.removesuffix("_g").upper() if self.period is None else f"Sa({self.period:g} s)"
        return Measure(name, STANDARD_GRAVITY if self.unit == "g" else 1.0)

    @property
    def table(self) -> dict[str, Any]:
        """Keys of the hazard in a job file, where accelerations are in g."""
        unit = STANDARD_GRAVITY if self.unit == "m/s^2" else 1.0
        levels = [float(f"{x / unit:.12g}") for x in self.levels]
        return vars(self) | {"levels": levels, "intensity": self.intensity.removesuffix("_g")}

    def factor(self, other: Measure) -> float:
        """Return the factor that converts intensities of a measure to the unit of the levels.

        Raises:
            ValueError: the intensities are of another quantity.
        """
        if other.quantity != self.measure.quantity:
            own = f"the hazard is over {self.measure.quantity} in {self.unit}"
            raise ValueError(
                f"hazard and ground motions must have the same intensity measure, but {own} and the ground "
                f"motions have the measure {other.quantity}"
            )
        return other.si / self.measure.si

    def exceeding(self, level: float) -> float:
        """Return the annual rate at which the intensity exceeds a level."""
        # A damage state without dispersion is reached whenever the intensity exceeds its median.
        return float(self.annual_rate(level, _STEP))

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
        return self.parts(median, dispersion).sum(axis=-1)

    def parts(self, median: Any, dispersion: Any) -> Any:
        """Return the parts of `annual_rate` from intensities below the first level, between levels, and above
        the last level, shape (..., levels + 1)."""
        theta, beta = checks.positive("median", median, every=True), dispersion
        beta = checks.positive("dispersion", beta, every=True)
        np_, log_ndtr = _functions(theta, beta)
        theta, beta = (np_.asarray(number)[..., None] for number in (theta, beta))
        # In a range H = exp(y0 - m (x - x0)) with x = ln s. Multiplied by the density of the curve, this is
        # again a normal density over z = (x - ln theta)/beta, shifted by m beta.
        x, y = np.log(self.levels), np.log(self.rates)
        m = -np.diff(y) / np.diff(x)
        m, x0, y0 = np.concatenate([m[:1], m, m[-1:]]), np.append(x[0], x), np.append(y[0], y)
        shift, z = m * beta, (x - np_.log(theta)) / beta
        low, high = z[..., :-1] + shift[..., 1:-1], z[..., 1:] + shift[..., 1:-1]
        # Phi(high) - Phi(low) = Phi(-low) - Phi(-high): above the median the second form loses no digits.
        large, small = (log_ndtr(np_.where(low > 0.0, -a, b)) for a, b in ((low, high), (high, low)))
        first, last = log_ndtr(z[..., :1] + shift[..., :1]), log_ndtr(-z[..., -1:] - shift[..., -1:])
        logs = np_.concatenate([first, large + np_.log(-np_.expm1(small - large)), last], axis=-1)
        # The sum of the logarithms is finite also where a factor alone would overflow.
        with np.errstate(over="ignore"):
            return np_.exp(y0 + m * (x0 - np_.log(theta)) + 0.5 * shift**2 + logs)

    def within(self, low: float, high: float, median: float, dispersion: float) -> float:
        """Return the part of `annual_rate` from intensities between two levels; 0 if they are not in
        order."""
        if not low < high:
            return 0.0
        levels = [low, *(x for x in self.levels if low < x < high), high]
        cut = replace(self, levels=levels, rates=[self.exceeding(x) for x in levels])
        return float(cut.parts(median, dispersion)[1:-1].sum())


def _functions(*values: Any) -> tuple[Any, Any]:
    """Return the module of arrays and the function ln(Phi(x)); those of JAX if a value is of JAX."""
    if any(map(checks.is_jax, values)):
        import jax.numpy
        from jax.scipy.special import log_ndtr

        return jax.numpy, log_ndtr
    # SciPy takes a while to load, and a job is read without it.
    from scipy.special import log_ndtr

    return np, log_ndtr
