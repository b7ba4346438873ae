"""The dimensionless parameters of the block-pendulum system."""

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
    # An array of NumPy or JAX, a traced value or a number: whoever checks types at run time does so where JAX
    # is imported, see `tpd.scene.pytrees`.
    Number = Any

SLENDERNESS_LIMIT = 0.5
"""Widest block (width over height) the linear equations are offered for: they drop terms of
relative order nu**2, a quarter at this limit."""

GREATEST = 1e12
"""Largest dimensionless parameter, and the inverse of the least one: beyond them squares and cubes of numbers
lose their meaning."""


@dataclass(frozen=True, init=False)
class Parameters:
    """Dimensionless parameters of block, pendulum and shaking. Angles are in rad, time is tau = omega0 t.

    A pytree of numbers. Symbols are those of (25) in Collini et al. (2016), the paper behind this package.
    Fields may hold arrays or traced values; plain numbers and arrays are checked on construction.

    Raises:
        ValueError: a plain number outside its range.
    """

    nu: Number
    """Slenderness a/b: half width over half height."""
    mu: Number
    """Mass ratio m/M of bob to block; 0 is the bare block."""
    lam: Number
    """Length ratio l/b: pendulum length over half height (the paper's Table 1 uses half of it)."""
    zeta: Number
    """Damping ratio of the hinge, of the pendulum hung from a fixed point."""
    k: Number
    """Dry friction moment of the rocking contact, divided by M g b."""
    f: Number
    """Base acceleration amplitude in g: alpha omega**2 / g."""
    xi: Number
    """Forcing frequency ratio omega/omega0."""
    rho: Number | None
    """b**2/(a**2 + b**2 + c**2) with c the radius of gyration about the centroid; None ties it to `nu` as
    for a uniform rectangle, also in gradients."""
    e: Number | None
    """Velocity ratio across an impact at zero tilt and psi = 0, of the block with its bob; 1 is no impact
    loss. None ties it to `nu`, `rho` and `mu` by `tpd.scene.impacts.housner`, also in gradients."""

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
    ) -> None:
        given = {"nu": nu, "mu": mu, "lam": lam, "zeta": zeta, "k": k, "f": f, "xi": xi, "rho": rho, "e": e}
        vars(self).update({name: checks.plain(name, x) for name, x in given.items()})
        for name in ("nu", "lam", "xi"):
            checks.positive(name, getattr(self, name), 1.0 / GREATEST, GREATEST, every=True)
        for name in ("mu", "zeta", "k", "f"):
            checks.not_negative(name, getattr(self, name), 0.0, GREATEST, every=True)
        told = " (the linear equations drop terms of order nu**2)"
        checks.within("nu", self.nu, 0.0, SLENDERNESS_LIMIT, told, every=True)
        if self.rho is not None:
            checks.within("rho", self.rho, 1e-6, 1.0, every=True)
        if self.e is None:
            _check_heaviest(self.nu, self.inertia_ratio, self.mu)
        else:
            checks.within("e", self.e, 0.0, 1.0, every=True)

    @property
    def inertia_ratio(self) -> Number:
        """rho as the equations use it: the field `rho`, or that of a uniform rectangle where it is None."""
        return uniform_inertia_ratio(self.nu) if self.rho is None else self.rho

    @property
    def velocity_ratio(self) -> Any:
        """e as the equations use it: the field `e`, or Housner's where it is None."""
        return housner(self.nu, self.inertia_ratio, self.mu) if self.e is None else self.e

    @property
    def hinge(self) -> Number:
        """The hinge coefficient c_p = 2 zeta sqrt(lam rho)."""
        inertia = self.lam * self.inertia_ratio
        return 2.0 * self.zeta * checks.namespace(inertia).sqrt(inertia)

    @property
    def period(self) -> Number:
        """The forcing period 2 pi / xi, in tau."""
        return 2.0 * np.pi / self.xi


NAMES = tuple(field.name for field in fields(Parameters))
"""Names of the parameters in the one order of every row, vector and kernel. No code relies on another one."""


def uniform_inertia_ratio(nu: Any) -> Any:
    """rho = 3/(4(1 + nu^2)) of a uniform rectangle, whose c^2 is (a^2 + b^2)/3."""
    return 0.75 / (1.0 + nu**2)


def _check_heaviest(nu: Any, rho: Any, mu: Any) -> None:
    """Raise `ValueError` for a bob with which Housner's velocity ratio is negative: it would throw the block
    back on the corner from which it comes."""
    if all(map(checks.is_concrete, (nu, rho, mu))):
        bobs, most = np.broadcast_arrays(mu, heaviest_of_housner(nu, rho))
        i = np.argmax(bobs - most)
        if bobs.flat[i] > most.flat[i]:
            raise ValueError(
                f"`mu` must be at most {most.flat[i]:.4g} with Housner's restitution (a heavier bob throws "
                f"the block back at an impact), but is {bobs.flat[i]:g}"
            )


def from_row(x: Any) -> Parameters:
    """Return the parameters in a row, whose entries may be numbers, arrays or traced values."""
    return Parameters(**dict(zip(NAMES, x, strict=True)))


def check_parameters(p: object) -> None:
    """Raise `ValueError` unless `p` is an object of `Parameters`, and `RuntimeError` if JAX computes in 32
    bits."""
    checks.require_x64()
    if not isinstance(p, Parameters):
        # A scene is what is given by mistake: it knows its parameters.
        checks.instance("p", p, Parameters, ": take its `.parameters()`" if hasattr(p, "parameters") else "")


def unchecked(p: Parameters, **changed: Any) -> Parameters:
    """Return the parameters with some of them replaced by whatever is given, such as values that are traced,
    or numbers with imaginary parts."""
    made = object.__new__(Parameters)
    vars(made).update(vars(p), **changed)
    return made


def as_arrays(p: Parameters) -> Parameters:
    """Parameters with 64-bit arrays in place of numbers."""
    # `eqx.filter_jit` takes Python floats as static and would compile again for every value.
    # Known numbers stay NumPy's: JAX would compile a program to make an array of its own of each.
    held = {name: x for name, x in vars(p).items() if x is not None}
    return unchecked(p, **{name: checks.namespace(x).asarray(x, dtype=float) for name, x in held.items()})
