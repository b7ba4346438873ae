"""Measures of the source, which are compared with those of an earlier commit by the same tool.

    python -m tests.measures [BASE]

prints each measure at the base and in the working tree. `base_commit` chooses the base. The tests let no
measure of the structure get worse than at the base, and no size exceed its ceiling.
"""

from __future__ import annotations

import ast
import io
import re
import subprocess
import sys
import tarfile
import tokenize
from collections import Counter
from collections.abc import Callable, Iterator
from dataclasses import dataclass
from functools import cache, cached_property
from pathlib import Path, PurePosixPath

ROOT = Path(__file__).parents[1] / "tpd"
TOP = ROOT.parent
FILES = sorted(ROOT.rglob("*.py"))
ALL_LINES = (".mjs", ".html", ".j2", ".toml", ".pyi")
"""Files of which every line is code."""
PRAGMA = re.compile(r"#\s*(noqa|type:|pyright:|fmt:|pragma)")
BY_STRING = re.compile(r"(tpd\.)?[a-z_]+(\.[a-z_]+)*:[a-z_]+")
INTERNAL = re.compile(r"(numba\.(core|np|_\w+)|jax\._src|jaxlib|matplotlib\._\w+)(\.|$)")
"""Modules of other libraries that their documentation does not offer to users."""
PUBLIC = {"_replace", "_asdict", "_make", "_fields", "_value_"}
"""Names with an underscore that Python documents, of named tuples and enumerations."""
CEILINGS = {
    "code lines": 19536,
    "characters of code": 992200,
    "lines of tests": 28878,
    "lines of benchmarks": 4187,
    "modules": 181,
}
"""Largest values of the measures that grow with what the package can do. They are only lowered. All other
measures concern the structure."""
COMMENTS = "comments per 100 code lines"
"""Name of the only measure of which more is better."""


parse = cache(ast.parse)


@cache
def nodes_of(parsed: ast.Module) -> tuple[ast.AST, ...]:
    """All nodes of a syntax tree, which many measures go through."""
    return tuple(ast.walk(parsed))


def tree(path: Path) -> ast.Module:
    """Syntax tree of a file."""
    return parse(path.read_text(encoding="utf-8"))


def name_of(path: Path) -> str:
    """Dotted name of a module; a package's is that of its folder."""
    parts = path.relative_to(TOP).with_suffix("").parts
    return ".".join(parts[:-1] if parts[-1] == "__init__" else parts)


MODULES = {name_of(path): path for path in FILES}


def imports(parsed: ast.Module) -> Iterator[str]:
    """Names of modules and of what is imported from them, also within functions and for type checkers."""
    for node in nodes_of(parsed):
        if isinstance(node, ast.Import):
            yield from (alias.name for alias in node.names)
        elif isinstance(node, ast.ImportFrom) and node.module:
            yield from (f"{node.module}.{alias.name}" for alias in node.names)


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


def docstrings(parsed: ast.Module) -> Iterator[ast.Constant]:
    """Docstrings of modules, classes, functions and attributes."""
    for node in nodes_of(parsed):
        value = node.value if isinstance(node, ast.Expr) else None
        if isinstance(value, ast.Constant) and isinstance(value.value, str):
            yield value


def code_of(text: str) -> list[str]:
    """Return the lines that are not blank and hold no comment alone, no docstring and no import, without
    indentation."""
    parsed = parse(text)
    no_code = (node for node in nodes_of(parsed) if isinstance(node, ast.Import | ast.ImportFrom))
    left_out: set[int] = set()
    for node in (*docstrings(parsed), *no_code):
        left_out.update(range(node.lineno, (node.end_lineno or node.lineno) + 1))
    lines = enumerate(map(str.strip, text.splitlines()), 1)
    return [line for i, line in lines if line and not line.startswith("#") and i not in left_out]


def comment_lines(text: str) -> int:
    """Count the lines with a comment that is no pragma."""
    tokens = tokenize.generate_tokens(io.StringIO(text).readline)
    return sum(t.type == tokenize.COMMENT and not PRAGMA.match(t.string) for t in tokens)


def imports_by_string(parsed: ast.Module) -> int:
    """Count the strings such as "report.answer:answer", which name a module and something in it."""
    nodes = (node for node in nodes_of(parsed) if isinstance(node, ast.Constant))
    return sum(isinstance(node.value, str) and bool(BY_STRING.fullmatch(node.value)) for node in nodes)


def many_arguments(parsed: ast.Module) -> int:
    """Count the functions of ten or more arguments. Keyword-only arguments have names at the call and do not
    count."""
    nodes = (node for node in nodes_of(parsed) if isinstance(node, ast.FunctionDef))
    return sum(len(node.args.posonlyargs) + len(node.args.args) >= 10 for node in nodes)


def called_once(text: str) -> list[str]:
    """Private functions of eight lines or fewer that their module uses once."""
    used = Counter(re.findall(r"\w+", text))
    return [
        node.name
        for node in nodes_of(parse(text))
        if isinstance(node, ast.FunctionDef)
        and re.match("_(?!_)", node.name)
        and used[node.name] == 2
        and (node.end_lineno or 0) - node.lineno < 8
    ]


def numbered_columns(parsed: ast.Module, *, alone: bool = False) -> int:
    """Count the whole numbers in subscripts of several axes, such as `x[:, 2]`; with `alone` also `x[2]`."""
    found = 0
    for node in nodes_of(parsed):
        if isinstance(node, ast.Subscript) and (alone or isinstance(node.slice, ast.Tuple)):
            parts = node.slice.elts if isinstance(node.slice, ast.Tuple) else [node.slice]
            found += any(isinstance(p, ast.Constant) and type(p.value) is int for p in parts)
    return found


def is_private(name: str) -> bool:
    """Return whether a name has one leading underscore."""
    return bool(re.match("_(?!_)", name)) and name != "_"


def own_names(parsed: ast.Module) -> set[str]:
    """Names that a module defines, also attributes of `self`."""
    names: set[str] = set()
    for node in nodes_of(parsed):
        match node:
            case ast.FunctionDef(name=name) | ast.ClassDef(name=name) | ast.Name(id=name, ctx=ast.Store()):
                names.add(name)
            case ast.Attribute(value=ast.Name(id="self"), attr=name, ctx=ast.Store()):
                names.add(name)
    return names


def foreign_names(parsed: ast.Module, own: set[str]) -> list[str]:
    """Private names of other libraries that stand outside a `try` with a fallback.

    Args:
        parsed: the module.
        own: names that the package defines itself.
    """
    protected: set[int] = set()
    for node in nodes_of(parsed):
        errors = {
            name
            for h in getattr(node, "handlers", ())
            if h.type
            for name in re.findall(r"\w+", ast.unparse(h.type))
        }
        if isinstance(node, ast.Try) and errors & {"ImportError", "AttributeError", "Exception"}:
            protected |= {id(inner) for part in node.body for inner in ast.walk(part)}
    found = []
    for node in nodes_of(parsed):
        if id(node) in protected:
            continue
        if isinstance(node, ast.Import | ast.ImportFrom):
            one = ast.Module([node], [])
            found += [
                name
                for name in imports(one)
                if not name.startswith("tpd")
                and (INTERNAL.match(name) or any(map(is_private, name.split("."))))
            ]
        elif isinstance(node, ast.Attribute) and is_private(node.attr) and node.attr not in own | PUBLIC:
            found.append(ast.unparse(node))
    return found


KIND = re.compile(
    r"(Harmonic|GroundMotion|Records|Pulse)(Problem|Job)?|(Harmonic|GroundMotion|Pulse)Excitation"
)
KIND_NAMES = {"harmonic", "pulse", "records"}


def kind_questions(parsed: ast.Module) -> int:
    """Count the questions about the kind of a problem: comparisons with its name or with its class."""
    found = 0
    for node in nodes_of(parsed):
        if isinstance(node, ast.Compare):
            parts = (node.left, *node.comparators)
            found += any(isinstance(p, ast.Constant) and p.value in KIND_NAMES for p in parts)
        elif isinstance(node, ast.Call) and getattr(node.func, "id", "") == "isinstance":
            found += bool(KIND.fullmatch(ast.unparse(node.args[1]).rpartition(".")[2]))
    return found


@dataclass(frozen=True)
class Source:
    """Files of a version of the project, as text by their path from its root."""

    texts: dict[str, str]

    @classmethod
    def here(cls) -> Source:
        """Read the working tree."""
        paths = (p for folder in ("tpd", "tests") for p in sorted((TOP / folder).rglob("*")))
        return cls(
            {p.relative_to(TOP).as_posix(): p.read_text(encoding="utf-8") for p in paths if is_source(p.name)}
        )

    @classmethod
    def of_commit(cls, commit: str) -> Source:
        """Read a commit of the history."""
        packed = subprocess.run(
            ["git", "archive", commit, "tpd", "tests"], cwd=TOP, capture_output=True, check=True
        ).stdout
        with tarfile.open(fileobj=io.BytesIO(packed)) as files:
            members = ((m.name, files.extractfile(m)) for m in files if is_source(m.name))
            return cls({name: f.read().decode() for name, f in members if f is not None})

    @cached_property
    def code(self) -> dict[str, str]:
        """Texts of the modules of the package by their dotted names."""
        paths = {
            p: PurePosixPath(p).with_suffix("").parts
            for p in self.texts
            if p.startswith("tpd/") and p.endswith(".py")
        }
        return {".".join(p[:-1] if p[-1] == "__init__" else p): self.texts[path] for path, p in paths.items()}

    @cached_property
    def trees(self) -> dict[str, ast.Module]:
        """Syntax trees of the modules of the package."""
        return {name: parse(text) for name, text in self.code.items()}

    def imports_of(self, name: str) -> set[str]:
        """Modules of the package that a module imports anywhere."""
        named = set(imports(self.trees[name]))
        named |= {other.rpartition(".")[0] for other in named - self.code.keys()}
        return named & (self.code.keys() - {name, "tpd"})

    @property
    def graph(self) -> dict[str, set[str]]:
        """Imports of every module except the list of names of the package."""
        return {name: self.imports_of(name) for name in self.code.keys() - {"tpd"}}

    def lines(self, *, benchmarks: bool) -> int:
        """Count the lines of the tests, or of the benchmarks."""
        is_benchmark = re.compile(
            "tests/benchmarks/.*(py|mjs)$" if benchmarks else "tests/(?!benchmarks/).*(py|mjs)$"
        )
        return sum(text.count("\n") for path, text in self.texts.items() if is_benchmark.match(path))

    def measures(self) -> dict[str, float]:
        """Return all measures by name: less is better, except for `COMMENTS`."""
        code = [line for text in self.code.values() for line in code_of(text)]
        whole = [
            text for path, text in self.texts.items() if path.startswith("tpd/") and path.endswith(ALL_LINES)
        ]
        characters = [*code, *(line.strip() for text in whole for line in text.splitlines())]

        def total(count: Callable[[ast.Module], int]) -> int:
            return sum(map(count, self.trees.values()))

        own = set[str]().union(*map(own_names, self.trees.values()))
        return {
            "code lines": len(code),
            "characters of code": sum(map(len, characters)),
            "lines of tests": self.lines(benchmarks=False),
            "lines of benchmarks": self.lines(benchmarks=True),
            "modules": len(self.code),
            "floors, all imports counted": longest_chain(self.graph),
            "functions of ten or more arguments": total(many_arguments),
            "functions of eight lines or fewer, called once": sum(
                len(called_once(t)) for t in self.code.values()
            ),
            "columns by number": total(numbered_columns),
            "columns by number in compiled code": sum(
                numbered_columns(parsed, alone=True)
                for name, parsed in self.trees.items()
                if re.match(r"tpd\.(exact|compiled|models)\.", name)
            ),
            "imports by string": total(imports_by_string),
            "private names of other libraries": total(lambda parsed: len(foreign_names(parsed, own))),
            "questions about the kind of problem": total(kind_questions),
            COMMENTS: round(100 * sum(map(comment_lines, self.code.values())) / len(code), 2),
        }


def is_source(name: str) -> bool:
    """Return whether a file counts, by its name."""
    return name.endswith((".py", *ALL_LINES))


def git(*words: str) -> str:
    """Return what git prints, or nothing if it fails."""
    try:
        done = subprocess.run(["git", *words], cwd=TOP, capture_output=True, text=True, check=False)
    except OSError:
        return ""
    return done.stdout.strip() if done.returncode == 0 else ""


def base_commit() -> str:
    """Return the commit with which the working tree is compared, or nothing without a history.

    On a branch the base is the commit where it left the main branch of the remote. On the main branch itself,
    and without a remote, it is the last commit before the day of HEAD. A clone of the main branch therefore
    compares what one day has changed, whenever it does so.
    """
    fork = git("merge-base", "HEAD", "origin/HEAD") or git("merge-base", "HEAD", "origin/main")
    if fork and fork != git("rev-parse", "HEAD"):
        return fork
    day, _, _ = git("log", "-1", "--format=%cI").partition("T")
    for line in git("log", "--format=%H %ct %cI").splitlines():
        commit, _, date = line.split()
        if date[:10] < day:
            return commit
    return ""


def worse(before: dict[str, float], now: dict[str, float]) -> list[str]:
    """Return a sentence for each size above its ceiling and for each other measure that got worse."""
    bounds = before | CEILINGS
    return [
        f"{name}: {now[name]:g}, and {bound:g} {'is the ceiling' if name in CEILINGS else 'before'}"
        for name, bound in bounds.items()
        if (now[name] < bound if name == COMMENTS else now[name] > bound)
    ]


def main() -> None:
    """Print all measures."""
    base = sys.argv[1] if len(sys.argv) > 1 else base_commit()
    now = Source.here().measures()
    before = Source.of_commit(base).measures() if base else {}
    lines = [f"{base[:8] or 'no base':>9} {'now':>9}"]
    lines += [f"{before.get(name, float('nan')):9g} {value:9g}  {name}" for name, value in now.items()]
    print("\n".join(lines))


if __name__ == "__main__":
    main()
