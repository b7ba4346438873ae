"""Checks of user input. A message is one sentence with the name, the allowed values, and the actual value."""

from __future__ import annotations

import functools
import inspect
import math
import numbers
import sys
import warnings
from collections.abc import Callable, Sequence
from datetime import date, time
from pathlib import PurePath
from typing import TYPE_CHECKING, Any, Protocol, TypeAlias, TypeVar, runtime_checkable

import numpy as np

from tpd.core.formatting import called, meant, pair_of

if TYPE_CHECKING:
    import jax

    Real: TypeAlias = float
    Whole: TypeAlias = int
    Vector: TypeAlias = Sequence[float] | np.ndarray | jax.Array
else:
    # An array or a traced value passes as well. The functions of this module reject everything else with
    # their own messages, instead of a type checker.
    @runtime_checkable
    class _Array(Protocol):
        """An array of NumPy or JAX, also a traced one, or a number of NumPy."""

        dtype: Any

    Real, Vector, Whole = Any, Any, int | _Array

Subject = TypeVar("Subject")
_SEEDS = 2**63 - 1
"""Largest seed of a random sequence."""
_MOST = 10_000_000
"""Largest count. A larger number of anything fits neither into memory nor into a day."""
_REAL = "iuf"
"""Kinds of the types of real numbers of NumPy."""
LEAST_TOLERANCE = 1e-16
"""Smallest tolerance of a model. No computation in 64 bits is more accurate."""
PLAUSIBLE = {"pga": (2.0, "g"), "sa": (5.0, "g"), "pgv": (3.0, "m/s")}
"""Largest usual values of ground motions, with their units. The strongest records have slightly more."""
IMPOSSIBLE = 5.0
"""Factor on a usual value from which no ground motion has the value."""
_LONGEST = 80
"""Largest number of characters of a value in a message."""


def is_jax(value: object) -> bool:
    """Return True for an array of JAX, traced or not. Before JAX is imported there are no such arrays."""
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
    """Return `numpy` for concrete values, and `jax.numpy` if one of the values is traced.

    Outside of a compiled function JAX compiles a program for each of its operations and for each shape, which
    NumPy avoids.
    """
    return np if all(map(is_concrete, values)) else _jax_numpy()


def _jax_numpy() -> Any:
    import jax.numpy

    return jax.numpy


def plain(name: str, value: Any, *, single: bool = False) -> Any:
    """Return a number as a float, and an array of numbers as a contiguous array of 64-bit floats.

    This is the only function that converts values of a user. Anything else is returned unchanged, for a check
    to reject.

    Args:
        name: name of the argument.
        value: number or array. Traced values stay traced.
        single: whether the value must be one number. An array of one element is then that number.

    Raises:
        ValueError: the numbers have a unit or a mask, or there are several numbers although `single` is set.
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
            # An integer of Python may be larger than any float. The check that follows rejects the infinity.
            return -math.inf if value < 0 else math.inf
    if value.dtype.kind not in _REAL:
        return value
    if single and value.size != 1:
        raise wrong(name, "a single number", quote(value))
    if is_traced(value) or (is_jax(value) and not single):
        array = value if value.dtype == np.float64 else value.astype(float)
        return array.reshape(()) if single and array.ndim else array
    array = np.ascontiguousarray(value, dtype=float)
    return float(array.reshape(())) if single or value.ndim == 0 else array


def _check_meaning(name: str, value: Any) -> None:
    """Raise `ValueError` for numbers with a unit or with a mask, whose plain values would be wrong."""
    if isinstance(value, (list, tuple)):
        for item in value:
            if type(item) is not float:
                _check_meaning(name, item)
    elif type(value) is np.ndarray or isinstance(value, str) or is_jax(value):
        # These are the usual types, and they have neither a unit nor a mask.
        return
    elif np.ma.is_masked(value):
        raise wrong(name, "no masked elements", f"{quote(value)}: remove or fill them", "have")
    elif any(hasattr(value, of) for of in ("__array__", "__float__")):
        # Quantities of astropy, unyt and pint, columns of pandas, and arrays of xarray have one of these
        # attributes.
        owners, attributes = (value, getattr(value, "dtype", None)), getattr(value, "attrs", None) or {}
        units = [getattr(x, of) for x in owners for of in ("unit", "units", "magnitude") if hasattr(x, of)]
        units += [attributes[of] for of in ("unit", "units") if of in attributes]
        if units:
            remedy = "convert it to the unit that the documentation states, and pass its value"
            raise wrong(name, "plain numbers", f"{quote(value)} with the unit '{units[0]}': {remedy}")


def quote(value: object) -> str:
    """Return a value as a message shows it: on one line of limited length."""
    # A path and a date of TOML have no notation that a user would write.
    is_plain = isinstance(value, (np.ndarray, PurePath, date, time))
    text = " ".join((str(value) if is_plain else repr(value)).split())
    if isinstance(value, list):
        text = f"[{', '.join(map(quote, value))}]"
    return text if len(text) <= _LONGEST else f"{text[:_LONGEST]}..."


def wrong(name: str, allowed: str, actual: str, be: str = "be") -> ValueError:
    """Return the error for an argument that must `be` something allowed, but is something else."""
    return ValueError(f"{called(name)} must {be} {allowed}, but is {actual}")


def instance(name: str, value: Any, of: type | tuple[type, ...], hint: str = "") -> Any:
    """Return an object of a class `of`, or of one of several classes; raise `ValueError` for anything else.

    Args:
        name: name of the argument.
        value: value of the argument.
        of: the class, or the classes.
        hint: end of the message, such as ": take `scene.parameters()`".
    """
    if isinstance(value, of) and not inspect.isclass(value):
        return value
    # Abstract base classes are named without their prefix in the message.
    classes = of if isinstance(of, tuple) else (of,)
    names = " or ".join(c.__name__.removeprefix("Abstract") for c in classes)
    if inspect.isclass(value) and issubclass(value, classes):
        raise wrong(name, f"an object of {names}, `{value.__name__}(...)`", "the class itself")
    raise wrong(name, f"a {names}", quote(value) + hint)


def optional(name: str, value: object, of: type | tuple[type, ...]) -> None:
    """Check as `instance`, but allow None as well."""
    if value is not None:
        instance(name, value, of)


def function(name: str, value: object, *, optional: bool = True) -> None:
    """Raise `ValueError` unless `value` is a function, or None if `optional` is set."""
    if not (callable(value) or (optional and value is None)):
        raise wrong(name, "a function", quote(value))


def keywords(subject: Subject) -> Subject:
    """Return a function, or a class, that suggests a name if an argument does not exist."""
    # Python itself suggests nothing before version 3.13, and does not know the old names.
    target: Any = subject
    function = target.__init__ if inspect.isclass(subject) else target
    allowed = [name for name in inspect.signature(function).parameters if name != "self"]

    @functools.wraps(function)
    def checked(*args: Any, **named: Any) -> Any:
        for name in named:
            if name not in allowed:
                raise TypeError(f"`{target.__name__}` has no argument `{name}`{meant(name, allowed)}")
        return function(*args, **named)

    if function is target:
        return checked  # type: ignore[return-value]
    target.__init__ = checked
    return subject


def flag(name: str, value: object) -> None:
    """Raise `ValueError` unless `value` is True or False."""
    if not isinstance(value, (bool, np.bool_)):
        raise wrong(name, "True or False", quote(value))


def array(name: str, value: object, shape: tuple[int, ...], of: str) -> Any:
    """Return an array of finite 64-bit floats with a certain shape, contiguous; of NumPy unless it is traced.

    Args:
        name: name of the argument.
        value: array or nested lists. For traced values only the shape is checked.
        shape: expected shape; -1 stands for any length above zero.
        of: words for the expected numbers.

    Raises:
        ValueError: the value is anything else.
    """
    _check_meaning(name, value)
    # The values of traced arrays are not known: only the shape can be checked.
    traced = _holds_traced(value)
    try:
        numbers: Any = _jax_numpy().asarray(value, dtype=float) if traced else np.asarray(value)
        pairs = zip(numbers.shape, shape, strict=False)
        fits = numbers.ndim == len(shape) and all(n == m or m < 0 < n for n, m in pairs)
        if fits and traced:
            return numbers
        if fits and numbers.dtype.kind in _REAL:
            floats = np.ascontiguousarray(numbers, float)
            if np.isfinite(floats).all():
                return floats
    except (TypeError, ValueError, OverflowError):
        # The errors of JAX about traced values are subclasses of TypeError.
        pass
    raise wrong(name, f"{of}, all finite", quote(value))


def increasing(name: str, value: object, least: int = 2) -> Any:
    """Return a vector of at least `least` increasing numbers; raise `ValueError` for anything else.

    For traced numbers only the shape is checked.
    """
    of = f"a vector of {least} or more increasing numbers"
    vector = array(name, value, (-1,), of)
    if len(vector) < least or (is_concrete(vector) and not np.all(np.diff(vector) > 0.0)):
        raise wrong(name, of, quote(vector))
    return vector


def _holds_traced(value: object) -> bool:
    """Return True for a traced value, or for nested lists that contain one."""
    return is_traced(value) or (isinstance(value, (list, tuple)) and any(map(_holds_traced, value)))


def state(value: Any) -> Any:
    """Return an initial state `y0` = (phi, psi, phi', psi') as floats, of NumPy unless it is traced.

    Raises:
        ValueError: the value is not four finite numbers.
    """
    return array("y0", value, (4,), "(phi, psi, phi', psi')")


def _check(name: str, value: object, allowed: str, holds: Callable[[Any], Any], every: bool = False) -> Any:
    """Return a number, or an array if `every` is set, for which `holds` is true; raise `ValueError`
    otherwise."""
    if type(value) is float and math.isfinite(value) and holds(value):
        # Check floats first, because NumPy needs more time for one number than a whole simulation.
        return value
    value = plain(name, value, single=not every)
    if is_traced(value):
        # A traced value has no number that could be checked. Its caller is responsible for the range.
        return value
    numbers = np.asarray(value) if is_concrete(value) else np.asarray(None)
    if numbers.dtype.kind not in _REAL:
        raise wrong(name, "a number", quote(value))
    if not (numbers.size and np.all(np.isfinite(numbers)) and np.all(holds(numbers))):
        raise wrong(name, allowed, f"{value:g}" if isinstance(value, float) else quote(numbers))
    return value


def number(name: str, value: object) -> Any:
    """Return a finite number; raise `ValueError` for anything else."""
    return _check(name, value, "finite", lambda x: True)


def each(name: str, value: object) -> np.ndarray:
    """Return finite numbers of any shape, from lists or an array; raise `ValueError` for anything else."""
    _check_meaning(name, value)
    return np.asarray(_check(name, np.asarray(value), "finite", lambda x: True, every=True))


def positive(name: str, value: object, *bounds: Any, every: bool = False) -> Any:
    """Return a positive finite number, or an array of them if `every` is set; raise `ValueError` for anything
    else.

    `bounds` are those of `within`.
    """
    value = _check(name, value, "positive and finite", lambda x: x > 0, every)
    return within(name, value, *bounds, every=every) if bounds else value


def count(name: str, value: Any, least: int = 1, most: int = _MOST) -> int:
    """Return an integer between `least` and `most`; raise `ValueError` for anything else."""
    if is_concrete(value) and np.size(value) == 1 and np.asarray(value).dtype.kind in "iu":
        value = int(np.reshape(value, ()))
        if least <= value <= most:
            return value
    # The upper bound is mentioned only if the value exceeds it, because it is unusual.
    too_many = type(value) is int and value > most
    allowed = f"a whole number, {least} to {most}" if too_many else f"a whole number, {least} or more"
    return _check(name, value, allowed, lambda x: False)


def seed(name: str, value: object) -> int:
    """Return an integer that is allowed as a seed; raise `ValueError` for anything else."""
    return count(name, value, 0, _SEEDS)


def not_negative(name: str, value: object, *bounds: Any, every: bool = False) -> Any:
    """Return a number as `positive` does, but allow zero as well."""
    value = _check(name, value, "zero or positive, and finite", lambda x: x >= 0, every)
    return within(name, value, *bounds, every=every) if bounds else value


def within(name: str, value: object, low: float, high: float, unit: str = "", *, every: bool = False) -> Any:
    """Return a number as `positive` does, but between `low` and `high`, both included."""
    allowed = f"between {low:g} and {high:g}{unit}"
    return _check(name, value, allowed, lambda x: (x >= low) & (x <= high), every)


def plausible(name: str, value: object, quantity: str, ask: str = "") -> None:
    """Warn of a size of a ground motion that is unusual, and raise `ValueError` for one that is impossible.

    Traced values are not checked.

    Args:
        name: words for the value, such as "the largest of `scales`".
        value: number or array, in the unit of `PLAUSIBLE`.
        quantity: key of `PLAUSIBLE`; the numbers of other quantities have no usual size.
        ask: question at the end of the message; default for a value that is stated in this unit.
    """
    if quantity not in PLAUSIBLE or not is_concrete(value):
        return
    usual, unit = PLAUSIBLE[quantity]
    if not (most := float(np.max(np.asarray(value)))) > usual:
        return
    # The strongest records exceed a usual value, and a scan for the strength of a block may go beyond it.
    is_impossible = most > IMPOSSIBLE * usual
    bound = f"must be at most {IMPOSSIBLE * usual:g}" if is_impossible else f"is usually at most {usual:g}"
    text = f"{name} {bound} {unit}, but is {most:.3g} {unit}: {ask or f'is it in {unit}?'}"
    if is_impossible:
        raise ValueError(text)
    warnings.warn(text, stacklevel=2)


def tolerance(name: str, value: object) -> Any:
    """Return a tolerance or a rate of a model; raise `ValueError` unless it is above 0 and at most 1."""
    return positive(name, value, LEAST_TOLERANCE, 1.0)


def set_checked(thing: Any, check: Callable[..., Any], names: str, *bounds: Any) -> None:
    """Replace fields of a frozen object by the results of a check. `names` are separated by spaces."""
    for name in names.split():
        object.__setattr__(thing, name, check(name, getattr(thing, name), *bounds))


def at_most(name: str, value: object, most: object, of: str) -> None:
    """Raise `ValueError` if `value` is larger than `most`, which the words `of` describe.

    Both may be arrays that broadcast. Traced values are not checked.
    """
    if not (is_concrete(value) and is_concrete(most)):
        return
    values, bounds = np.broadcast_arrays(np.asarray(value), np.asarray(most))
    # Allow rounding errors, for example of a mass that was computed from its ratio.
    beyond = values > bounds * (1.0 + 1e-9)
    if np.any(beyond):
        first = tuple(np.argwhere(beyond)[0])
        actual, limit = pair_of(float(values[first]), float(bounds[first]), 6)
        raise wrong(name, f"at most {limit}, {of}", actual)


def one_of(name: str, value: object, allowed: Sequence[str]) -> None:
    """Raise `ValueError` unless `value` is one of the allowed words."""
    if not isinstance(value, str) or value not in allowed:
        close = meant(value, allowed, listing=False)
        raise wrong(name, f"one of {', '.join(allowed)}", quote(value) + close)


def interval(name: str, value: Any, low: float, high: float) -> tuple[float, float]:
    """Return a pair (lo, hi) with `low` <= lo < hi <= `high`; raise `ValueError` for anything else."""
    _check_meaning(name, value)
    try:
        # Index the value: a set, which has no order, cannot be indexed and is rejected.
        lo, hi = (plain(name, value[i], single=True) for i in range(len(value)))
    except (TypeError, ValueError, KeyError):
        lo = hi = None
    if not (type(lo) is float and type(hi) is float):
        raise wrong(name, "a pair of numbers (low, high)", quote(value))
    if not (math.isfinite(lo) and math.isfinite(hi) and low <= lo < hi <= high):
        raise wrong(name, f"an interval low < high within {low:g} to {high:g}", f"{lo:g} to {hi:g}")
    return lo, hi


def largest(values: Any) -> Any:
    """Return the largest absolute value of an array, also of a traced one."""
    size = abs(values)
    # JAX looks for the maximum again to differentiate it. The result is NaN if XLA rounds differently then.
    return size[size.argmax()]


def require_x64() -> None:
    """Raise `RuntimeError` unless JAX computes in 64 bits."""
    import jax

    # The library does not change this setting, because it would affect other computations of the user.
    if not jax.config.jax_enable_x64:  # type: ignore[attr-defined]
        remedy = 'call jax.config.update("jax_enable_x64", True) before using it'
        raise RuntimeError(f"tpd needs 64-bit floats, but JAX is in 32-bit mode: {remedy}")
