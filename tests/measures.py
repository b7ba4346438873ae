"""Measures of the source, each of which may only get better. The text of docstrings is not counted.

    python -m tests.measures

prints them; `tests/test_layout.py` compares them with the last ones.
"""

from __future__ import annotations

import ast
import io
import re
import tokenize
from collections import Counter
from collections.abc import Callable, Iterable, Iterator
from functools import cache
from pathlib import Path

ROOT = Path(__file__).parents[1] / "tpd"
FILES = sorted(ROOT.rglob("*.py"))
PRAGMA = re.compile(r"#\s*(noqa|type:|pyright:|fmt:|pragma)")
BY_STRING = re.compile(r"(tpd\.)?[a-z_]+(\.[a-z_]+)*:[a-z_]+")
COMMENTS = "comments per 100 code lines"
"""Name of the only measure of which more is better."""


@cache
def tree(path: Path) -> ast.Module:
    """Syntax tree of a file."""
    return ast.parse(path.read_text(encoding="utf-8"))


def name_of(path: Path) -> str:
    """Dotted name of a module; a package's is that of its folder."""
    parts = path.relative_to(ROOT.parent).with_suffix("").parts
    return ".".join(parts[:-1] if parts[-1] == "__init__" else parts)


MODULES = {name_of(path): path for path in FILES}


def imports(path: Path, *, everywhere: bool) -> set[str]:
    """Modules of the package that a module imports when it is loaded; with `everywhere` also within functions
    and for type checkers only."""
    found: set[str] = set()

    def walk(nodes: list[ast.stmt]) -> None:
        for node in nodes:
            if isinstance(node, ast.Import):
                found.update(alias.name for alias in node.names)
            elif isinstance(node, ast.ImportFrom) and node.module:
                inner = {f"{node.module}.{alias.name}" for alias in node.names}
                found.update(inner & MODULES.keys() or {node.module})
            elif isinstance(node, ast.If) and (everywhere or "TYPE_CHECKING" not in ast.unparse(node.test)):
                walk([*node.body, *node.orelse])
            elif isinstance(node, ast.Try):
                walk([*node.body, *(s for handler in node.handlers for s in handler.body)])
            elif everywhere and isinstance(node, ast.FunctionDef | ast.ClassDef | ast.With | ast.For):
                walk(node.body)

    walk(tree(path).body)
    return found & (MODULES.keys() - {name_of(path), "tpd"})


def longest_chain(graph: dict[str, set[str]]) -> int:
    """Nodes on the longest path.

    Raises:
        ValueError: a cycle.
    """
    lengths: dict[str, int] = {}

    def length(node: str, above: tuple[str, ...]) -> int:
        if node in above:
            raise ValueError(" -> ".join((*above[above.index(node) :], node)))
        if node not in lengths:
            lengths[node] = 1 + max((length(n, (*above, node)) for n in sorted(graph[node])), default=0)
        return lengths[node]

    return max(length(node, ()) for node in graph)


def everywhere() -> dict[str, set[str]]:
    """Imports of every module but the package's own list of names."""
    return {name: imports(path, everywhere=True) for name, path in MODULES.items() if name != "tpd"}


def loaded_by_name() -> dict[str, set[str]]:
    """Modules that each module names in a string: compiled code is loaded so, also in other processes."""
    strings = {
        name: {
            n.value for n in ast.walk(tree(path)) if isinstance(n, ast.Constant) and isinstance(n.value, str)
        }
        for name, path in MODULES.items()
    }
    return {name: found & (MODULES.keys() - {name, "tpd"}) for name, found in strings.items()}


def reached(graph: dict[str, set[str]], start: str) -> set[str]:
    """Modules that one imports, and what these import."""
    found, todo = {start}, [start]
    while todo:
        new = graph[todo.pop()] - found
        found |= new
        todo.extend(new)
    return found


def docstrings(parsed: ast.Module) -> Iterator[ast.Constant]:
    """Docstrings of modules, classes, functions and attributes."""
    for node in ast.walk(parsed):
        value = node.value if isinstance(node, ast.Expr) else None
        if isinstance(value, ast.Constant) and isinstance(value.value, str):
            yield value


def code_lines(text: str) -> int:
    """Count the lines that are not blank and hold no comment alone, no docstring and no import."""
    parsed = ast.parse(text)
    imports = (node for node in ast.walk(parsed) if isinstance(node, ast.Import | ast.ImportFrom))
    left_out: set[int] = set()
    for node in (*docstrings(parsed), *imports):
        left_out.update(range(node.lineno, (node.end_lineno or node.lineno) + 1))
    lines = enumerate(map(str.strip, text.splitlines()), 1)
    return sum(bool(line) and not line.startswith("#") and i not in left_out for i, line in lines)


def comment_lines(text: str) -> int:
    """Count the lines with a comment that is no pragma."""
    tokens = tokenize.generate_tokens(io.StringIO(text).readline)
    return sum(t.type == tokenize.COMMENT and not PRAGMA.match(t.string) for t in tokens)


def total(count: Callable[[str], int], paths: Iterable[Path] = FILES) -> int:
    """Add up what a function counts in the text of each file."""
    return sum(count(path.read_text(encoding="utf-8")) for path in paths)


def imports_by_string(text: str) -> int:
    """Count the strings such as "report.answer:answer", which name a module and something in it."""
    nodes = (node for node in ast.walk(ast.parse(text)) if isinstance(node, ast.Constant))
    return sum(isinstance(node.value, str) and bool(BY_STRING.fullmatch(node.value)) for node in nodes)


def functions() -> Iterator[tuple[Path, ast.FunctionDef]]:
    """Every function and the file that it stands in."""
    for path in FILES:
        for node in ast.walk(tree(path)):
            if isinstance(node, ast.FunctionDef):
                yield path, node


def arguments(node: ast.FunctionDef) -> int:
    """Arguments that are handed over one by one; keyword-only ones, which have names at the call, do not
    count."""
    return len(node.args.posonlyargs) + len(node.args.args)


def called_once() -> list[str]:
    """Private functions of eight lines or fewer that their module uses once."""
    used = {path: Counter(re.findall(r"\w+", path.read_text(encoding="utf-8"))) for path in FILES}
    return [
        f"{name_of(path)}.{node.name}"
        for path, node in functions()
        if node.name.startswith("_")
        and not node.name.startswith("__")
        and used[path][node.name] == 2
        and (node.end_lineno or 0) - node.lineno < 8
    ]


def numbered_columns() -> int:
    """Whole numbers within subscripts of compiled code."""
    found = 0
    for path in FILES:
        if path.relative_to(ROOT).parts[0] not in ("compiled", "models"):
            continue
        for node in ast.walk(tree(path)):
            if isinstance(node, ast.Subscript):
                parts = node.slice.elts if isinstance(node.slice, ast.Tuple) else [node.slice]
                found += any(isinstance(p, ast.Constant) and isinstance(p.value, int) for p in parts)
    return found


def measured() -> dict[str, float]:
    """All measures by name: less is better, except for `COMMENTS`."""
    graph = everywhere()
    by_name = loaded_by_name()
    job = reached({name: found | by_name[name] for name, found in graph.items()}, "tpd.cli.optimise")
    code = total(code_lines)
    return {
        "code lines": code,
        "modules": len(FILES),
        "modules that the main job may import": len(job),
        "code lines of these": total(code_lines, (MODULES[name] for name in job)),
        "floors, all imports counted": longest_chain(graph),
        "functions of ten or more arguments": sum(arguments(node) >= 10 for _, node in functions()),
        "functions of eight lines or fewer, called once": len(called_once()),
        "columns by number in compiled code": numbered_columns(),
        "imports by string": total(imports_by_string),
        COMMENTS: round(100 * total(comment_lines) / code, 2),
    }


def main() -> None:
    """Print all measures."""
    for name, value in measured().items():
        print(f"{value:8g}  {name}")


if __name__ == "__main__":
    main()
