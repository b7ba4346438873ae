"""Content of a report as typed data: result, reliability, construction, and how to repeat the search.

Nothing is solved in this module. All numbers come from the design and from `tpd.details`.
"""

from __future__ import annotations

import math
import shlex
from collections.abc import Mapping
from pathlib import Path
from typing import Any

from msgspec.structs import replace

from tpd.core import files
from tpd.core.formatting import number
from tpd.design.as_built import Details
from tpd.design.design import Design
from tpd.report import construction, sections, words
from tpd.report.blocks import MOST, Block, Cell, Code, Figure, Report, Section, Severity, Table, Text
from tpd.report.summary import repeat, rows_of, summary
from tpd.scene.conditions import MEASURED

_SOURCE = (
    ". The scatter of e comes from the first impacts in 134 free-rocking trials of limestone blocks "
    "(Colombo and others, 2026, DOI 10.60756/uminho-jh25, CC BY 4.0). For other blocks it is an indication"
)
# The codes tell the designer which verifications the report does not replace. Their parts differ between
# countries and editions, so only the numbers of the codes are given.
_SCOPE: tuple[tuple[Cell, ...], ...] = (
    (
        "basis of design (EN 1990)",
        "share of runs that overturn under the stated excitation",
        "consequence class, required reliability, combinations of actions, partial factors",
    ),
    (
        "earthquake (EN 1998)",
        "only the excitation in the hypotheses, in one horizontal direction",
        "design ground motion of the site, vertical acceleration, importance class",
    ),
    (
        "steel parts (EN 1993)",
        "first sizes of rod, pin, damper and stop against yield",
        "beam of the hinge, plates, bolts, threads, welds; stability; fatigue (EN 1993-1-9)",
    ),
    (
        "block and ground",
        "forces of the pendulum on the top of the block",
        "strength of walls, top and base (EN 1996 for masonry), crushing of the edges, soil (EN 1997)",
    ),
    (
        "second horizontal direction",
        "none: one pendulum reduces rocking in one direction",
        "the second direction needs a second design (universal joint or second pendulum)",
    ),
    (
        "inspection",
        "measurements on site before the first use, in the section Build it",
        "intervals, at least after every uplift: frequency, play and cracks of pin and rod, leaks and "
        "stroke of the damper, stops, edges of the block",
    ),
    ("wind, ageing, temperature", "none", "wind load, corrosion, damping at low and high temperature"),
)
"""Subjects of a verification, with what the report contains and what it leaves to the designer."""
CONDITIONS = "Conditions, limits and friction"
"""Title of the section with the rows that the answer leaves out."""
_CAPTIONS = {
    "drawing.svg": (
        "The block on its base and its pendulum, to scale, with dimensions",
        "Left: block and base, to scale; + is the centroid. Right: the pendulum as built, on a larger scale. "
        "Dashed: the bob at the ends of its swing. The rod has another length in the equations, where bob "
        "and rod are a point mass.",
    ),
    "animation.gif": (
        "Animation of the block as seen from its base, without and with the pendulum",
        "Motion from rest under the scene's own excitation, by the linear model, as seen from the base: the "
        "seconds around the last overturning, or the first seconds if the block overturns in neither case.",
    ),
    "benefit.svg": (
        "Share of the runs that overturn with the pendulum (filled) and without it (open), of all runs and "
        "for each start or level",
        "Validation runs. The further a dot lies to the left of its square, the larger the benefit. Above "
        "the line: all runs; the wide bar is the 95 % interval of the difference. Below: starts or levels, "
        "thin bars are 95 % intervals. At a tilt of 1 the block topples; overturned runs count as 1.",
    ),
    "response.svg": (
        "Settled amplitude against frequency, and share of runs that overturn, without and with the pendulum",
        "Top: settled motion from rest, by the linear model. Triangles and crosses: the block "
        "overturns. Bottom: share of the runs from rest within 5 % of each frequency that overturn, with "
        "its 95 % interval. Whether a single run overturns is often chance. Dotted: frequency of the scene.",
    ),
    "motion.svg": (
        "Tilt of the block without and with the pendulum, and angle of the rod, against time from rest",
        "Motion from rest under the scene's own excitation, by the linear model, without the pendulum "
        "(grey) and with it (blue). The block was followed over 100 periods. The picture ends after 24 of "
        "them, or after the last overturning. The stroke limit (dotted) applies to the settled motion only.",
    ),
    "search.png": (
        "Tilt over mass ratio and length ratio as a shaded field, with the edges of the limits and the "
        "design",
        "Mean tilt of the trial runs, smoothed over all designs, at the damping ratio of the best design "
        "(star). Dark means a large tilt. Hatched: a limit is exceeded; its name stands at the edge. Lines: "
        "paths of the descents.",
    ),
}
"""Alternative text and caption of every picture, by the name of its file."""


def content(
    design: Design, details: Details, directory: Path | None = None, date: str = "", lines: int = MOST
) -> Report:
    """Build the report of a design.

    Args:
        design: the answer of `optimise`.
        details: further results that the report shows, from `tpd.details`.
        directory: folder of the report, for the commands that need its job.
        date: date of the report, for the title.
        lines: largest number of lines of the summary on the terminal.
    """
    # A picture whose data is missing has no figure, so the report does not refer to it.
    job = design.problem.job
    project: Mapping[str, Any] = job.full["project"] if job else {}
    name, folder = project.get("name") or "", directory if job else None
    first, drawn = summary(design, details, folder), figures(design, details)
    width, height = (number(x) for x in (design.scene.block.width, design.scene.block.height))
    size = f" for a block of {width} m × {height} m{', ' * bool(date)}{date}"

    def picture(file: str) -> list[Block]:
        # A picture whose data is missing has no figure, so the report does not refer to it.
        return [drawn[file]] if file in drawn else []

    # The sections follow the questions of an engineer: what the result depends on, what to watch, what to
    # build, why to believe it, where it stops to hold. How it was computed is in appendices.
    parts: dict[str, list[Block]] = {
        "Build it": construction.section(design, details),
        CONDITIONS: [Table(("", ""), tuple(rows_of(design, details)))],
        "Notes": [n for n in first.notes if n.severity is not Severity.danger],
        "Hypotheses": [_hypotheses(design)],
        "Document and scope": _scope(project, date),
        **sections.sections(design, details, picture),
        "Appendix: how to repeat the search": _repeat(design, folder),
    }
    return Report(
        title=f"{name}: pendulum{size}" if name else f"Pendulum{size}",
        summary=first,
        figures=tuple(drawn[name] for name in ("benefit.svg", "drawing.svg") if name in drawn),
        sections=tuple(Section(t, tuple(b)) for t, b in parts.items() if b),
        lines=lines,
    )


def figures(design: Design, details: Details) -> dict[str, Figure]:
    """Return the figures by the names of their files, for all pictures that the results have data for."""
    # A picture without data would be empty axes.
    has_data = {
        "benefit.svg": design.runs is not None,
        "search.png": design.trials is not None
        and (design.trials.risk is not None or (design.search is not None and len(design.space.names) > 1)),
        "response.svg": bool(details.responses),
        "motion.svg": bool(details.histories),
        "drawing.svg": True,
        "animation.gif": bool(details.histories),
    }
    all_figures = {name: Figure(name, *_CAPTIONS[name]) for name, exists in has_data.items() if exists}
    # The caption of the drawing must not name parts that it does not show.
    if design.pendulum is None:
        all_figures["drawing.svg"] = replace(
            all_figures["drawing.svg"], caption="Block and base, to scale; + is the centroid."
        )
    return all_figures


def _hypotheses(design: Design) -> Table:
    """Return the table of the hypotheses that the result depends on."""
    scene, problem, gyration = design.scene, design.problem, design.scene.block.radius_of_gyration
    block = scene.block
    radius = f"radius of gyration {number(gyration or 0.0)} m about the centroid"
    diagonal = number(0.5 * math.hypot(float(block.base_width), 2.0 * float(block.centroid)))
    height = problem.space.hinge_height
    hinge = "in the middle of the top"
    if height is not None:
        hinge = f"on the axis of the block, {number(height)} m above the base"
    # Only the default scatter of Housner's e has a source.
    is_measured = problem.scatter.get("restitution") == MEASURED
    rows: list[tuple[Cell, ...]] = [
        ("block", f"rigid; {'uniform rectangle' if gyration is None else radius}"),
        ("b, height of the centroid", f"{number(block.centroid)} m, on the middle line"),
        ("R, distance of the centroid from the lower edges", f"{diagonal} m"),
        ("α, toppling angle", words.toppling(block)),
        ("p = ω₀ = √(g ρ/b)", f"{number(scene.rate)} rad/s, frequency parameter of the block"),
        (
            "energy loss",
            f"{words.losses(block)} (e: coefficient of restitution; k: moment of friction over M g b)",
        ),
        # A block that slides or bounces has other motions than those of the equations.
        (
            "ground",
            "rigid and level; the block rocks about its two lower edges and neither slides nor bounces",
        ),
        # A pendulum on a pin does nothing in the other horizontal direction.
        ("direction", "one vertical plane, in which block, pendulum and excitation move"),
        ("pendulum", f"point mass on a massless rod, with a viscous damper at the hinge {hinge}"),
        ("excitation", problem.words.assumed),
        ("starts", problem.words.starts),
        ("duration", problem.words.duration),
        # Many sentences of the report count runs by their outcome, which is defined here only.
        ("overturned", "the tilt passes the toppling angle, and the block cannot return"),
        ("surviving runs", "runs in which the block does not overturn"),
        (
            "models",
            "search: linear equations (25) of Collini et al. (2016) without their misprints, solved from "
            "event to event (descents under harmonic excitation: with smoothed friction and impacts); "
            "validation: nonlinear equations (4)",
        ),
        (
            "scatter",
            f"{problem.scatter_in_words()}; ranges are uniform, with the same values with and without the "
            f"pendulum{_SOURCE if is_measured else ''}",
        ),
    ]
    return Table(("hypothesis", "value"), tuple(rows), "The result holds for these hypotheses only.")


def _scope(project: Mapping[str, Any], date: str) -> list[Block]:
    """Return the table of who made and checked the report, and the table of the checks that remain."""
    names = {"name": "project", "author": "author", "checker": "checked by", "revision": "revision"}
    names |= {"source": "source of the excitation", "return_period": "its return period"}
    # A line without a value is left blank, and can be filled in on the printed page.
    about = [(label, project.get(key) or "") for key, label in names.items()]
    head = "subject", "in this report", "left to the designer"
    return [
        Table(("document", ""), (*about, ("date", date), ("signatures", ""))),
        Table(head, _SCOPE, "The report is not a verification by a code."),
    ]


def _repeat(design: Design, directory: Path | None) -> list[Block]:
    """Return the command and the job file that repeat the search, and the versions of the packages."""
    out: list[Block] = []
    if directory is not None:
        out += [
            Code(repeat(directory)),
            Text("This command writes explore.html, an interactive page of this design, beside this page:"),
            Code(f"tpd explore {shlex.quote(str(directory))}"),
        ]
    if job := design.problem.job:
        out += [Text("The file scene.toml in the folder of this report contains:"), Code(job.toml)]
    versions = ", ".join(f"{name} {v}" for name, v in files.versions().items())
    return [
        *out,
        Text(f"Seed {design.seed}. Made with {versions}. The file design.json contains all results."),
    ]
