"""Results of the benchmarks: one JSON file each, from which all tables and pictures are made.

A benchmark is a module of this folder, named in `NAMES`, with

    QUESTION: str                     question that it answers, for the list
    MEASURES: tuple[str, ...]         modules and folders of `tpd` that decide its numbers, such as "compiled"
    SEED: int or None                 seed of its random numbers
    run(quick) -> list[dict]          measurement: records of numbers, texts and lists of them
    table(rows) -> str                the rows as Markdown
    pictures(rows) -> {name: figure}  written into notebooks/pictures; optional
"""

import datetime
import hashlib
import json
import math
import os
import platform
import re
import statistics
import subprocess
import time
from collections.abc import Callable, Iterable
from importlib import import_module
from importlib.metadata import PackageNotFoundError, version
from pathlib import Path
from types import ModuleType
from typing import Any, NamedTuple

import tpd
from tests.measures import code_of

NAMES = (
    *("precision", "smoothing", "engine", "commands", "ground", "regret", "earthquakes", "optima"),
    *("objectives", "descent", "engines", "measurements", "intervals", "power"),
)
LONG = ("regret", "objectives")
"""Benchmarks that `--stale` does not run."""
OLDER = "older than the code"
"""Mark of a result whose modules have changed. Every page that shows the result repeats the mark."""
ROOT = Path(__file__).parents[2]
RESULTS = Path(__file__).parent / "results"
PICTURES = ROOT / "notebooks" / "pictures"
PAGES = (Path(__file__).parent / "README.md", ROOT / "notebooks" / "guide" / "accuracy_and_speed.md")
PACKAGES = ("jax", "numpy", "numba", "scipy")
DIGITS = 4
"""Significant digits of stored numbers."""
_MARKED = re.compile(r"(<!-- drawn: ([\w.]+) -->\n\n).*?(\n\n<!-- end -->)", re.DOTALL)


class Stored(NamedTuple):
    """Content of a file of results."""

    about: dict[str, Any]
    rows: list[dict[str, Any]]


def module(name: str) -> ModuleType:
    """Return the module of a benchmark."""
    return import_module(f"tests.benchmarks.{name}")


def code(name: str) -> str:
    """Return a hash of the code that decides the numbers of a benchmark, without docstrings and comments.

    Raises:
        ValueError: `MEASURES` of the benchmark names a module that does not exist.
    """
    every = hashlib.sha256()
    for place in module(name).MEASURES:
        folder = ROOT / "tpd" / place
        paths = sorted(folder.rglob("*.py")) or [folder.with_suffix(".py")]
        if not paths[0].exists():
            raise ValueError(f"`MEASURES` of the benchmark {name} must name modules of tpd, but has {place}")
        for path in paths:
            lines = code_of(path.read_text(encoding="utf-8"))
            every.update("\n".join([str(path.relative_to(ROOT)), *lines]).encode())
    return every.hexdigest()[:12]


def about(name: str, seconds: float) -> dict[str, Any]:
    """Return version, commit, date, machine, command and seed of a result."""
    return {
        "version": tpd.__version__,
        "commit": _commit(),
        "code": code(name),
        "date": str(datetime.date.today()),
        "machine": _machine(),
        "cores": os.cpu_count(),
        **{package: _version(package) for package in PACKAGES},
        "command": f"python -m tests.benchmarks {name}",
        "seed": module(name).SEED,
        "seconds": round(seconds),
    }


def _commit() -> str:
    def git(*words: str) -> str:
        done = subprocess.run(["git", *words], cwd=ROOT, capture_output=True, text=True, check=False)
        return done.stdout.strip()

    # New results of other benchmarks do not change what is measured.
    changed = git("status", "--porcelain", "--untracked-files=no", "tpd")
    return (git("rev-parse", "--short", "HEAD") or "unknown") + ("-dirty" if changed else "")


def _version(package: str) -> str:
    try:
        return version(package)
    except PackageNotFoundError:
        return "not installed"


def _machine() -> str:
    text = Path("/proc/cpuinfo").read_text() if Path("/proc/cpuinfo").exists() else ""
    names = re.findall(r"model name\s*: (.*)", text)
    return names[0] if names else platform.processor() or platform.machine()


def store(name: str, rows: list[dict[str, Any]], seconds: float) -> None:
    """Write a file of results."""
    _write(name, about(name, seconds), plain(rows))


def _write(name: str, said: dict[str, Any], rows: list[dict[str, Any]]) -> None:
    RESULTS.mkdir(exist_ok=True)
    (RESULTS / f"{name}.json").write_text(compact({"about": said, "rows": rows}), encoding="utf-8")


def read(name: str) -> Stored | None:
    """Return the stored results of a benchmark, or None."""
    path = RESULTS / f"{name}.json"
    return Stored(**json.loads(path.read_text(encoding="utf-8"))) if path.exists() else None


def is_stale(name: str) -> bool:
    """Return whether a benchmark has no result of the present source of the modules that it measures."""
    found = read(name)
    return found is None or found.about["code"] != code(name)


def mark() -> list[str]:
    """Mark the results that are older than the code, and return their names."""
    results = {name: found for name in NAMES if (found := read(name)) is not None and is_stale(name)}
    for name, found in results.items():
        _write(name, found.about | {"code": OLDER}, found.rows)
    return list(results)


def plain(value: Any) -> Any:
    """Return a value for JSON: floats rounded to `DIGITS` digits, and None if they are not finite."""
    if isinstance(value, dict):
        return {key: plain(of) for key, of in value.items()}
    if isinstance(value, list | tuple):
        return [plain(of) for of in value]
    if hasattr(value, "item"):
        return plain(value.item() if value.ndim == 0 else value.tolist())
    if isinstance(value, float):
        return float(f"{value:.{DIGITS}g}") if math.isfinite(value) else None
    return value


def compact(content: dict[str, Any]) -> str:
    """Return JSON with one line for each entry of a table and each record of a list."""
    parts = []
    for key, value in content.items():
        if isinstance(value, dict):
            lines = [f"{json.dumps(k)}: {json.dumps(v, allow_nan=False)}" for k, v in value.items()]
        else:
            lines = [json.dumps(v, allow_nan=False, ensure_ascii=False) for v in value]
        ends = "{}" if isinstance(value, dict) else "[]"
        parts.append(f"{json.dumps(key)}: {ends[0]}\n" + ",\n".join(lines) + f"\n{ends[1]}")
    return "{\n" + ",\n".join(parts) + "\n}\n"


def markdown(head: Iterable[str], rows: Iterable[Iterable[Any]]) -> str:
    """Return a Markdown table."""
    lines = [[str(cell) for cell in row] for row in (head, *rows)]
    lines.insert(1, ["---"] * len(lines[0]))
    return "\n".join("| " + " | ".join(line) + " |" for line in lines)


def columns(rows: Iterable[dict[str, Any]], **heads: str) -> str:
    """A table of records, from heads and templates such as "{ms:.3g}"; a cell is empty where a number is
    missing, and heads that are no names come by `**{}`."""

    def cell(template: str, row: dict[str, Any]) -> str:
        try:
            return template.format_map(row)
        except (KeyError, TypeError):
            return ""

    return markdown(heads, ([cell(template, row) for template in heads.values()] for row in rows))


def timed(work: Callable[[], Any], repeats: int = 1) -> float:
    """Return the median time of a call in seconds, including the work that JAX does asynchronously."""
    import jax

    spent = []
    for _ in range(repeats):
        begun = time.perf_counter()
        jax.block_until_ready(work())
        spent.append(time.perf_counter() - begun)
    return statistics.median(spent)


def drawn(what: str) -> str:
    """Return the text of a function of `aims`, of a benchmark, or of a part of it ("benchmark.short")."""
    from tests.benchmarks import aims

    if what in ("aims", "overview", "machine"):
        return getattr(aims, what)()
    name, _, part = what.partition(".")
    found, of = read(name), module(name)
    if found is None:
        return f"Not measured with this version: `python -m tests.benchmarks {name}`."
    return getattr(of, part or "table")(found.rows)


def pages() -> dict[Path, str]:
    """Return the text of every page with results: pages with marked parts, and a page for each benchmark."""
    out = {}
    for path in PAGES:
        text = path.read_text(encoding="utf-8")
        out[path] = _MARKED.sub(lambda m: m[1] + drawn(m[2]) + m[3], text)
    for name in NAMES:
        found = read(name)
        said = "" if found is None else ", ".join(f"{k} {v}" for k, v in found.about.items()) + "\n\n"
        text = f"# {module(name).QUESTION}\n\n{said}{drawn(name)}\n"
        out[RESULTS / f"{name}.md"] = text
    return out


def draw(names: Iterable[str] = NAMES) -> None:
    """Write the pages, and the pictures of benchmarks that have results."""
    from tpd.plots.style import saved

    RESULTS.mkdir(exist_ok=True)
    for path, text in pages().items():
        path.write_text(text, encoding="utf-8")
    for name in names:
        found = read(name)
        if found is None or not hasattr(module(name), "pictures"):
            continue
        for picture, figure in module(name).pictures(found.rows).items():
            (PICTURES / picture).write_bytes(saved(figure))
