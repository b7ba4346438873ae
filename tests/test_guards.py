"""Guards that a benchmark takes away are where they are said to be; seeing their tests fail takes an hour."""

import ast

import pytest

from tests.benchmarks.guards import GUARDS, ROOT
from tests.benchmarks.mutations import EQUIVALENT, places
from tests.benchmarks.removals import mutated, never, without_term


def names_in(path):
    defined = ast.parse((ROOT / path).read_text(encoding="utf-8")).body
    return [n.name for n in defined if isinstance(n, ast.FunctionDef)]


@pytest.mark.parametrize("guard", GUARDS, ids=[f"{g.place} {i}" for i, g in enumerate(GUARDS)])
def test_every_guard_can_be_removed_and_has_tests(guard):
    ast.parse(guard.taken_from((ROOT / guard.path).read_text(encoding="utf-8")))
    assert guard.tests
    for test in guard.tests:
        path, _, name = test.partition("::")
        assert name.partition("[")[0] in names_in(path)


def test_a_missing_guard_is_an_error():
    source = "def f(a, b):\n    usable = a & ~b\n    return usable\n"
    assert "usable = a\n" in mutated(source, "f", without_term("usable", "b"))
    with pytest.raises(ValueError, match="was not found"):
        mutated(source, "f", never("failed"))
    with pytest.raises(ValueError, match="no function"):
        mutated(source, "g", never("failed"))


def test_a_mutation_changes_one_expression_and_no_line_number():
    module = "theory/no_uplift"
    before = places(module)[0].path.read_bytes()
    changed = {place.text() for place in places(module)}
    assert len(changed) == len(places(module)) > 50
    for text in changed:
        assert text.count(b"\n") == before.count(b"\n")
        assert ast.dump(ast.parse(text)) != ast.dump(ast.parse(before))


def test_every_mutation_without_effect_exists():
    for module, line, change in EQUIVALENT:
        assert any((place.line, place.change) == (line, change) for place in places(module)), change
