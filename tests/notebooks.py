"""Runs every cell of every notebook in one process, at small sizes.

.venv/bin/python -m tests.notebooks          # all
.venv/bin/python -m tests.notebooks 06 13    # these

`make_small` is the switch: searches and records become few where notebooks call them. A notebook with
claims or loops of its own that need full size has `FULL = True` in its first cell, which is False here.
"""

import io
import sys
import time
import traceback
from collections.abc import Iterable
from contextlib import redirect_stdout
from dataclasses import replace
from functools import wraps
from importlib import import_module
from pathlib import Path

import matplotlib
import matplotlib.pyplot as plt
import nbformat

NOTEBOOKS = sorted((Path(__file__).parents[1] / "notebooks").glob("*.ipynb"))
DONE = " s of processor time"
"""End of the line of a notebook that ran."""
SWITCH = "FULL = True"
SMALL: dict[str, dict[str, object]] = {
    "tpd.answers.annual_rates": {"RESAMPLES": 50},
    "tpd.design.harmonic": {"_COMPARISON_RUNS": 32, "_MORE_RUNS": 256},
    "tpd.design.corrections": {"_SPREAD": 8, "_DRAWS": 256},
}
"""Sizes of a search that are no arguments, by module."""
RUNS, RECORDS, OUTCOMES = 512, 4, 96
"""Validation runs of a design, which of every so many records is kept, and most runs of `tpd.outcomes`."""


def make_small() -> None:
    """Let the functions that notebooks call search little, on exact gradients, and follow few records."""
    import tpd

    at_full, records_of = tpd.optimise, tpd.records.fema_p695
    outcomes_of = tpd.outcomes

    @wraps(at_full)
    def optimise(scene, *args, **others):
        if isinstance(scene, tpd.Job):
            scene, others = scene.scene, scene.settings | others
        conditions, method, ensemble = (others.get(x) for x in ("conditions", "method", "ensemble"))
        if conditions is not None and conditions.motions:
            method = replace(method or tpd.GroundSearch(), designs=8, steps=2)
        else:
            # The smoothed descent compiles for half a minute: it has its own tests.
            small = {
                "model": tpd.Piecewise(),
                "searches": 2,
                "screening": 32,
                "steps": 3,
                "corrections": 1,
                "polish": 10,
            }
            method = replace(method or tpd.Descent(), **small)
            ensemble = replace(ensemble or tpd.Ensemble(), size=RUNS)
        return at_full(scene, *args, **others | {"method": method, "ensemble": ensemble})

    @wraps(outcomes_of)
    def outcomes(*args, ensemble=None, **others):
        if ensemble is not None:
            ensemble = replace(ensemble, size=min(ensemble.size, OUTCOMES))
        return outcomes_of(*args, ensemble=ensemble, **others)

    tpd.optimise, tpd.outcomes = optimise, outcomes
    tpd.records.fema_p695 = lambda *args, **others: records_of(*args, **others)[::RECORDS]
    for module, sizes in SMALL.items():
        home = import_module(module)
        for name, size in sizes.items():
            assert type(getattr(home, name)) is type(size), f"{module} has no size {name}"
            setattr(home, name, size)


def cells_of(path: Path) -> list[str]:
    """Sources of the code cells, with the switch turned."""
    code = [c.source for c in nbformat.read(path, as_version=4).cells if c.cell_type == "code"]
    sources = ["\n".join(x for x in source.splitlines() if not x.startswith("%")) for source in code]
    return [source.replace(SWITCH, "FULL = False") for source in sources]


def failure_of(path: Path) -> str:
    """Run all cells, and return what a failed one has printed and raised."""
    scope = {"__name__": "__main__", "display": lambda *_, **__: None}
    output = io.StringIO()
    try:
        for i, source in enumerate(cells_of(path)):
            with redirect_stdout(output):
                exec(compile(source, f"{path.stem}, code cell {i}", "exec"), scope)
    except Exception:
        return output.getvalue()[-1000:] + traceback.format_exc()
    finally:
        plt.close("all")
    return ""


def main(numbers: Iterable[str]) -> int:
    """Run the notebooks of these numbers, a line for each, and return how many failed."""
    matplotlib.use("Agg")
    make_small()
    failed = 0
    for number in numbers:
        (path,) = (path for path in NOTEBOOKS if path.stem.startswith(number.strip()))
        begun = time.process_time()
        failure = failure_of(path)
        failed += bool(failure)
        said = f"{path.stem}: {time.process_time() - begun:.0f}{DONE}"
        print(repr(said + failure) if failure else said, flush=True)
    return failed


if __name__ == "__main__":
    asked = sys.argv[1:] or [path.stem[:2] for path in NOTEBOOKS]
    sys.exit(main(sys.stdin if asked == ["-"] else asked))
