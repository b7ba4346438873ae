"""Content of a report as typed data: what was found, how far it can be relied upon, and how to repeat it.

Nothing is solved here: all numbers come from the design and its study. One condition is a special case of
many.
"""

from __future__ import annotations

import math
import shlex
from collections import Counter
from pathlib import Path

import numpy as np

from tpd.core import files
from tpd.core.formatting import number
from tpd.design.objective import KINDS
from tpd.design.result import HarmonicDesign, SearchStatus
from tpd.design.study import Study
from tpd.design.verified import Bare, Verified
from tpd.report import benefit, earthquakes, pictures, scene_words, tables, words
from tpd.report.blocks import (
    Block,
    Cell,
    Code,
    Figure,
    Listing,
    Report,
    Section,
    Table,
    information,
    warning,
)
from tpd.report.notes import notes

_ROWS = 40
"""Most conditions in a table, evenly over all of them."""


def content(
    design: HarmonicDesign,
    study: Study,
    job_toml: str = "",
    directory: Path | None = None,
    name: str = "",
    date: str = "",
) -> Report:
    """Build the report of a design.

    Args:
        design: the answer of `optimise`.
        study: everything else that is shown, from `tpd.design.study.study`.
        job_toml: the job file that repeats the run; left out if empty.
        directory: where the report lies, for the command that repeats the run.
        name: of the project, for the title.
        date: of the report, for the title.
    """
    parts = {
        "Scene": scene_words.section(design.scene, name, date),
        "Before anything else": notes(design, study),
        "The answer": _answer(design, study),
        "With and without": [*_figures(design, study, "benefit.svg"), *benefit.paired_runs(design)],
        "Other losses of energy": benefit.losses(design),
        "What limits the design": benefit.limiting(design, study),
        "The block and its motion": _figures(design, study, "drawing.svg", "animation.gif"),
        "Over many runs": tables.ensemble(design),
        "In earthquakes": earthquakes.section(study.earthquakes),
        "Under every condition": _conditions(design, study),
        "Over frequency": _figures(design, study, "response.svg"),
        "Over time": _figures(design, study, "motion.svg"),
        "Where it was searched": _search(design, study),
        "By several models": _models(design, study),
        "Designs refused": _refused(design),
        "Sensitivity": tables.sensitivity(design, study),
        "Assumptions": _assumptions(design),
        "How to repeat it": _repeat(design, study, job_toml, directory),
    }
    always = "Before anything else"
    sections = (Section(t, tuple(blocks)) for t, blocks in parts.items() if blocks or t == always)
    return Report(scene_words.title(design.scene, name, date), benefit.verdict(design), tuple(sections))


_LIMITED = {
    "relative_stroke": "relative stroke",
    "tilt": "tilt",
    "multiplier": "multiplier",
    "offset": "offset (bob from the axis)",
    "room": "room (bob to the wall)",
    "thickness": "thickness (bob within half the rod)",
    "worsening": "worsening (against the bare tilt)",
}
"""Limits whose use a report shows; the stroke has a row of its own, and a reserve has no share."""


def _figures(design: HarmonicDesign, study: Study, *names: str) -> list[Block]:
    """Figures of the pictures there are."""
    there = pictures.names(design, study)
    return [Figure(n, *pictures.CAPTIONS[n], narrow=len(names) > 1) for n in names if n in there]


def _answer(design: HarmonicDesign, study: Study) -> list[Block]:
    hung, winner = design.pendulum, design.winner
    if hung is None or winner is None:
        return _no_answer(design)
    hinge = number(hung.hinge_damping(design.scene.gravity))
    rows: list[tuple[Cell, ...]] = [
        ("mass of the bob", f"{number(hung.mass)} kg", f"μ = {number(winner.mass_ratio, 5)}"),
        ("length of the pendulum", f"{number(hung.length)} m", f"λ = {number(winner.length_ratio, 5)}"),
        words.rod(hung, words.bob_of(design.limits), design.scene.gravity),
        ("damping of the hinge", f"{hinge} N m s/rad", f"ζ = {number(hung.damping_ratio)} of critical"),
        *_sizes(design, winner, hung.length),
        *((f"limit on {_LIMITED[n]}", f"{x:.1%} used", None) for n, x in study.usage if n in _LIMITED),
        ("losses of the block", words.losses(design.scene.block), None),
    ]
    caption = (
        "Angles are from the vertical. Toppling: the tilt at which the block falls by itself, nu (1 + mu)/(1 "
        "+ 2 mu). Rocking amplitudes are those of the exact solution from rest."
    )
    held = "; ".join(map(str, winner.active)) or "nothing"
    left = f"Decrease left, to first order: {winner.stationarity:.2g} per unit of a scaled step."
    return [Table(("", "value", "relative"), tuple(rows), caption), information(f"Held by: {held}. {left}")]


def _sizes(design: HarmonicDesign, winner: Verified, length: float) -> list[tuple[Cell, ...]]:
    """Rows of angles: risk over several conditions, amplitudes, strokes and the way from rest."""
    exact, limit = winner.exact, design.stroke_limit
    stroke = design.swing
    way = number(length * math.sin(min(stroke, 0.5 * math.pi)))
    used = f"{stroke / limit:.0%} of the limit" if limit < np.inf else None
    name = f"{design.risk.name} tilt"
    rows: list[tuple[Cell, ...]] = []
    if len(design.conditions) > 1:
        rows = [
            (f"{name} with it", words.risk(design, winner.value), None),
            (f"{name} without a pendulum", words.risk(design, design.bare.value), None),
        ]
    rows += [
        ("rocking amplitude with it", *words.of_toppling(design, design.amplitude, winner.mass_ratio)),
        ("rocking amplitude without", *words.of_toppling(design, design.amplitude_without, 0.0)),
        ("stroke of the bob, settled", words.angle(stroke), used),
        ("way of the bob to either side", f"{way} m", "settled, from the vertical"),
    ]
    if np.isfinite(exact.peak).any():
        peak, swing = float(np.nanmax(exact.peak)), float(np.nanmax(exact.peak_stroke))
        rows.append(("largest tilt from rest on", *words.of_toppling(design, peak, winner.mass_ratio)))
        rows.append(("largest bob angle from rest on", words.angle(swing), None))
    return [*rows, ("uplift margin, settled", f"{np.min(winner.margin):.1%}", "of the moment that lifts")]


def _no_answer(design: HarmonicDesign) -> list[Block]:
    known = design.search.end_values[np.isfinite(design.search.end_values)]
    best = [("best that a search ended at", words.risk(design, float(known.min())))] if known.size else []
    rows = (
        ("pendulum", "none to offer"),
        *best,
        ("rocking amplitude without pendulum", words.angle(design.amplitude_without)),
        (f"{design.risk.name} tilt without pendulum", words.risk(design, design.bare.value)),
        ("losses of the block", words.losses(design.scene.block)),
    )
    out: list[Block] = [Table(("", "value"), rows)]
    if design.nearest is not None:
        at = "μ = {:.4g}, λ = {:.4g}, ζ = {:.4g}".format(*design.nearest.design)
        broken = "; ".join(map(str, design.nearest.broken))
        out.append(warning(f"Nearest to the limits comes {at}: {broken}."))
    return out


def _conditions(design: HarmonicDesign, study: Study) -> list[Block]:
    n, best = len(design.conditions), design.best
    if n == 1:
        return []
    rows = []
    for i in map(int, np.unique(np.linspace(0, n - 1, min(n, _ROWS)).astype(int))):
        cells = [design.conditions.label(i), *_motion(design, design.bare, i)]
        if best is not None:
            cells += [*_motion(design, best, i), float(best.evaluation.stroke[0, i])]
        rows.append(tuple(cells))
    head = ("condition", "bare tilt (rad)", "bare kind", "bare from rest")
    head += () if best is None else ("tilt (rad)", "kind", "from rest", "stroke (rad)")
    source = words.source_of_tilts(design)
    caption = f"Tilt, stroke and kind: of {source}. From rest: end of the motion followed by events."
    shown = " The design shown is the best found, which is not offered." if best and not design.winner else ""
    described = information("; ".join(design.conditions.description) + "." + shown)
    return [described, *_figures(design, study, "conditions.svg"), Table(head, tuple(rows), caption)]


def _motion(design: HarmonicDesign, of: Verified | Bare, i: int) -> tuple[Cell, ...]:
    """Tilt (rad) and kind of motion under a condition, and end from rest."""
    e, nu = of.evaluation, design.scene.block.slenderness * design.conditions.column("slenderness")[i]
    tilt, kind = float(e.tilt[0, i] * nu), KINDS[int(e.kind[0, i])].replace("_", " ")
    return tilt if math.isfinite(tilt) else None, kind, str(of.exact.status[i]).replace("_", " ")


def _search(design: HarmonicDesign, study: Study) -> list[Block]:
    search = design.search
    counts = Counter(s.value for s in search.statuses)
    ends = "; ".join(f"{n} {what}" for what, n in counts.items())
    said = f"{search.evaluations} designs"
    said += f", from {search.description}, seed {design.seed}"
    out: list[Block] = [information(f"Method {design.method.name}: {said}. Searches: {ends or 'none'}.")]
    out += _confirmed(design)
    out += _figures(design, study, "search.png")
    if study.front:
        out += [*_figures(design, study, "front.svg"), tables.front(study.front)]
    return out


def _confirmed(design: HarmonicDesign) -> list[Block]:
    """How the ends of descents on a model compare with the exact solution."""
    mismatch, lost = design.search.mismatch, int(np.sum(design.search.lost))
    if not np.any(mismatch):
        return []
    told = zip(mismatch[:, 0], design.search.statuses, strict=False)
    good = [np.isfinite(x) and status is not SearchStatus.contradicted for x, status in told]
    tilt, slope = (float(x) for x in np.max(mismatch[: len(good)][good], axis=0, initial=0.0))
    said = (
        f"The exact solution confirms {sum(good)} of {len(mismatch)} ends: their tilts differ from "
        f"those of the smoothed signs by at most {tilt:.1e} and the slopes of these by at most {slope:.1e}, "
        f"relative. An end that it contradicts is not offered. Orbits lost on the way: {lost}."
    )
    return [information(said)]


def _models(design: HarmonicDesign, study: Study) -> list[Block]:
    rest = None if design.best is None else design.best.rest
    out: list[Block] = [] if rest is None else [information(rest.told)]
    return out if study.comparison is None else [*out, *tables.comparison(study.comparison)]


def _refused(design: HarmonicDesign) -> list[Block]:
    rows = tuple(
        (v.source, v.mass_ratio, v.length_ratio, v.damping_ratio, v.value, "; ".join(map(str, v.reasons)))
        for v in design.verified
        if v.reasons
    )
    caption = "Value: the risk, a tilt over nu where the block rocks. A refused design is not offered."
    return [Table(("from", "μ", "λ", "ζ", "value", "reasons"), rows, caption)] if rows else []


def _assumptions(design: HarmonicDesign) -> list[Block]:
    scene, own = design.scene, design.scene.block.radius_of_gyration
    inertia = "uniform rectangle" if own is None else f"radius of gyration {number(own)} m about the centroid"
    more = "" if len(design.conditions) == 1 else ", before the conditions change it"
    items = (
        f"A rigid block ({inertia}) that rocks about its two lower edges: it neither slides nor bounces.",
        f"Energy losses: {words.losses(scene.block)} (friction as a moment over M g b, e the ratio of the "
        "tilting rates after and before an impact on the base).",
        "A point bob on a massless rod from the middle of the top, with a viscous hinge.",
        f"A harmonic motion of the base, {number(scene.motion.amplitude)} m · sin(2π · "
        f"{number(scene.motion.frequency)} Hz · t){more}, horizontal and in the plane; g = "
        f"{number(scene.gravity)} m/s².",
        "A start at rest at t = 0, where the motion begins suddenly, unless a section says otherwise.",
        "Linear equations (25) of Collini et al. (2016), misprints corrected, solved exactly; nonlinear "
        "equations (4) in the survey from rest, the refinement and the verification.",
        "Limits: " + ("; ".join(map(words.limit, design.limits)) or "none") + ".",
    )
    return [Listing(items)]


def _repeat(design: HarmonicDesign, study: Study, job_toml: str, directory: Path | None) -> list[Block]:
    made = ", ".join(f"{name} {v}" for name, v in files.versions().items())
    out: list[Block] = []
    if directory is not None:
        again = directory.with_name(directory.name + "-again")
        more = " --pareto" if study.front else ""
        if study.earthquakes is not None:
            more += " --records " + shlex.join(study.earthquakes.sources)
        scene, to = shlex.quote(str(directory / "scene.toml")), shlex.quote(str(again))
        out.append(Code(f"tpd optimise --scene {scene} --out {to}{more}"))
    if job_toml:
        out.append(information(f"Seed {design.seed}. The file scene.toml beside this page holds:"))
        out.append(Code(job_toml))
    return [*out, information(f"Made with {made}. The file design.json holds all results in full.")]
