"""Under what a design is judged: a band of frequencies, several amplitudes, uncertain numbers, and every
combination of them, each a factor on the scene's own value."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field

import jax.numpy as jnp
import numpy as np
from jaxtyping import Array, Float

from tpd.core import checks
from tpd.core.parameters import Parameters
from tpd.core.scene import Scene

FACTORS = ("amplitude", "frequency", "friction", "slenderness", "mass", "length", "damping")
"""What can differ: amplitude and frequency of the base motion, k, nu, and the pendulum's m, l and zeta."""
_MOST_SCATTER = 0.5
"""Largest relative half width of what is uncertain."""


@dataclass(frozen=True)
class Conditions:
    """A set of n conditions: for each of `FACTORS` that differs a vector of n factors.

    `Conditions.band(...) * Conditions.scatter(...)` is every one of the first under every one of the
    second.
    """

    factors: Mapping[str, np.ndarray] = field(default_factory=dict)
    description: tuple[str, ...] = ()
    """What they are, a phrase each."""
    units: Mapping[str, tuple[float, str]] = field(default_factory=dict)
    """Of factors that have one: the scene's own value, and its unit."""

    def __len__(self) -> int:
        return max((len(v) for v in self.factors.values()), default=1)

    def __mul__(self, other: Conditions) -> Conditions:
        n, m = len(self), len(other)
        names = {*self.factors, *other.factors}
        both = {
            name: np.repeat(self.column(name), m) * np.tile(other.column(name), n)
            for name in FACTORS
            if name in names
        }
        return Conditions(both, (*self.description, *other.description), {**self.units, **other.units})

    def column(self, name: str) -> np.ndarray:
        """The factors on one of `FACTORS`, shape (n,): ones where it does not differ."""
        return np.asarray(self.factors.get(name, np.ones(len(self))), dtype=float)

    def subset(self, most: int, seed: int = 0) -> Conditions:
        """At most so many of them: those nearest to the corners of what they span, where the worst is likely
        to be, and a seeded choice of the others."""
        n = len(self)
        if n <= most:
            return self
        rows = np.array([v for v in self.factors.values() if np.ptp(v) > 0.0]).T
        unit = (rows - rows.min(axis=0)) / np.ptp(rows, axis=0)
        d = unit.shape[1]
        corners = np.stack(np.meshgrid(*[[0.0, 1.0]] * d, indexing="ij"), axis=-1).reshape(-1, d)
        nearest = {int(np.argmin(np.abs(unit - corner).sum(axis=1))) for corner in corners[: most // 2]}
        others = [i for i in np.random.default_rng([seed, 4]).permutation(n) if i not in nearest]
        chosen = np.sort([*nearest, *others[: most - len(nearest)]])
        told = f"{most} of {n} conditions: {', '.join(self.description)}"
        return Conditions({k: v[chosen] for k, v in self.factors.items()}, (told,), self.units)

    @property
    def axis(self) -> str | None:
        """What the conditions differ in, if it is one thing: the axis of a picture."""
        differ = [name for name, v in self.factors.items() if np.ptp(v) > 0.0]
        return differ[0] if len(differ) == 1 else None

    def label(self, i: int) -> str:
        """Label of the i-th condition, such as "2.5 Hz and 1.1 times the amplitude"."""
        differ = [name for name, v in self.factors.items() if np.ptp(v) > 0.0]
        if len(differ) > 2:
            return f"sample {i}"
        parts = []
        for name in differ:
            own, unit = self.units.get(name, (1.0, f"times the {name}"))
            parts.append(f"{self.factors[name][i] * own:.4g} {unit}")
        return " and ".join(parts) if parts else "the scene's own shaking"

    def factor_rows(self) -> Float[Array, "n 7"]:
        """All factors, in the order of `FACTORS`."""
        return jnp.stack([jnp.asarray(self.column(name)) for name in FACTORS], axis=1)

    @staticmethod
    def band(scene: Scene, low: float, high: float, count: int = 20) -> Conditions:
        """Frequencies from `low` to `high` in Hz, in equal ratios; the base's amplitude stays.

        Raises:
            ValueError: bounds that are not positive and in order, or a count below two.
        """
        checks.interval("band", (low, high), 1e-6 * scene.motion.frequency, 1e6 * scene.motion.frequency)
        checks.count("count", count, least=2)
        told, own = f"{count} frequencies from {low:g} to {high:g} Hz", scene.motion.frequency
        return Conditions(
            {"frequency": np.geomspace(low, high, count) / own}, (told,), {"frequency": (own, "Hz")}
        )

    @staticmethod
    def amplitudes(*factors: float) -> Conditions:
        """Amplitudes of the base motion, as factors on the scene's.

        Raises:
            ValueError: none, or one that is not positive.
        """
        if not factors:
            raise ValueError("`factors` must hold at least one number, but is empty")
        checks.positive("factors", np.array(factors, dtype=float))
        told = f"amplitudes {', '.join(f'{x:g}' for x in factors)} times the scene's"
        return Conditions({"amplitude": np.array(factors, dtype=float)}, (told,))

    @staticmethod
    def scatter(size: int, seed: int = 0, **half_widths: float) -> Conditions:
        """A seeded Latin hypercube of uncertain factors, each even between 1 - w and 1 + w: manufacturing
        (mass, length, damping), the block (friction, slenderness) and the shaking (amplitude, frequency).

        Raises:
            ValueError: an unknown name, a width beyond 0 to 0.5, or a size below one.
        """
        checks.count("size", size)
        checks.count("seed", seed, least=0)
        unknown = [name for name in half_widths if name not in FACTORS]
        if unknown:
            raise ValueError(f"what scatters must be of {', '.join(FACTORS)}, but has {', '.join(unknown)}")
        rng, factors = np.random.default_rng(seed), {}
        for name in FACTORS:
            # Drawn whether it is used or not: the others' draws do not depend on it.
            unit = (rng.permutation(size) + rng.random(size)) / size
            if name in half_widths:
                checks.within(name, half_widths[name], 0.0, _MOST_SCATTER)
                factors[name] = 1.0 + half_widths[name] * (2.0 * unit - 1.0)
        widths = ", ".join(f"{n} within {w:.0%}" for n, w in half_widths.items())
        return Conditions(factors, (f"{size} samples of {widths or 'nothing'} (seed {seed})",))


def under(p: Parameters, design: Float[Array, "3 *n"], factors: Float[Array, "7 *n"]) -> Parameters:
    """The parameters of one design (mu, lam, zeta) under one condition. A frequency moves f with its
    square, since the base's amplitude stays; where rho is tied to nu it follows."""
    amplitude, frequency, friction, slenderness, mass, length, damping = factors
    return Parameters(
        nu=p.nu * slenderness,
        mu=design[0] * mass,
        lam=design[1] * length,
        zeta=design[2] * damping,
        k=p.k * friction,
        f=p.f * amplitude * frequency**2,
        xi=p.xi * frequency,
        rho=p.rho,
        e=p.e,
    )


def under_all(p: Parameters, designs: Float[Array, "m 3"], conditions: Conditions) -> Parameters:
    """The parameters of m designs under all n conditions: leaves (m n,), conditions running fastest."""
    n = len(conditions)
    rows = jnp.tile(conditions.factor_rows(), (len(designs), 1))
    each = jnp.repeat(jnp.asarray(designs), n, axis=0)
    q = under(p, each.T, rows.T)
    names = ("nu", "mu", "lam", "zeta", "k", "f", "xi", "e")
    whole = {name: jnp.broadcast_to(jnp.asarray(getattr(q, name)), len(rows)) for name in names}
    return Parameters(**whole, rho=jnp.broadcast_to(jnp.asarray(q.inertia_ratio), len(rows)))
