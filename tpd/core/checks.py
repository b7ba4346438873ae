"""Checks of user input. An error is one sentence: the name, the range that is allowed, and the value."""

from __future__ import annotations

import math
from collections.abc import Callable, Sequence
from typing import Any

import jax
import jax.core
import numpy as np


def is_concrete(value: object) -> bool:
    """Return True for a plain number or an array that is not traced."""
    plain = isinstance(value, (int, float, np.generic, np.ndarray, jax.Array))
    return plain and not isinstance(value, jax.core.Tracer)


def as_float(value: Any) -> Any:
    """Return a whole number as a float, which JAX can differentiate, and anything else unchanged."""
    return float(value) if isinstance(value, int) and not isinstance(value, bool) else value


def instance(name: str, value: object, of: type) -> None:
    """Raise `ValueError` unless `value` is an object of the class `of`."""
    if not isinstance(value, of):
        raise ValueError(f"`{name}` must be a {of.__name__}, but is {value!r}")


def _check(name: str, value: object, allowed: str, holds: Callable[[np.ndarray], np.ndarray]) -> None:
    if isinstance(value, jax.core.Tracer):
        # A traced value has no number yet: whoever traces answers for its range.
        return
    array = np.asarray(value) if is_concrete(value) else np.asarray(value, dtype=object)
    if not np.issubdtype(array.dtype, np.integer) and not np.issubdtype(array.dtype, np.floating):
        raise ValueError(f"`{name}` must be a number, but is {value!r}")
    if not (np.all(np.isfinite(array)) and np.all(holds(array))):
        shown = f"{value:g}" if isinstance(value, (int, float)) else f"{array}"
        raise ValueError(f"`{name}` must be {allowed}, but is {shown}")


def positive(name: str, value: object) -> None:
    """Raise `ValueError` unless `value` is finite and above zero."""
    _check(name, value, "positive and finite", lambda x: x > 0)


def count(name: str, value: object, least: int = 1) -> None:
    """Raise `ValueError` unless `value` is a whole number, `least` or above."""
    _check(
        name,
        value,
        f"a whole number, {least} or more",
        lambda x: (x >= least) & np.issubdtype(x.dtype, np.integer),
    )


def not_negative(name: str, value: object) -> None:
    """Raise `ValueError` unless `value` is finite and zero or above."""
    _check(name, value, "zero or positive, and finite", lambda x: x >= 0)


def within(name: str, value: object, low: float, high: float, unit: str = "") -> None:
    """Raise `ValueError` unless `value` lies in the closed interval from `low` to `high`."""
    _check(
        name,
        value,
        f"between {low:g} and {high:g}{unit}",
        lambda x: (x >= low) & (x <= high),
    )


def one_of(name: str, value: object, allowed: Sequence[str]) -> None:
    """Raise `ValueError` unless `value` is one of the words allowed."""
    if value not in allowed:
        raise ValueError(f"`{name}` must be one of {', '.join(allowed)}, but is {value!r}")


def interval(name: str, value: object, low: float, high: float) -> tuple[float, float]:
    """Return a pair (lo, hi) with `low` <= lo < hi <= `high`, or raise `ValueError`."""
    try:
        lo, hi = (float(x) for x in value)  # type: ignore[attr-defined]
    except (TypeError, ValueError):
        raise ValueError(f"`{name}` must be a pair of numbers (low, high), but is {value!r}") from None
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
