"""Classes of a scene as pytrees of JAX, so that `jax.grad`, `jax.jit` and `jax.vmap` accept whole objects.

The classes themselves can be imported without JAX, so that a job is checked before JAX is imported. The
import of this module registers the classes. Every module that passes them to JAX imports it.
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
    # Plain numbers may be arrays of NumPy, see `checks.namespace`. A static type checker sees only the types
    # of JAX. Numbers of NumPy may be complex, because an imaginary part carries a derivative.
    Number = Float[Array, "..."] | Inexact[np.ndarray, "..."] | float
    State = Float[Array, "4"] | Float[np.ndarray, "4"]
Numbers = tuple[Number, Number, Number, Number]
"""State (phi, psi, phi', psi'), one number each."""

Class = TypeVar("Class", bound=type[Any])
Static: TypeAlias = tuple[tuple[str, ...], tuple[tuple[str, Any], ...]]
"""Names of the leaves, and the fields with texts, by name."""


def single(thing: Any, name: str = "p") -> Any:
    """Return a number, or a pytree of numbers, with plain numbers instead of arrays of one element.

    Raises:
        ValueError: an array has several elements.
    """
    return jax.tree.map(lambda x: checks.plain(name, x, single=True), thing)


def _is_words(value: Any) -> bool:
    """Whether a field is a text, or a tuple that contains only texts (it may be empty)."""
    return isinstance(value, str) or (isinstance(value, tuple) and all(isinstance(v, str) for v in value))


def pytree(cls: Class) -> Class:
    """Register a frozen dataclass as a pytree. Fields with texts are static, and all other fields are leaves.

    `jax.tree_util.register_dataclass` fixes the static fields once, and runs `__post_init__` on everything
    that JAX substitutes for a leaf. Here a text such as "housner" is static only in the objects that contain
    it, and nothing is checked.
    """
    fixed = tuple(f.name for f in fields(cls))

    def flatten_with_keys(thing: Any) -> tuple[tuple[tuple[Any, Any], ...], Static]:
        values = {name: getattr(thing, name) for name in fixed}
        words = tuple((name, value) for name, value in values.items() if _is_words(value))
        names = tuple(name for name, value in values.items() if not _is_words(value))
        # Optax and Equinox take a float of Python for a constant without a shape or a derivative.
        leaves = (np.float64(x) if type(x) is float else x for x in map(values.get, names))
        return tuple(zip(map(GetAttrKey, names), leaves, strict=True)), (names, words)

    def unflatten(static: Static, leaves: Any) -> Any:
        # Bypass the constructor and its checks: JAX substitutes objects of its own for leaves.
        thing, (names, words) = object.__new__(cls), static
        for name, value in (*zip(names, leaves, strict=True), *words):
            object.__setattr__(thing, name, value)
        return thing

    jax.tree_util.register_pytree_with_keys(cls, flatten_with_keys, unflatten)
    return cls


for _class in (Parameters, Block, Pendulum, Harmonic, Scene, Pulse, Record):
    checks.keywords(pytree(_class))
