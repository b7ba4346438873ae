"""Content of the page as plain numbers and texts: block, limits, controls, orbits, and stored runs."""

from __future__ import annotations

import base64
import math
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import replace
from typing import Any

import numpy as np

import tpd
from tpd.answers.ensemble import outcomes, plan
from tpd.answers.transient import FREE
from tpd.core import checks
from tpd.core.formatting import confidence, number, percent, with_and_without
from tpd.design.design import Design
from tpd.design.ground_motion import motion_factors
from tpd.design.job import Job
from tpd.design.optimise import problem_of
from tpd.design.problem import Problem
from tpd.design.space import HEAVIEST_RATIO
from tpd.design.stored_design import StoredDesign
from tpd.explore.tables import GridAxis, Table, axis, solve
from tpd.limits import LABELS, STILL, bob_of
from tpd.report.json import json_of, shares_at_levels
from tpd.scene.conditions import MEASURE_NAMES
from tpd.scene.impacts import heaviest_of_housner, housner
from tpd.scene.scene import LARGEST_DAMPING, Pendulum, Scene

Subject = Design | StoredDesign | Job | Scene
"""Objects that a page can show."""
_COUNTS = {"mass": 10, "length": 16, "damping": 4, "frequency": 24, "amplitude": 3}
"""Nodes along each axis of the large table, without the values of the design, which are nodes as well."""
_SHARES = {"mass": 12, "length": 9}
"""Nodes of the map of the share of runs that overturn, without the values of the design."""
_RUNS = 100
"""Number of runs in the browser, and of runs at each node of the map."""
_QUANTITIES = {name: f"pendulum_{name}" for name in ("mass", "length", "damping")}
"""Names of the quantities of a pendulum in `Scene.quantities`, by their names on the page."""
_LABELS = {
    "mass": ("Mass of the bob", "kg"),
    "length": ("Length of the pendulum", "m"),
    "damping": ("Damping ratio of the hinge", ""),
    "frequency": ("Frequency", "Hz"),
    "amplitude": ("Amplitude", "m"),
}
"""Labels and units of the controls."""
_LINEAR = "damping", "amplitude"
"""Quantities with evenly spaced nodes: a hinge may have no damping, and the tilt is almost linear in the
amplitude. The nodes of the others are evenly spaced on the logarithm."""
_FINE = {"frequency": 121, "amplitude": 5}
"""Nodes of the tables without a pendulum and of the recommended design."""
_FREQUENCIES, _AMPLITUDES = (0.6, 1.5), (0.5, 1.5)
"""Range of the sliders over the scene's own frequency and amplitude; conditions may extend both."""
_RANGE_FACTOR = 2.5
"""Factor by which a slider can leave a value that the search keeps fixed."""
_SHOWN = "stroke", "relative_stroke", "tilt", "mass", "offset", "clearance", "worsening"
"""Limits that the page evaluates."""
_DISTANCES = np.array([0.02, 0.02, 0.2])
"""Relative distance in mass, length and damping within which stored runs hold for a design without a
tolerance range of its own: the scatter of the validation runs."""
_RUN_ROWS = ("overturned", "Share overturned in the report"), ("mean", "Mean tilt over the slenderness")
"""Names and labels of the rows on validation runs."""
_NUMBERS: dict[Any, Any] = {"infinite": math.inf, "-infinite": -math.inf, "nan": math.nan}
"""Numbers by their words in a file."""
_NO_RUNS = "no validation runs near this design and excitation"
_LEVELS = 0.1, 2.0
"""Range of the slider of the level, over the lowest and the highest level of the ground motions."""
_CODES = 32767
"""Largest whole number of two bytes, in which the page stores an acceleration."""


def content(subject: Subject) -> dict[str, Any]:
    """Return everything that the page holds, ready for JSON.

    Args:
        subject: a design, the stored design of a report, a job, or a scene with the usual limits.

    Raises:
        ValueError: another object, or a problem that cannot be posed.
        RuntimeError: JAX is in 32-bit mode.
    """
    checks.require_x64()
    checks.instance("design", subject, (Design, StoredDesign, Job, Scene))
    # The answer has the keys of design.json. It is empty for a job or a scene.
    answer: Mapping[str, Any] = subject.content if isinstance(subject, StoredDesign) else {}
    if isinstance(subject, Design):
        problem, names = subject.problem, ("pendulum", "validated", "equivalent")
        shown = {n: getattr(subject, n) for n in names} | {"levels": shares_at_levels(subject)}
        answer = json_of(shown | {"verdict": subject.verdict})
    else:
        problem = problem_of(subject.job if isinstance(subject, StoredDesign) else subject)
    start, stated = _first_pendulum(problem, answer), answer.get("pendulum")
    pendulum = stated and Pendulum(**stated)
    # Each limit that the page evaluates has one number, or none: then its name is enough.
    values = {limit.name: next(iter(vars(limit).values()), True) for limit in problem.limits}
    limits = {
        name: x if isinstance(x, (int, float)) else True for name, x in values.items() if name in _SHOWN
    }
    out = {
        "version": tpd.__version__,
        "title": (problem.job and problem.job.full["project"]["name"]) or "",
        "verdict": answer.get("verdict") or "",
        "scene": block_numbers(problem),
        "limits": limits,
        "other_limits": sorted(values.keys() - limits.keys()),
        "limit_labels": LABELS,
        "still": STILL,
        "space": dict(zip(_QUANTITIES, _space(problem).tolist(), strict=True)),
        "recommended": pendulum and _values_of(pendulum),
        "runs": list(_stored_runs(problem, answer)),
        "no_runs": [(*row, "not simulated", _NO_RUNS) for row in _RUN_ROWS],
    }
    # Only a harmonic has steady motions. Under a pulse or a record the browser simulates the motion alone.
    if problem.has_earthquakes:
        return out | _ground_motions(problem, start) | {"levels": answer.get("levels") or []}
    return out | _harmonic(problem, start, pendulum)


def block_numbers(problem: Problem) -> dict[str, Any]:
    """Return block, gravity and bob as the page computes with them, in SI units."""
    scene, block, bob = problem.scene, problem.scene.block, bob_of(problem.limits)
    return {
        "nu": float(block.slenderness),
        "rho": float(block.inertia_ratio),
        "k": float(block.friction),
        "restitution": block.restitution if isinstance(block.restitution, str) else float(block.restitution),
        "gravity": float(scene.gravity),
        "rate": float(scene.rate),
        "mass": float(block.mass),
        "height": float(block.height),
        "centroid": float(block.centroid),
        "kappa": problem.hinge_ratio,
        "hinge": problem.hinge_ratio * float(block.centroid),
        "depth": float(problem.geometry.depth),
        "lowest": problem.geometry.obstacle,
        "width": float(block.width),
        # Without a cavity the search has no limit on the clearance, and the drawing no walls.
        "wall": 0.5 * float(block.clear_width) if np.isfinite(block.clear_width) else None,
        "frame": block.frame_width is not None,
        "bob": {
            "shape": bob.shape,
            "density": float(bob.density),
            "aspect": float(bob.aspect),
            "rodShare": bob.rod_share(1.0, float(scene.gravity)),
        },
    }


def _space(problem: Problem) -> np.ndarray:
    """Least and largest mass, length and damping of the search in SI units, shape (3, 2)."""
    block = problem.scene.block
    return problem.space.ends.T * np.array([[float(block.mass)], [float(block.centroid)], [1.0]])


def _first_pendulum(problem: Problem, answer: Mapping[str, Any]) -> Pendulum:
    """Pendulum with which the page begins: the recommended one, else the last one that was validated, else
    one in the middle of the space of the search."""
    for stored in (answer, *reversed(answer.get("validated", []))):
        if stored.get("pendulum"):
            return Pendulum(**stored["pendulum"])
    low, high = _space(problem).T
    # Ratios span decades: their geometric mean is in the middle.
    mass, length = np.sqrt(low * high)[:2].tolist()
    zeta, height = float(low[2] + high[2]) / 2.0, problem.space.hinge_height
    return Pendulum(mass=mass, length=length, damping_ratio=zeta, hinge_height=height)


def _ranges(problem: Problem, start: Pendulum) -> dict[str, tuple[float, float]]:
    """Ranges of the sliders of the pendulum, in SI units."""
    block, (mass, length, damping) = problem.scene.block, _space(problem)
    heaviest = HEAVIEST_RATIO
    if isinstance(block.restitution, str):
        # A heavier bob would throw the block back at an impact.
        heaviest = min(heaviest, 0.99 * float(heaviest_of_housner(block.slenderness, block.inertia_ratio)))

    def wide(ends: np.ndarray, own: float, most: float) -> tuple[float, float]:
        low, high = float(ends[0]), float(ends[1])
        # A value that the search keeps fixed can be explored as well.
        if low == high:
            low, high = low / _RANGE_FACTOR, high * _RANGE_FACTOR
        return min(low, own), min(max(high, own), most)

    zeta, longest = float(start.damping_ratio), problem.space.longest_ratio(block)
    # The names are those of the controls of the page.
    return {
        "mass": wide(mass, float(start.mass), heaviest * float(block.mass)),
        "length": wide(length, float(start.length), longest * float(block.centroid)),
        # A hinge without damping has a range as well.
        "damping": wide(damping, zeta, LARGEST_DAMPING) if damping[1] > 0.0 else (0.0, 0.2),
    }


def _harmonic(problem: Problem, start: Pendulum, recommended: Pendulum | None) -> dict[str, Any]:
    """Controls and tables of orbits under a harmonic."""
    scene, motion = problem.scene, problem.scene.excitation
    own = _values_of(start) | {"frequency": float(motion.frequency), "amplitude": float(motion.amplitude)}
    ranges = _ranges(problem, start)
    # The sliders reach every condition of the design.
    for name, share in (("frequency", _FREQUENCIES), ("amplitude", _AMPLITUDES)):
        factors = np.append(problem.conditions.column(name), share)
        ranges[name] = own[name] * float(factors.min()), own[name] * float(factors.max())

    def axes_of(counts: Mapping[str, int]) -> list[GridAxis]:
        return [
            axis(_QUANTITIES.get(n, n), *ranges[n], count, [own[n]], log=n not in _LINEAR)
            for n, count in counts.items()
        ]

    # Without a pendulum, or with a known one, only the excitation varies: these tables can be finer.
    fine = axes_of(_FINE)
    tables = {"grid": solve(scene, axes_of(_COUNTS), start).encoded()}
    tables["without"] = solve(scene, fine).encoded("tilt", "unstable", "tilt_error")
    if recommended is not None:
        tables["recommended"] = solve(scene, fine, recommended).encoded("tilt", "unstable")
    trials = _trials(problem, start, axes_of(_SHARES))
    periods = int(problem.ensemble.periods)
    return {"controls": _controls(own, ranges), "tables": tables, "periods": periods, "trials": trials}


def _trials(problem: Problem, start: Pendulum, axes: list[GridAxis]) -> dict[str, Any]:
    """Runs that the browser simulates, and the share of them that overturn over mass and length."""
    ensemble, conditions = replace(problem.ensemble, size=_RUNS), problem.conditions
    grid = np.meshgrid(*(a.values for a in axes), indexing="ij")
    sizes = zip(*(x.ravel().tolist() for x in grid), strict=True)
    pendulums = (replace(start, mass=mass, length=length) for mass, length in sizes)
    # The same runs everywhere: their scatter is no difference between two pendulums.
    how = {"ensemble": ensemble, "conditions": conditions}
    alone, *cases = (outcomes(problem.scene, pendulum, **how) for pendulum in (None, *pendulums))
    shares = np.reshape([runs.share_overturned.value for runs in cases], grid[0].shape)
    p = problem.scene.parameters(start)
    runs = plan(p, **how)
    nominal = {**vars(p), "rho": p.inertia_ratio, "e": p.velocity_ratio}
    # The page multiplies its own parameters by the factors of each run. A value of zero stays zero.
    scatter = {name: getattr(runs.p, name) / (float(x) or 1.0) for name, x in nominal.items()}
    if p.e is None:
        # Housner's e follows the mass of the bob: runs differ from it by a number.
        scatter["e"] = runs.p.e - housner(runs.p.nu, runs.p.rho, runs.p.mu)
    scatter |= {"phase": runs.begin * runs.p.xi, "growth": runs.growth, "start": runs.y0}
    starts = {"all starts": np.ones(_RUNS)} | alone.starts
    return {
        "words": f"Starts: {problem.words.starts}. Duration: {problem.words.duration}. A run counts as "
        "overturned if the tilt passes the toppling angle and the block cannot return.",
        "scatter": {name: x.tolist() for name, x in scatter.items()},
        "kinds": {label: np.flatnonzero(rows).tolist() for label, rows in starts.items()},
        "without": alone.share_overturned.value,
        "map": Table(tuple(axes), {"share": shares}).encoded(),
    }


def _ground_motions(problem: Problem, start: Pendulum) -> dict[str, Any]:
    """Controls, and accelerations of the base under pulses or records, of which the page simulates one."""
    conditions, values = problem.conditions, problem.conditions.column("amplitude")
    # The motion of a condition is proportional to its level.
    factors = motion_factors(problem.scene, conditions) / values
    _, first = np.unique(np.asarray(conditions.which), return_index=True)
    own, ranges = _values_of(start) | {"level": float(values[0])}, _ranges(problem, start)
    ranges["level"] = _LEVELS[0] * float(values.min()), _LEVELS[1] * float(values.max())
    motions = (m.scaled(float(factors[i])) for m, i in zip(conditions.motions, first, strict=True))
    words = {"level": (f"Level: {MEASURE_NAMES[conditions.intensity]}", "")}
    return {"controls": _controls(own, ranges, _LABELS | words), "grounds": list(map(_encoded, motions))}


def _encoded(motion: Any) -> dict[str, Any]:
    """Return a pulse or a record as numbers and texts for JSON.

    Coefficients become whole numbers of two bytes in base64, rounded by at most 2e-5 of the largest one.
    """
    pieces = np.asarray(motion.pieces())
    # A record is linear between its samples: its higher coefficients are zero and are left out.
    pieces = pieces[:, : int(max(np.flatnonzero(np.any(pieces != 0.0, axis=0)), default=0)) + 1]
    units = np.maximum(np.abs(pieces).max(axis=0), np.finfo(float).tiny) / _CODES
    period = f", {number(1.0 / float(motion.frequency), 3)} s" if hasattr(motion, "frequency") else ""
    return {
        "name": (getattr(motion, "kind", "") or getattr(motion, "name", "") or "record") + period,
        "peak": float(motion.pga),
        "piece": float(motion.piece),
        "seconds": float(motion.duration) + FREE,
        "units": units.tolist(),
        "data": base64.b64encode(np.rint(pieces / units).astype("<i2").tobytes()).decode(),
    }


def _values_of(pendulum: Pendulum) -> dict[str, float]:
    """Values of the controls of a pendulum."""
    sizes = pendulum.mass, pendulum.length, pendulum.damping_ratio
    return {name: float(x) for name, x in zip(_QUANTITIES, sizes, strict=True)}


def _controls(
    own: Mapping[str, float], ranges: Mapping[str, tuple[float, float]], words: Mapping[str, Any] = _LABELS
) -> list[dict[str, Any]]:
    """Controls of the page: each with its name, label, unit, group, first value and range."""
    controls = []
    for name, value in own.items():
        (label, unit), (low, high) = words[name], ranges[name]
        group = "pendulum" if name in _QUANTITIES else "excitation"
        texts = {"name": name, "label": label, "unit": unit, "group": group}
        controls.append(texts | {"value": value, "low": low, "high": high, "log": name not in _LINEAR})
    return controls


def _stored_runs(problem: Problem, answer: Mapping[str, Any]) -> Iterator[dict[str, Any]]:
    """Validation runs of each validated design, with the range of the pendulum in which they hold."""
    block = problem.scene.block
    si = np.array([float(block.mass), float(block.centroid), 1.0])
    validated, equivalent = answer.get("validated", []), answer.get("equivalent")
    for v in validated:
        # A limit that needs no run can reject a design before its runs.
        if (runs := v["reported_runs"] or v["deciding_runs"]) is None:
            continue
        design = np.array(v["design"])
        low, high = design * (1.0 - _DISTANCES), design * (1.0 + _DISTANCES)
        # The tolerance range is that of the recommended design, which is the last one.
        if equivalent is not None and v is validated[-1]:
            low, high = np.array(equivalent)
        yield {
            "low": (np.minimum(low, design) * si).tolist(),
            "high": (np.maximum(high, design) * si).tolist(),
            "rows": _rows(runs, [reason["sentence"] for reason in v["reasons"]]),
        }


def _rows(runs: Mapping[str, Any], sentences: Sequence[str]) -> list[tuple[str, ...]]:
    """Return names, labels, texts and sources of the rows on validation runs."""
    # A file has words for the numbers that JSON does not have.
    benefit, *changes = (
        {key: _NUMBERS.get(x, x) for key, x in part.items()} for part in (runs["benefit"], *runs["changes"])
    )
    by_name = {change["name"]: change for change in changes}
    # Changes count the runs of the description. The summaries of both cases count all runs.
    overturned, mean = by_name["overturned"], by_name["mean tilt"]
    shares, tilts = ([c[f"{case}_pendulum"] for case in ("with", "without")] for c in (overturned, mean))
    fell = f"{percent(benefit['mean'])} {confidence(benefit['low'], benefit['high'])}"
    fell = "unknown" if math.isnan(benefit["mean"]) else fell
    texts = (
        f"{with_and_without(*shares)} (difference: {confidence(overturned['low'], overturned['high'])[1:]}",
        f"{number(tilts[0], 3)}; without a pendulum {number(tilts[1], 3)}: reduction {fell}",
    )
    rows = [
        (*row, text, f"validation runs: {runs['runs']}") for row, text in zip(_RUN_ROWS, texts, strict=True)
    ]
    verdict = " ".join(sentences) or "no reason against this design"
    return [*rows, ("validation", "Validation", verdict, "validation runs")]
