"""Examples in docstrings: every public name has one, and each prints the output that stands below it."""

from __future__ import annotations

import doctest
import inspect
from collections.abc import Iterable
from types import ModuleType
from typing import Any

import pytest

import tpd
from tpd import limits

OPTIONS = doctest.NORMALIZE_WHITESPACE | doctest.ELLIPSIS


def public(module: ModuleType, names: Iterable[str]) -> dict[str, Any]:
    """Return the objects behind public names, by their dotted names."""
    out: dict[str, Any] = {}
    for name in names:
        value = getattr(module, name)
        if inspect.ismodule(value):
            out |= public(value, LISTED.get(name) or value.__all__)
        else:
            out[f"{module.__name__}.{name}"] = value
    return out


LISTED = {"limits": limits.__all__, "records": ("el_centro", "fema_p695", "loma_prieta")}
"""Names of the public modules without a list of their own."""
WITHOUT = ("tpd.engines.mujoco", "tpd.engines.EngineVerdict")
"""An engine that is an optional package, and its result."""
PUBLIC = {
    name: thing
    for name, thing in public(tpd, tpd.__all__).items()
    # Tuples of limits have no docstring.
    if name not in WITHOUT and not isinstance(thing, tuple)
}


@pytest.mark.parametrize("name", sorted(PUBLIC))
def test_every_public_name_has_an_example_that_prints_its_output(name):
    thing = PUBLIC[name]
    found = doctest.DocTestFinder(recurse=False).find(thing, name, globs={})
    (test,) = found
    assert test.docstring, name
    assert 2 <= len(test.examples) <= 10, "an example has two to ten lines"
    assert "tpd" in "".join(example.source for example in test.examples)
    runner = doctest.DocTestRunner(optionflags=OPTIONS)
    text: list[str] = []
    runner.run(test, out=text.append)
    assert not runner.failures, "".join(text)
