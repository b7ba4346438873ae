"""The classes of a scene as pytrees of JAX: `jax.grad`, `jax.jit` and `jax.vmap` take whole objects.

The classes themselves are importable without JAX, so that a job is checked before JAX is imported. Importing
this module registers them; every module that hands them to JAX imports it.
"""

from __future__ import annotations

from dataclasses import fields
from typing import TYPE_CHECKING, Any, TypeAlias, TypeVar

import jax
import numpy as np
from jax.tree_util import GetAttrKey
from jaxtyping import Array, Float, Inexact

from tpd.core import checks
from tpd.scene.ground_motion import Pulse
from tpd.scene.parameters import Parameters
from tpd.scene.record import Record
from tpd.scene.scene import Block, Harmonic, Pendulum, Scene

if TYPE_CHECKING:
    Number = Float[Array, "..."] | float
    State = Float[Array, "4"]
else:
    # Known numbers may be arrays of NumPy: see `checks.namespace`. To a checker of types these are JAX's. An
    # imaginary part of theirs carries a derivative.
    Number = Float[Array, "..."] | Inexact[np.ndarray, "..."] | float
    State = Float[Array, "4"] | Float[np.ndarray, "4"]
Numbers = tuple[Number, Number, Number, Number]
"""A state (phi, psi, phi', psi'), one number each."""

Class = TypeVar("Class", bound=type[Any])
Static: TypeAlias = tuple[tuple[str, ...], tuple[tuple[str, Any], ...]]
"""Names of the leaves, and the fields that hold a word or several, by name."""


def single(thing: Any, name: str = "p") -> Any:
    """Return a number, or a pytree of numbers, where one-element arrays are the number in them.

    Raises:
        ValueError: arrays of several numbers.
    """
    return jax.tree.map(lambda x: checks.plain(name, x, single=True), thing)


def _is_words(value: Any) -> bool:
    """Whether a field holds a word, or a tuple of words only, such as an empty one."""
    return isinstance(value, str) or (isinstance(value, tuple) and all(isinstance(v, str) for v in value))


def pytree(cls: Class) -> Class:
    """Register a frozen dataclass as a pytree: a field that holds words is static, any other is a leaf.

    `jax.tree_util.register_dataclass` fixes the static fields once, and runs `__post_init__` on whatever JAX
    puts in the place of a leaf. Here a word such as "housner" is static where it is used; nothing is checked.
    """
    fixed = tuple(f.name for f in fields(cls))

    def flatten_with_keys(thing: Any) -> tuple[tuple[tuple[Any, Any], ...], Static]:
        held = {name: getattr(thing, name) for name in fixed}
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


for _class in (Parameters, Block, Pendulum, Harmonic, Scene, Pulse, Record):
    pytree(_class)
