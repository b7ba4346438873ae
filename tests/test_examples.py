"""Examples in docstrings: every public name has one, and each prints the output that stands below it."""

from __future__ import annotations

import doctest
import inspect
from types import ModuleType
from typing import Any

import pytest

import tpd

OPTIONS = doctest.NORMALIZE_WHITESPACE | doctest.ELLIPSIS


def public(names: ModuleType) -> dict[str, Any]:
    """Public names of the package and of its public modules, with the objects behind them."""
    out: dict[str, Any] = {}
    for name in getattr(names, "__all__", [name for name in dir(names) if not name.startswith("_")]):
        value = getattr(names, name)
        if not inspect.ismodule(value):
            out[f"{names.__name__}.{name}"] = value
        elif value.__name__.startswith("tpd"):
            out |= public(value)
    # Constants have no docstring, and a module also shows what it imports.
    return {path: x for path, x in out.items() if str(getattr(x, "__module__", "")).startswith("tpd")}


PUBLIC = public(tpd)


@pytest.mark.parametrize("name", sorted(PUBLIC))
def test_every_public_name_has_an_example_that_prints_its_output(name):
    thing = PUBLIC[name]
    found = doctest.DocTestFinder(recurse=False).find(thing, name, globs={})
    (test,) = found
    assert test.docstring, name
    assert 2 <= len(test.examples) <= 10, "an example has two to ten lines"
    assert "import tpd" in test.examples[0].source
    runner = doctest.DocTestRunner(optionflags=OPTIONS)
    text: list[str] = []
    runner.run(test, out=text.append)
    assert not runner.failures, "".join(text)
