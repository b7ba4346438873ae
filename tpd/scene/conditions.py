"""Conditions that a design is evaluated under: a band of frequencies, several amplitudes, uncertain numbers,
ground motions, and combinations of these. Each condition is a set of factors on the scene's own values, and
may have a ground motion of its own."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field, replace
from typing import Any

import numpy as np
from jaxtyping import Float

from tpd.core import checks
from tpd.scene.ground_motion import GroundMotion, Pulse, refuse_zeros
from tpd.scene.parameters import Parameters
from tpd.scene.scene import Harmonic, Scene

FACTORS = ("amplitude", "frequency", "friction", "slenderness", "mass", "length", "damping", "restitution")
"""Numbers that can differ: amplitude and frequency of the base motion, k, nu, the pendulum's m, l and zeta,
and e. Seeded samples depend on the order: a new name comes last."""

HARMONIC_PERIODS = 40
"""Periods that a harmonic among ground motions lasts."""
FASTEST = 10.0
"""Largest rate of an initial state: phi' in shares of nu, psi' in rad per unit tau."""
MOST_SCATTER = 0.5
"""Largest relative half width of an uncertain number."""
MEASURES = {
    "pga_star": "PGA over g tan(alpha), 1 = the acceleration that lifts the block",
    "pgv_star": "p PGV over g tan(alpha)",
    "pga": "PGA in m/s^2",
    "pga_g": "PGA in g",
    "pgv": "PGV in m/s",
    "scale": "factor on each motion",
}
"""Measures that the scales of ground motions can count: names of `tpd.records.intensity`, in words."""


@dataclass(frozen=True)
class Conditions:
    """A set of n conditions. `Conditions()` is one condition, the scene's own shaking.

    `Conditions.band(...) * Conditions.scatter(...)` combines every condition of the first set with every
    condition of the second.
    """

    factors: Mapping[str, np.ndarray] = field(default_factory=dict)
    """Factors on the scene's own values by name in `FACTORS`, shape (n,) each; a name left out is 1."""
    description: tuple[str, ...] = ()
    """Phrases that describe the set, one for each set that was combined."""
    units: Mapping[str, tuple[float, str]] = field(default_factory=dict)
    """The scene's own value and its unit, by name, of factors that have one."""
    motions: tuple[GroundMotion, ...] = ()
    """Ground motions; empty where all conditions have the scene's harmonic."""
    which: np.ndarray | None = None
    """Index of the ground motion of every condition, shape (n,)."""
    intensity: str = "scale"
    """Name in `tpd.records.intensity` of what the amplitude of a ground motion counts."""
    scales: tuple[float, ...] = ()
    """Values of the intensity that every ground motion is scaled to."""

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
        lengths = sorted({len(values) for values in (*self.factors.values(), *self._chosen)})
        if len(lengths) > 1:
            raise ValueError(f"`factors` must be of one length, but have lengths {lengths}")

    def __len__(self) -> int:
        return max((len(v) for v in (*self.factors.values(), *self._chosen)), default=1)

    @property
    def _chosen(self) -> tuple[np.ndarray, ...]:
        return () if self.which is None else (self.which,)

    def __mul__(self, other: Conditions) -> Conditions:
        if not isinstance(other, Conditions):
            return NotImplemented
        n, m = len(self), len(other)
        if self.motions and other.motions:
            raise ValueError("only one of two sets of conditions can have ground motions, but both have")
        names = {*self.factors, *other.factors}
        # Factors multiply where both sets have one, such as two uncertainties of the amplitude.
        factors = {
            n_: np.repeat(self.column(n_), m) * np.tile(other.column(n_), n) for n_ in FACTORS if n_ in names
        }
        # As for the factors, the second set varies fastest.
        which = None if self.which is None else np.repeat(self.which, m)
        which = which if other.which is None else np.tile(other.which, n)
        return Conditions(
            factors,
            (*self.description, *other.description),
            {**self.units, **other.units},
            self.motions or other.motions,
            which,
            self.intensity if self.motions else other.intensity,
            self.scales or other.scales,
        )

    def column(self, name: str) -> np.ndarray:
        """Factors on one of `FACTORS`, shape (n,)."""
        checks.one_of("name", name, FACTORS)
        return self.factors.get(name, np.ones(len(self)))

    def subset(self, most: checks.Whole, seed: checks.Whole = 0) -> Conditions:
        """Return at most `most` conditions: those nearest to the corners of the range of factors, and a
        seeded choice of the others."""
        most, seed, n = checks.count("most", most), checks.seed("seed", seed), len(self)
        if n <= most:
            return self
        # The worst condition is likely to be at a corner, where several factors are extreme at once.
        rows = np.array([v for v in self.factors.values() if np.ptp(v) > 0.0]).T
        unit = (rows - rows.min(axis=0)) / np.ptp(rows, axis=0)
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
    def axis(self) -> str | None:
        """Name of the factor in which the conditions differ, or None unless it is exactly one."""
        differ = self._differing
        return differ[0] if len(differ) == 1 else None

    @property
    def _differing(self) -> tuple[str, ...]:
        return tuple(name for name, v in self.factors.items() if np.ptp(v) > 0.0)

    def label(self, i: int) -> str:
        """Label of the i-th condition, such as "2.5 Hz and 1.1 times the amplitude"; of three factors
        or more "2.45 Hz, 1.1 x amplitude, friction x 0.93"."""
        if len(self._differing) > 2:
            return self._sample(i)
        parts = []
        # A factor that is the same in all conditions still belongs to the label, unless it is 1. Quantities
        # with a unit come first, and beside them a factor of 1 says nothing.
        moved = [name for name, v in self.factors.items() if np.any(v != 1.0)]
        for name in sorted(moved, key=lambda n: n not in self.units):
            own, unit = self.units.get(name, (1.0, f"times the {name}"))
            if name in self.units or self.factors[name][i] != 1.0 or not parts:
                parts.append(f"{self.factors[name][i] * own:.4g} {unit}")
        return " and ".join(parts) if parts else "the scene's own shaking"

    def _sample(self, i: int) -> str:
        """Label of a condition of many factors: the shaking first, then what scatters."""
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
        """All factors: one row for each condition, columns in the order of `FACTORS`."""
        return np.stack([self.column(name) for name in FACTORS], axis=1)

    @staticmethod
    def exactly() -> Conditions:
        """One condition: the scene's own shaking."""
        return Conditions()

    @staticmethod
    def around(
        scene: Scene, frequency: checks.Real = 0.05, amplitude: checks.Real = 0.1, count: checks.Whole = 5
    ) -> Conditions:
        """Neighbourhood of the scene's own shaking: `count` frequencies within a relative half width, each
        at the scene's amplitude and at one larger by the share `amplitude`.

        Raises:
            ValueError: a share out of range, or a count below two.
        """
        _check_scene(scene)
        frequency = checks.within("frequency", frequency, 1e-3, 0.5)
        amplitude = checks.within("amplitude", amplitude, 0.0, 1.0)
        count = checks.count("count", count, least=2)
        factors, own = 1.0 + frequency * np.linspace(-1.0, 1.0, count), scene.motion.frequency
        low, high = own * (1.0 - frequency), own * (1.0 + frequency)
        phrase = f"{count} frequencies from {low:.3g} to {high:.3g} Hz"
        near = Conditions({"frequency": factors}, (phrase,), {"frequency": (own, "Hz")})
        return near * Conditions.amplitudes(1.0, 1.0 + amplitude) if amplitude else near

    @staticmethod
    def band(scene: Scene, low: checks.Real, high: checks.Real, count: checks.Whole = 20) -> Conditions:
        """Frequencies from `low` to `high` in Hz, in equal ratios, at the scene's amplitude of displacement.

        Raises:
            ValueError: bounds that are not positive and in order, or a count below two.
        """
        _check_scene(scene)
        own = scene.motion.frequency
        low, high = checks.interval("band", (low, high), 1e-6 * own, 1e6 * own)
        count = checks.count("count", count, least=2)
        phrase = f"{count} frequencies from {low:g} to {high:g} Hz"
        factors = {"frequency": np.geomspace(low, high, count) / own}
        return Conditions(factors, (phrase,), {"frequency": (own, "Hz")})

    @staticmethod
    def amplitudes(*factors: checks.Real) -> Conditions:
        """Amplitudes of the base motion, as factors on the scene's.

        Raises:
            ValueError: no factor, or a factor that is not positive.
        """
        if not factors:
            raise ValueError("`factors` must hold at least one number, but is empty")
        factors = tuple(checks.positive("factors", factor) for factor in factors)
        phrase = f"amplitudes {', '.join(f'{x:g}' for x in factors)} times the scene's"
        return Conditions({"amplitude": np.array(factors, dtype=float)}, (phrase,))

    @staticmethod
    def records(
        motions: Sequence[Any],
        scales: checks.Vector = (1.0,),
        *,
        intensity: str = "pga_star",
        scatter: Mapping[str, float] | None = None,
        samples: checks.Whole = 1,
        seed: checks.Whole = 0,
    ) -> Conditions:
        """Every ground motion at every intensity.

        Args:
            motions: records, pulses and harmonics; of a harmonic 40 periods from rest.
            scales: values of the intensity, above 0.
            intensity: what the scales count: "pga_star" is PGA/(g tan alpha), "pgv_star" p PGV/(g tan alpha),
                "pga" and "pgv" are in m/s^2 and m/s, "pga_g" is PGA in g, "scale" is a factor on the motion
                as it is.
            scatter: relative half widths of uncertain numbers by name in `FACTORS`; every condition has a
                sample of its own from one seeded Latin hypercube.
            samples: conditions for each motion and scale.
            seed: of the samples.

        Raises:
            ValueError: no motion, a motion of zeros, a scale that is not positive, an unknown intensity, or a
                bad scatter.
        """
        checks.instance("motions", motions, Sequence)
        # A motion ends: of a harmonic a train of sines.
        listed = tuple(
            Pulse.sine_train(
                acceleration=m.amplitude * m.rate**2, frequency=m.frequency, cycles=HARMONIC_PERIODS
            )
            if isinstance(m, Harmonic)
            else m
            for m in motions
        )
        if not listed:
            raise ValueError("`motions` must hold at least one ground motion, but is empty")
        for i, motion in enumerate(listed):
            checks.instance(f"motions[{i}]", motion, GroundMotion)
        refuse_zeros(listed)
        checks.one_of("intensity", intensity, tuple(MEASURES))
        listed_scales = np.atleast_1d(scales) if np.ndim(scales) == 0 else scales
        each = checks.array("scales", listed_scales, (-1,), "a vector of numbers")
        checks.positive("scales", each, every=True)
        samples, stated = checks.count("samples", samples), tuple(map(float, each))
        seed, scatter = checks.seed("seed", seed), {} if scatter is None else scatter
        checks.instance("scatter", scatter, Mapping)
        # The motion varies slowest, so that runs of one record stand together in the batch.
        each = np.repeat(each, samples)
        factors = {"amplitude": np.tile(each, len(listed))}
        stripes = ", ".join(f"{x:g}" for x in stated)
        phrase = f"{len(listed)} ground motions, each at {stripes} ({MEASURES[intensity]})"
        if scatter:
            drawn = Conditions.scatter(len(factors["amplitude"]), seed, **scatter)
            amplitude = factors["amplitude"] * drawn.column("amplitude")
            factors = {**drawn.factors, "amplitude": amplitude}
            phrase += f" with scatter of {', '.join(scatter)} (seed {seed})"
        which = np.repeat(np.arange(len(listed)), len(each))
        return Conditions(factors, (phrase,), {}, listed, which, intensity, stated)

    @staticmethod
    def scatter(size: checks.Whole, seed: checks.Whole = 0, **half_widths: checks.Real) -> Conditions:
        """A seeded Latin hypercube of uncertain factors, each uniform between 1 - w and 1 + w, with w given
        by name in `FACTORS`: manufacturing (mass, length, damping), the block (friction, slenderness,
        restitution) and the shaking (amplitude, frequency).

        Raises:
            ValueError: an unknown name, a width beyond 0 to 0.5, or a size below one.
        """
        size, seed = checks.count("size", size), checks.seed("seed", seed)
        if unknown := [name for name in half_widths or ("nothing",) if name not in FACTORS]:
            raise ValueError(f"what scatters must be of {', '.join(FACTORS)}, but has {', '.join(unknown)}")
        half_widths = check_half_widths(half_widths)
        # Every name has its column, used or not, so that the draws of one name do not depend on the others.
        unit = latin_hypercube(np.random.default_rng(seed), size, len(FACTORS), axis_by_axis=True)
        used = [name for name in FACTORS if name in half_widths]
        columns = unit[:, [FACTORS.index(name) for name in used]]
        factors = factors_at(columns, {name: half_widths[name] for name in used})
        widths = ", ".join(f"{n} within {w:.0%}" for n, w in half_widths.items())
        return Conditions(factors, (f"{size} samples of {widths or 'nothing'} (seed {seed})",))


def _check_scene(scene: object) -> None:
    """Raise `ValueError` for what has no frequency that conditions could vary."""
    checks.instance("scene", scene, Scene)
    checks.instance("motion", scene.motion, Harmonic, ": see `Conditions.records`")  # type: ignore[attr-defined]


def check_restitution(scene: Scene) -> None:
    """Raise `ValueError` unless the block of a scene has a restitution that can scatter."""
    own = scene.block.restitution
    if isinstance(own, str) or own == 1.0:
        why = f"{own!r}, which follows the block's shape" if isinstance(own, str) else "1, which is no loss"
        raise ValueError(f"`restitution` can scatter where it is a number below 1, but it is {why}")


def under(p: Parameters, design: Any, factors: Any) -> Parameters:
    """Return the parameters of one design (mu, lam, zeta), along the first axis, under one condition, whose
    factors are in the order of `FACTORS`.

    The base's amplitude of displacement stays, so f goes with the square of the frequency's factor. rho
    follows nu, and e follows nu, rho and mu, where they are tied; xi does not. e stays at most 1: an impact
    adds no energy.
    """
    amplitude, frequency, friction, slenderness, mass, length, damping, restitution = factors
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
        # Not a minimum, whose derivative is a half where both are equal.
        e=None if ratio is None else checks.namespace(ratio).where(ratio > 1.0, 1.0, ratio),
    )


def under_all(p: Parameters, designs: Any, conditions: Conditions) -> Parameters:
    """Return the parameters of m designs under all n conditions: leaves (m n,), the conditions varying
    fastest."""
    # rho and e become numbers here: each condition may have its own, and all leaves need the same length.
    n = len(conditions)
    rows = np.tile(conditions.factor_rows(), (len(designs), 1))
    q = under(p, np.repeat(designs, n, axis=0).T, rows.T)
    values = {**vars(q), "rho": q.inertia_ratio, "e": q.velocity_ratio}
    leaves: dict[str, Any] = {n: np.broadcast_to(np.asarray(x), len(rows)) for n, x in values.items()}
    return Parameters(**leaves)


def latin_hypercube(
    rng: np.random.Generator, size: int, dimensions: int, *, axis_by_axis: bool = False
) -> np.ndarray:
    """Points in the unit cube, shape (size, dimensions): along every axis one in each of `size` strata.

    With `axis_by_axis` the generator gives strata and places of one axis before those of the next, so that
    the first axes do not depend on the number of axes. Without it, all strata come before all places.
    """
    # Both orders stay: stored results depend on the points that a seed gives.
    if axis_by_axis:
        axes = [rng.permutation(size) + rng.random(size) for _ in range(dimensions)]
        return np.stack(axes, axis=1) / size
    strata = np.stack([rng.permutation(size) for _ in range(dimensions)], axis=1)
    return (strata + rng.random((size, dimensions))) / size


def check_half_widths(half_widths: Mapping[str, float]) -> dict[str, float]:
    """Return relative half widths; raise `ValueError` unless every one is between 0 and 0.5."""
    return {name: checks.within(name, width, 0.0, MOST_SCATTER) for name, width in half_widths.items()}


def check_reach(spread: Any) -> None:
    """Turn the spreads of initial states of an object into floats; raise `ValueError` for one that is
    negative or too large."""
    checks.set_checked(spread, checks.not_negative, "tilt tilt_rate swing swing_rate")
    checks.at_most("tilt", spread.tilt, 1.0, "a block that stands on its corner")
    checks.at_most("swing", spread.swing, 0.5 * np.pi, "a right angle in rad")
    for name in ("tilt_rate", "swing_rate"):
        checks.at_most(
            name, getattr(spread, name), FASTEST, "ten times the rate that overturns a block or a bob"
        )


def factors_at(unit: np.ndarray, half_widths: Mapping[str, float]) -> dict[str, np.ndarray]:
    """Factors on uncertain numbers, each uniform between 1 - w and 1 + w, by name.

    Args:
        unit: places in the unit cube, shape (size, len(half_widths)), one column for each name in order.
        half_widths: w of every uncertain number, by name.
    """
    return {n: 1.0 + w * (2.0 * unit[:, i] - 1.0) for i, (n, w) in enumerate(half_widths.items())}
