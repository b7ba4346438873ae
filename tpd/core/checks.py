"""Checks of user input. An error is one sentence: the name, the range that is allowed, and the value."""

from __future__ import annotations

import inspect
import math
from collections.abc import Callable, Sequence
from typing import Any

import jax
import jax.core
import jax.numpy as jnp
import numpy as np

from tpd.core.formatting import meant

_SEEDS = 2**63 - 1
"""Largest number that begins a random sequence."""
_MOST = 10_000_000
"""Largest count: more of anything fits neither into memory nor into a day."""
_LONGEST = 80
"""Most characters of a value in a message."""


def is_concrete(value: object) -> bool:
    """Return True for a plain number or an array that is not traced."""
    plain = isinstance(value, (int, float, np.generic, np.ndarray, jax.Array))
    return plain and not isinstance(value, jax.core.Tracer)


def namespace(*values: object) -> Any:
    """Return `numpy` for values that are known, and `jax.numpy` where one of them is traced: outside of a
    compiled function JAX compiles a program for each of its operations, and for each shape."""
    return np if all(map(is_concrete, values)) else jnp


def as_float(value: Any) -> Any:
    """Return a whole number as a float, which JAX can differentiate, and anything else unchanged."""
    if not isinstance(value, int) or isinstance(value, bool):
        return value
    try:
        return float(value)
    except OverflowError:
        return math.inf if value > 0 else -math.inf


def shown(value: object) -> str:
    """Return a value as it stands in a message: on one line, and not longer than one."""
    text = " ".join((str(value) if isinstance(value, np.ndarray) else repr(value)).split())
    return text if len(text) <= _LONGEST else f"{text[:_LONGEST]}..."


def instance(name: str, value: object, of: type | tuple[type, ...], hint: str = "") -> None:
    """Raise `ValueError` unless `value` is an object of a class `of`, or of one of several.

    Args:
        name: of the argument.
        value: that is given for it.
        of: the class, or the classes.
        hint: end of the message, such as ": take `scene.parameters()`".
    """
    if isinstance(value, of):
        return
    classes = of if isinstance(of, tuple) else (of,)
    names = " or ".join(c.__name__.removeprefix("Abstract") for c in classes)
    if inspect.isclass(value) and issubclass(value, classes):
        raise ValueError(
            f"`{name}` must be a {names} that is made, `{value.__name__}(...)`, but is the class itself"
        )
    raise ValueError(f"`{name}` must be a {names}, but is {shown(value)}{hint}")


def optional(name: str, value: object, of: type | tuple[type, ...]) -> None:
    """As `instance`, where None is allowed as well."""
    if value is not None:
        instance(name, value, of)


def function(name: str, value: object) -> None:
    """Raise `ValueError` unless `value` can be called, or is None."""
    if value is not None and not callable(value):
        raise ValueError(f"`{name}` must be a function, but is {shown(value)}")


def flag(name: str, value: object) -> None:
    """Raise `ValueError` unless `value` is True or False."""
    if not isinstance(value, (bool, np.bool_)):
        raise ValueError(f"`{name}` must be True or False, but is {shown(value)}")


def numbers(name: str, value: object, shape: tuple[int, ...], of: str) -> None:
    """Raise `ValueError` unless `value` is an array of finite numbers of a shape; -1 stands for any length
    above zero, and `of` says what the numbers are. Of traced values only the shape is known."""
    if isinstance(value, jax.core.Tracer):
        sound = _fits(value.shape, shape)
    else:
        try:
            array = np.asarray(value)
            real = np.issubdtype(array.dtype, np.integer) or np.issubdtype(array.dtype, np.floating)
            sound = _fits(array.shape, shape) and real and bool(np.isfinite(array).all())
        except (TypeError, ValueError, jax.errors.JAXTypeError):
            # A list that holds traced values has no NumPy array; JAX checks its shape when it is stacked.
            sound = any(isinstance(leaf, jax.core.Tracer) for leaf in jax.tree.leaves(value))
    if not sound:
        raise ValueError(f"`{name}` must be {of}, all finite, but is {shown(value)}")


def _fits(shape: tuple[int, ...], wanted: tuple[int, ...]) -> bool:
    return len(shape) == len(wanted) and all(n == m or m < 0 < n for n, m in zip(shape, wanted, strict=True))


def state(value: Any) -> Any:
    """Return a start `y0` = (phi, psi, phi', psi') as floats, NumPy's where it is known; raise `ValueError`
    unless it is four finite numbers."""
    numbers("y0", value, (4,), "(phi, psi, phi', psi')")
    return namespace(*jax.tree.leaves(value)).asarray(value, dtype=float)


def _check(name: str, value: object, allowed: str, holds: Callable[[Any], Any]) -> None:
    if type(value) is float and math.isfinite(value) and holds(value):
        # First, because NumPy takes longer for one number than following a motion does.
        return
    if isinstance(value, jax.core.Tracer):
        # A traced value has no number yet: whoever traces answers for its range.
        return
    array = np.asarray(value) if is_concrete(value) else np.asarray(value, dtype=object)
    if not np.issubdtype(array.dtype, np.integer) and not np.issubdtype(array.dtype, np.floating):
        raise ValueError(f"`{name}` must be a number, but is {shown(value)}")
    if not (array.size and np.all(np.isfinite(array)) and np.all(holds(array))):
        text = f"{value:g}" if isinstance(value, (int, float)) else shown(array)
        raise ValueError(f"`{name}` must be {allowed}, but is {text}")


def positive(name: str, value: object) -> None:
    """Raise `ValueError` unless `value` is finite and above zero."""
    _check(name, value, "positive and finite", lambda x: x > 0)


def single(name: str, value: object) -> None:
    """Raise `ValueError` for an array where one number is meant; a traced value is one."""
    if np.ndim(value) > 0:  # type: ignore[arg-type]
        raise ValueError(f"`{name}` must be a single number, but is {shown(value)}")


def count(name: str, value: object, least: int = 1, most: int = _MOST) -> None:
    """Raise `ValueError` unless `value` is a whole number, `least` or above, and `most` or below."""
    too_many = is_concrete(value) and bool(np.any(np.asarray(value) > most))
    allowed = f"a whole number, {least} to {most}" if too_many else f"a whole number, {least} or more"
    whole = lambda x: (x >= least) & (x <= most) & np.issubdtype(np.asarray(x).dtype, np.integer)  # noqa: E731
    _check(name, value, allowed, whole)


def seed(name: str, value: object) -> None:
    """Raise `ValueError` unless `value` is a whole number that can begin a random sequence."""
    count(name, value, 0, _SEEDS)


def not_negative(name: str, value: object) -> None:
    """Raise `ValueError` unless `value` is finite and zero or above."""
    _check(name, value, "zero or positive, and finite", lambda x: x >= 0)


def within(name: str, value: object, low: float, high: float, unit: str = "") -> None:
    """Raise `ValueError` unless `value` lies in the closed interval from `low` to `high`."""
    _check(name, value, f"between {low:g} and {high:g}{unit}", lambda x: (x >= low) & (x <= high))


def at_most(name: str, value: object, most: object, of: str) -> None:
    """Raise `ValueError` unless `value` is at most `most`, which `of` describes. Numbers or arrays that
    broadcast; whoever traces answers for the range."""
    if not (is_concrete(value) and is_concrete(most)):
        return
    values, bounds = np.broadcast_arrays(np.asarray(value), np.asarray(most))
    # Equal numbers may differ by rounding, such as a mass that was made of its ratio.
    beyond = values > bounds * (1.0 + 1e-9)
    if np.any(beyond):
        first = tuple(np.argwhere(beyond)[0])
        raise ValueError(f"`{name}` must be at most {bounds[first]:g}, {of}, but is {values[first]:g}")


def one_of(name: str, value: object, allowed: Sequence[str]) -> None:
    """Raise `ValueError` unless `value` is one of the words allowed."""
    if not isinstance(value, str) or value not in allowed:
        close = meant(value, allowed, listing=False)
        raise ValueError(f"`{name}` must be one of {', '.join(allowed)}, but is {shown(value)}{close}")


def interval(name: str, value: object, low: float, high: float) -> tuple[float, float]:
    """Return a pair (lo, hi) with `low` <= lo < hi <= `high`, or raise `ValueError`."""
    try:
        # By number: a set has no order.
        pair = [value[i] for i in range(len(value))]  # type: ignore
        # Python takes a text and a truth value for a number as well.
        if any(isinstance(x, (str, bytes, bool, np.bool_)) for x in pair):
            raise TypeError
        lo, hi = (float(as_float(x)) for x in pair)
    except (TypeError, ValueError, KeyError):
        raise ValueError(f"`{name}` must be a pair of numbers (low, high), but is {shown(value)}") from None
    if not (math.isfinite(lo) and math.isfinite(hi) and low <= lo < hi <= high):
        raise ValueError(
            f"`{name}` must be an interval low < high within {low:g} to {high:g}, but is {lo:g} to {hi:g}"
        )
    return lo, hi


def require_x64() -> None:
    """Raise `RuntimeError` unless JAX computes in 64 bits."""
    # Set here it would change the caller's other computations, so it is asked for instead.
    if not jax.config.jax_enable_x64:  # type: ignore[attr-defined]
        raise RuntimeError(
            "tpd needs 64-bit floats, but JAX is in 32-bit mode: call "
            'jax.config.update("jax_enable_x64", True) before using it'
        )
