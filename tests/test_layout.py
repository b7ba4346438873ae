"""Measures of the source: layers, sizes, comments and names."""

from __future__ import annotations

import ast
import re
import tomllib
from importlib import import_module

import pytest

import tpd
from tests.api_reference import Reference
from tests.measures import (
    CEILINGS,
    COMMENTS,
    FILES,
    MODULES,
    ROOT,
    Source,
    base_commit,
    foreign_names,
    longest_chain,
    name_of,
    tree,
    worse,
)
from tests.test_english import exists, messages

NOW = Source.here()
SETTINGS = tomllib.loads((ROOT.parent / "pyproject.toml").read_text(encoding="utf-8"))["tool"]
LAYERS = [
    layer.partition(" : ")[0].removeprefix("tpd.")
    for layer in reversed(SETTINGS["importlinter"]["contracts"][0]["layers"])
]


def folder(module: str) -> str:
    """Folder of a module: that of the designs for the limits, which have a short name for users."""
    parts = module.split(".")
    return "design" if module == "tpd.limits" else parts[1] if len(parts) > 2 else "tpd"


def test_there_is_no_import_cycle():
    # Imports within functions and those for type checkers count.
    longest_chain(NOW.graph)


def test_an_import_cycle_is_detected():
    with pytest.raises(ValueError, match="a -> b -> a"):
        longest_chain({"a": {"b"}, "b": {"a"}})


def test_a_folder_imports_only_from_lower_layers_and_every_folder_is_a_layer():
    for name in MODULES:
        if (layer := folder(name)) != "tpd":
            lower = {"tpd", *LAYERS[: LAYERS.index(layer) + 1]}
            assert {folder(other) for other in NOW.imports_of(name)} <= lower, name
    assert {path.relative_to(ROOT).parts[0] for path in FILES if path.parent != ROOT} == set(LAYERS)


def test_no_measure_of_the_code_gets_worse():
    base = base_commit()
    before = Source.of_commit(base).measures() if base else {}
    assert not worse(before, NOW.measures())


def test_a_size_has_a_ceiling_and_the_structure_does_not_get_worse():
    before = {"columns by number": 5.0, COMMENTS: 10.0}
    now = {**CEILINGS, "columns by number": 6.0, COMMENTS: 9.0, "modules": CEILINGS["modules"] + 1}
    above = f"modules: {now['modules']}, and {CEILINGS['modules']} is the ceiling"
    changed = [above, "columns by number: 6, and 5 before", f"{COMMENTS}: 9, and 10 before"]
    assert sorted(worse(before, now)) == sorted(changed)
    assert not worse({}, dict(CEILINGS))


def test_private_names_of_libraries_are_counted_without_a_fallback():
    text = """
from argparse import _HelpAction
from numba.core import caching
from tpd.core import _own
import numba._dynfunc
try:
    from numba.core import codegen
    parser._actions
except ImportError:
    codegen = library._unsafe
row._replace(x=self._own)
"""
    names = ["argparse._HelpAction", "numba.core.caching", "numba._dynfunc", "library._unsafe"]
    assert sorted(foreign_names(ast.parse(text), {"_own"})) == sorted(names)


def test_no_module_compares_the_name_of_an_excitation():
    """What differs between kinds of motion is answered by the classes of jobs and problems."""
    compared = re.compile(r"""kind(\"\])? (==|!=|in|not in) \(?"(harmonic|pulse|records)\"""")
    assert compared.search('if job.kind == "harmonic":')
    found = [name for name, path in MODULES.items() if compared.search(path.read_text(encoding="utf-8"))]
    assert not found


READERS = {
    "tpd.cli.options": "words of the command line, and messages of argparse",
    "tpd.cli.new": "the template of a job file",
    "tpd.design.job": "columns of a user, and errors of the reader of TOML",
    "tpd.design.sizes": "errors of JAX",
    "tpd.design.tables": "docstrings",
    "tpd.explore.page": "modules of the page",
    "tpd.report.blocks": "numbers in a cell, and units",
    "tpd.report.render": "the format of a picture",
    "tpd.plots.results": "the name of a file",
}
"""Modules of the upper layers that search a text, with what they read."""
SEARCHES = {"startswith", "endswith", "removeprefix", "removesuffix", "partition", "rpartition", "splitlines"}
SEARCHES |= {"search", "fullmatch", "findall", "sub"}
"""Methods that search a text."""


def searches_text(node: ast.AST) -> bool:
    """Return whether a node is a call that searches a text, or compares a text with a part of it."""
    match node:
        case ast.Call(func=ast.Attribute(attr=name)):
            return name in SEARCHES
        case ast.Compare(left=ast.Constant(value=str(word)), ops=[ast.In() | ast.NotIn()]):
            return " " in word or word[:1].isupper()
    return False


def test_modules_that_make_sentences_do_not_search_them():
    """Kinds are data: a sentence is made once, and neither searched nor changed."""
    texts = 'x.partition(":")', 're.sub("a", "b", page)', '"MuJoCo" in first', '"name" in row'
    found = [any(map(searches_text, ast.walk(ast.parse(text)))) for text in texts]
    assert found == [True, True, True, False]
    paths = [path for name, path in MODULES.items() if folder(name) in ASKING and name not in READERS]
    found = [
        f"{path.name}:{node.lineno}" for path in paths for node in ast.walk(tree(path)) if searches_text(node)
    ]
    assert not found


ASKING = "design", "engines", "plots", "report", "explore", "cli"
"""Layers that know the problem of a design."""


def test_public_names_are_few_and_each_has_a_module():
    stub = [node for node in tree(ROOT / "__init__.pyi").body if isinstance(node, ast.ImportFrom)]
    names = [alias.name for node in stub for alias in node.names]
    assert sorted(names) == tpd.__all__ == dir(tpd)
    assert len(names) <= 58
    for node in stub:
        for alias in node.names:
            assert alias.asname == alias.name, "type checkers see only names that are imported as themselves"
            home = f"tpd.{node.module}" if node.module else f"tpd.{alias.name}"
            assert home in MODULES
            assert node.module is None or getattr(tpd, alias.name) is vars(import_module(home))[alias.name]


def test_a_misspelt_public_name_is_an_error_with_a_hint():
    with pytest.raises(AttributeError, match="No tpd attribute optimize") as refused:
        _ = tpd.optimize
    assert refused.value.name == "optimize", "Python suggests a similar name"


def names_in(text: str) -> list[str]:
    """Return the names in backticks, of calls as well."""
    return re.findall(r"`([A-Za-z_][\w.]*)(?:\([^`]*\))?`", text)


def test_every_name_in_a_message_or_a_public_docstring_can_be_reached():
    page = Reference().text()
    public = {name for title in re.findall(r"^#+ `([\w.]+)`", page, re.M) for name in title.split(".")}
    nodes = [node for path in FILES for node in tree(path).body]
    private = {node.name for node in nodes if isinstance(node, ast.FunctionDef)}
    for node in nodes:
        if isinstance(node, (ast.Assign, ast.AnnAssign)):
            names = (name for name in ast.walk(node) if isinstance(name, ast.Name))
            private |= {name.id for name in names if isinstance(name.ctx, ast.Store)}
    # The same word may be an argument, a field or a method.
    inner = {arg.arg for path in FILES for arg in ast.walk(tree(path)) if isinstance(arg, ast.arg)}
    for node in nodes:
        if isinstance(node, ast.ClassDef):
            inner |= {part.name for part in node.body if isinstance(part, ast.FunctionDef)}
            inner |= {part.target.id for part in node.body if isinstance(part, ast.AnnAssign)}
    private -= public | inner
    assert {"all_symmetric_orbits", "row_of", "ANGLES"} <= private
    # The types of annotations have their own paragraphs, which are not text for readers of a docstring.
    texts = [("api.md", re.sub(r"^\*\*`\w+`\*\*", "", page, flags=re.M))]
    texts += [(f"{name_of(path)}:{line}", text) for path in FILES for line, text in messages(path)]
    found = [
        f"{place}: {name}"
        for place, text in texts
        for name in names_in(text)
        if name in private or (name.startswith("tpd.") and not exists(name))
    ]
    assert not found
