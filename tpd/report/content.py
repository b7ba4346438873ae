"""Content of a report as typed data, for designs of both kinds: what was found, how far to rely on it, how to
repeat it.

Nothing is solved here: all numbers come from the design and its study.
"""

from __future__ import annotations

import math
import shlex
from collections.abc import Sequence
from pathlib import Path

from tpd.core import files
from tpd.core.formatting import number
from tpd.design.build import FrontPoint
from tpd.design.ground.design import GroundDesign
from tpd.design.ground.judgement import scatter_of
from tpd.design.result import Design, HarmonicDesign
from tpd.design.study import Study
from tpd.report import answer, construction, sections, words
from tpd.report.blocks import Block, Cell, Code, Figure, Listing, Report, Section, Severity, Table, Text
from tpd.report.notes import notes

_INTENSITIES = {
    "pga_star": "PGA/(g tan α)",
    "pgv_star": "p PGV/(g tan α)",
    "pga": "PGA, m/s²",
    "pgv": "PGV, m/s",
    "scale": "factor on each motion",
}
CAPTIONS = {
    "drawing.svg": (
        "The block on its base and its pendulum, to scale, with dimensions",
        "To scale; the pendulum to a larger scale as it is to be built. Dashed: the bob at the ends of its "
        "swing. The rod differs from the length in the equations by the size of the bob and the mass of the"
        " rod.",
    ),
    "animation.gif": (
        "Animation of the block on its moving base, without the pendulum and with it",
        "First seconds from rest under the scene's own shaking, by the linear equations.",
    ),
    "benefit.svg": (
        "Mean tilt with the pendulum (filled) and without (open), over all runs and under each condition",
        "Paired runs of the nonlinear equations: the further a dot lies to the left of its square, the "
        "better. Above the line: over all runs, the bar a 95 % interval of the difference. A tilt of 1 is "
        "the slenderness, where the block topples; overturned runs count as 1.",
    ),
    "response.svg": (
        "Settled amplitude over frequency, and share of runs that overturn, bare (open) and hung (filled)",
        "Above: the motion that the block settles into from rest, by the linear equations; triangles and "
        "crosses: it overturns. Below: share that overturns of the runs from rest near each frequency, with"
        " its 95 % interval: next to overturning a single run is chance. Dotted: the frequency of the "
        "scene.",
    ),
    "motion.svg": (
        "Tilt of the block without and with the pendulum, and angle of the rod, against time from rest",
        "First periods from rest under the scene's own shaking, by the linear equations: grey without the "
        "pendulum, blue with it. A block that stands here may overturn later. A limit on the stroke "
        "(dotted) holds for the settled motion only.",
    ),
    "search.png": (
        "Tilt over mass ratio and length ratio as a shaded field, with edges of the limits and the answer",
        "The darker, the more the block tilts: the trend through the designs that the search followed from "
        "rest by the linear equations, at the damping of the answer (the star). Hatched: a limit is broken;"
        " each edge bears the name of its limit. Lines: ways of the descents.",
    ),
    "conditions.svg": (
        "Tilt and bob angle over the quantity that the conditions differ in, with and without a pendulum",
        "Lines: largest steady tilt of the motions that count. Near the top: the block overturns from rest.",
    ),
    "front.svg": (
        "Fall of the mean tilt against the mass of the bob",
        "The gain of each kilogramme: answers whose bob may be no heavier than a bound, over its own mass.",
    ),
    "groups.svg": (
        "Share of motions that overturn the block over their intensity, without and with the pendulum",
        "Marks: shares of the motions of each group by the nonlinear equations; curves: lognormal fits with"
        " bands of 95 %. The title says the difference over all stripes, with its interval.",
    ),
}
"""Alternative text of every picture, and a caption that says what to see."""
_PRINTED = ("Notes", "Build it", "Over the runs", "Other losses of energy", "Assumptions", "How to repeat it")
"""Sections that are printed: with the first screen some four pages."""


def content(
    design: Design,
    study: Study,
    job_toml: str = "",
    directory: Path | None = None,
    name: str = "",
    date: str = "",
    said: Sequence[str] = (),
) -> Report:
    """Build the report of a design.

    Args:
        design: the answer of `optimise`.
        study: everything else that is shown, from `tpd.design.study.study`.
        job_toml: the job file that repeats the run; left out if empty.
        directory: where the report lies, for the command that repeats the run.
        name: of the project, for the title.
        date: of the report, for the title.
        said: notes of the reader on the files of the records.
    """
    found = notes(design, study)
    drawn = names(design, study)
    # By the stem of their names; empty lists where there is none.
    there = {n.partition(".")[0]: [Figure(n, *said)] if n in drawn else [] for n, said in CAPTIONS.items()}
    parts: dict[str, list[Block]] = {
        "Notes": [n for n in found if n.severity is not Severity.danger],
        "Build it": construction.section(design, study.build),
    }
    if isinstance(design, HarmonicDesign):
        parts |= sections.harmonic(design, study, there)
    elif isinstance(design, GroundDesign):
        parts |= sections.ground(design, there, said)
    front: list[Block] = [*there["front"], _front(study.front)] if study.front else []
    parts |= {
        "What a kilogramme pays": front,
        "Assumptions": [Listing(tuple(_assumptions(design)))],
        "How to repeat it": _repeat(design, job_toml, directory),
    }
    told = design.comparison
    rows = (*(("project", name) for _ in range(bool(name))), *answer.pairs(design, study))
    return Report(
        title=words.title(design.scene, name, date),
        verdict=answer.verdict(design),
        dangers=tuple(n for n in found if n.severity is Severity.danger),
        answer=Table(("", ""), tuple(rows)),
        comparison=None if told is None else answer.comparison(told),
        figures=(*there["drawing"], *there["animation"]),
        sections=tuple(Section(t, tuple(b), t in _PRINTED) for t, b in parts.items() if b),
    )


def names(design: Design, study: Study) -> tuple[str, ...]:
    """Names of the pictures that there is data for."""
    there = {}
    if isinstance(design, GroundDesign):
        there |= {"groups.svg": bool(design.judged), "search.png": design.searched is not None}
    elif isinstance(design, HarmonicDesign):
        there |= {
            "benefit.svg": design.best is not None and design.best.benefit is not None,
            "conditions.svg": len(design.conditions) > 1 and design.conditions.axis is not None,
            "search.png": len(design.search.screened) > 0,
            "response.svg": bool(study.responses),
            "motion.svg": bool(study.histories),
        }
    there |= {"front.svg": bool(study.front), "drawing.svg": True, "animation.gif": bool(study.histories)}
    return tuple(name for name, exists in there.items() if exists)


def _front(points: Sequence[FrontPoint]) -> Table:
    """The answer for every largest mass of the bob."""
    rows: list[tuple[Cell, ...]] = []
    for p in points:
        if p.pendulum is None:
            rows.append((f"{number(p.most)} kg", p.status.replace("_", " "), None))
            continue
        hung = f"{number(p.pendulum.mass)} kg on {number(p.pendulum.length)} m, ζ = "
        saved, low, high = p.saved
        fall = None if math.isnan(saved) else f"{saved:.0%} ({low:.0%} to {high:.0%})"
        rows.append((f"{number(p.most)} kg", f"{hung}{number(float(p.pendulum.damping_ratio))}", fall))
    caption = "Every row is an answer of its own, verified by the same runs; the last is the design itself."
    return Table(("bob at most", "answer", "less tilt (95 %)"), tuple(rows), caption)


def _assumptions(design: Design) -> list[str]:
    scene, own = design.scene, design.scene.block.radius_of_gyration
    inertia = "uniform rectangle" if own is None else f"radius of gyration {number(own)} m about the centroid"
    said = [
        f"A rigid block ({inertia}) that rocks about its two lower edges: it neither slides nor bounces.",
        f"Energy losses: {words.losses(scene.block)} (friction as a moment over M g b, e the ratio of the "
        "tilting rates after and before an impact on the base).",
        "A point bob on a massless rod from the middle of the top, with a viscous hinge.",
    ]
    limits = "; ".join(map(words.limit, design.limits)) or "none"
    if design.conditions.motions:
        scatter = ", ".join(f"{n} ±{w:.0%}" for n, w in scatter_of(scene.block, design.ensemble).items())
        return [
            *said,
            f"{'; '.join(design.conditions.description)} ({_INTENSITIES[design.conditions.intensity]}).",
            f"From rest. Judged with scatter of {scatter or 'nothing'}, each uniform, the same with the "
            "pendulum and without.",
            "Search by the linear equations, exact between the samples; verdict by the nonlinear equations.",
            f"Limits, for all but {design.worth.broken:.0%} of the standing runs: {limits}.",
        ]
    more = "" if len(design.conditions) == 1 else ", before the conditions change it"
    return [
        *said,
        f"A harmonic motion of the base, {number(scene.motion.amplitude)} m · sin(2π · "
        f"{number(scene.motion.frequency)} Hz · t){more}, horizontal and in the plane; g = "
        f"{number(scene.gravity)} m/s².",
        "A start at rest at t = 0, where the motion begins suddenly, unless a section says otherwise.",
        "Linear equations (25) of Collini et al. (2016), misprints corrected, solved exactly; nonlinear "
        "equations (4) in the survey from rest, the refinement and the verification.",
        f"Limits: {limits}.",
    ]


def _repeat(design: Design, job_toml: str, directory: Path | None) -> list[Block]:
    out: list[Block] = []
    if directory is not None:
        scene, to = shlex.quote(str(directory / "scene.toml")), shlex.quote(f"{directory}-again")
        out.append(Code(f"tpd optimise --scene {scene} --out {to}"))
    if job_toml:
        out += [Text("The file scene.toml beside this page holds:"), Code(job_toml)]
    made = ", ".join(f"{name} {v}" for name, v in files.versions().items())
    return [*out, Text(f"Seed {design.seed}. Made with {made}. The file design.json holds all results.")]
