"""The table of answers for block and pendulum under ground motions; nothing here is the package's.

`python -m tests.ground_truth` writes `ground_truth.json` anew; with names of rows, only those. Its parts:

- cases: `scene`, `motion`, start `y0` and seconds of `free` motion as `ground_scenes` gives them; `results`
  in rad, s and, at the `end`, (phi, psi, phi', psi') with rates per unit of tau. Samples times `scale` are in
  m/s²; those of a motion with a `record` are that record's. `derivatives` are of `tilt`. `impacts` are those
  faster than 1e-6 nu; `impact_speeds`, over nu, of the fastest that is not counted and the slowest that is.
- boundaries: a bare block, friction 0, one sine of frequency ratio W; peak accelerations over g nu.
- critical: a column with peak acceleration `scale` g width/height; the scale at which the verdict changes.
"""

from __future__ import annotations

import json
import multiprocessing
import sys
import time
from collections.abc import Mapping
from pathlib import Path
from typing import Any

from tests import ground_scenes
from tests.ground_series import Run, System, digits, follow

TABLE = Path(__file__).with_name("ground_truth.json")
DIGITS = 20
"""Of a number in the table; of a derivative 15."""

_STEP = 1e-15
"""Of the differences, relative."""
_WIDTH = 1e-14
"""Bracket of a critical scale, relative."""
_NEAR = 2e-6
"""Half the bracket that the search begins with."""


def _text(mp: Any, value: Any, count: int = DIGITS) -> str | None:
    return None if value is None else mp.nstr(value, count, strip_zeros=False)


def evaluated(case: Mapping[str, Any]) -> dict[str, Any]:
    """A case with its answers. Angles in rad, times in s, rates per unit of tau."""
    mp = digits()
    run = follow(case, mp)
    seconds, bare = 1 / run.system.omega, run.system.bare
    out: dict[str, Any] = {
        "overturned": run.overturned,
        "uplift_time": _text(mp, None if run.uplift is None else run.uplift * seconds),
        "modes": sorted(run.modes),
    }
    if not run.overturned:
        out |= {
            "tilt": _text(mp, run.amplitude),
            "tilt_time": _text(mp, run.when * seconds),
            "swing": None if bare else _text(mp, run.stroke),
            "relative_swing": None if bare else _text(mp, run.relative),
            "end": [None if bare and i % 2 else _text(mp, v) for i, v in enumerate(run.y)],
            "impacts": run.impacts,
            "impact_speeds": [float(f"{v:.6g}") if v < 1e9 else None for v in run.speeds],
            "amplification": float(f"{_amplification(case, run):.4g}"),
        }
    if case["name"] in ground_scenes.DERIVED:
        out["derivatives"] = _derivatives(case, run)
    motion = dict(case["motion"])
    if "record" in motion:
        del motion["acceleration"]
    return {**case, "motion": motion, "results": out}


def _amplification(case: Mapping[str, Any], run: Run) -> float:
    """How much the largest tilt changes with a state at the uplift, and later on the way to it."""
    mp, best = run.system.mp, 0.0
    begun = run.uplift or mp.mpf(0)
    size = mp.mpf(10) ** -20
    for share in (0.0, 0.3, 0.6, 0.9):
        for i in (2,) if run.system.bare else (2, 3):
            nudge = [size * (i == j) for j in range(4)]
            at = begun + (run.when - begun) * mp.mpf(share)
            other = follow(case, mp, stop=run.when, nudge=(at, nudge))
            best = max(best, float(abs(other.amplitude - run.amplitude) / size))
    return best


def _derivatives(case: Mapping[str, Any], run: Run) -> dict[str, str]:
    """Of the largest tilt, one quantity of the scene at a time: the block's mass stays."""
    mp, out = run.system.mp, {}
    # The turn moves by far less than this.
    stop = run.when + mp.mpf(10) ** -9
    for name in ("bob", "length", "damping", "friction", "restitution", "scale"):
        x = mp.mpf(case["scene"][name])
        step = mp.mpf(_STEP) * (x or 1)

        def slope(h: Any, name: str = name, x: Any = x) -> Any:
            up, down = (follow(case, mp, stop=stop, **{name: x + d}).amplitude for d in (h, -h))
            return (up - down) / (2 * h)

        out[name] = mp.nstr((4 * slope(step) - slope(2 * step)) / 3, 15, strip_zeros=False)
    return out


def _crossing(case: Mapping[str, Any], near: float) -> str:
    """The scale at which the verdict changes, by bisection."""
    mp = digits(40)
    lo, hi = mp.mpf(near) * (1 - mp.mpf(_NEAR)), mp.mpf(near) * (1 + mp.mpf(_NEAR))

    def verdict(scale: Any) -> bool:
        run = follow(case, mp, scale=scale, verdict=True)
        if run.overturned == run.safe:
            raise ArithmeticError(f"no verdict at {mp.nstr(scale, 20)}")
        return run.overturned

    below = verdict(lo)
    if below == verdict(hi):
        raise ArithmeticError(f"{case['name']}: no change near {near}")
    while hi - lo > _WIDTH * hi:
        middle = (lo + hi) / 2
        if verdict(middle) == below:
            lo = middle
        else:
            hi = middle
    return mp.nstr((lo + hi) / 2, 15)


def boundary(name: str, width_ratio: float, restitution: float, scales: tuple[float, ...]) -> dict[str, Any]:
    """Critical scales of a bare block under one sine, in g nu; in tau they do not depend on the block."""
    mp = digits(40)
    size = {"width": 1.0, "height": 4.0, "mass": 1.0, "gravity": 9.80665}
    scene = {**size, "friction": 0.0, "restitution": restitution, "scale": 1.0}
    system = System(scene, mp)
    frequency = width_ratio * system.omega / (2 * mp.pi)
    motion = {"kind": "one_sine", "peak": mp.mpf(9.80665) * system.nu, "frequency": frequency}
    case = {"name": name, "scene": scene, "motion": motion, "y0": ground_scenes.REST, "free": 100.0}
    found = [_crossing(case, near) for near in scales]
    return {"name": name, "frequency_ratio": width_ratio, "restitution": restitution, "scales": found}


def critical(name: str, kind: str, frequency: float, bob: tuple[float, ...], near: float) -> dict[str, Any]:
    """Critical scale of the column under a pulse, in g width/height."""
    mp = digits(40)
    scene = ground_scenes.scene(ground_scenes.COLUMN, (0.0, 0.9595), bob, 1.0)
    peak = mp.mpf(scene["gravity"]) * System(scene, mp).nu
    motion = {"kind": kind, "peak": peak, "frequency": frequency}
    case = {"name": name, "scene": scene, "motion": motion, "y0": ground_scenes.REST, "free": 100.0}
    found = _crossing(case, near)
    return {"name": name, "scene": scene, "motion": {"kind": kind, "frequency": frequency}, "scale": found}


def _row(task: tuple[str, Any]) -> tuple[str, dict[str, Any], float]:
    begun = time.perf_counter()
    what, given = task
    row = {
        "cases": evaluated,
        "boundaries": lambda x: boundary(*x),
        "critical": lambda x: critical(*x),
    }[what](given)
    return what, row, time.perf_counter() - begun


def tasks() -> list[tuple[str, Any]]:
    """Everything that the table holds: its part, and what to evaluate."""
    out: list[tuple[str, Any]] = [("cases", case) for case in ground_scenes.cases()]
    for w, e, scales in ground_scenes.BOUNDARIES:
        out.append(("boundaries", (f"W = {w:g}, e = {e:.6g}", w, e, scales)))
    for kind, frequency, bob, near in ground_scenes.CRITICAL:
        name = f"{kind} {frequency} Hz, " + (f"bob {bob[0]:g} kg, {bob[1]:g} m" if bob else "bare")
        out.append(("critical", (name, kind, frequency, bob, near)))
    return out


def load() -> dict[str, list[dict[str, Any]]]:
    """The table: cases, boundaries and critical scales."""
    return json.loads(TABLE.read_text())


def main() -> None:
    """Write the table anew, a row per line; rows that were not asked for stay."""
    names, todo, begun = set(sys.argv[1:]), tasks(), time.perf_counter()
    order = [(what, given["name"] if what == "cases" else given[0]) for what, given in todo]
    rows = {(what, row["name"]): row for what, part in load().items() for row in part} if names else {}
    wanted = [task for task, (_, name) in zip(todo, order, strict=True) if not names or name in names]
    with multiprocessing.Pool(2, maxtasksperchild=1) as pool:
        for i, (what, row, spent) in enumerate(pool.imap_unordered(_row, wanted), 1):
            rows[what, row["name"]] = row
            past = time.perf_counter() - begun
            print(f"{i}/{len(wanted)} {past:6.1f} s  {row['name']}: {spent:.1f} s", file=sys.stderr)
    parts = []
    for part in ("cases", "boundaries", "critical"):
        lines = ",\n".join(
            json.dumps(rows[key], sort_keys=True) for key in order if key[0] == part and key in rows
        )
        parts.append(f'"{part}": [\n{lines}\n]')
    TABLE.write_text("{" + ",\n".join(parts) + "}\n")


if __name__ == "__main__":
    main()
