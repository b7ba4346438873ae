"""Conditions under which a design is evaluated.

Conditions are a band of frequencies, several amplitudes, samples of uncertain quantities, ground motions, and
combinations of these. A condition is a set of factors on the values of the scene. It can also have another
ground motion.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field, replace
from typing import Any, NamedTuple

import numpy as np
from jaxtyping import Float

from tpd.core import checks
from tpd.scene.ground_motion import GroundMotion, Pulse, refuse_zeros
from tpd.scene.hazard import Hazard
from tpd.scene.parameters import Parameters
from tpd.scene.scene import Harmonic, Scene

FACTORS = ("amplitude", "frequency", "friction", "slenderness", "mass", "length", "damping", "restitution")
"""Quantities that can vary: amplitude and frequency of the excitation, k, nu, the m, l and zeta of the
pendulum, and e. Seeded samples depend on the order, so a new name must come last."""

HARMONIC_PERIODS = 40
"""Number of periods of a harmonic among ground motions."""
FASTEST = 10.0
"""Largest rate of an initial state: phi' as a share of nu, psi' in rad per unit of tau."""
MOST_SCATTER = 0.5
"""Largest relative half width of an uncertain quantity."""
MEASURE_NAMES = {
    "pga_star": "PGA over g tan(alpha)",
    "pgv_star": "p PGV over g tan(alpha)",
    "pga": "PGA in g",
    "pgv": "PGV in m/s",
    "scale": "factor on each motion",
}
"""Intensity measures of the scales of ground motions, with their names in sentences. The keys are those of
`tpd.records.intensity`."""
MEASURES = {**MEASURE_NAMES, "pga_star": f"{MEASURE_NAMES['pga_star']}; at 1 the block lifts"}
"""Intensity measures with their descriptions."""


class Normal(NamedTuple):
    """Normal distribution of the difference from Housner's e, cut at three standard deviations."""

    mean: float
    """Mean."""
    deviation: float
    """Standard deviation."""

    def factors(self, unit: np.ndarray) -> np.ndarray:
        """Return factors 1 + d with the difference d at probabilities between 0 and 1."""
        # Few commands need this module, so its import is here.
        from statistics import NormalDist

        quantile = NormalDist(1.0 + self.mean, self.deviation).inv_cdf
        # The ends are the probabilities of three standard deviations.
        return np.array([quantile(x) for x in np.clip(unit, 0.00135, 0.99865)])

    def __str__(self) -> str:
        return f"e normal with mean Housner's e {self.mean:+g} and standard deviation {self.deviation:g}"


MEASURED = Normal(-0.01, 0.03)
"""Scatter of e in runs with Housner's restitution: measured e minus Housner's e in the first impacts of 134
free-rocking trials of limestone blocks (Colombo and others, 2026, DOI 10.60756/uminho-jh25, CC BY 4.0). The
numbers come from group means that a third party processed, and include the noise of the measurement. They are
therefore an indication."""
HalfWidth = checks.Real | Normal
"""Scatter of a quantity: the relative half width of a uniform distribution, or the distribution of e."""


def train_of(motion: Harmonic, amplitude: float = 1.0, frequency: float = 1.0) -> Pulse:
    """Return the first periods from rest of a harmonic with factors on its amplitude and frequency."""
    a, f = motion.amplitude * amplitude * (motion.rate * frequency) ** 2, motion.frequency * frequency
    return Pulse.sine_train(acceleration=a, frequency=f, cycles=HARMONIC_PERIODS)


@dataclass(frozen=True)
class Conditions:
    """Set of n conditions. `Conditions()` is a single condition, the excitation of the scene.

    `Conditions.band(...) * Conditions.scatter(...)` combines every condition of the first set with every
    condition of the second set.

    The main field is `factors`: dimensionless factors on the values of the scene, by a name of
    `tpd.scene.conditions.FACTORS`, each of shape (n,). `motions`, `which`, `intensity` and `scales` describe
    ground motions. `description` and `units` serve labels.

    Example:
        >>> import tpd
        >>> scene = tpd.paper_scene()
        >>> conditions = tpd.Conditions.band(scene, 2.4, 2.6, 3) * tpd.Conditions.amplitudes(1.0, 1.1)
        >>> len(conditions), conditions.label(1)
        (6, '2.4 Hz and 1.1 times the amplitude')
    """

    factors: Mapping[str, np.ndarray] = field(default_factory=dict)
    """Factors on the values of the scene, by a name of `tpd.scene.conditions.FACTORS`, each of shape (n,). A
    name that is left out has the factor 1."""
    description: tuple[str, ...] = ()
    """Phrases that describe the set, one for each set of a combination."""
    units: Mapping[str, tuple[float, str]] = field(default_factory=dict)
    """Value of the scene and its unit, by name, for factors that have a unit."""
    motions: tuple[GroundMotion, ...] = ()
    """Ground motions; empty if all conditions use the harmonic of the scene."""
    which: np.ndarray | None = None
    """Index of the ground motion of every condition, shape (n,)."""
    intensity: str = "scale"
    """Name in `tpd.records.intensity` of the measure to which the amplitude of a ground motion refers."""
    scales: tuple[float, ...] = ()
    """Values of the intensity to which every ground motion is scaled."""
    hazard: Hazard | None = None
    """Seismic hazard of the site, for the annual rate of overturning under ground motions."""

    def __post_init__(self) -> None:
        checks.instance("factors", self.factors, Mapping)
        for name in self.factors:
            checks.one_of("factors", name, FACTORS)
        factors = {
            n: checks.positive(n, checks.array(n, x, (-1,), "a vector of factors"), every=True)
            for n, x in self.factors.items()
        }
        object.__setattr__(self, "factors", factors)
        checks.instance("motions", self.motions, tuple)
        if self.which is not None:
            checks.array("which", self.which, (-1,), "a vector of indices of motions")
        if len(self._lengths) > 1:
            raise ValueError(f"`factors` must be of one length, but have lengths {self._lengths}")

    def __len__(self) -> int:
        return self._lengths[0] if self._lengths else 1

    @property
    def _lengths(self) -> list[int]:
        # All factors and the indices of the motions have one entry per condition.
        columns = (*self.factors.values(), *(() if self.which is None else (self.which,)))
        return sorted({len(values) for values in columns})

    def __mul__(self, other: Conditions) -> Conditions:
        if not isinstance(other, Conditions):
            return NotImplemented
        # The first set varies slowly, so its values are repeated. Those of the second set are tiled.
        n, m = len(self), len(other)
        if self.motions and other.motions:
            raise ValueError("only one of two sets of conditions can have ground motions, but both have some")
        names = [name for name in FACTORS if name in {*self.factors, *other.factors}]
        # If both sets have a factor on the same quantity, the factors are multiplied.
        factors = {x: np.repeat(self.column(x), m) * np.tile(other.column(x), n) for x in names}
        # The second set varies fastest, as in the factors.
        which = None if self.which is None else np.repeat(self.which, m)
        which = which if other.which is None else np.tile(other.which, n)
        # Motions, their scales and the hazard belong together.
        base, phrases = (self if self.motions else other), (*self.description, *other.description)
        units = {**self.units, **other.units}
        return replace(base, factors=factors, which=which, description=phrases, units=units)

    def column(self, name: str) -> np.ndarray:
        """Return the factors on one of `tpd.scene.conditions.FACTORS`, shape (n,)."""
        checks.one_of("name", name, FACTORS)
        return self.factors.get(name, np.ones(len(self)))

    def subset(self, most: checks.Whole, seed: checks.Whole = 0) -> Conditions:
        """Return at most `most` conditions: those nearest to the corners of the range of factors, and a
        seeded selection of the others."""
        most, seed, n = checks.count("most", most), checks.seed("seed", seed), len(self)
        if n <= most:
            return self
        # The worst condition is probably at a corner, where several factors are extreme at once.
        rows = np.array([v for v in self.factors.values() if np.ptp(v) > 0.0]).T
        unit = (rows - rows.min(axis=0)) / np.ptp(rows, axis=0)
        # The corners of the unit cube of the factors that vary.
        d = unit.shape[1]
        corners = np.stack(np.meshgrid(*[[0.0, 1.0]] * d, indexing="ij"), axis=-1).reshape(-1, d)
        nearest = {int(np.argmin(np.abs(unit - corner).sum(axis=1))) for corner in corners[: most // 2]}
        others = [i for i in np.random.default_rng([seed, 4]).permutation(n) if i not in nearest]
        chosen = np.sort([*nearest, *others[: most - len(nearest)]])
        phrase = f"{most} of {n} conditions: {', '.join(self.description)}"
        which = None if self.which is None else self.which[chosen]
        factors = {k: v[chosen] for k, v in self.factors.items()}
        return replace(self, factors=factors, description=(phrase,), which=which)

    @property
    def ranks(self) -> np.ndarray:
        """Position of every condition in an order by motions and factors, shape (n,).

        The order depends on the accelerations of the motions, and not on the order in which they are listed.
        """
        keys = self.factor_rows().T
        if self.which is not None:
            digests = np.unique([motion.digest for motion in self.motions], return_inverse=True)[1]
            keys = [*keys, digests[self.which]]
        return np.argsort(np.lexsort(keys))

    @property
    def _differing(self) -> tuple[str, ...]:
        return tuple(name for name, v in self.factors.items() if np.ptp(v) > 0.0)

    def label(self, i: int) -> str:
        """Return a label of the i-th condition.

        An example is "2.5 Hz and 1.1 times the amplitude". With three or more varied factors it is "2.45 Hz,
        1.1 x amplitude, friction x 0.93".
        """
        # With many factors a sentence would be too long.
        if len(self._differing) > 2:
            return self._sample(i)
        parts = []
        # A factor that is equal in all conditions belongs to the label as well, unless it is 1. Quantities
        # with a unit come first. After them a factor of 1 is left out.
        names = [name for name, v in self.factors.items() if np.any(v != 1.0)]
        for name in sorted(names, key=lambda n: n not in self.units):
            own, unit = self.units.get(name, (1.0, f"times the {name}"))
            if name in self.units or self.factors[name][i] != 1.0 or not parts:
                parts.append(f"{self.factors[name][i] * own:.4g} {unit}")
        return " and ".join(parts) if parts else "the scene's own shaking"

    def _sample(self, i: int) -> str:
        """Return a label of a condition with many factors: first the excitation, then the other
        quantities."""
        parts = []
        for name in sorted(self._differing, key=lambda n: (n != "frequency", n != "amplitude")):
            value = self.factors[name][i]
            if name in self.units:
                own, unit = self.units[name]
                parts.append(f"{value * own:.3g} {unit}")
            else:
                parts.append(f"{value:.3g} x amplitude" if name == "amplitude" else f"{name} x {value:.3g}")
        return ", ".join(parts)

    def factor_rows(self) -> Float[np.ndarray, "n 8"]:
        """Return all factors, a row for each condition and a column for each name."""
        return np.stack([self.column(name) for name in FACTORS], axis=1)

    @staticmethod
    def exactly() -> Conditions:
        """Return a single condition, the excitation of the scene."""
        return Conditions()

    @staticmethod
    def around(
        scene: Scene, frequency: checks.Real = 0.05, amplitude: checks.Real = 0.1, count: checks.Whole = 5
    ) -> Conditions:
        """Return the neighbourhood of the excitation of the scene.

        It consists of `count` frequencies within a relative half width, each at the amplitude of the scene
        and at an amplitude that is larger by the share `amplitude`.

        Raises:
            ValueError: a share is out of range, or the count is below two.
        """
        _check_scene(scene)
        frequency = checks.within("frequency", frequency, 1e-3, 0.5)
        amplitude = checks.within("amplitude", amplitude, 0.0, 1.0)
        count = checks.count("count", count, least=2)
        # Frequencies are stored as factors on the frequency of the scene.
        factors, own = 1.0 + frequency * np.linspace(-1.0, 1.0, count), scene.excitation.frequency
        low, high = own * (1.0 - frequency), own * (1.0 + frequency)
        phrase = f"{count} frequencies from {low:.3g} to {high:.3g} Hz"
        near = Conditions({"frequency": factors}, (phrase,), {"frequency": (own, "Hz")})
        return near * Conditions.amplitudes(1.0, 1.0 + amplitude) if amplitude else near

    @staticmethod
    def band(scene: Scene, low: checks.Real, high: checks.Real, count: checks.Whole = 20) -> Conditions:
        """Return frequencies from `low` to `high` in Hz, in equal ratios, at the displacement amplitude of
        the scene.

        Raises:
            ValueError: the bounds are not positive or not in order, or the count is below two.
        """
        _check_scene(scene)
        own = scene.excitation.frequency
        low, high = checks.interval("band", (low, high), 1e-6 * own, 1e6 * own)
        count = checks.count("count", count, least=2)
        phrase = f"{count} frequencies from {low:g} to {high:g} Hz"
        factors = {"frequency": np.geomspace(low, high, count) / own}
        return Conditions(factors, (phrase,), {"frequency": (own, "Hz")})

    @staticmethod
    def amplitudes(*factors: checks.Real) -> Conditions:
        """Return amplitudes of the excitation, as factors on that of the scene.

        Raises:
            ValueError: there is no factor, or a factor is not positive.
        """
        numbers = checks.array("factors", factors, (-1,), "one or more numbers")
        checks.positive("factors", numbers, every=True)
        phrase = f"amplitude factors {', '.join(f'{x:g}' for x in factors)}"
        return Conditions({"amplitude": numbers}, (phrase,))

    @staticmethod
    def records(
        motions: Sequence[Any],
        scales: checks.Vector = (1.0,),
        *,
        intensity: str = "pga_star",
        scatter: Mapping[str, HalfWidth] | None = None,
        samples: checks.Whole = 1,
        seed: checks.Whole = 0,
        hazard: Hazard | None = None,
    ) -> Conditions:
        """Return every ground motion at every intensity.

        Args:
            motions: records, pulses and harmonics. A harmonic becomes 40 periods from rest.
            scales: values of the intensity, above 0.
            intensity: measure of the scales: "pga_star" is PGA/(g tan alpha), "pgv_star" is p PGV/(g tan
                alpha), "pga" is PGA in g, "pgv" is PGV in m/s, "scale" is a factor on the motion.
            scatter: relative half widths of uncertain quantities, by a name of
                `tpd.scene.conditions.FACTORS`. Every condition has its own sample from one seeded Latin
                hypercube.
            samples: number of conditions for each motion and scale.
            seed: seed of the samples.
            hazard: seismic hazard of the site, with which results also state how often a year the block
                overturns.

        Raises:
            ValueError: there is no motion, a motion is zero, a scale is not positive, the intensity is
                unknown, or a half width is not allowed.
        """
        checks.instance("motions", motions, Sequence)
        # A ground motion has an end, so a harmonic becomes a train of sines.
        listed = tuple(train_of(m) if isinstance(m, Harmonic) else m for m in motions)
        if not listed:
            raise ValueError("`motions` must contain at least one ground motion, but is empty")
        for i, motion in enumerate(listed):
            checks.instance(f"motions[{i}]", motion, GroundMotion)
        refuse_zeros(listed)
        checks.one_of("intensity", intensity, tuple(MEASURES))
        listed_scales = np.atleast_1d(scales) if np.ndim(scales) == 0 else scales
        each = checks.array("scales", listed_scales, (-1,), "a vector of numbers")
        checks.plausible("the largest of `scales`", checks.positive("scales", each, every=True), intensity)
        samples, stated = checks.count("samples", samples), tuple(map(float, each))
        seed, scatter = checks.seed("seed", seed), {} if scatter is None else scatter
        checks.optional("hazard", hazard, Hazard)
        checks.instance("scatter", scatter, Mapping)
        # The motion varies slowest, so that the runs of one record are neighbours in the batch.
        each = np.repeat(each, samples)
        factors = {"amplitude": np.tile(each, len(listed))}
        stripes = ", ".join(f"{x:g}" for x in stated)
        motions = "1 ground motion" if len(listed) == 1 else f"{len(listed)} ground motions, each"
        phrase = f"{motions} at {stripes} ({MEASURES[intensity]})"
        which = np.repeat(np.arange(len(listed)), len(each))
        out = Conditions(factors, (phrase,), {}, listed, which, intensity, stated, hazard=hazard)
        if not scatter:
            return out
        phrase += f" with scatter of {', '.join(scatter)} (seed {seed})"
        return replace(out.scattered(seed, **scatter), description=(phrase,))

    def scattered(self, seed: checks.Whole, **half_widths: HalfWidth) -> Conditions:
        """Return the conditions with a sample of uncertain factors for each of them, see `scatter`."""
        if not half_widths:
            return self
        sample, ranks = Conditions.scatter(len(self), seed, **half_widths), self.ranks
        factors = {name: self.column(name) * x[ranks] for name, x in sample.factors.items()}
        return replace(self, factors={**self.factors, **factors})

    @staticmethod
    def scatter(size: checks.Whole, seed: checks.Whole = 0, **half_widths: HalfWidth) -> Conditions:
        """Return samples of uncertain factors from a seeded Latin hypercube.

        Each factor is uniform between 1 - w and 1 + w. The half widths w are passed by name in `FACTORS`:
        manufacture (mass, length, damping), block (friction, slenderness, restitution) and excitation
        (amplitude, frequency).

        Raises:
            ValueError: a name is unknown, a half width is not between 0 and 0.5, or the size is below one.
        """
        size, seed = checks.count("size", size), checks.seed("seed", seed)
        if unknown := [name for name in half_widths or ("nothing",) if name not in FACTORS]:
            raise ValueError(f"half widths must be of {', '.join(FACTORS)}, but are of {', '.join(unknown)}")
        half_widths = check_half_widths(half_widths)
        # Draw a column for every name, so that the samples of one quantity do not depend on which others
        # vary.
        unit = latin_hypercube(np.random.default_rng(seed), size, len(FACTORS), axis_by_axis=True)
        every = factors_at(unit, {name: half_widths.get(name, 0.0) for name in FACTORS})
        factors = {name: x for name, x in every.items() if name in half_widths}
        widths = ", ".join(
            str(w) if isinstance(w, Normal) else f"{n} within {w:.0%}" for n, w in half_widths.items()
        )
        return Conditions(factors, (f"{size} samples of {widths or 'nothing'} (seed {seed})",))


def _check_scene(scene: object) -> None:
    """Raise `ValueError` unless the argument is a scene with a harmonic, whose frequency the conditions
    vary."""
    checks.instance("scene", scene, Scene)
    checks.instance("excitation", scene.excitation, Harmonic, ": see `Conditions.records`")  # type: ignore[attr-defined]


def check_restitution(scene: Scene, *, in_runs: bool = False) -> None:
    """Raise `ValueError` unless the restitution of the block of a scene can vary.

    Housner's restitution can vary only in runs, because the gradients of a search follow Housner's formula.
    """
    own = scene.block.restitution
    if own == 1.0 or (isinstance(own, str) and not in_runs):
        value = f"{own!r}, which follows from the block" if isinstance(own, str) else "1, which is no loss"
        raise ValueError(f"`restitution` can vary only if it is a number below 1, but it is {value}")


def under(p: Parameters, design: Any, factors: Any) -> Parameters:
    """Return the parameters of one design (mu, lam, zeta), along the first axis, under one condition.

    The factors of the condition are in the order of `FACTORS`. The amplitude of the base displacement does
    not change with the frequency, so f is proportional to the square of the frequency factor. If rho
    follows from nu, and e from nu, rho and mu, they also do so here, but xi does not change with them. e is
    at most 1, because an impact adds no energy.
    """
    amplitude, frequency, friction, slenderness, mass, length, damping, restitution = factors
    # e follows the other parameters if it is None, and then has no factor of its own.
    ratio = None if p.e is None else p.e * restitution
    return Parameters(
        nu=p.nu * slenderness,
        mu=design[0] * mass,
        lam=design[1] * length,
        zeta=design[2] * damping,
        k=p.k * friction,
        f=p.f * amplitude * frequency**2,
        xi=p.xi * frequency,
        rho=p.rho,
        # `where` instead of a minimum: the derivative of a minimum is one half if both values are equal.
        e=None if ratio is None else checks.namespace(ratio).where(ratio > 1.0, 1.0, ratio),
        kappa=p.kappa,
    )


def under_all(p: Parameters, designs: Any, conditions: Conditions) -> Parameters:
    """Return the parameters of m designs under all n conditions: leaves (m n,), the conditions vary
    fastest."""
    rows = np.tile(conditions.factor_rows(), (len(designs), 1))
    return under_each(p, np.repeat(designs, len(conditions), axis=0).T, rows.T)


def under_each(p: Parameters, designs: Any, factors: np.ndarray) -> Parameters:
    """Return the parameters of n designs (3, n), each under its own condition: leaves (n,).

    Args:
        p: dimensionless parameters.
        designs: (mu, lam, zeta) along the first axis.
        factors: factors in the order of `FACTORS` along the first axis. A factor 1 + d of restitution adds d
            to Housner's e, because measurements state the difference from it. The sum is at least 0, and
            at most 0.999 unless Housner's e is larger.
    """
    # All leaves need the same length, so rho and e become numbers. They may differ between conditions.
    q = under(p, designs, factors)
    e = np.asarray(q.velocity_ratio)
    # A number e has its factor already. No impact throws the block back, and each one loses energy: a block
    # without any loss would never come to rest.
    e = np.clip(e + (factors[-1] - 1.0), 0.0, np.maximum(e, 0.999)) if q.e is None else e
    values = {**vars(q), "rho": q.inertia_ratio, "e": e}
    leaves: dict[str, Any] = {n: np.broadcast_to(x, factors.shape[1]) for n, x in values.items()}
    return Parameters(**leaves)


def latin_hypercube(
    rng: np.random.Generator, size: int, dimensions: int, *, axis_by_axis: bool = False
) -> np.ndarray:
    """Return points in the unit cube, shape (size, dimensions), one in each of `size` strata along every
    axis.

    With `axis_by_axis` the generator draws strata and positions of one axis before those of the next axis, so
    the first axes do not depend on the number of axes. Without it, all strata are drawn before all
    positions.
    """
    # Both orders are needed: stored results depend on the points of a seed.
    if axis_by_axis:
        axes = [rng.permutation(size) + rng.random(size) for _ in range(dimensions)]
        return np.stack(axes, axis=1) / size
    strata = np.stack([rng.permutation(size) for _ in range(dimensions)], axis=1)
    return (strata + rng.random((size, dimensions))) / size


def check_half_widths(half_widths: Mapping[str, Any]) -> dict[str, Any]:
    """Return relative half widths; raise `ValueError` unless each of them is between 0 and 0.5."""
    # A normal distribution is one of this package, such as `MEASURED`, and needs no check.
    return {
        name: width if isinstance(width, Normal) else checks.within(name, width, 0.0, MOST_SCATTER)
        for name, width in half_widths.items()
    }


def check_reach(spread: Any) -> None:
    """Convert the ranges of the initial states of an object to floats; raise `ValueError` if one is negative
    or too large."""
    checks.set_checked(spread, checks.not_negative, "tilt tilt_rate swing swing_rate")
    checks.at_most("tilt", spread.tilt, 1.0, "a block that stands on its corner")
    checks.at_most("swing", spread.swing, 0.5 * np.pi, "a right angle in rad")
    fastest = "ten times the rate that overturns a block or a bob"
    for name in ("tilt_rate", "swing_rate"):
        checks.at_most(name, getattr(spread, name), FASTEST, fastest)


def factors_at(unit: np.ndarray, half_widths: Mapping[str, HalfWidth]) -> dict[str, np.ndarray]:
    """Return factors on uncertain quantities by name, each uniform between 1 - w and 1 + w, or normal.

    Args:
        unit: points in the unit cube, shape (size, len(half_widths)), one column for each name in order.
        half_widths: half width w of every uncertain quantity, or its normal distribution, by name.
    """
    return {
        n: w.factors(unit[:, i]) if isinstance(w, Normal) else 1.0 + w * (2.0 * unit[:, i] - 1.0)
        for i, (n, w) in enumerate(half_widths.items())
    }
