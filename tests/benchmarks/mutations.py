"""Change single operators, comparisons, constants and conditions, and see whether a test of the module fails.

The places are drawn at random from the code outside the kernels. Left out are annotations, decorators, texts
(also the values within formatted ones), tolerances below 1e-5, and the arguments in `WITHOUT_EFFECT`. The
tests of a place are those of its module, `tests/<folder>/test_<module>.py`, and those in `ALSO`. A test that
fails or does not end notices the change.

The first trial of a change forks a process that has imported the package. There the function gets its new
code, and the tests run that reach the changed line. A second trial imports the package anew with the changed
source and runs all tests of the module: for changes outside functions, and for those not noticed so far.
"""

from __future__ import annotations

import ast
import contextlib
import gc
import hashlib
import json
import os
import select
import signal
import sys
import time
import traceback
import warnings
from collections import Counter
from collections.abc import Callable, Iterator
from importlib import import_module, util
from importlib.machinery import SourceFileLoader
from pathlib import Path
from types import CodeType, FunctionType
from typing import Any, NamedTuple

import pytest

from tests.benchmarks import stored

QUESTION = "Does a test of the module notice if one operator, constant or condition changes?"
SEED = 1
PLACES = 300
FOLDERS = ("design", "answers", "scene", "report", "theory", "formats")
MEASURES = FOLDERS
ALSO = {"formats/text": ("tests/formats/test_table.py",)}
"""Further tests of modules."""
WITHOUT_EFFECT = {"stacklevel", "strict", "repr", "figsize"}
"""Arguments of calls that no test can be expected to notice: `strict` of `zip` checks the package itself."""
EQUIVALENT: dict[tuple[str, str, str], str] = {
    (
        "answers/fragility",
        "scale = math.sqrt(float(np.average((x - middle) ** 2, weights=n)))",
        "x - middle -> x + middle",
    ): "the scale only conditions the search for the maximum",
    (
        "answers/bifurcations",
        "if abs(more) == change and (change or below.margin * above.margin < 0):",
        "below.margin * above.margin -> below.margin / above.margin",
    ): "the sign of a product is that of the quotient",
    (
        "answers/bifurcations",
        "at = vanishing(np.append(u, [1.0] * (3 - m)), x)",
        "3 - m -> 3 + m",
    ): "no entry beyond the third is read",
    (
        "answers/design_map",
        "chunk = _CHUNK_FOLLOWED if y0 is not None else _CHUNK",
        "y0 is not None -> y0 is None",
    ): "the size of a chunk changes the time, and no result",
    (
        "formats/read",
        "if len(data) > 8 and (set(data[1:64:2]) == {0} or set(data[0:64:2]) == {0}):",
        "64 -> 65",
    ): "one more byte of the text is examined",
}
"""Changes that change no result, by module, line and text of the change, with the reason."""
SWAPPED: dict[type, type] = {
    **{ast.Add: ast.Sub, ast.Sub: ast.Add, ast.Mult: ast.Div, ast.Div: ast.Mult, ast.Pow: ast.Mult},
    **{ast.FloorDiv: ast.Div, ast.Mod: ast.Mult, ast.BitAnd: ast.BitOr, ast.BitOr: ast.BitAnd},
    **{
        ast.Eq: ast.NotEq,
        ast.NotEq: ast.Eq,
        ast.Lt: ast.GtE,
        ast.GtE: ast.Lt,
        ast.Gt: ast.LtE,
        ast.LtE: ast.Gt,
    },
    **{
        ast.Is: ast.IsNot,
        ast.IsNot: ast.Is,
        ast.In: ast.NotIn,
        ast.NotIn: ast.In,
        ast.And: ast.Or,
        ast.Or: ast.And,
    },
}
AT_BOUND = {ast.Lt: ast.LtE, ast.LtE: ast.Lt, ast.Gt: ast.GtE, ast.GtE: ast.Gt}
"""Comparisons with a count change at the bound alone."""
TYPES = {"int", "float", "str", "bool", "bytes", "None"}


class Place(NamedTuple):
    """A change of one expression of a module."""

    module: str
    """Folder and module, such as "answers/statistics"."""
    node: ast.expr
    after: ast.expr

    @property
    def path(self) -> Path:
        """Source file."""
        return stored.ROOT / "tpd" / f"{self.module}.py"

    @property
    def change(self) -> str:
        """Text of the change."""
        return f"{ast.unparse(self.node)} -> {ast.unparse(self.after)}"

    @property
    def line(self) -> str:
        """Text of the line."""
        return self.path.read_text(encoding="utf-8").splitlines()[self.node.lineno - 1].strip()

    def text(self) -> bytes:
        """Return the changed source of the module. Every line keeps its number."""
        source = self.path.read_bytes()
        lines = source.splitlines(keepends=True)
        begin, end = (
            sum(map(len, lines[: line - 1])) + column
            for line, column in (
                (self.node.lineno, self.node.col_offset),
                (self.node.end_lineno or 0, self.node.end_col_offset or 0),
            )
        )
        lines_within = b"\n" * source[begin:end].count(b"\n")
        return source[:begin] + b"(" + ast.unparse(self.after).encode() + lines_within + b")" + source[end:]


def places(module: str) -> list[Place]:
    """Return all changes of a module in the order of its text."""
    tree = ast.parse((stored.ROOT / "tpd" / f"{module}.py").read_text(encoding="utf-8"))
    return [Place(module, *change) for node in _nodes(tree) for change in _changes(node)]


def _nodes(node: ast.AST) -> Iterator[ast.AST]:
    """Nodes of a syntax tree that concern what the package does, outer ones first."""
    yield node
    for name, value in ast.iter_fields(node):
        if name in ("annotation", "returns", "decorator_list"):
            continue
        for child in value if isinstance(value, list) else [value]:
            is_left_out = (
                not isinstance(child, ast.AST)
                or isinstance(child, ast.JoinedStr)
                or (isinstance(child, ast.keyword) and child.arg in WITHOUT_EFFECT)
                or (isinstance(child, ast.If) and {"TYPE_CHECKING", "__name__"} & _names(child.test))
            )
            if not is_left_out:
                yield from _nodes(child)


def _names(node: ast.AST) -> set[str]:
    return {n.id for n in ast.walk(node) if isinstance(n, ast.Name)}


def _changes(node: ast.AST) -> Iterator[tuple[ast.expr, ast.expr]]:
    """Return expressions of a node that change, each with what replaces it."""
    match node:
        case ast.BinOp(left, op, right) if type(op) in SWAPPED and not _is_text_or_type(node):
            yield node, ast.BinOp(left, SWAPPED[type(op)](), right)
        case ast.BoolOp(op, values):
            yield node, ast.BoolOp(SWAPPED[type(op)](), values)
        case ast.Compare(left, [op, *ops], parts):
            counts = any(_is_count(part) for part in (left, *parts))
            swapped = AT_BOUND if counts and type(op) in AT_BOUND else SWAPPED
            yield node, ast.Compare(left, [swapped[type(op)](), *ops], parts)
        case ast.UnaryOp(ast.Not() | ast.USub(), operand):
            yield node, operand
        case ast.Constant(bool(value)):
            yield node, ast.Constant(not value)
        case ast.Constant(int(value)):
            yield node, ast.Constant(value + 1)
        case ast.Constant(float(value)) if value == 0.0 or value >= 1e-5:
            yield node, ast.Constant(2 * value or 1.0)
        case ast.If(test) | ast.While(test) | ast.IfExp(test) if not isinstance(
            test, ast.Compare | ast.BoolOp | ast.UnaryOp
        ):
            yield test, ast.UnaryOp(ast.Not(), test)


def _is_text_or_type(node: ast.BinOp) -> bool:
    """Return whether + or % joins texts, / paths, or | types."""
    parts = (node.left, node.right)
    texts = any(isinstance(p, ast.JoinedStr) or isinstance(getattr(p, "value", None), str) for p in parts)
    last = [ast.unparse(part).rpartition(".")[2] for part in parts]
    return texts or (
        isinstance(node.op, ast.BitOr) and any(t in TYPES or t[:1].isupper() or "[" in t for t in last)
    )


def _is_count(node: ast.expr) -> bool:
    whole = isinstance(node, ast.Constant) and type(node.value) is int and node.value > 0
    return whole or (isinstance(node, ast.Call) and getattr(node.func, "id", "") == "len")


def tests_of(module: str) -> list[str]:
    """Return the test files of a module."""
    folder, _, name = module.rpartition("/")
    return [f"tests/{folder}/test_{name}.py", *ALSO.get(module, ())]


def _codes(code: CodeType) -> Iterator[CodeType]:
    """Code of a module and of all that is defined in it."""
    yield code
    for constant in code.co_consts:
        if isinstance(constant, CodeType):
            yield from _codes(constant)


def _runs_at_import(code: CodeType) -> bool:
    """Return whether code is that of a module or of a class."""
    return code.co_name == "<module>" or "__qualname__" in code.co_names


def _own(code: CodeType) -> tuple[Any, ...]:
    """Return what code does without the functions that are defined in it."""
    return code.co_code, code.co_names, [repr(c) for c in code.co_consts if not isinstance(c, CodeType)]


def new_codes(place: Place) -> dict[CodeType, CodeType]:
    """Return the changed code of functions by the code of now: none if the change takes effect at import."""
    loader: Any = util.find_spec(f"tpd.{place.module.replace('/', '.')}").loader  # type: ignore[union-attr]
    old, new = (
        list(_codes(loader.source_to_code(text, str(place.path))))
        for text in (place.path.read_bytes(), place.text())
    )
    pairs = list(zip(old, new, strict=False))
    if len(old) != len(new) or any(_runs_at_import(a) and _own(a) != _own(b) for a, b in pairs):
        return {}
    return {a: b for a, b in pairs if a != b and not _runs_at_import(a)}


def with_changed_source(place: Place) -> None:
    """Let the module be imported with the change, and without stored byte code."""
    get_data, path_stats, path = SourceFileLoader.get_data, SourceFileLoader.path_stats, str(place.path)

    def changed_data(self: SourceFileLoader, name: Any) -> bytes:
        return place.text() if str(name) == path else get_data(self, name)

    def no_stats(self: SourceFileLoader, name: Any) -> Any:
        if str(name) == path:
            raise OSError("byte code would be that of the module without the change")
        return path_stats(self, name)

    SourceFileLoader.get_data, SourceFileLoader.path_stats = changed_data, no_stats


def forked(work: Callable[[], Any], limit: float) -> Any:
    """Return what a function returns in a new process; None if it fails or takes longer than a limit."""
    read, write = os.pipe()
    with warnings.catch_warnings():
        # JAX warns, but it has not started any threads yet.
        warnings.simplefilter("ignore")
        process = os.fork()
    if process == 0:
        try:
            os.setsid()
            os.close(read)
            os.write(write, json.dumps(work()).encode())
        except BaseException:
            traceback.print_exc()
        finally:
            os._exit(0)
    os.close(write)
    parts, end = [], time.monotonic() + limit
    while select.select([read], [], [], max(end - time.monotonic(), 0))[0] and (
        part := os.read(read, 1 << 16)
    ):
        parts.append(part)
    os.close(read)
    with contextlib.suppress(ProcessLookupError):
        os.killpg(process, signal.SIGKILL)
    os.waitpid(process, 0)
    return json.loads(b"".join(parts)) if parts else None


class Known:
    """What the tests of a module do without a change; a plugin of pytest that records or uses it."""

    def __init__(self, path: Path) -> None:
        self.path = str(path)
        self.seconds: dict[str, float] = {}
        self.lines: dict[str, list[int]] = {}
        self.only: set[str] = set()
        self.is_recording = False

    @pytest.hookimpl(trylast=True)
    def pytest_collection_modifyitems(self, items: list[Any]) -> None:
        """Run the shortest tests first, and only some of them."""
        items[:] = [item for item in items if not self.only or item.nodeid in self.only]
        items.sort(key=lambda item: self.seconds.get(item.nodeid, 0.0))

    @pytest.hookimpl(wrapper=True)
    def pytest_runtest_protocol(self, item: Any) -> Any:
        """Record the time of a test, and the lines of the module that it runs."""
        if not self.is_recording:
            return (yield)
        begun, lines = time.monotonic(), set()

        def trace(frame: Any, _event: str, _: Any) -> Any:
            if frame.f_code.co_filename != self.path:
                return None
            lines.add(frame.f_lineno)
            return trace

        sys.settrace(trace)
        try:
            return (yield)
        finally:
            sys.settrace(None)
            self.seconds[item.nodeid] = time.monotonic() - begun
            self.lines[item.nodeid] = sorted(lines)

    def of(self, place: Place) -> set[str]:
        """Return the tests that run a place."""
        lines = set(range(place.node.lineno, (place.node.end_lineno or 0) + 1))
        return {test for test, run in self.lines.items() if lines & set(run)}


def tested(module: str, plugin: Known) -> bool:
    """Return whether the tests of a module pass in this process."""
    sys.stdout = sys.stderr = open(os.devnull, "w")  # noqa: SIM115
    for number in (1, 2):
        os.dup2(sys.stdout.fileno(), number)
    # Programs that were compiled without the change are read, and none with a change is stored.
    jax = import_module("jax")
    jax.config.update("jax_persistent_cache_min_compile_time_secs", 1e9)
    words = ["-n", "0", "-x", "-q", "-p", "no:cacheprovider"]
    # The server has imported modules in which pytest would rewrite assertions.
    words += ["-W", "ignore::pytest.PytestAssertRewriteWarning", *tests_of(module)]
    return pytest.main(words, plugins=[plugin]) == 0


def recorded(module: str) -> dict[str, Any]:
    """Run the tests of a module without a change, and return what they do."""
    known = Known(stored.ROOT / "tpd" / f"{module}.py")
    known.is_recording = True
    return {"passes": tested(module, known), "seconds": known.seconds, "lines": known.lines}


def first_trials(drawn: list[Place]) -> list[dict[str, Any]]:
    """Return for each module what its tests do, and which of its places no test has noticed.

    The package is imported here. Each trial has a process of its own.
    """
    import_module("tests.conftest")
    for entry in ("run", "orbit"):
        import_module(f"tpd.compiled.{entry}_entry")
    functions = [f for f in gc.get_objects() if type(f) is FunctionType and "tpd" in f.__code__.co_filename]

    def trial(place: Place, known: Known, codes: dict[CodeType, CodeType]) -> bool:
        for function in functions:
            function.__code__ = codes.get(function.__code__, function.__code__)
        return tested(place.module, known)

    results = []
    for module in dict.fromkeys(place.module for place in drawn):
        found = forked(lambda module=module: recorded(module), 1800.0)
        if found is None or not found["passes"]:
            raise RuntimeError(
                f"the tests of {module} fail without a change: {found and list(found['seconds'])[-1:]}"
            )
        known = Known(stored.ROOT / "tpd" / f"{module}.py")
        known.seconds, known.lines = found["seconds"], found["lines"]
        limit, unnoticed = 30.0 + 5.0 * sum(known.seconds.values()), []
        for place in (place for place in drawn if place.module == module):
            known.only, codes = known.of(place), new_codes(place)
            passes = not (codes and known.only)
            if not passes:
                passes = forked(lambda p=place, k=known, c=codes: trial(p, k, c), limit) is True
            if passes:
                unnoticed.append(drawn.index(place))
        results.append({"module": module, "seconds": known.seconds, "limit": limit, "unnoticed": unnoticed})
        print(
            f"{module}: {sum(known.seconds.values()):.0f} s, {len(unnoticed)} left",
            file=sys.stderr,
            flush=True,
        )
    return results


def second_trial(place: Place, seconds: dict[str, float]) -> bool:
    """Return whether all tests of the module pass with its changed source."""
    with_changed_source(place)
    known = Known(place.path)
    known.seconds = seconds
    return tested(place.module, known)


def drawn_places(number: int, folders: tuple[str, ...] = FOLDERS) -> list[Place]:
    """Draw places at random, in the order of the modules.

    A place is drawn by a hash of its text, so that a change elsewhere leaves most of the others drawn.
    """
    modules = [
        f"{folder}/{path.stem}"
        for folder in FOLDERS
        for path in sorted((stored.ROOT / "tpd" / folder).glob("*.py"))
        if folder in folders and (stored.ROOT / f"tests/{folder}/test_{path.name}").exists()
    ]
    hashes: list[tuple[bytes, Place]] = []
    for module in modules:
        count: Counter[str] = Counter()
        for place in places(module):
            count[place.change] += 1
            text = f"{SEED} {module} {place.change} {count[place.change]}"
            hashes.append((hashlib.sha256(text.encode()).digest(), place))
    least = sorted(hash_ for hash_, _ in hashes)[: number + 1][-1]
    return [place for hash_, place in hashes if hash_ < least]


def tried(drawn: list[Place]) -> list[Place]:
    """Return the places that no test has noticed."""
    for library in (
        "jax",
        "scipy.stats",
        "matplotlib.pyplot",
        "numba",
        "hypothesis",
        "diffrax",
        "optimistix",
        "optax",
    ):
        import_module(library)
    unnoticed = []
    for result in forked(lambda: first_trials(drawn), 1e5) or sys.exit("the first trials failed"):
        for place in (drawn[i] for i in result["unnoticed"]):
            if (
                forked(lambda p=place, r=result: second_trial(p, r["seconds"]), result["limit"] + 30.0)
                is True
            ):
                unnoticed.append(place)
                print(f"{place.module}:{place.node.lineno}: {place.change}", file=sys.stderr, flush=True)
    return unnoticed


def run(quick: bool) -> list[dict[str, Any]]:
    """Return a row for each folder."""
    drawn = drawn_places(3, ("theory",)) if quick else drawn_places(PLACES)
    unnoticed = tried(drawn)
    rows = []
    for folder in FOLDERS:
        survivors = [p for p in unnoticed if p.module.startswith(f"{folder}/")]
        equivalent = [p for p in survivors if (p.module, p.line, p.change) in EQUIVALENT]
        rows.append(
            {
                "folder": folder,
                "places": sum(p.module.startswith(f"{folder}/") for p in drawn),
                "equivalent": len(equivalent),
                "survivors": [
                    f"{p.module}:{p.node.lineno}: {p.change}" for p in survivors if p not in equivalent
                ],
            }
        )
    return rows


def table(rows: list[dict[str, Any]]) -> str:
    """Return the numbers of each folder, and the changes that no test notices."""
    cells, survivors = [], []
    for r in [
        *rows,
        {
            "folder": "all",
            **{
                k: sum((row[k] for row in rows), start=type(rows[0][k])())
                for k in ("places", "equivalent", "survivors")
            },
        },
    ]:
        places, survivors = r["places"] - r["equivalent"], r["survivors"]
        share = f"{1 - len(survivors) / places:.0%}" if places else ""
        cells.append((r["folder"], r["places"], r["equivalent"], places - len(survivors), share))
    head = ("folder", "places", "of these without effect", "noticed", "share of those with an effect")
    return "\n\n".join(
        [stored.markdown(head, cells), "\n".join(f"- `{line}`" for line in survivors) or "No other change."]
    )
