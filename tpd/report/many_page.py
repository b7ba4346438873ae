"""The page of a design over many conditions, warnings first."""

from __future__ import annotations

import shlex
from dataclasses import dataclass
from pathlib import Path

import numpy as np

from tpd.analysis.compare_models import Check
from tpd.core import files
from tpd.core.formatting import number
from tpd.design.job import Job, dump
from tpd.design.many_result import DesignOver, Judged
from tpd.design.pareto import Front
from tpd.report import many as report
from tpd.report.html import Section, beside, code, figure, listing, page, paragraph, table
from tpd.report.notes import losses
from tpd.report.single_page import ensemble_section, ladder_table

_ROWS = 40
"""Most conditions in the table, evenly over all of them."""
_CAPTIONS = {
    "conditions.png": (
        "Tilt and bob angle over what the conditions differ in, with the pendulum and without",
        "Lines: largest steady tilt of the motions that count. Crosses: from rest the block overturns.",
    ),
    "search.png": (
        "Mass ratio against length ratio: designs screened, search paths and the answer",
        "Designs screened, the paths of the last searches and their ends.",
    ),
    "front.png": (
        "Least tilt against the mass of the bob",
        "What each kilogramme buys: the least tilt of all designs that are no heavier.",
    ),
}


@dataclass(frozen=True)
class Shown:
    """All that the page is made of."""

    design: DesignOver
    job: Job
    front: Front | None
    pictures: dict[str, bytes]
    """By their file names; one that is missing is left out."""
    ladder: Check | None
    directory: Path


def over_page(shown: Shown) -> str:
    """The page, complete and by itself."""
    design, winner = shown.design, shown.design.winner
    sections = [
        _warnings(design),
        _answer(design),
        _shape(shown),
        None if winner is None or winner.verdict is None else ensemble_section(winner.verdict),
        None if winner is None else _conditions(shown, winner),
        None if winner is None else _models(shown, winner),
        _search(shown),
        _refused(design),
        None if winner is None else _sensitive(design),
        _assumed(shown),
        _repeat(shown),
    ]
    block = design.scene.block
    title = f"Pendulum for a block of {number(block.width)} m × {number(block.height)} m"
    return page(title, [s for s in sections if s is not None])


def _warnings(design: DesignOver) -> Section:
    said = report.notes(design)
    dangers = [n for n in said if n.startswith("DANGER")]
    others = [n[0].upper() + n[1:] for n in said if not n.startswith("DANGER")]
    parts = [
        paragraph(design.status.value, "verdict" if report.is_sound(design) else "danger"),
        *(paragraph(d, "danger") for d in dangers),
    ]
    return Section("Before anything else", "\n".join([*parts, listing(others)]))


def _answer(design: DesignOver) -> Section:
    what = design.measure.name
    bare = (f"{what} tilt without a pendulum", report.worth(design, design.bare_value), None)
    pendulum, winner = design.pendulum, design.winner
    if pendulum is None or winner is None:
        return Section("The answer", table(("", "value"), [("pendulum", "none to offer"), bare[:2]]))
    hinge = pendulum.hinge_damping(design.scene.gravity)
    stroke = float(np.nanmax(winner.told.stroke))
    rows = [
        ("mass of the bob", f"{number(pendulum.mass)} kg", f"μ = {number(winner.mass_ratio)}"),
        ("length of the pendulum", f"{number(pendulum.length)} m", f"λ = {number(winner.length_ratio)}"),
        ("damping of the hinge", f"{number(hinge)} N m s/rad", f"ζ = {number(pendulum.damping_ratio)}"),
        (f"{what} tilt with it", report.worth(design, winner.value), None),
        bare,
        (
            "largest stroke of the bob",
            f"{number(stroke)} rad",
            f"{stroke / design.space.stroke:.0%} of the limit",
        ),
        (
            "bob's way to either side",
            f"{number(stroke * pendulum.length)} m",
            "settled, relative to the pivot",
        ),
    ]
    words = paragraph("Held by: " + ("; ".join(winner.active) or "nothing") + ".")
    return Section("The answer", table(("", "value", "relative"), rows) + "\n" + words)


def _shape(shown: Shown) -> Section:
    parts = []
    if "drawing.png" in shown.pictures:
        alt = "Block and pendulum to scale, with their dimensions"
        parts.append(figure(shown.pictures["drawing.png"], alt=alt, caption="To scale, dimensions in SI."))
    if "animation.gif" in shown.pictures:
        alt = "The block from rest under the scene's own shaking, without and with the pendulum"
        caption = "The scene's own shaking, from rest, without (left) and with the pendulum (right)."
        parts.append(figure(shown.pictures["animation.gif"], alt=alt, caption=caption))
    return Section("What it looks like", beside(*parts))


def _picture(shown: Shown, name: str) -> str:
    alt, caption = _CAPTIONS[name]
    return figure(shown.pictures[name], alt=alt, caption=caption) if name in shown.pictures else ""


def _conditions(shown: Shown, winner: Judged) -> Section:
    design, n = shown.design, len(shown.design.conditions)
    nu = design.scene.block.slenderness * design.conditions.column("slenderness")
    rows = []
    for i in np.unique(np.linspace(0, n - 1, min(n, _ROWS)).astype(int)):
        tilts = (float(t.tilt[0, i] * nu[i]) for t in (winner.told, design.bare))
        kinds = [report.kind_of(t, int(i)) for t in (winner.told, design.bare)]
        with_, without = (x if np.isfinite(x) else None for x in tilts)
        reached = (str(winner.reached[i]), str(design.bare_reached[i]))
        name = design.conditions.name(int(i)).removeprefix("at ")
        rows.append(
            (
                name,
                with_,
                float(winner.told.stroke[0, i]),
                kinds[0],
                reached[0],
                without,
                kinds[1],
                reached[1],
            )
        )
    head = (
        "condition",
        "tilt (rad)",
        "stroke (rad)",
        "kind",
        "from rest",
        "tilt without",
        "kind",
        "from rest",
    )
    whose = "attracting symmetric motion" if design.reached is None else "motion that the starts reach"
    caption = f"Tilt and kind: of the largest {whose}. From rest: what events end in."
    words = paragraph("; ".join(design.conditions.told) + ".")
    return Section(
        "Under every condition",
        words + _picture(shown, "conditions.png") + table(head, rows, caption=caption),
    )


def _models(shown: Shown, winner: Judged) -> Section:
    name = shown.design.conditions.name
    rows = [(name(i).removeprefix("at "), a, s, status) for i, a, s, status in winner.nonlinear]
    parts = [
        table(
            ("worst conditions", "tilt (rad)", "stroke (rad)", "ends"),
            rows,
            caption="By the nonlinear equations (4), from rest.",
        )
    ]
    if shown.ladder is not None:
        told = "Under the scene's own shaking: "
        parts += [ladder_table(shown.ladder), *(paragraph(told + x + ".") for x in shown.ladder.objections)]
    return Section("What the models say", "\n".join(parts))


def _search(shown: Shown) -> Section:
    design = shown.design
    counts = {s: design.starts.count(s) for s in dict.fromkeys(design.starts)}
    words = f"{design.evaluations} designs, from {design.searched}: " + "; ".join(
        f"{n} {s.value}" for s, n in counts.items()
    )
    return Section(
        "Where it was looked for",
        paragraph(words + ".") + beside(_picture(shown, "search.png"), _picture(shown, "front.png")),
    )


def _refused(design: DesignOver) -> Section | None:
    rows = [
        (j.mass_ratio, j.length_ratio, j.damping_ratio, "; ".join(j.objections))
        for j in design.judged
        if j.objections
    ]
    return Section("What was refused", table(("μ", "λ", "ζ", "why"), rows)) if rows else None


def _sensitive(design: DesignOver) -> Section:
    order = sorted(design.elasticities, key=lambda name: -abs(design.elasticities[name]))
    rows = [(name, f"{design.elasticities[name]:+.2f}") for name in order]
    caption = (
        f"Per cent of the {design.measure.name} tilt for one per cent more of each, the others as they are."
    )
    return Section("What it is sensitive to", table(("", "% for 1 %"), rows, caption=caption))


def _assumed(shown: Shown) -> Section:
    scene, limits = shown.design.scene, shown.design.limits.told()
    said = [
        "A rigid block that rocks about its two lower edges: it neither slides nor bounces.",
        f"What takes its energy: {losses(scene.block)}.",
        "A point bob on a massless rod from the middle of the top, with a viscous hinge.",
        f"A harmonic motion of the base, {number(scene.motion.amplitude)} m at "
        f"{number(scene.motion.frequency)} Hz before the conditions change it; g = "
        f"{number(scene.gravity)} m/s².",
        f"Limits: stroke {number(shown.design.space.stroke)} rad"
        + "".join(f", {name.replace('_', ' ')} {number(x)}" for name, x in limits.items())
        + ".",
        "The linear equations (25) of Collini et al. (2016), their misprints corrected; the nonlinear ones "
        "were asked under the worst conditions only.",
    ]
    return Section("What was assumed", listing(said))


def _repeat(shown: Shown) -> Section:
    scene = shown.directory / "scene.toml"
    again = shown.directory.with_name(shown.directory.name + "-again")
    more = " --pareto" if shown.front is not None else ""
    parts = [
        code(f"tpd optimise --scene {shlex.quote(str(scene))} --out {shlex.quote(str(again))}{more}"),
        paragraph(f"Seed {shown.design.seed}. scene.toml, which lies beside this page, holds:"),
        code(dump(shown.job)),
        paragraph("Made with " + ", ".join(f"{name} {v}" for name, v in files.versions().items()) + "."),
    ]
    return Section("How to repeat it", "\n".join(parts))
