"""Guards that a benchmark takes away are where they are said to be; seeing their tests fail takes an hour."""

import ast

import pytest

from tests.benchmarks.guards import GUARDS, ROOT
from tests.benchmarks.removals import mutated, never, without_term


def names_in(path):
    defined = ast.parse((ROOT / path).read_text(encoding="utf-8")).body
    return [n.name for n in defined if isinstance(n, ast.FunctionDef)]


@pytest.mark.parametrize("guard", GUARDS, ids=[f"{g.place} {i}" for i, g in enumerate(GUARDS)])
def test_every_guard_can_be_taken_out_and_has_tests(guard):
    ast.parse(guard.taken_from((ROOT / guard.path).read_text(encoding="utf-8")))
    assert guard.tests
    for test in guard.tests:
        path, _, name = test.partition("::")
        assert name.partition("[")[0] in names_in(path)


def test_a_guard_that_is_gone_is_an_error():
    source = "def f(a, b):\n    usable = a & ~b\n    return usable\n"
    assert "usable = a\n" in mutated(source, "f", without_term("usable", "b"))
    with pytest.raises(ValueError, match="was not found"):
        mutated(source, "f", never("failed"))
    with pytest.raises(ValueError, match="no function"):
        mutated(source, "g", never("failed"))
