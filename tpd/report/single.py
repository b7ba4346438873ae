"""The report of a design: text, JSON, the job that repeats it, and pictures, in one directory."""

from __future__ import annotations

import math
from collections.abc import Iterator
from dataclasses import asdict
from pathlib import Path
from typing import Any

from tpd.analysis.compare_models import Check
from tpd.analysis.response import Response
from tpd.analysis.sensitivity import Elasticities, elasticities
from tpd.core import files
from tpd.design.job import Job, dump, tables
from tpd.design.result import Candidate, Design
from tpd.report.notes import losses, notes, toppling
from tpd.report.single_page import Told, design_page


def text(design: Design, responses: tuple[Response, ...] = ()) -> str:
    """The report in words; its first line says what the answer is worth."""
    said = notes(design, responses)
    dangers = [f"note: {note}" for note in said if note.startswith("DANGER")]
    lines = [design.status.value, "", *dangers, *([""] if dangers else [])]
    lines += _answer(design)
    lines += ["", f"{'':24}{'exact':>14}{design.searched_with:>14}{'difference':>12}  settles as"]
    named = (
        ("best design", design.winner),
        ("runner-up", design.runner_up),
        ("bare block", design.bare),
    )
    lines += [_row(name, c) for name, c in named if c is not None]
    lines += _rounds(design)
    lines += ["", *(f"note: {note}" for note in said[len(dangers) :])]
    if design.verdict is not None:
        runs = design.verdict.hung.ensemble
        head = f"ensemble of {runs.size} runs, seed {runs.seed} (lost: overturned, or no answer):"
        lines += ["", head, design.verdict.table()]
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
    bare = f"without pendulum   {_degrees(design.amplitude_without, toppling(design, 0.0))}"
    loss = f"the block's losses {losses(design.scene.block)}"
    if pendulum is None or winner is None:
        return ["no pendulum to offer", bare, loss]
    topples = toppling(design, winner.mass_ratio)
    hinge = pendulum.hinge_damping(design.scene.gravity)
    return [
        f"pendulum mass      {pendulum.mass:10.4g} kg   (mass ratio   mu   = {winner.mass_ratio:.5g})",
        f"pendulum length    {pendulum.length:10.4g} m    (length ratio lam  = {winner.length_ratio:.5g})",
        f"hinge damping      {hinge:10.4g} N m s/rad ({pendulum.damping_ratio:.4g} of critical, hung from a "
        "fixed point)",
        f"rocking amplitude  {_degrees(design.amplitude, topples)}",
        bare,
        loss,
        f"bob's stroke       {_degrees(design.stroke)}, limit {design.space.stroke:g} rad",
        f"first 24 periods   tilt up to {design.peak[0]:.4f} rad ({design.peak[0] / topples:.0%} of "
        f"toppling), bob up to {design.peak[1]:.4f} rad",
    ]


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
    which = ""
    if name == "runner-up":
        which = f"  (mu {c.mass_ratio:.4g}, lam {c.length_ratio:.4g}, zeta {c.damping_ratio:.4g})"
    return f"{name:24}{sizes}{difference}  {settles}{agree}{which}"


def as_json(
    design: Design,
    job: Job,
    responses: tuple[Response, ...] = (),
    sensitive: Elasticities | None = None,
) -> str:
    """The design as sorted JSON: SI and dimensionless, statuses, seed, versions and the job."""
    p, hung = design.scene.parameters(design.pendulum), design.pendulum
    content = {
        "amplitude_rad": design.amplitude,
        "amplitude_without_rad": design.amplitude_without,
        "bare_block": _plain(design.bare),
        "elasticities": None if sensitive is None else asdict(sensitive),
        "hinge_damping_N_m_s_per_rad": None if hung is None else hung.hinge_damping(design.scene.gravity),
        "history": {k: v.tolist() for k, v in asdict(design.history).items()},
        "interrupted": design.interrupted,
        "overturned_nearby": design.overturned_nearby,
        "peak_rad": design.peak,
        "job": tables(job),
        "notes": notes(design, responses),
        "parameters": {k: v for k, v in vars(p).items() if v is not None} | {"rho": p.inertia_ratio},
        "pendulum": None if hung is None else asdict(hung),
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
        "ensemble": None if design.verdict is None else design.verdict.summary(),
        "versions": files.versions(),
        "winner": _plain(design.winner),
    }
    return files.as_json(content)


def _plain(candidate: Candidate | None) -> dict[str, Any] | None:
    return None if candidate is None else asdict(candidate) | {"difference": candidate.difference}


def write(
    directory: Path,
    design: Design,
    job: Job,
    responses: tuple[Response, ...],
    *,
    ladder: Check | None = None,
) -> list[Path]:
    """Write the whole report; each file appears complete or not at all. Returns the files.

    The page is written last, and not of what was interrupted. `ladder` is shown there.
    """
    from tpd.plot import single as plot

    directory.mkdir(parents=True, exist_ok=True)
    written = []

    def place(name: str, content: str | bytes) -> None:
        written.append(files.place(directory / name, content))

    whole = not design.interrupted
    sensitive = elasticities(design.scene.parameters(design.pendulum)) if whole else None
    place("report.txt", text(design, responses))
    place("design.json", as_json(design, job, responses, sensitive))
    place("scene.toml", dump(job))
    pictures = {}
    for name, picture in plot.pictures(design, responses):
        pictures[name] = picture
        place(name, picture)
    if sensitive is None:
        return written
    for name, picture in _moving(design):
        pictures[name] = picture
        place(name, picture)
    told = Told(design, job, responses, pictures, sensitive, directory, ladder=ladder)
    place("report.html", design_page(told))
    return written


def _moving(design: Design) -> Iterator[tuple[str, bytes]]:
    """(file name, content) of the pictures of the thing itself."""
    from tpd.plot.animation import animate
    from tpd.plot.drawing import plot_scene
    from tpd.plot.style import png

    scene = plot_scene(design.scene, design.pendulum, stroke=design.stroke)
    yield "drawing.png", png(scene.figure)
    yield "animation.gif", animate(design.scene, design.pendulum)


def is_sound(design: Design) -> bool:
    """Whether the answer may be used: a design found and confirmed, or none needed."""
    return design.status.is_sound
