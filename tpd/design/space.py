"""Design space: bounds of the search, and distances between designs in shares of the logarithmic bounds."""

from __future__ import annotations

from collections.abc import Iterable
from dataclasses import dataclass, replace
from typing import Any

import numpy as np

from tpd.core import checks
from tpd.scene.conditions import Conditions, check_restitution, latin_hypercube
from tpd.scene.parameters import HIGHEST_HINGE, HIGHEST_RATIO
from tpd.scene.scene import HEAVIEST, LARGEST_DAMPING, LENGTHS, Block, Scene, check_excitation

HEAVIEST_RATIO = 1.0
"""Largest mass ratio m/M. A bob inside the block is not heavier than the block."""
Bounds = checks.Real | tuple[float, float]
"""Bounds of a search: one number, which fixes the value, or a lower and an upper bound."""
TWINS = {"mass": "mass_ratio", "length": "length_ratio"}
"""Fields of a design space in SI units, with the ratio that states the same quantity."""
USUAL_BOUNDS = {"mass_ratio": (0.01, 0.2), "length_ratio": (0.1, 1.5)}
"""Default bounds of the ratios."""
_RANGES = {
    "mass_ratio": (0.0, HEAVIEST_RATIO),
    "length_ratio": (1e-3, HIGHEST_RATIO),
    "damping_ratio": (0.0, LARGEST_DAMPING),
    "mass": (0.0, HEAVIEST),
    "length": LENGTHS,
}
"""Largest ranges of a design space."""
_LINEAR_SHARE = 0.01
"""Share of an upper bound below which shares of the bounds are no longer logarithmic."""


@checks.keywords
@dataclass(frozen=True, kw_only=True)
class DesignSpace:
    """Bounds of the search. Each field is one number, which fixes the value, or a pair of bounds.

    Mass and length are those of the equivalent point pendulum: a point mass, and its distance from the hinge.
    The body as built is heavier and hangs on a shorter rod. To limit the mass of the body, use
    `tpd.limits.Mass`, or in a job file the key `mass` of [limits].

    The fields are the ratios `mass_ratio` (m/M), `length_ratio` (l/b) and `damping_ratio` (zeta), without
    unit, and instead of the first two `mass` in kg and `length` in m. `hinge_height` in m is one number. It
    is no variable of the search, because a higher hinge is better under earthquakes.

    Raises:
        ValueError: a bound is out of range, bounds are reversed or equal, a ratio is given together with its
            value in SI units, or all three values are fixed.

    Example:
        >>> import tpd
        >>> space = tpd.DesignSpace(mass_ratio=(0.02, 0.1), damping_ratio=(0.05, 0.5))
        >>> space.names, space.length_ratio
        (('mu', 'lam', 'zeta'), (0.1, 1.5))
    """

    mass_ratio: Bounds | None = None
    """Ratio m/M of the point mass of the bob to the mass of the block: one fixed number, or two bounds
    (default 0.01 0.2)."""
    length_ratio: Bounds | None = None
    """Ratio l/b of the length of the pendulum to the height of the block's centroid: one fixed number, or two
    bounds (default 0.1 1.5)."""
    damping_ratio: Bounds = (0.05, 0.6)
    """Damping ratio zeta of the hinge: one fixed number, or two bounds."""
    mass: Bounds | None = None
    """Mass of the equivalent point in kg, instead of the mass ratio: one fixed number, or two bounds (the
    heavier body as built is limited by `mass` in [limits])."""
    length: Bounds | None = None
    """Length of the equivalent point pendulum in m, instead of the length ratio: one fixed number, or two
    bounds (the rod of the body as built is shorter)."""

    hinge_height: checks.Real | None = None
    """Height of the hinge above the base in m, up to twice the height of the block (default: its top)."""

    def __post_init__(self) -> None:
        for name, ratio in TWINS.items():
            in_si, as_ratio = getattr(self, name), getattr(self, ratio)
            if in_si is not None and as_ratio is not None:
                raise ValueError(f"`{name}` and `{ratio}` state the same quantity: give only one of them")
            if in_si is None and as_ratio is None:
                object.__setattr__(self, ratio, USUAL_BOUNDS[ratio])
        names = [x for x in _RANGES if x == "damping_ratio" or getattr(self, x) is not None]
        for name in names:
            # A pendulum needs a mass and a length, but not a damper: only the damping ratio may be zero.
            number = checks.within if name == "damping_ratio" else checks.positive
            check = number if np.asarray(getattr(self, name), object).size == 1 else checks.interval
            checks.set_checked(self, check, name, *_RANGES[name])
        if self.hinge_height is not None:
            checks.set_checked(self, checks.positive, "hinge_height", *LENGTHS)
        if not any(isinstance(getattr(self, name), tuple) for name in names):
            raise ValueError(
                "a search needs two bounds for mass, length or damping ratio, but each has one fixed value: "
                "use `tpd check` to validate a pendulum without a search"
            )

    def of(self, block: Block) -> DesignSpace:
        """Return the space of a block, with ratios instead of values in SI units.

        Raises:
            ValueError: the bob is heavier than the block, the length is out of range, or the hinge is above
                twice the height of the block.
        """
        out = dict[str, Any]()
        block.check_hinge(self.hinge_height)
        if self.hinge_height is not None and self.hinge_height > HIGHEST_HINGE * block.height:
            most = f"twice the height of the block, {2.0 * block.height:g} m"
            raise ValueError(f"`hinge_height` must be at most {most}, but is {self.hinge_height:g} m")
        # On a mast the rod is still no longer than the block is high.
        longest = self.longest_ratio(block)
        for name, unit, size in (("mass", "kg", block.mass), ("length", "m", block.centroid)):
            value, (low, high) = getattr(self, name), _RANGES[TWINS[name]]
            high = longest if name == "length" else high
            if value is not None:
                # Check each bound separately, so that the message contains the bound that is out of range.
                for x in np.ravel(value).tolist():
                    checks.within(name, x, low * size, high * size, f" {unit} in this block")
                # Clip the ratio, because the division may exceed a bound by rounding.
                out |= {name: None, TWINS[name]: np.clip(np.array(value) / size, low, high).tolist()}
        low, high = USUAL_BOUNDS["length_ratio"]
        if self.length_ratio == (low, high) and longest > low:
            # The usual bounds end where the bob would hang below the base.
            out["length_ratio"] = (low, min(high, longest))
        for x in np.ravel([] if self.length_ratio is None else out.get("length_ratio", self.length_ratio)):
            most = "the smaller height of hinge and block over that of the centroid"
            checks.at_most("length_ratio", x, longest, most)
        return replace(self, **out)

    def hinge_ratio(self, block: Block) -> float:
        """Return the height of the hinge over that of the centroid of a block, kappa."""
        return float((block.height if self.hinge_height is None else self.hinge_height) / block.centroid)

    def longest_ratio(self, block: Block) -> float:
        """Return the largest length ratio: a longer rod would reach the base, or exceed the height."""
        return min(float(block.height / block.centroid), self.hinge_ratio(block))

    @property
    def ends(self) -> np.ndarray:
        """Lower and upper ends of (mu, lam, zeta), shape (2, 3); equal for a fixed value.

        Raises:
            ValueError: the space is in SI units, so its ratios depend on the block.
        """
        if self.mass_ratio is None or self.length_ratio is None:
            raise ValueError("a space in kg or m has no ratios without a block: use `space.of(block)`")
        return np.array([np.broadcast_to(getattr(self, n), 2) for n in (*TWINS.values(), "damping_ratio")]).T

    @property
    def searched(self) -> np.ndarray:
        """Columns of (mu, lam, zeta) that the search varies."""
        return np.flatnonzero(np.ptp(self.ends, axis=0))

    @property
    def names(self) -> tuple[str, ...]:
        """Symbols of the parameters that the search varies."""
        return tuple(("mu", "lam", "zeta")[i] for i in self.searched)

    @property
    def bounds(self) -> np.ndarray:
        """Lower and upper bounds of the parameters that the search varies, shape (2, len(names))."""
        return self.ends[:, self.searched]

    def bounds_at(self, design: np.ndarray) -> dict[int, int]:
        """Return the columns of (mu, lam, zeta) of a design (3,) that lie on a bound, with 0 for the lower
        and 1 for the upper bound."""
        # A design within a hundredth of the range counts as on the bound.
        shares = dict(zip(self.searched.tolist(), self.scaled(design).tolist(), strict=True))
        return {i: int(x > 0.5) for i, x in shares.items() if not 0.01 < x < 0.99}

    def sample(self, rng: np.random.Generator, count: int) -> np.ndarray:
        """Draw designs (mu, lam, zeta) by a Latin hypercube, shape (count, 3)."""
        return self.unscaled(latin_hypercube(rng, count, len(self.names)))

    @property
    def _shift(self) -> np.ndarray:
        """Numbers that are added to the varied parameters before the logarithm is taken, (len(names),)."""
        low, high = self.bounds
        # A bound may be zero, or so small that most of a logarithmic range would have no effect.
        return np.maximum(_LINEAR_SHARE * high - low, 0.0)

    def logarithms(self, designs: np.ndarray) -> np.ndarray:
        """Return the logarithms of the varied parameters of designs (..., 3), shape (..., len(names)).

        Their differences are relative changes, which do not depend on the bounds.
        """
        return np.log(np.take(designs, self.searched, axis=-1) + self._shift)

    def scaled(self, designs: np.ndarray) -> np.ndarray:
        """Return the varied parameters of designs (..., 3) as shares of the logarithmic bounds, shape (...,
        len(names))."""
        # Mass and length have no common unit for a step, and their bounds may span decades: equal steps are
        # equal factors.
        low, high = self.logarithms(self.ends)
        return (self.logarithms(designs) - low) / (high - low)

    def unscaled(self, unit: np.ndarray) -> np.ndarray:
        """Return designs (mu, lam, zeta), shape (..., 3), from shares of the logarithmic bounds, shape (...,
        len(names))."""
        low, high = self.logarithms(self.ends)
        out = np.tile(self.ends[0], (*np.shape(unit)[:-1], 1))
        varied = np.exp(low + np.asarray(unit) * (high - low)) - self._shift
        # The logarithm of a bound has a rounding error.
        out[..., self.searched] = np.clip(varied, *self.bounds)
        return out

    def slopes(self, designs: np.ndarray, by_ratio: np.ndarray) -> np.ndarray:
        """Return derivatives with respect to the shares, (m, n, len(names)), from those with respect to (mu,
        lam, zeta), (m, n, 3), at designs (m, 3)."""
        low, high = self.logarithms(self.ends)
        rates = (np.take(designs, self.searched, axis=-1) + self._shift) * (high - low)
        return np.take(by_ratio, self.searched, axis=-1) * rates[:, None]


def check_moves(scene: Scene, conditions: Conditions) -> None:
    """Raise `ValueError` if the excitation is zero, or stronger than any base can move."""
    if not scene.excitation.amplitude > 0.0:
        raise ValueError(
            f"`amplitude` must be above 0 in a search, but is {scene.excitation.amplitude:g}: the base does "
            "not move"
        )
    motion, factor = scene.excitation, conditions.column
    check_excitation(motion.amplitude * factor("amplitude"), motion.frequency * factor("frequency"))


def check_scatter(scene: Scene, names: Iterable[str], space: DesignSpace | None = None) -> None:
    """Raise `ValueError` if a factor of `FACTORS` applies to a quantity that is zero or absent, and has no
    effect."""
    zero = {
        "friction": scene.block.friction == 0.0,
        "damping": space is not None and space.damping_ratio == 0.0,
    }
    for name in names:
        if zero.get(name, False):
            raise ValueError(f"`{name}` cannot vary by a share of itself, because it is 0")
        if name == "restitution":
            check_restitution(scene)
