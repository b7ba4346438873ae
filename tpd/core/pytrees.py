"""Frozen dataclasses of numbers as JAX pytrees."""

from __future__ import annotations

from dataclasses import fields
from typing import Any, TypeAlias, TypeVar

import jax
from jax.tree_util import GetAttrKey

Class = TypeVar("Class", bound=type[Any])
Static: TypeAlias = tuple[tuple[str, ...], tuple[tuple[str, Any], ...]]
"""Names of the leaves, and the fields that hold a word or several, by name."""


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
