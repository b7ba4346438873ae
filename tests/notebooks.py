"""Runs every notebook in one process, without the cells that take long and those that need what these define.

.venv/bin/python -m tests.notebooks
"""

import ast
import io
import sys
import traceback
from contextlib import redirect_stdout
from pathlib import Path

import matplotlib
import matplotlib.pyplot as plt
import nbformat

NOTEBOOKS = sorted((Path(__file__).parents[1] / "notebooks").glob("*.ipynb"))
LONG = {
    "00": (2,),
    "01": (3, 6, 9),
    "02": (3, 5),
    "05": (2,),
    "06": (2,),
    "07": (1, 3, 5),
    "10": (1,),
    "11": (1, 5),
    "12": (1,),
    "13": (1, 5),
    "14": (1,),
}
"""Code cells, counted from 0, that search for designs or measure times: half a minute each or more."""


def names_in(source: str) -> tuple[set[str], set[str]]:
    """Names that a cell defines, and those that it uses."""
    tree = ast.parse(source)
    nodes = [n for n in ast.walk(tree) if isinstance(n, ast.Name)]
    defined = {n.id for n in nodes if isinstance(n.ctx, ast.Store)}
    defined |= {n.name for n in ast.walk(tree) if isinstance(n, ast.FunctionDef | ast.ClassDef)}
    return defined, {n.id for n in nodes if isinstance(n.ctx, ast.Load)}


def quick_cells(path: Path) -> list[str]:
    """Sources of the code cells that do not take long and need none that does."""
    code = [c.source for c in nbformat.read(path, as_version=4).cells if c.cell_type == "code"]
    sources = ["\n".join(x for x in source.splitlines() if not x.startswith("%")) for source in code]
    missing: set[str] = set()
    out = []
    for i, source in enumerate(sources):
        defined, used = names_in(source)
        if i in LONG.get(path.stem[:2], ()) or used & missing:
            missing |= defined
        else:
            out.append(source)
            missing -= defined
    return out


def main() -> int:
    """Run all, and return the number of those that failed."""
    matplotlib.use("Agg")
    failed = 0
    for path in NOTEBOOKS:
        scope = {"__name__": "__main__", "display": lambda *_, **__: None}
        output = io.StringIO()
        try:
            for i, source in enumerate(quick_cells(path)):
                with redirect_stdout(output):
                    exec(compile(source, f"{path.stem}, quick cell {i}", "exec"), scope)
        except Exception:
            failed += 1
            print(output.getvalue(), traceback.format_exc(), file=sys.stderr)
        plt.close("all")
        print(path.stem, flush=True)
    return failed


if __name__ == "__main__":
    sys.exit(main())
