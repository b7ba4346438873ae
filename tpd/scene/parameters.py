"""Dimensionless parameters of block, pendulum and excitation."""

from __future__ import annotations

from dataclasses import dataclass, fields
from typing import TYPE_CHECKING, Any

import numpy as np

from tpd.core import checks
from tpd.scene.impacts import heaviest_of_housner, housner

if TYPE_CHECKING:
    from jaxtyping import Array, Float

    Number = Float[Array, "..."] | float
else:
    # At run time a number is an array of NumPy or JAX, a traced value or a Python number. Type checks at run
    # time import JAX, so the exact types are in `tpd.scene.pytrees`.
    Number = Any

SLENDERNESS_LIMIT = 0.5
"""Largest width over height for which the linear model is offered. It neglects terms of relative order
nu**2, which is one quarter at this limit."""

GREATEST = 1e12
"""Largest dimensionless parameter, and the inverse of the smallest one. Beyond these values squares and cubes
of numbers are not accurate."""


HIGHEST_HINGE, HIGHEST_RATIO = 2.0, 20.0
"""Largest height of the hinge above the base over the height of the block, and over that of its centroid."""


@dataclass(frozen=True, init=False)
class Parameters:
    """Dimensionless parameters of block, pendulum and excitation. Angles are in rad, and time is tau = omega0
    t.

    Symbols are those of (25) in Collini et al. (2016), the paper behind this package. The fields are the
    slenderness `nu`, the mass ratio `mu`, the length ratio `lam`, the damping ratio `zeta`, the friction `k`,
    the amplitude `f` and the frequency ratio `xi` of the excitation, the inertia ratio `rho` (None: a uniform
    rectangle), the coefficient of restitution `e` (None: Housner's), and the height `kappa` of the hinge
    above the base over that of the centroid (2, the top of a uniform block).

    The class is a pytree of numbers. Fields may also contain arrays or traced values. Plain numbers and
    arrays are checked on construction.

    Raises:
        ValueError: a plain number is out of range.

    Example:
        >>> import tpd
        >>> p = tpd.Parameters(nu=0.25, mu=0.1, lam=0.2, zeta=0.1, k=0.05, f=0.377, xi=2.67)
        >>> round(p.inertia_ratio, 4), round(p.period, 4)
        (0.7059, 2.3533)
    """

    nu: Number
    """Slenderness a/b: half width over the height of the centroid (half the height of a uniform block)."""
    mu: Number
    """Mass ratio m/M of bob to block; 0 means no pendulum."""
    lam: Number
    """Length ratio l/b: pendulum length over height of the centroid (the paper's Table 1 has half of it)."""
    zeta: Number
    """Damping ratio of the hinge: share of the critical damping of the pendulum on a fixed hinge."""
    k: Number
    """Dry friction moment of the rocking contact, divided by M g b."""
    f: Number
    """Amplitude of the base acceleration in g: alpha omega**2 / g."""
    xi: Number
    """Forcing frequency ratio omega/omega0."""
    rho: Number | None
    """Inertia ratio b**2/(a**2 + b**2 + c**2), with the radius of gyration c about the centroid. None means
    that it follows from `nu` as for a uniform rectangle, also in gradients."""
    e: Number | None
    """Coefficient of restitution of an impact at zero tilt and psi = 0, of the block with its bob; 1 means no
    loss. None means that it follows from `nu`, `rho` and `mu` by `tpd.scene.impacts.housner`, also in
    gradients."""
    kappa: Number
    """Height of the hinge above the base over that of the centroid, up to 20. The paper has 2, the top of a
    uniform block; a mast has more."""

    def __init__(
        self,
        *,
        nu: Number,
        mu: Number,
        lam: Number,
        zeta: Number,
        k: Number,
        f: Number,
        xi: Number,
        rho: Number | None = None,
        e: Number | None = 1.0,
        kappa: Number = 2.0,
    ) -> None:
        values = {"nu": nu, "mu": mu, "lam": lam, "zeta": zeta, "k": k, "f": f, "xi": xi, "rho": rho, "e": e}
        values["kappa"] = kappa
        vars(self).update({name: checks.plain(name, x) for name, x in values.items()})
        for name in ("nu", "lam", "xi"):
            checks.positive(name, getattr(self, name), 1.0 / GREATEST, GREATEST, every=True)
        for name in ("mu", "zeta", "k", "f"):
            checks.not_negative(name, getattr(self, name), 0.0, GREATEST, every=True)
        checks.positive("kappa", self.kappa, 1.0 / GREATEST, HIGHEST_RATIO, every=True)
        why = " (the linear model neglects terms of order nu**2)"
        checks.within("nu", self.nu, 0.0, SLENDERNESS_LIMIT, why, every=True)
        # Without a value rho is that of a uniform rectangle.
        if self.rho is not None:
            checks.within("rho", self.rho, 1e-6, 1.0, every=True)
        # Housner's coefficient falls with the mass of the bob, and must remain positive.
        if self.e is None:
            # A heavier bob would throw the block back on the corner from which it comes.
            most = "the heaviest bob with Housner's restitution (a heavier one throws the block back)"
            checks.at_most("mu", self.mu, heaviest_of_housner(self.nu, self.inertia_ratio), most)
        else:
            checks.within("e", self.e, 0.0, 1.0, every=True)

    @property
    def inertia_ratio(self) -> Number:
        """Inertia ratio rho of the equations: the field `rho`, or that of a uniform rectangle if the field is
        None."""
        return uniform_inertia_ratio(self.nu) if self.rho is None else self.rho

    @property
    def velocity_ratio(self) -> Any:
        """Coefficient of restitution: the field `e`, or Housner's value if the field is None."""
        return housner(self.nu, self.inertia_ratio, self.mu) if self.e is None else self.e

    @property
    def numbers(self) -> tuple[Any, ...]:
        """Numbers of the equations in the order of the fields, with `inertia_ratio` and `velocity_ratio`."""
        values = {**vars(self), "rho": self.inertia_ratio, "e": self.velocity_ratio}
        return tuple(map(values.__getitem__, NAMES))

    @property
    def hinge(self) -> Number:
        """Coefficient of the hinge c_p = 2 zeta sqrt(lam rho)."""
        inertia = self.lam * self.inertia_ratio
        return 2.0 * self.zeta * checks.namespace(inertia).sqrt(inertia)

    @property
    def period(self) -> Number:
        """Forcing period 2 pi / xi, in units of tau."""
        return 2.0 * np.pi / self.xi


NAMES = tuple(field.name for field in fields(Parameters))
"""Names of the parameters in the order of every row, vector and kernel. There is no other order."""


def uniform_inertia_ratio(nu: Any) -> Any:
    """Return rho = 3/(4(1 + nu^2)) of a uniform rectangle, for which c^2 = (a^2 + b^2)/3."""
    return 0.75 / (1.0 + nu**2)


def from_row(x: Any) -> Parameters:
    """Return the parameters from a row, whose entries may be numbers, arrays or traced values."""
    return Parameters(**dict(zip(NAMES, x, strict=True)))


def check_parameters(p: object) -> None:
    """Raise `ValueError` unless `p` is a `Parameters` object, and `RuntimeError` if JAX is in 32-bit mode."""
    checks.require_x64()
    if not isinstance(p, Parameters):
        # A common mistake is to pass a scene. The message then names the method that returns its parameters.
        checks.instance("p", p, Parameters, ": take its `.parameters()`" if hasattr(p, "parameters") else "")


def unchecked(p: Parameters | None, **changed: Any) -> Parameters:
    """Return the parameters with some of them replaced (all of them if `p` is None), without checks.

    The new values may be traced, or numbers with imaginary parts.
    """
    # `__new__` without `__init__` skips the checks, which would reject such values.
    parameters = object.__new__(Parameters)
    vars(parameters).update({} if p is None else vars(p), **changed)
    return parameters


def as_arrays(p: Parameters) -> Parameters:
    """Return the parameters with 64-bit arrays instead of numbers."""
    # `eqx.filter_jit` treats Python floats as static and would compile again for every value. Plain numbers
    # become arrays of NumPy, because JAX would compile a program to create each of its arrays.
    values = {name: x for name, x in vars(p).items() if x is not None}
    return unchecked(p, **{name: checks.namespace(x).asarray(x, dtype=float) for name, x in values.items()})
