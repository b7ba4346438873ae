"""The dimensionless parameters of the block-pendulum system, and pytrees of numbers."""

from __future__ import annotations

from dataclasses import fields
from typing import TYPE_CHECKING, Any, TypeAlias, TypeVar

import equinox as eqx
import jax
import numpy as np
from jax.tree_util import GetAttrKey
from jaxtyping import Array, Float, Inexact

from tpd.core import checks
from tpd.scene.impacts import heaviest_of_housner, housner

if TYPE_CHECKING:
    Number = Float[Array, "..."] | float
    State = Float[Array, "4"]
    Given = Float[Array, "..."] | float
else:
    # Known numbers may be arrays of NumPy: see `checks.namespace`. To a checker of types these are JAX's. An
    # imaginary part of theirs carries a derivative.
    Number = Float[Array, "..."] | Inexact[np.ndarray, "..."] | float
    State = Float[Array, "4"] | Float[np.ndarray, "4"]
    Given = Any
Numbers = tuple[Number, Number, Number, Number]
"""A state (phi, psi, phi', psi'), one number each."""

Class = TypeVar("Class", bound=type[Any])
Static: TypeAlias = tuple[tuple[str, ...], tuple[tuple[str, Any], ...]]
"""Names of the leaves, and the fields that hold a word or several, by name."""

SLENDERNESS_LIMIT = 0.5
"""Widest block (width over height) the linear equations are offered for: they drop terms of
relative order nu**2, a quarter at this limit."""

GREATEST = 1e12
"""Largest dimensionless parameter, and the inverse of the least one: beyond them squares and cubes of numbers
lose their meaning."""


class Parameters(eqx.Module):
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
        nu: Given,
        mu: Given,
        lam: Given,
        zeta: Given,
        k: Given,
        f: Given,
        xi: Given,
        rho: Given | None = None,
        e: Given | None = 1.0,
    ) -> None:
        # At once: equinox's own way, field by field, takes longer than following a motion.
        given = {"nu": nu, "mu": mu, "lam": lam, "zeta": zeta, "k": k, "f": f, "xi": xi, "rho": rho, "e": e}
        vars(self).update({name: checks.plain(name, x) for name, x in given.items()})

    def __check_init__(self) -> None:
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


def check_parameters(p: object, name: str = "p") -> None:
    """Raise `ValueError` unless `p` is an object of `Parameters`."""
    if not isinstance(p, Parameters):
        # A scene is what is given by mistake: it knows its parameters.
        checks.instance(name, p, Parameters, ": take its `.parameters()`" if hasattr(p, "parameters") else "")


def single(thing: Any, name: str = "p") -> Any:
    """Return a number, or a pytree of numbers, where one-element arrays are the number in them.

    Raises:
        ValueError: arrays of several numbers.
    """
    return jax.tree.map(lambda x: checks.plain(name, x, single=True), thing)


def as_arrays(p: Parameters) -> Parameters:
    """Parameters with 64-bit array leaves."""
    # `eqx.filter_jit` takes Python floats as static and would compile again for every value.
    # Known numbers stay NumPy's: JAX would compile a program to make an array of its own of each.
    return jax.tree.map(lambda x: checks.namespace(x).asarray(x, dtype=float), p)


def _is_words(value: Any) -> bool:
    """Whether a field holds a word, or a tuple of words only, such as an empty one."""
    return isinstance(value, str) or (isinstance(value, tuple) and all(isinstance(v, str) for v in value))


def pytree(cls: Class) -> Class:
    """Register a frozen dataclass as a pytree: a field that holds words is static, any other is a leaf.

    `jax.tree_util.register_dataclass` fixes the static fields once, and runs `__post_init__` on whatever JAX
    puts in the place of a leaf. Here a word such as "housner" is static where it is used; nothing is checked.
    """

    def flatten_with_keys(thing: Any) -> tuple[tuple[tuple[Any, Any], ...], Static]:
        held = {f.name: getattr(thing, f.name) for f in fields(cls)}
        words = tuple((name, value) for name, value in held.items() if _is_words(value))
        names = tuple(name for name, value in held.items() if not _is_words(value))
        return tuple((GetAttrKey(name), held[name]) for name in names), (names, words)

    def unflatten(static: Static, leaves: Any) -> Any:
        # Not through the constructor: JAX puts objects of its own in the place of leaves.
        thing, (names, words) = object.__new__(cls), static
        for name, value in (*zip(names, leaves, strict=True), *words):
            object.__setattr__(thing, name, value)
        return thing

    jax.tree_util.register_pytree_with_keys(cls, flatten_with_keys, unflatten)
    return cls
