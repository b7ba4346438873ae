"""Every module of the package has the tests of its name: `tpd/<folder>/<module>.py` those in
`tests/<folder>/test_<module>.py`, and no other test file stands in such a folder.

    python -m tests.test_mirror

lists what is missing and what is left over.
"""

import ast
from pathlib import Path

TESTS = Path(__file__).parent
PACKAGE = TESTS.parent / "tpd"
ELSEWHERE = {"benchmarks", "browser", "properties"}
"""Folders of the tests that mirror none of the package."""
OF_ALL = {Path("cli/test_bad_input.py")}
"""Tests of all modules of a folder at once."""


def has_code(path: Path) -> bool:
    """Return whether a module defines a function or a class."""
    tree = ast.parse(path.read_text(encoding="utf-8"))
    return any(isinstance(node, ast.FunctionDef | ast.ClassDef) for node in tree.body)


def modules() -> set[Path]:
    """Test files that the modules of the package ask for, from the folder of the tests."""
    paths = {
        p.relative_to(PACKAGE) for p in PACKAGE.rglob("*.py") if not p.name.startswith("__") and has_code(p)
    }
    return {path.with_name(f"test_{path.name}") for path in paths}


def with_tests() -> set[Path]:
    """Test files of modules, each with a test."""
    found = {path.relative_to(TESTS) for path in TESTS.rglob("test_*.py")}
    # Other files beside this one concern the whole package.
    found -= {path for path in found if path.parent == Path() and not (PACKAGE / path.name[5:]).exists()}
    tests = {path for path in found if "def test_" in (TESTS / path).read_text(encoding="utf-8")}
    return {path for path in tests if path.parts[0] not in ELSEWHERE}


def test_every_module_has_tests_of_its_name():
    assert not sorted(map(str, modules() - with_tests()))


def test_every_test_file_in_a_folder_is_of_a_module():
    there = {
        path.with_name(f"test_{path.name}")
        for path in (p.relative_to(PACKAGE) for p in PACKAGE.rglob("*.py"))
    }
    assert not sorted(map(str, with_tests() - there - OF_ALL))


if __name__ == "__main__":
    for path in sorted(modules() - with_tests()):
        print(f"missing   tests/{path}")
    for path in sorted(with_tests() - modules() - OF_ALL):
        print(f"left over tests/{path}")
