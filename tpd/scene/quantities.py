"""Variation of a parameter or of an SI quantity by its name, with derivatives.

`Setup` contains plain numbers by name and returns the parameters with some of them replaced. `Axis` is the
line along one of them. `with_design` replaces only the pendulum. Gradients with respect to whole objects need
no names, because `Block`, `Pendulum`, `Harmonic` and `Scene` are pytrees.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, replace
from typing import Any

import numpy as np

from tpd.core import checks
from tpd.scene.parameters import NAMES, Parameters, unchecked
from tpd.scene.scene import (
    Harmonic,
    Pendulum,
    Scene,
    check_centroid,
    check_damping,
    check_excitation,
    check_proportions,
    dimensionless,
)

QUANTITIES = (
    *("width", "height", "centroid_height", "mass", "friction", "restitution", "amplitude", "frequency"),
    *("pendulum_mass", "pendulum_length", "pendulum_damping", "pendulum_hinge_height"),
)
"""Quantities of a scene by name (units m, m, m, kg, -, -, m, Hz, kg, m, -, m)."""
UNITS = {
    **dict.fromkeys(
        ("width", "height", "centroid_height", "amplitude", "pendulum_length", "pendulum_hinge_height"), "m"
    ),
    **dict.fromkeys(("mass", "pendulum_mass"), "kg"),
    "frequency": "Hz",
}
"""Units by name. Quantities that are not listed are dimensionless."""
_MAY_BE_ZERO = ("friction", "amplitude", "pendulum_mass", "pendulum_damping")
"""Quantities that may be zero."""
_BOUNDS = {
    "pendulum_mass": ("mass", "the mass of the block"),
    "pendulum_length": ("height", "the height of the block"),
}
"""Quantities of the pendulum that must not exceed a quantity of the block, with the words for that
quantity."""
_RATIOS = {"mass_ratio": "mu", "length_ratio": "lam", "damping_ratio": "zeta"}
"""Names that the command line and the job file have for parameters."""
_TINY = 1e-100
"""Imaginary step for complex-step differentiation."""
_OF_PENDULUM = (
    *("mu", "lam", "zeta", "kappa", "pendulum_mass", "pendulum_length", "pendulum_damping"),
    "pendulum_hinge_height",
)
"""Names that exist only with a pendulum."""


def named(name: Any) -> Any:
    """Return the name of a parameter or quantity from a name with hyphens, or from that of a ratio."""
    if not isinstance(name, str):
        return name
    plain = name.replace("-", "_")
    return _RATIOS.get(plain, plain)


def parameters_of(subject: Parameters | Scene, pendulum: Pendulum | None = None) -> Parameters:
    """Return the parameters of a subject: dimensionless parameters, or a scene with its pendulum, if any.

    Raises:
        ValueError: the parameters are traced or batched, or a pendulum is passed together with parameters.
    """
    return Setup.of(subject, pendulum).at({})


def parameters_without_pendulum(subject: Parameters | Scene) -> Parameters:
    """Return the parameters of a subject without its pendulum."""
    return subject.parameters() if isinstance(subject, Scene) else replace(subject, mu=0.0)


def with_design(p: Parameters, design: Any) -> Parameters:
    """Return the parameters with another pendulum (mu, lam, zeta) along the first axis, without checks.

    The values may be traced, or numbers with imaginary parts.
    """
    return unchecked(p, mu=design[0], lam=design[1], zeta=design[2])


@dataclass(frozen=True)
class Setup:
    """Numbers by name that describe block, excitation and pendulum. Each of them can be varied."""

    values: Mapping[str, float]
    """Values by name."""
    scene: bool
    """Whether the values are quantities of a scene in SI units; else they are dimensionless parameters."""
    has_pendulum: bool
    """Whether there is a pendulum."""

    @staticmethod
    def of(subject: Parameters | Scene, pendulum: Pendulum | None = None) -> Setup:
        """Return the setup of dimensionless parameters, or of a scene with or without a pendulum.

        Raises:
            ValueError: the parameters are batched, or a pendulum is passed together with parameters.
        """
        checks.instance("subject", subject, (Parameters, Scene))
        if isinstance(subject, Scene):
            other = ": use `tpd.transient` for pulses and records"
            checks.instance("excitation", subject.excitation, Harmonic, other)
            values = {n: checks.plain(n, v, single=True) for n, v in subject.quantities(pendulum).items()}
            return Setup(values, True, pendulum is not None)
        if pendulum is not None:
            raise ValueError("`pendulum` is allowed only with a scene: parameters contain their own")
        # rho and e are left out if they are None, and then follow the other parameters.
        numbers = {n: getattr(subject, n) for n in NAMES if getattr(subject, n) is not None}
        values = {n: checks.plain(n, value, single=True) for n, value in numbers.items()}
        for n, value in values.items():
            if not checks.is_concrete(value):
                raise ValueError(f"`{n}` must be a single number, but is {value!r}")
        return Setup(values, False, values["mu"] > 0.0)

    @property
    def names(self) -> tuple[str, ...]:
        """Names that can be varied."""
        return (*QUANTITIES, *NAMES) if self.scene else NAMES

    def moved(self, name: str) -> tuple[str, ...]:
        """Return the parameters that depend on the quantity `name`; none if `name` is itself a parameter."""
        if not self.scene or name not in QUANTITIES:
            return ()
        # A tiny imaginary part, also of a quantity that has a default, reaches what depends on it.
        changed = self.vector({name: complex(self.values.get(name, 1.0), _TINY)})
        return tuple(n for n, x in zip(NAMES, changed, strict=True) if abs(np.imag(x)) > 1e-12 * _TINY)

    def check_plausible(self, name: str, values: np.ndarray) -> None:
        """Raise `ValueError` for values of a quantity of a scene that are plausible only in another unit."""
        if not (self.scene and np.size(values)):
            return
        q = {**self.values, name: values}
        if name in ("width", "height", "mass"):
            check_proportions(q["width"], q["height"], q["mass"])
        if name in ("height", "centroid_height") and "centroid_height" in q:
            check_centroid(q["centroid_height"], q["height"], q.get("radius_of_gyration"))
        if name in ("pendulum_damping", "zeta"):
            check_damping(name, values)
        if name == "amplitude":
            check_excitation(values, q["frequency"])
        if name == "frequency" and "amplitude" in q:
            # The acceleration grows with the square of the frequency, so the upper end of a wide range
            # may exceed any ground motion: check only the lower end.
            check_excitation(q["amplitude"], values.min())

    def check_name(self, argument: str, name: str) -> None:
        """Raise `ValueError` unless `name`, the value of `argument`, can be varied."""
        checks.one_of(argument, name, self.names)
        if self.scene and not self.has_pendulum and name in _OF_PENDULUM:
            raise ValueError(f"`{name}` cannot be varied without a pendulum, but none is given")

    def check_sign(self, name: str, value: float) -> None:
        """Raise `ValueError` if a quantity is negative, or zero although it must be positive.

        `at` checks a quantity against the other quantities, for example a width against a height.
        """
        if name in QUANTITIES:
            check = checks.not_negative if name in _MAY_BE_ZERO else checks.positive
            check(name, value)
        # When mass or length of the pendulum are varied, the bounds are the same as for fixed values.
        if name in _BOUNDS and self.has_pendulum:
            of, words = _BOUNDS[name]
            if name == "pendulum_length" and "pendulum_hinge_height" in self.values:
                of, words = "pendulum_hinge_height", "the height of the hinge"
            checks.at_most(name, value, self.values[of], words)

    def at(self, varied: Mapping[str, Any]) -> Parameters:
        """Return the parameters with some numbers replaced, each by a number or an array.

        In a scene the SI quantities are replaced first. The replacement of a parameter then changes no other
        parameter, with two exceptions: rho follows nu unless the block has a radius of gyration, and
        Housner's e follows nu, rho and mu.
        """
        return Parameters(**self.numbers(varied))

    def numbers(self, varied: Mapping[str, Any]) -> dict[str, Any]:
        """Return the numbers of `at` by name without checks, also for traced values and values out of
        range."""
        if not self.scene:
            # None stands for Housner's e. Without the key the default of e would be 1.
            return {"e": None, **self.values, **varied}
        # A parameter overrides the value that follows from the quantities.
        over = {n: v for n, v in varied.items() if n in NAMES}
        own = {n: v for n, v in varied.items() if n not in over}
        return {**dimensionless({**self.values, **own}), **over}

    def vector(self, varied: Mapping[str, Any]) -> list[Any]:
        """Return the numbers of `at` as a list in the order of NAMES, with rho and e as numbers."""
        return list(unchecked(None, **{"rho": None, **self.numbers(varied)}).numbers)


@dataclass(frozen=True)
class Axis:
    """Line in the space of parameters along which one number of a setup varies."""

    setup: Setup
    """Values of all numbers."""
    name: str
    """Name of the varied number."""

    @staticmethod
    def of(subject: Parameters | Scene, name: str, pendulum: Pendulum | None = None) -> Axis:
        """Return the axis of `name` through parameters or a scene; raise `ValueError` if `name` cannot be
        varied."""
        setup, name = Setup.of(subject, pendulum), named(name)
        setup.check_name("name", name)
        # A parameter varies while the other parameters are fixed, so the scene is replaced by its
        # parameters.
        if setup.scene and name in NAMES:
            setup = Setup.of(setup.at({}))
        return Axis(setup, name)

    @property
    def others(self) -> tuple[str, ...]:
        """Names of the other numbers, in the order of the columns of `jacobian` after the first."""
        absent = _OF_PENDULUM if self.setup.scene and not self.setup.has_pendulum else ()
        return tuple(n for n in self.setup.values if n not in (self.name, *absent))

    def check(self, *values: float) -> None:
        """Raise `ValueError` unless all values are in range."""
        for value in map(float, values):
            self.setup.check_sign(self.name, value)
            self.setup.at({self.name: value})
        self.setup.check_plausible(self.name, np.array(values, dtype=float))

    def at(self, values: np.ndarray) -> np.ndarray:
        """Return the parameters at values of shape (n,), in the order of NAMES, shape (n, 10)."""
        rows = [np.broadcast_to(x, np.shape(values)) for x in self.setup.vector({self.name: values})]
        return np.stack(rows, axis=1)

    def jacobian(self, value: float) -> np.ndarray:
        """Return the derivatives of the parameters, shape (10, 1 + len(others)).

        The columns are the derivatives with respect to the varied number and to `others`.
        """
        # Complex-step differentiation: an imaginary part that is too small to change the real part carries
        # the exact derivative.
        values = {**self.setup.values, self.name: value}
        steps = ({**values, n: complex(values[n], _TINY)} for n in (self.name, *self.others))
        return np.stack([np.imag(self.setup.vector(varied)) / _TINY for varied in steps], axis=1)
