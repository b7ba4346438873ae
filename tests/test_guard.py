"""How near answers come, and what they cost in steps, may not get worse unnoticed: against stored numbers. No
seconds, so that it does not matter where this runs.

    python -m tests.test_guard

writes `counts.json` anew, after a change that is meant.
"""

from __future__ import annotations

import json
from pathlib import Path

import jax
import numpy as np
import pytest

jax.config.update("jax_enable_x64", True)

from tests.counting import counted  # noqa: E402
from tests.exact.test_steady import ROWS, SETTLE  # noqa: E402
from tests.exact.test_trajectory import scales  # noqa: E402
from tests.reference import BARE, HUNG, parameters  # noqa: E402
from tpd import Segmented, Smoothed  # noqa: E402
from tpd.core.files import as_json, place, versions  # noqa: E402

STORED = Path(__file__).with_name("counts.json")
COMMAND = "python -m tests.test_guard"

MORE, LESS = 1.1, 0.5
"""How much above and below the stored one a count may be: rounding differs between machines, and half of the
work is rather work that is no longer counted."""
WORSE, ROUND_OFF = 4.0, 2e-13
"""How much above the stored one an error of the size of rounding may be, and what is none."""


def steps() -> dict[str, float]:
    """Solver steps until the integrated models have settled."""
    out: dict[str, float] = {}
    for model in (Smoothed(), Segmented()):
        with counted() as solves:
            run = jax.jit(lambda x, y0, model=model: model.settle(parameters(x), y0).elapsed)
            for case in (HUNG[0], BARE[1]):
                periods = int(run(np.array(case.x), np.array(case.y0)))
                name = f"{type(model).__name__}, {case.name}"
                out |= {f"{name}: solver steps": sum(solves.taken()), f"{name}: periods": periods}
    return out


def truth() -> dict[str, float]:
    """The worst relative errors of settled motions against 50 digits."""
    sizes, states = [], []
    for row in ROWS[::3]:
        x = np.array(row["parameters"])
        s = SETTLE(x, np.array(row["y0"]))
        pairs = ((float(getattr(s, name)), float(row[name])) for name in ("amplitude", "stroke"))
        sizes.append(max(abs(found - known) / (known or 1.0) for found, known in pairs))
        end = np.array([float(v) for v in row["end"]])
        states.append(np.max(np.abs(np.asarray(s.state) - end) / scales(x)))
    return {"error of the sizes": float(max(sizes)), "error of the state": float(max(states))}


MEASURES = {f.__name__: f for f in (steps, truth)}


@pytest.mark.parametrize("kind", MEASURES)
def test_no_more_work_and_no_larger_error_than_stored(kind):
    stored, found = json.loads(STORED.read_text())[kind], MEASURES[kind]()
    assert set(found) == set(stored), f"what is counted has changed: run `{COMMAND}`"
    wrong = {k: (v, stored[k]) for k, v in found.items() if not holds(k, v, stored[k])}
    assert not wrong, f"(found, stored), if meant run `{COMMAND}`: {wrong}"


def holds(name: str, value: float, stored: float) -> bool:
    """Whether a number is within the slack of its kind."""
    if name.startswith("error"):
        return value <= max(WORSE * stored, ROUND_OFF)
    return LESS * stored <= value <= MORE * stored


@pytest.mark.parametrize(
    ("name", "value", "stored", "expected"),
    [
        ("periods", 110, 100, True),
        ("periods", 112, 100, False),
        ("periods", 40, 100, False),
        ("error of x", 3.9e-12, 1e-12, True),
        ("error of x", 4.1e-12, 1e-12, False),
        ("error of x", 1.9e-13, 1e-15, True),
        ("error of x", np.nan, 1e-12, False),
    ],
)
def test_the_slack_is_as_stated(name, value, stored, expected):
    assert holds(name, value, stored) is expected


if __name__ == "__main__":
    found = {kind: measure() for kind, measure in MEASURES.items()}
    print(place(STORED, as_json({"command": COMMAND, "versions": versions(), **found})))
