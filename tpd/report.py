"""The report of a design: text, JSON, the job that repeats it, and pictures, in one directory."""

from __future__ import annotations

import math
from dataclasses import asdict
from pathlib import Path
from typing import Any

import numpy as np

from tpd import files
from tpd.design import Candidate, Design, DesignStatus
from tpd.job import Job, dump, tables
from tpd.response import Response
from tpd.scene import HOUSNER, Block
from tpd.status import SETTLED

LARGE_PEAK = 0.7
"""Of the toppling tilt; above it a start from rest is called dangerous."""
LARGE_STROKE = 0.3
"""rad; sin(psi) is 1.5 % below psi there, and falls further with its square."""


def text(design: Design, responses: tuple[Response, ...] = ()) -> str:
    """The report in words; its first line says what the answer is worth."""
    lines = [design.status.value, ""]
    lines += _answer(design)
    lines += ["", f"{'':24}{'exact':>14}{design.searched_with:>14}{'difference':>12}  settles as"]
    named = (
        ("best design", design.winner),
        ("runner-up", design.runner_up),
        ("bare block", design.bare),
    )
    lines += [_row(name, c) for name, c in named if c is not None]
    lines += _rounds(design)
    lines += ["", *(f"note: {note}" for note in notes(design, responses))]
    lines += ["", f"searched from {len(design.starts)} starts, seed {design.seed}:"]
    counts = {s: design.starts.count(s) for s in dict.fromkeys(design.starts)}
    lines += [f"  {n} of them {s.value}" for s, n in counts.items()]
    return "\n".join(lines) + "\n"


def _rounds(design: Design) -> list[str]:
    """What the nonlinear equations said of each design put to them."""
    if not design.rounds:
        return []
    lines = [
        "",
        f"{'nonlinear equations':24}{'amplitude':>14}{'stroke':>14}{'searched under':>16}  settles as",
    ]
    for i, r in enumerate(design.rounds):
        sizes = "".join(f"{x:14.6f}" if math.isfinite(x) else f"{'-':>14}" for x in (r.amplitude, r.stroke))
        lines.append(f"{f'round {i + 1}':24}{sizes}{r.limit:12.4f} rad  {r.status}")
        lines += [f"  refused: {objection}" for objection in r.objections]
    return lines


def _answer(design: Design) -> list[str]:
    pendulum, winner = design.pendulum, design.winner
    bare = f"without pendulum   {_degrees(design.amplitude_without, _toppling(design, 0.0))}"
    loss = f"the block's losses {losses(design.scene.block)}"
    if pendulum is None or winner is None:
        return ["no pendulum to offer", bare, loss]
    toppling = _toppling(design, winner.mass_ratio)
    hinge = 2.0 * pendulum.damping_ratio * pendulum.mass * pendulum.length**1.5 * design.scene.gravity**0.5
    return [
        f"pendulum mass      {pendulum.mass:10.4g} kg   (mass ratio   mu   = {winner.mass_ratio:.5g})",
        f"pendulum length    {pendulum.length:10.4g} m    (length ratio lam  = {winner.length_ratio:.5g})",
        f"hinge damping      {hinge:10.4g} N m s/rad ({pendulum.damping_ratio:.4g} of critical, hung from a "
        "fixed point)",
        f"rocking amplitude  {_degrees(design.amplitude, toppling)}",
        bare,
        loss,
        f"bob's stroke       {_degrees(design.stroke)}, limit {design.space.stroke:g} rad",
        f"first 24 periods   tilt up to {design.peak[0]:.4f} rad ({design.peak[0] / toppling:.0%} of "
        f"toppling), bob up to {design.peak[1]:.4f} rad",
    ]


def losses(block: Block) -> str:
    """What takes the rocking block's energy, in words."""
    if block.restitution is None:
        return f"friction k = {block.friction:g}"
    model = "Housner, " if block.restitution == HOUSNER else ""
    impacts = f"impact loss: {model}e = {block.velocity_ratio:.4g}"
    return f"{impacts}; friction k = {block.friction:g}" if block.friction else impacts


def _toppling(design: Design, mass_ratio: float) -> float:
    """The tilt (rad) at which the linear block topples of itself, nu (1 + mu)/(1 + 2 mu)."""
    return design.scene.block.slenderness * (1.0 + mass_ratio) / (1.0 + 2.0 * mass_ratio)


def _degrees(angle: float, toppling: float | None = None) -> str:
    if not math.isfinite(angle):
        return " overturns"
    share = "" if toppling is None else f", {angle / toppling:.1%} of the tilt at which it topples"
    return f"{angle:10.5f} rad ({math.degrees(angle):.3f} deg{share})"


def _row(name: str, c: Candidate) -> str:
    agree = "" if c.agree else "  MODELS DISAGREE" if c.smoothed_status != "not solved" else ""
    difference = f"{c.difference:12.2%}" if math.isfinite(c.difference) else f"{'-':>12}"
    sizes = "".join(
        f"{x:14.6f}" if math.isfinite(x) else f"{'-':>14}" for x in (c.amplitude, c.smoothed_amplitude)
    )
    settles = c.status if c.periods == 1 else f"{c.status}, period {c.periods}"
    return f"{name:24}{sizes}{difference}  {settles}{agree}"


def notes(design: Design, responses: tuple[Response, ...] = ()) -> list[str]:
    """What somebody who would hang this pendulum must know, dangers first."""
    out = [
        "amplitudes, strokes and responses are those of the linear equations of Collini et al. (2016) under "
        "one harmonic motion of the base, switched on suddenly at rest; the nonlinear ones were asked of the "
        "design itself. Other starts may settle elsewhere, and an earthquake is not a harmonic."
    ]
    if design.interrupted:
        out.insert(0, "the search was interrupted; nothing below is the best of the design space.")
    winner = design.winner
    out = _dangers(design, responses) + out
    if winner is not None and design.pendulum is not None:
        out.extend(_margins(winner))
        out.extend(_edges(design, winner))
    if not design.bare.agree and design.bare.smoothed_status != "not solved":
        out.append("the models disagree on the bare block: take its amplitude as a rough one.")
    if (design.history.screened_status == "overturned").any():
        share = np.mean(design.history.screened_status == "overturned")
        out.append(
            f"of the designs screened, {share:.0%} overturn the block: "
            "a pendulum in the wrong place does harm."
        )
    return out


def _margins(winner: Candidate) -> list[str]:
    """How far the settled motion is from being another."""
    out = []
    if winner.status == "rest":
        out.append(
            f"the resting block keeps {winner.margin:.1%} of the moment that would lift it in hand, once the "
            "pendulum has settled; the sudden start may lift it before."
        )
    elif winner.margin > 0:
        out.append("the block could rest under this pendulum, but a start from rest ends in rocking.")
    if winner.stroke > LARGE_STROKE:
        out.append(f"a stroke of {winner.stroke:.2f} rad stretches the linear equations of the pendulum.")
    if winner.multiplier > 0.95:
        out.append(f"the motion attracts slowly (Floquet multiplier {winner.multiplier:.3f}).")
    return out


def _dangers(design: Design, responses: tuple[Response, ...]) -> list[str]:
    """Where, near the design's shaking, the block overturns or rocks more."""
    out = []
    tried, hung_lost, bare_lost = design.overturned_nearby
    if design.pendulum is not None and hung_lost:
        out.append(
            f"DANGER: of {tried} shakings within 1 % in amplitude or frequency, {hung_lost} overturn the "
            f"block with this pendulum ({bare_lost} without), from rest."
        )
    if design.pendulum is not None and design.peak[0] > LARGE_PEAK * _toppling(design, 0.0):
        out.append(
            "DANGER: in the first 24 periods from rest the block comes near the tilt at which it topples."
        )
    if len(responses) < 2:
        return out
    bare, hung = responses
    away = np.abs(hung.frequency / design.scene.motion.frequency - 1.0)
    lost, lost_bare = hung.status == "overturned", bare.status == "overturned"
    harmed = np.flatnonzero(lost & ~lost_bare)
    if harmed.size:
        i = harmed[np.argmin(away[harmed])]
        out.append(
            f"DANGER: at {hung.frequency[i]:.4g} Hz, same base amplitude, from rest, this pendulum OVERTURNS "
            f"the block, which without it ends {bare.status[i]}. The design is for its one frequency; see "
            "response.png."
        )
    settled = [np.isin(r.status, SETTLED) for r in responses]
    worse = np.flatnonzero(settled[0] & settled[1] & (hung.amplitude > 1.02 * bare.amplitude))
    if worse.size:
        i = worse[np.argmin(away[worse])]
        out.append(
            f"at {hung.frequency[i]:.4g} Hz the block rocks more with this pendulum "
            f"({hung.amplitude[i]:.4g} rad) than without ({bare.amplitude[i]:.4g} rad)."
        )
    out.append(
        f"of {lost.size} frequencies tried from {hung.frequency[0]:.4g} to {hung.frequency[-1]:.4g} Hz, "
        f"{lost.sum()} overturn the block with the pendulum and {lost_bare.sum()} without."
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
        "overturned_nearby": design.overturned_nearby,
        "peak_rad": design.peak,
        "job": tables(job),
        "notes": notes(design, responses),
        "parameters": {k: v for k, v in vars(p).items() if v is not None} | {"rho": p.inertia_ratio},
        "pendulum": None if design.pendulum is None else asdict(design.pendulum),
        "responses": [{k: v.tolist() for k, v in asdict(r).items()} for r in responses],
        "rounds": [asdict(r) for r in design.rounds],
        "runner_up": _plain(design.runner_up),
        "seed": design.seed,
        "settings": design.settings,
        "starts": [s.name for s in design.starts],
        "status": design.status.name,
        "status_message": design.status.value,
        "stroke_rad": design.stroke,
        "tolerance": design.tolerance,
        "versions": files.versions(),
        "winner": _plain(design.winner),
    }
    return files.as_json(content)


def _plain(candidate: Candidate | None) -> dict[str, Any] | None:
    return None if candidate is None else asdict(candidate) | {"difference": candidate.difference}


def write(directory: Path, design: Design, job: Job, responses: tuple[Response, ...]) -> list[Path]:
    """Write the whole report; each file appears complete or not at all. Returns the files."""
    from tpd import plot

    directory.mkdir(parents=True, exist_ok=True)
    written = []

    def place(name: str, content: str | bytes) -> None:
        written.append(files.place(directory / name, content))

    place("report.txt", text(design, responses))
    place("design.json", as_json(design, job, responses))
    place("scene.toml", dump(job))
    for name, picture in plot.pictures(design, responses):
        place(name, picture)
    return written


def is_sound(design: Design) -> bool:
    """Whether the answer may be used: a design found and confirmed, or none needed."""
    return design.status in (DesignStatus.found, DesignStatus.no_uplift)
