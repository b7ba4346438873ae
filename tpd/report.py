"""The report of a design: text, JSON, the job that repeats it, and pictures, in one directory."""

from __future__ import annotations

import json
import math
import platform
import tempfile
from dataclasses import asdict
from importlib.metadata import version
from pathlib import Path
from typing import Any

import numpy as np

import tpd
from tpd.design import Candidate, Design, DesignStatus
from tpd.job import Job, dump, tables
from tpd.response import Response

PACKAGES = ("jax", "jaxlib", "diffrax", "optax", "equinox", "numpy")
LARGE_STROKE = 0.3
"""rad; above it the linear equations are off by more than a per cent or so."""


def text(design: Design, responses: tuple[Response, ...] = ()) -> str:
    """The report in words; its first line says what the answer is worth."""
    lines = [design.status.value, ""]
    lines += _answer(design)
    lines += ["", f"{'':24}{'exact':>14}{'smoothed':>14}{'difference':>12}  settles as"]
    named = (
        ("with the pendulum", design.winner),
        ("runner-up", design.runner_up),
        ("bare block", design.bare),
    )
    lines += [_row(name, c) for name, c in named if c is not None]
    lines += ["", *(f"note: {note}" for note in notes(design, responses))]
    lines += ["", f"searched from {len(design.starts)} starts, seed {design.seed}:"]
    counts = {s: design.starts.count(s) for s in dict.fromkeys(design.starts)}
    lines += [f"  {n} {s.value}" for s, n in counts.items()]
    return "\n".join(lines) + "\n"


def _answer(design: Design) -> list[str]:
    pendulum, winner = design.pendulum, design.winner
    if pendulum is None or winner is None:
        return ["no pendulum to offer"]
    nu = design.scene.block.slenderness
    return [
        f"pendulum mass      {pendulum.mass:10.4g} kg   (mass ratio   mu   = {winner.mass_ratio:.5g})",
        f"pendulum length    {pendulum.length:10.4g} m    (length ratio lam  = {winner.length_ratio:.5g})",
        f"hinge damping      {pendulum.damping_ratio:10.4g}      of critical",
        f"rocking amplitude  {_degrees(design.amplitude)}   "
        f"({design.amplitude / nu:.1%} of the slenderness {nu:g})",
        f"without pendulum   {_degrees(design.amplitude_without)}   "
        f"({design.amplitude_without / nu:.1%} of the slenderness)",
        f"bob's stroke       {_degrees(design.stroke)}   (limit {design.space.stroke:g} rad)",
    ]


def _degrees(angle: float) -> str:
    if not math.isfinite(angle):
        return "overturns           "
    return f"{angle:10.5f} rad ({math.degrees(angle):7.3f} deg)"


def _row(name: str, c: Candidate) -> str:
    agree = "" if c.agree else "  MODELS DISAGREE"
    difference = f"{c.difference:12.2%}" if math.isfinite(c.difference) else f"{'-':>12}"
    settles = c.status if c.periods == 1 else f"{c.status}, period {c.periods}"
    return f"{name:24}{c.amplitude:14.8f}{c.smoothed_amplitude:14.8f}{difference}  {settles}{agree}"


def notes(design: Design, responses: tuple[Response, ...] = ()) -> list[str]:
    """What somebody who would hang this pendulum must know, dangers first."""
    out = [
        "the linear equations of Collini et al. (2016) for one harmonic motion of the base, started from "
        "rest; other starts may settle elsewhere, and an earthquake is not a harmonic."
    ]
    if design.interrupted:
        out.insert(0, "the search was interrupted: this is the best design found until then.")
    winner = design.winner
    out = _dangers(design, responses) + out
    if winner is not None:
        if winner.margin > 0:
            out.append(
                f"the settled block keeps {winner.margin:.1%} of the moment that would lift it in hand; "
                "the sudden start may lift it before the pendulum has settled."
            )
        if winner.stroke > LARGE_STROKE:
            out.append(f"a stroke of {winner.stroke:.2f} rad stretches the linear equations of the pendulum.")
        out.extend(_edges(design, winner))
        if winner.multiplier > 0.95:
            out.append(f"the motion attracts slowly (Floquet multiplier {winner.multiplier:.3f}).")
    if (design.history.screened_status == "overturned").any():
        share = np.mean(design.history.screened_status == "overturned")
        out.append(
            f"of the designs screened, {share:.0%} overturn the block: "
            "a pendulum in the wrong place does harm."
        )
    return out


def _dangers(design: Design, responses: tuple[Response, ...]) -> list[str]:
    """Where, near the design frequency, the pendulum does harm: overturns, or rocks more."""
    if len(responses) < 2:
        return []
    bare, hung = responses
    away = np.abs(hung.frequency / design.scene.motion.frequency - 1.0)
    lost = np.flatnonzero(hung.status == "overturned")
    worse = np.flatnonzero((hung.amplitude > 1.02 * bare.amplitude) & (hung.status != "overturned"))
    out = []
    if lost.size:
        i = lost[np.argmin(away[lost])]
        out.append(
            f"DANGER: at {hung.frequency[i]:.4g} Hz, same base amplitude, from rest, the block "
            f"OVERTURNS with this pendulum (bare block there: {bare.status[i]}). Of {hung.frequency.size} "
            f"frequencies tried, {lost.size} overturn with it and {np.sum(bare.status == 'overturned')} "
            "without. The design is for its one frequency; see response.png."
        )
    if worse.size:
        i = worse[np.argmin(away[worse])]
        out.append(
            f"at {hung.frequency[i]:.4g} Hz the block rocks more with this pendulum "
            f"({hung.amplitude[i]:.4g} rad) than without ({bare.amplitude[i]:.4g} rad)."
        )
    return out


def _edges(design: Design, winner: Candidate) -> list[str]:
    space, out = design.space, []
    for name, value, bounds in (
        ("mass", winner.mass_ratio, space.mass_ratio),
        ("length", winner.length_ratio, space.length_ratio),
    ):
        width = bounds[1] - bounds[0]
        for bound, word in ((bounds[0], "least"), (bounds[1], "largest")):
            if abs(value - bound) < 0.002 * width:
                out.append(f"the {name} ratio is at the {word} allowed, {bound:g}.")
    return out


def as_json(design: Design, job: Job, responses: tuple[Response, ...] = ()) -> str:
    """The design as sorted JSON: SI and dimensionless, statuses, seed, versions and the job."""
    p = design.scene.parameters(design.pendulum)
    content = {
        "amplitude_rad": design.amplitude,
        "amplitude_without_rad": design.amplitude_without,
        "bare_block": _plain(design.bare),
        "history": {k: v.tolist() for k, v in asdict(design.history).items()},
        "interrupted": design.interrupted,
        "job": tables(job),
        "notes": notes(design, responses),
        "parameters": {k: v for k, v in vars(p).items() if v is not None} | {"rho": p.inertia_ratio},
        "pendulum": None if design.pendulum is None else asdict(design.pendulum),
        "responses": [{k: v.tolist() for k, v in asdict(r).items()} for r in responses],
        "runner_up": _plain(design.runner_up),
        "seed": design.seed,
        "settings": design.settings,
        "starts": [s.name for s in design.starts],
        "status": design.status.name,
        "status_message": design.status.value,
        "stroke_rad": design.stroke,
        "tolerance": design.tolerance,
        "versions": {"python": platform.python_version(), "tpd": tpd.__version__}
        | {name: version(name) for name in PACKAGES},
        "winner": _plain(design.winner),
    }
    return json.dumps(_finite(content), indent=1, sort_keys=True, allow_nan=False) + "\n"


def _plain(candidate: Candidate | None) -> dict[str, Any] | None:
    return None if candidate is None else asdict(candidate) | {"difference": candidate.difference}


def _finite(value: Any) -> Any:
    """JSON has no infinity: what overturns or is unknown becomes a word."""
    if isinstance(value, dict):
        return {k: _finite(v) for k, v in value.items()}
    if isinstance(value, (list, tuple)):
        return [_finite(v) for v in value]
    if isinstance(value, float) and not math.isfinite(value):
        return "nan" if math.isnan(value) else "infinite"
    return value


def claim(directory: Path, *, overwrite: bool) -> None:
    """Check, before any work, that the report can be written.

    Raises:
        ValueError: the directory exists and may not be overwritten, or cannot be written.
    """
    if directory.exists() and not directory.is_dir():
        raise ValueError(f"cannot write the report: {directory} is a file, not a directory")
    if directory.exists() and any(directory.iterdir()) and not overwrite:
        raise ValueError(
            f"{directory} already holds files: choose another directory with --out, or pass --overwrite"
        )
    try:
        directory.parent.mkdir(parents=True, exist_ok=True)
        with tempfile.TemporaryFile(dir=directory if directory.exists() else directory.parent):
            pass
    except OSError as error:
        raise ValueError(f"cannot write to {directory}: {error.strerror or error}") from None


def write(directory: Path, design: Design, job: Job, responses: tuple[Response, ...]) -> list[Path]:
    """Write the whole report; each file appears complete or not at all. Returns the files."""
    from tpd import plot

    directory.mkdir(parents=True, exist_ok=True)
    written = []

    def place(name: str, content: str | bytes) -> None:
        data = content.encode() if isinstance(content, str) else content
        with tempfile.NamedTemporaryFile(dir=directory, delete=False) as file:
            file.write(data)
        path = directory / name
        Path(file.name).chmod(0o644)
        Path(file.name).replace(path)
        written.append(path)

    place("report.txt", text(design, responses))
    place("design.json", as_json(design, job, responses))
    place("scene.toml", dump(job))
    for name, picture in plot.pictures(design, responses):
        place(name, picture)
    return written


def is_sound(design: Design) -> bool:
    """Whether the answer may be used: a design found and confirmed, or none needed."""
    return design.status in (DesignStatus.found, DesignStatus.no_uplift)
