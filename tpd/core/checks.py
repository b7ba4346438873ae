"""Checks of user input. An error is one sentence: the name, the range that is allowed, and the value."""

from __future__ import annotations

import inspect
import math
import numbers
import sys
from collections.abc import Callable, Sequence
from typing import TYPE_CHECKING, Any, Protocol, TypeAlias, runtime_checkable

import numpy as np

from tpd.core.formatting import meant

if TYPE_CHECKING:
    import jax

    Real: TypeAlias = float
    Whole: TypeAlias = int
    Vector: TypeAlias = Sequence[float] | np.ndarray | jax.Array
else:
    # An array or a traced value passes as well, and the functions here refuse the rest in words of their own,
    # before and instead of a checker of types.
    @runtime_checkable
    class _Array(Protocol):
        """An array of NumPy or JAX, also a traced one, or a number of NumPy."""

        dtype: Any

    Real, Vector, Whole = Any, Any, int | _Array

_SEEDS = 2**63 - 1
"""Largest number that begins a random sequence."""
_MOST = 10_000_000
"""Largest count: more of anything fits neither into memory nor into a day."""
_REAL = "iuf"
"""Kinds of NumPy's types of real numbers."""
LEAST_TOLERANCE = 1e-16
"""Least tolerance of a model: no computation in 64 bits comes nearer."""
_LONGEST = 80
"""Most characters of a value in a message."""


def is_jax(value: object) -> bool:
    """Return True for an array of JAX, traced or not. Before JAX is imported there is none."""
    if "jax" not in sys.modules:
        return False
    import jax

    return isinstance(value, jax.Array)


def is_traced(value: object) -> bool:
    """Return True for a value that JAX traces."""
    if "jax" not in sys.modules:
        return False
    from jax.core import Tracer

    return isinstance(value, Tracer)


def is_concrete(value: object) -> bool:
    """Return True for a plain number or an array that is not traced."""
    is_plain = isinstance(value, (int, float, np.generic, np.ndarray))
    return is_plain or (is_jax(value) and not is_traced(value))


def namespace(*values: object) -> Any:
    """Return `numpy` for values that are known, and `jax.numpy` where one of them is traced: outside of a
    compiled function JAX compiles a program for each of its operations, and for each shape."""
    return np if all(map(is_concrete, values)) else _jax_numpy()


def _jax_numpy() -> Any:
    import jax.numpy

    return jax.numpy


def plain(name: str, value: Any, *, single: bool = False) -> Any:
    """Return a number as a float, and an array of numbers as a contiguous array of 64-bit floats.

    This is the one place that converts what a user gives. Anything else is returned unchanged, for a check
    to reject.

    Args:
        name: of the argument.
        value: the number or the array; traced ones stay traced.
        single: whether one number is meant. An array of one element is then that number.

    Raises:
        ValueError: numbers with a unit or a mask, or several where one is meant.
    """
    if type(value) is float:
        return value
    _check_meaning(name, value)
    if not (isinstance(value, (np.generic, np.ndarray)) or is_jax(value)):
        if not isinstance(value, numbers.Real) or isinstance(value, bool):
            return value
        try:
            return float(value)
        except OverflowError:
            # A whole number of Python may be larger than any float: the check that follows refuses it.
            return -math.inf if value < 0 else math.inf
    if value.dtype.kind not in _REAL:
        return value
    if single and value.size != 1:
        raise ValueError(f"`{name}` must be a single number, but is {shown(value)}")
    if is_traced(value) or (is_jax(value) and not single):
        array = value if value.dtype == np.float64 else value.astype(float)
        return array.reshape(()) if single and array.ndim else array
    known = np.ascontiguousarray(value, dtype=float)
    return float(known.reshape(())) if single or value.ndim == 0 else known


def _check_meaning(name: str, value: Any) -> None:
    """Raise `ValueError` for numbers that mean more than they are: with a unit, or with a mask."""
    if isinstance(value, (list, tuple)):
        for item in value:
            if type(item) is not float:
                _check_meaning(name, item)
    elif type(value) is np.ndarray or isinstance(value, str) or is_jax(value):
        # The usual cases, quickly.
        return
    elif np.ma.is_masked(value):
        raise ValueError(f"`{name}` must have no masked elements, but is {shown(value)}: remove or fill them")
    elif any(hasattr(value, of) for of in ("__array__", "__float__")):
        # Attributes of quantities of astropy, unyt and pint, columns of pandas, and arrays of xarray.
        holders, noted = (value, getattr(value, "dtype", None)), getattr(value, "attrs", None) or {}
        units = [getattr(x, of) for x in holders for of in ("unit", "units", "magnitude") if hasattr(x, of)]
        units += [noted[of] for of in ("unit", "units") if of in noted]
        if units:
            raise ValueError(
                f"`{name}` must be plain numbers, but is {shown(value)} with the unit '{units[0]}': convert "
                "it to the unit that the documentation states, and pass its value"
            )


def shown(value: object) -> str:
    """Return a value as it stands in a message: on one line, and not longer than one."""
    text = " ".join((str(value) if isinstance(value, np.ndarray) else repr(value)).split())
    return text if len(text) <= _LONGEST else f"{text[:_LONGEST]}..."


def instance(name: str, value: Any, of: type | tuple[type, ...], hint: str = "") -> Any:
    """Return an object of a class `of`, or of one of several; raise `ValueError` for anything else.

    Args:
        name: of the argument.
        value: that is given for it.
        of: the class, or the classes.
        hint: end of the message, such as ": take `scene.parameters()`".
    """
    if isinstance(value, of):
        return value
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


def function(name: str, value: object, *, optional: bool = True) -> None:
    """Raise `ValueError` unless `value` can be called, or is None where that is allowed."""
    if not (callable(value) or (optional and value is None)):
        raise ValueError(f"`{name}` must be a function, but is {shown(value)}")


def flag(name: str, value: object) -> None:
    """Raise `ValueError` unless `value` is True or False."""
    if not isinstance(value, (bool, np.bool_)):
        raise ValueError(f"`{name}` must be True or False, but is {shown(value)}")


def array(name: str, value: object, shape: tuple[int, ...], of: str) -> Any:
    """Return an array of finite numbers of a shape, contiguous and of 64-bit floats: NumPy's if it is known.

    Args:
        name: of the argument.
        value: the array or nested lists; of traced values only the shape is checked.
        shape: -1 stands for any length above zero.
        of: words that say what the numbers are.

    Raises:
        ValueError: anything else.
    """
    _check_meaning(name, value)
    traced = _holds_traced(value)
    try:
        found: Any = _jax_numpy().asarray(value, dtype=float) if traced else np.asarray(value)
        fits = len(found.shape) == len(shape) and all(
            n == m or m < 0 < n for n, m in zip(found.shape, shape, strict=True)
        )
        if fits and traced:
            return found
        if fits and found.dtype.kind in _REAL:
            known = np.ascontiguousarray(found, float)
            if np.isfinite(known).all():
                return known
    except (TypeError, ValueError, OverflowError):
        # Errors of JAX about traced values are a TypeError as well.
        pass
    raise ValueError(f"`{name}` must be {of}, all finite, but is {shown(value)}")


def increasing(name: str, value: object, least: int = 2) -> Any:
    """Return a vector of numbers, so many at `least`, each above the one before; raise `ValueError` for
    anything else. Of traced numbers only the shape is checked."""
    of = f"a vector of {least} or more increasing numbers"
    found = array(name, value, (-1,), of)
    if len(found) < least or (is_concrete(found) and not np.all(np.diff(found) > 0.0)):
        raise ValueError(f"`{name}` must be {of}, but is {shown(found)}")
    return found


def _holds_traced(value: object) -> bool:
    """Return True for a traced value, or nested lists with one."""
    return is_traced(value) or (isinstance(value, (list, tuple)) and any(map(_holds_traced, value)))


def state(value: Any) -> Any:
    """Return a start `y0` = (phi, psi, phi', psi') as floats, NumPy's where it is known; raise `ValueError`
    unless it is four finite numbers."""
    return array("y0", value, (4,), "(phi, psi, phi', psi')")


def _check(name: str, value: object, allowed: str, holds: Callable[[Any], Any], every: bool = False) -> Any:
    if type(value) is float and math.isfinite(value) and holds(value):
        # First, because NumPy takes longer for one number than following a motion does.
        return value
    value = plain(name, value, single=not every)
    if is_traced(value):
        # A traced value has no number yet: whoever traces answers for its range.
        return value
    known = np.asarray(value) if is_concrete(value) else np.asarray(None)
    if known.dtype.kind not in _REAL:
        raise ValueError(f"`{name}` must be a number, but is {shown(value)}")
    if not (known.size and np.all(np.isfinite(known)) and np.all(holds(known))):
        text = f"{value:g}" if isinstance(value, float) else shown(known)
        raise ValueError(f"`{name}` must be {allowed}, but is {text}")
    return value


def number(name: str, value: object) -> Any:
    """Return a finite number; raise `ValueError` for anything else."""
    return _check(name, value, "finite", lambda x: True)


def each(name: str, value: object) -> np.ndarray:
    """Return finite numbers of any shape, in lists or an array; raise `ValueError` for anything else."""
    _check_meaning(name, value)
    return np.asarray(_check(name, np.asarray(value), "finite", lambda x: True, every=True))


def positive(name: str, value: object, *bounds: Any, every: bool = False) -> Any:
    """Return a number that is finite and above zero, or an array if `every` element must be so; raise
    `ValueError` for anything else. `bounds` are those of `within`."""
    value = _check(name, value, "positive and finite", lambda x: x > 0, every)
    return within(name, value, *bounds, every=every) if bounds else value


def count(name: str, value: Any, least: int = 1, most: int = _MOST) -> int:
    """Return a whole number, `least` or above, and `most` or below; raise `ValueError` for anything else."""
    if is_concrete(value) and np.size(value) == 1 and np.asarray(value).dtype.kind in "iu":
        value = int(np.reshape(value, ()))
        if least <= value <= most:
            return value
    too_many = type(value) is int and value > most
    allowed = f"a whole number, {least} to {most}" if too_many else f"a whole number, {least} or more"
    return _check(name, value, allowed, lambda x: False)


def seed(name: str, value: object) -> int:
    """Return a whole number that can begin a random sequence; raise `ValueError` for anything else."""
    return count(name, value, 0, _SEEDS)


def not_negative(name: str, value: object, *bounds: Any, every: bool = False) -> Any:
    """As `positive`, where zero is allowed as well."""
    value = _check(name, value, "zero or positive, and finite", lambda x: x >= 0, every)
    return within(name, value, *bounds, every=every) if bounds else value


def within(name: str, value: object, low: float, high: float, unit: str = "", *, every: bool = False) -> Any:
    """As `positive`, of the closed interval from `low` to `high`."""
    return _check(
        name, value, f"between {low:g} and {high:g}{unit}", lambda x: (x >= low) & (x <= high), every
    )


def tolerance(name: str, value: object) -> Any:
    """Return the tolerance or the rate of a model; raise `ValueError` unless it is above 0 and at most 1."""
    return positive(name, value, LEAST_TOLERANCE, 1.0)


def set_checked(thing: Any, check: Callable[..., Any], names: str, *bounds: Any) -> None:
    """Replace fields of a frozen object by what a check returns; `names` are separated by spaces."""
    for name in names.split():
        object.__setattr__(thing, name, check(name, getattr(thing, name), *bounds))


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


def interval(name: str, value: Any, low: float, high: float) -> tuple[float, float]:
    """Return a pair (lo, hi) with `low` <= lo < hi <= `high`, or raise `ValueError`."""
    _check_meaning(name, value)
    try:
        # By number: a set has no order.
        lo, hi = (plain(name, value[i], single=True) for i in range(len(value)))
    except (TypeError, ValueError, KeyError):
        lo = hi = None
    if not (type(lo) is float and type(hi) is float):
        raise ValueError(f"`{name}` must be a pair of numbers (low, high), but is {shown(value)}")
    if not (math.isfinite(lo) and math.isfinite(hi) and low <= lo < hi <= high):
        raise ValueError(
            f"`{name}` must be an interval low < high within {low:g} to {high:g}, but is {lo:g} to {hi:g}"
        )
    return lo, hi


def require_x64() -> None:
    """Raise `RuntimeError` unless JAX computes in 64 bits."""
    import jax

    # Set here it would change the caller's other computations, so it is asked for instead.
    if not jax.config.jax_enable_x64:  # type: ignore[attr-defined]
        raise RuntimeError(
            "tpd needs 64-bit floats, but JAX is in 32-bit mode: call "
            'jax.config.update("jax_enable_x64", True) before using it'
        )
