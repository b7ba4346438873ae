"""Types of the package, checked by beartype while the tests run, with the shapes of jaxtyping."""

from __future__ import annotations

import re
from contextlib import suppress
from functools import partial
from inspect import isfunction
from types import CodeType
from typing import Any

import jaxtyping

_with_shapes = jaxtyping.jaxtyped
_CHECKED: set[CodeType] = set()
"""Local functions that were decorated once."""


def names_dimensions(function: Any) -> bool:
    """Whether dimensions of several annotations may have one name, such as `Float[Array, "times"]`."""
    return any(re.search(r"\[.*'[^']*[a-z]", str(text)) for text in function.__annotations__.values())


def checked(function: Any, typechecker: Any) -> Any:
    """Let beartype check the arguments and the result of a function."""
    stated = function.__annotations__
    known = {}
    for name, text in stated.items():
        # Some names are imported for type checkers only.
        with suppress(NameError, AttributeError, TypeError):
            known[name] = eval(text, function.__globals__) if isinstance(text, str) else text
    function.__annotations__ = known
    try:
        return typechecker(function)
    finally:
        function.__annotations__ = stated


def jaxtyped(target: Any, typechecker: Any) -> Any:
    """Decorate a function or class as the import hook of jaxtyping does, but faster.

    The decorator of jaxtyping compares dimensions of one name. For this it binds the arguments of each call
    and checks them twice, which took a third of the time of the tests. All functions without such names leave
    the check to beartype. A local function is checked only the first time that it is made, because decorating
    it takes a millisecond.
    """
    if not isfunction(target):
        # `checks.keywords` has wrapped some classes, which name a wrong argument themselves.
        if hasattr(target.__init__, "__wrapped__"):
            return target
        return _with_shapes(target, typechecker=typechecker)
    if "<locals>" in target.__qualname__:
        if target.__code__ in _CHECKED:
            return target
        _CHECKED.add(target.__code__)
    if names_dimensions(target):
        return _with_shapes(target, typechecker=typechecker)
    return checked(target, typechecker)


def install() -> None:
    """Check the types of all modules of the package that are imported from now on."""

    def decorator(*target: Any, typechecker: Any = None) -> Any:
        if target:
            return _with_shapes(*target, typechecker=typechecker)
        return partial(jaxtyped, typechecker=typechecker)

    # The modules that the hook has changed find the decorator by this name, and so do other packages.
    jaxtyping.jaxtyped = decorator
    jaxtyping.install_import_hook("tpd", "beartype.beartype")
