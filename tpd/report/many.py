"""The report of a design over many conditions: text, JSON and pictures."""

from __future__ import annotations

import math
from collections import Counter
from collections.abc import Iterator
from dataclasses import asdict
from typing import Any

import numpy as np

from tpd.analysis.ensemble import SIGNIFICANT, Verdict, chance_of
from tpd.core import files
from tpd.core.scene import Block, Pendulum
from tpd.design.many_result import DesignOver, Judged, OverStatus
from tpd.design.objective import KINDS, Objective, Told
from tpd.design.pareto import Front
from tpd.report.notes import dangers_first, strikes, thick

_ROWS = 24
"""Most conditions that the text lists, evenly over all of them."""


def is_sound(design: DesignOver) -> bool:
    """Whether the answer may be used: a design found and judged, or none needed."""
    return design.status in (OverStatus.found, OverStatus.no_uplift)


def text(design: DesignOver, front: Front | None = None) -> str:
    """The report in words; its first line says what the answer is worth."""
    lines = [design.status.value, "", *(f"note: {n}" for n in notes(design)), "", *_answer(design)]
    winner = design.winner
    if winner is not None:
        lines += ["held by: " + "; ".join(winner.active or ("nothing",))]
        lines += [f"decrease left, to first order: {winner.stationarity:.2g} per unit of scaled step"]
        lines += ["", *_conditions(design, winner), "", *_nonlinear(design, winner)]
        if winner.verdict is not None:
            lines += ["", _ensemble(winner.verdict)]
        lines += ["", *_sensitivities(design)]
    for judged in design.judged:
        if judged.objections:
            at = (judged.mass_ratio, judged.length_ratio, judged.damping_ratio)
            lines += ["", "refused: mu {:.4g}, lam {:.4g}, zeta {:.4g}".format(*at)]
            lines += [f"  {o}" for o in judged.objections]
    if front is not None:
        lines += ["", "largest mass ratio    value (tilt over nu, over all symmetric orbits)"]
        lines += [f"{m:18.4g}    {v:.4f}" for m, v in zip(front.mass_ratio, front.value, strict=True)]
    counts = Counter(s.value for s in design.starts)
    lines += ["", f"searched from {design.searched}, seed {design.seed}, {design.evaluations} designs:"]
    return "\n".join([*lines, *(f"  {n} of them {s}" for s, n in counts.items())]) + "\n"


def notes(design: DesignOver) -> list[str]:
    """What somebody who would hang this pendulum must know, dangers first."""
    out, winner = [], design.winner
    if winner is not None:
        lost, bare = winner.reached == "overturned", design.bare_reached == "overturned"
        if np.any(lost & ~bare):
            first = design.conditions.name(int(np.flatnonzero(lost & ~bare)[0]))
            out.append(
                f"DANGER: from rest this pendulum OVERTURNS the block under {np.sum(lost & ~bare)} of "
                f"{lost.size} conditions that it stands without, the first {first}."
            )
        if lost.any():
            out.append(
                f"from rest the block overturns under {lost.sum()} of {lost.size} conditions with the "
                f"pendulum, {bare.sum()} without."
            )
        if winner.verdict is not None:
            share, without = winner.verdict.hung.overturned, winner.verdict.bare.overturned
            out.append(f"of the ensemble {share} overturn with the pendulum, {without} without.")
        nu = design.scene.block.slenderness * design.conditions.column("slenderness")
        settled = winner.told.stroke + winner.told.tilt * nu
        kept = design.limits.walls
        out.extend(walls(design.scene.block, design.pendulum, settled, winner.verdict, kept))
        out.extend([] if design.pendulum is None else thick(design.pendulum))
        if not _overturns_less(design, winner):
            out.append(
                "that the block overturns less with this pendulum is not shown: neither from rest nor in the "
                "ensemble are there significantly fewer. What it lessens is the steady tilt."
            )
        out.extend(_fallen(design, winner))
        if not winner.ended:
            out.append(
                "the best at which a search ended was refused, see below; a search came through this design "
                "on its way. It is not the best of its neighbours, and a neighbour may be refused as well."
            )
        if design.reached is not None and np.any(winner.told.lost):
            out.append(
                f"from {np.mean(winner.told.lost):.1%} of the starts the block overturns with the pendulum, "
                f"from {np.mean(design.bare.lost):.1%} without: tilts are those of the others."
            )
        if np.any(winner.told.loose):
            out.append(
                f"of {np.mean(winner.told.loose):.1%} of the starts the motion does not repeat, or is about "
                "to vanish: it counts by its largest tilt, and the search saw no slope there."
            )
        if design.reached is None and np.any(~winner.told.attracts):
            out.append(
                f"under {int(np.sum(~winner.told.attracts))} conditions no symmetric motion attracts: what "
                "the block does there only events tell."
            )
    out.append(f"tilts are those of {_whose(design)}; an earthquake is not a harmonic.")
    return dangers_first(out)


def _fallen(design: DesignOver, winner: Judged) -> list[str]:
    """Where the block overturns by the nonlinear equations, and what the bare one does there."""
    names = [design.conditions.name(i) for i, _, _, _ in winner.nonlinear]
    alone = [
        n for n, bare in zip(names, winner.nonlinear_bare, strict=True) if bare not in ("", "overturned")
    ]
    both = [n for n, bare in zip(names, winner.nonlinear_bare, strict=True) if bare == "overturned"]
    start = "by the nonlinear equations, from rest, the block overturns with the pendulum"
    out = []
    if alone:
        out.append(
            f"DANGER: {start} {', '.join(alone)}, and bare it stands; not held against it, since by the "
            "linear ones the bare block overturns there: a single run near overturning says little."
        )
    if both:
        out.append(f"{start} {', '.join(both)}, and so it does bare.")
    return out


def _whose(design: DesignOver) -> str:
    """Of which motions the tilts are."""
    if design.reached is None:
        return "the largest attracting symmetric motion of the linear equations, whichever start leads to it"
    start = f"{design.reached.size} starts (seed {design.reached.seed})"
    if design.by_share:
        return f"the motions, by the linear equations, that {start} reach, the mean over the starts"
    return f"the largest motion, by the linear equations, that one of {start} reaches"


def _overturns_less(design: DesignOver, winner: Judged) -> bool:
    """Whether significantly fewer conditions, or runs of the ensemble, overturn the block than without."""
    lost, bare = winner.reached == "overturned", design.bare_reached == "overturned"
    pairs = [(int(np.sum(lost & ~bare)), int(np.sum(bare & ~lost)))]
    if winner.verdict is not None:
        pairs.append((winner.verdict.worse, winner.verdict.better))
    return any(better > worse and chance_of(better, worse) < SIGNIFICANT for worse, better in pairs)


def walls(
    block: Block,
    pendulum: Pendulum | None,
    settled: np.ndarray,
    verdict: Verdict | None,
    limited: bool = False,
) -> list[str]:
    """Whether a bob of steel keeps within the width of the block: under every condition (`settled`, the
    largest bob angle and tilt together, rad, any shape), and in most runs of the ensemble."""
    if pendulum is None:
        return []
    worst = np.max(settled, where=np.isfinite(settled), initial=0.0)
    angles = {"once settled under the worst condition": float(worst)}
    if verdict is not None:
        reach = np.quantile(verdict.hung.peak_stroke + verdict.hung.peak, 0.5, method="inverted_cdf")
        if math.isfinite(reach):
            angles["in half of the runs"] = float(reach)
    return strikes(block, pendulum, angles, limited)


def _answer(design: DesignOver) -> list[str]:
    what = design.measure.name
    bare = f"{what} tilt without {worth(design, design.bare_value)}"
    pendulum, winner = design.pendulum, design.winner
    if pendulum is None or winner is None:
        near = [f"nearest to the limits comes {design.nearest}"] if design.nearest else []
        known = design.end_values[np.isfinite(design.end_values)]
        best = [f"best within the limits {worth(design, float(known.min()))}"] if known.size else []
        return ["no pendulum to offer", *near, *best, bare]
    hinge = 2.0 * pendulum.damping_ratio * pendulum.mass * pendulum.length**1.5 * design.scene.gravity**0.5
    return [
        f"pendulum mass      {pendulum.mass:10.4g} kg   (mass ratio   mu   = {winner.mass_ratio:.5g})",
        f"pendulum length    {pendulum.length:10.4g} m    (length ratio lam  = {winner.length_ratio:.5g})",
        f"hinge damping      {hinge:10.4g} N m s/rad ({pendulum.damping_ratio:.4g} of critical)",
        f"conditions         {'; '.join(design.conditions.told) or 'the scene alone'}",
        f"{what} tilt         {worth(design, winner.value)}",
        bare,
        f"largest stroke     {np.nanmax(winner.told.stroke):10.4f} rad, limit {design.space.stroke:g} rad",
        *_room(design, winner),
    ]


def _room(design: DesignOver, winner: Judged) -> list[str]:
    """What the settled bob takes of the room to either side, where that is limited."""
    asked = design.scene, design.conditions, design.space, design.measure, design.limits
    told = winner.told
    nu = design.scene.block.slenderness * design.conditions.column("slenderness")
    taken = Objective.of(*asked).room(told.design, told.stroke + told.tilt * nu)
    words = {"offset": "bob from the axis", "walls": "ball to the wall", "ball": "ball within rod"}
    return [f"{words[n]:18} {x.max():10.4f} of what the limit on {n} allows" for n, x in taken.items()]


def worth(design: DesignOver, value: float) -> str:
    """A value of the design's measure in words."""
    followed = design.reached is not None
    mean = design.measure.share > 0.0 or (followed and design.by_share)
    told = f"{value:.4f} times nu, rest counted as less its uplift margin"
    if followed and (mean or value > 1.0):
        return told + ", a start that overturns as 2 less that margin"
    return told if mean and value <= 0.0 else tilt(value, design.scene.block.slenderness)


def tilt(value: float, nu: float) -> str:
    """A value of a measure in words."""
    if value <= 0.0:
        return f"none: at rest with {-value:.1%} of the lifting moment in hand"
    if value > 1.0:
        return "no motion to settle into under the worst condition: by events the block may overturn"
    return f"{value * nu:.5f} rad ({value:.1%} of nu)"


def _conditions(design: DesignOver, winner: Judged) -> list[str]:
    n = len(design.conditions)
    chosen = np.unique(np.linspace(0, n - 1, min(n, _ROWS)).astype(int))
    lines = [f"{'condition':34}{'tilt':>9}{'stroke':>9}{'from rest':>14}{'bare tilt':>11}{'from rest':>14}"]
    nu = design.scene.block.slenderness * design.conditions.column("slenderness")
    for i in chosen:
        name = design.conditions.name(int(i))[:33]
        tilts = [_cell(t, int(i), float(nu[i])) for t in (winner.told, design.bare)]
        lines.append(
            f"{name:34}{tilts[0]:>9}{winner.told.stroke[0, i]:9.4f}{winner.reached[i]:>14}{tilts[1]:>11}"
            f"{design.bare_reached[i]:>14}"
        )
    return lines


def _cell(told: Told, i: int, nu: float) -> str:
    kind = KINDS[int(told.kind[0, i])]
    if kind == "no_orbit" and np.any(told.lost):
        return "lost"
    return kind if kind in ("rest", "no_orbit", "unstable") else f"{told.tilt[0, i] * nu:.4f}"


def kind_of(told: Told, i: int) -> str:
    """What a design does under a condition, and from which share of the starts it overturns."""
    kind = KINDS[int(told.kind[0, i])].replace("_", " ")
    lost = float(np.broadcast_to(told.lost, told.kind.shape)[0, i])
    return kind if not lost else "overturned" if lost >= 1.0 else f"{kind}; {lost:.0%} overturn"


def _nonlinear(design: DesignOver, winner: Judged) -> list[str]:
    lines = [f"{'nonlinear equations, from rest':34}{'tilt':>9}{'stroke':>9}  ends"]
    for i, amplitude, stroke, status in winner.nonlinear:
        sizes = "".join(f"{x:9.4f}" if math.isfinite(x) else f"{'-':>9}" for x in (amplitude, stroke))
        lines.append(f"{design.conditions.name(i)[:33]:34}{sizes}  {status}")
    return lines


def _ensemble(verdict: Verdict) -> str:
    o = verdict.hung.ensemble
    return f"ensemble of {o.size} runs, seed {o.seed} (lost: overturned, or no answer):\n{verdict.table()}"


def _sensitivities(design: DesignOver) -> list[str]:
    told = ", ".join(f"{name} {x:+.2f}" for name, x in design.elasticities.items() if math.isfinite(x))
    return [f"per cent of the value for one per cent of: {told}"]


def as_json(design: DesignOver, job: dict[str, Any], front: Front | None = None) -> str:
    """The design as sorted JSON: SI and dimensionless, statuses, seed, versions and the job."""
    content = {
        "status": design.status.name,
        "status_message": design.status.value,
        "notes": notes(design),
        "pendulum": None if design.pendulum is None else asdict(design.pendulum),
        "measure": asdict(design.measure),
        "conditions": {"told": design.conditions.told, **_lists(design.conditions.factors)},
        "limits": design.limits.told() | {"stroke": design.space.stroke},
        "nearest": design.nearest,
        "bare": {"value": design.bare_value, "reached": design.bare_reached.tolist(), **_told(design.bare)},
        "judged": [_judged(j) for j in design.judged],
        "bare_ensemble": None if design.bare_outcomes is None else design.bare_outcomes.summary(),
        "elasticities": design.elasticities,
        "starts": [s.name for s in design.starts],
        "ends": design.ends.tolist(),
        "end_values": design.end_values.tolist(),
        "front": None if front is None else _lists(vars(front)),
        "evaluations": design.evaluations,
        "searched": design.searched,
        "seed": design.seed,
        "settings": design.settings,
        "job": job,
        "versions": files.versions(),
    }
    return files.as_json(content)


def _lists(values: Any) -> dict[str, Any]:
    return {k: v.tolist() if isinstance(v, np.ndarray) else v for k, v in values.items()}


def _told(told: Told) -> dict[str, Any]:
    kept = ("tilt", "stroke", "margin", "multiplier", "reserve")
    lost = np.broadcast_to(told.lost, told.kind.shape)[0].tolist()
    kinds = [KINDS[k] for k in told.kind[0]]
    return {n: getattr(told, n)[0].tolist() for n in kept} | {"kind": kinds, "lost": lost}


def _judged(judged: Judged) -> dict[str, Any]:
    skipped = ("told", "verdict", "reached", "reached_tilt")
    plain = {k: v for k, v in vars(judged).items() if k not in skipped}
    more = {"reached": judged.reached.tolist(), "reached_tilt": judged.reached_tilt.tolist()}
    verdict = judged.verdict
    told = None if verdict is None else verdict.summary()
    return plain | more | _told(judged.told) | {"ensemble": told}


def pictures(design: DesignOver, front: Front | None = None) -> Iterator[tuple[str, bytes]]:
    """(file name, PNG) of every picture."""
    from tpd.plot.animation import animate
    from tpd.plot.drawing import plot_scene
    from tpd.plot.many import plot_conditions, plot_front, plot_landscape
    from tpd.plot.style import png

    if design.conditions.along is not None:
        yield "conditions.png", png(plot_conditions(design)[0].figure)
    if len(design.screened):
        yield "search.png", png(plot_landscape(design).figure)
    if front is not None:
        yield "front.png", png(plot_front(front, design).figure)
    if design.winner is not None and design.status is OverStatus.found:
        stroke = float(np.nanmax(design.winner.told.stroke))
        yield "drawing.png", png(plot_scene(design.scene, design.pendulum, stroke=stroke).figure)
        yield "animation.gif", animate(design.scene, design.pendulum)
