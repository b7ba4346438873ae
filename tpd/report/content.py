"""Content of a report as typed data: result, reliability, construction, and how to repeat the search.

Nothing is solved in this module. All numbers come from the design and from `tpd.details`.
"""

from __future__ import annotations

import math
import shlex
from collections.abc import Sequence
from dataclasses import replace
from pathlib import Path

from tpd.core import files
from tpd.core.formatting import interval, number, percent
from tpd.design.as_built import Details
from tpd.design.design import Design, FrontPoint
from tpd.report import construction, sections, words
from tpd.report.blocks import Block, Cell, Code, Figure, Listing, Report, Section, Severity, Table, Text
from tpd.report.summary import repeat, summary
from tpd.scene.conditions import MEASURED

_SOURCE = (
    " The difference from Housner's e is the one of the first impacts in 134 free-rocking trials of "
    "limestone blocks (Colombo and others, 2026, DOI 10.60756/uminho-jh25, CC BY 4.0): an indication."
)
_CAPTIONS = {
    "drawing.svg": (
        "The block on its base and its pendulum, to scale, with dimensions",
        "Left: block and base, to scale. Right: the pendulum as built, on a larger scale. Dashed: the bob "
        "at the ends of its swing. The rod has another length in the equations, where bob and rod are a "
        "point mass.",
    ),
    "animation.gif": (
        "Animation of the block on its moving base, without and with the pendulum",
        "Motion from rest under the scene's own excitation, by the linear equations: the seconds around the "
        "last overturning, or the first seconds if the block overturns in neither case.",
    ),
    "benefit.svg": (
        "Mean tilt with the pendulum (filled) and without it (open), over all runs and for each condition",
        "Validation runs. The further a dot lies to the left of its square, the larger the benefit. Above "
        "the line: all runs; a bar is the 95 % interval of the difference. At a tilt of 1, the slenderness, "
        "the block topples; overturned runs count as 1.",
    ),
    "response.svg": (
        "Settled amplitude against frequency, and share of runs that overturn, without and with the pendulum",
        "Top: settled motion from rest, by the linear equations. Triangles and crosses: the block "
        "overturns. Bottom: share of the runs from rest within 5 % of each frequency that overturn, with "
        "its 95 % interval. Whether a single run overturns is often chance. Dotted: frequency of the scene.",
    ),
    "motion.svg": (
        "Tilt of the block without and with the pendulum, and angle of the rod, against time from rest",
        "Motion from rest under the scene's own excitation, by the linear equations, without the pendulum "
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
    "conditions.svg": (
        "Tilt and bob angle against the quantity in which the conditions differ, with and without a pendulum",
        "Lines: largest steady tilt of the attracting orbits. Marks near the top: the block overturns from "
        "rest.",
    ),
    "front.svg": (
        "Reduction of the mean tilt against the mass of the bob",
        "Each point is a design with its own upper bound of the bob's mass, plotted against its actual mass.",
    ),
}
"""Alternative text and caption of every picture, by the name of its file."""


def content(
    design: Design,
    details: Details,
    job_toml: str = "",
    directory: Path | None = None,
    name: str = "",
    date: str = "",
    record_notes: Sequence[str] = (),
) -> Report:
    """Build the report of a design.

    Args:
        design: the answer of `optimise`.
        details: further results that the report shows, from `tpd.details`.
        job_toml: content of the job file that repeats the search; left out if empty.
        directory: folder of the report, for the command that repeats the search.
        name: name of the project, for the title.
        date: date of the report, for the title.
        record_notes: notes of the reader on the files of the records.
    """
    # A picture whose data is missing has no figure, so that the report does not refer to it.
    first, drawn = summary(design, details, directory, name), figures(design, details)

    def picture(file: str) -> list[Block]:
        # A picture whose data is missing has no figure, so that the report does not refer to it.
        return [drawn[file]] if file in drawn else []

    # The sections follow the questions of an engineer: what to watch, what to build, why to believe it, where
    # it stops to hold, how it was computed.
    parts: dict[str, list[Block]] = {
        "Notes": [n for n in first.notes if n.severity is not Severity.danger],
        "Build it": construction.section(design, details),
    } | sections.sections(design, details, picture, record_notes)
    front: list[Block] = [*picture("front.svg"), _front(details.front, design)] if details.front else []
    parts |= {
        "Lighter pendulums": front,
        "Assumptions": [Listing(tuple(_assumptions(design)))],
        "How to repeat it": _repeat(design, job_toml, directory),
    }
    return Report(
        title=words.title(design.scene, name, date),
        summary=first,
        figures=tuple(drawn[name] for name in ("drawing.svg", "animation.gif") if name in drawn),
        sections=tuple(Section(t, tuple(b)) for t, b in parts.items() if b),
    )


def figures(design: Design, details: Details) -> dict[str, Figure]:
    """Return the figures by the names of their files, for all pictures that the results have data for."""
    has_data = {
        "benefit.svg": design.runs is not None,
        "conditions.svg": "conditions" in design.problem.pictures
        and len(design.conditions) > 1
        and design.conditions.axis is not None,
        "search.png": design.trials is not None and design.trials.risk is not None,
        "response.svg": bool(details.responses),
        "motion.svg": bool(details.histories),
        "front.svg": bool(details.front),
        "drawing.svg": True,
        "animation.gif": bool(details.histories),
    }
    all_figures = {name: Figure(name, *_CAPTIONS[name]) for name, exists in has_data.items() if exists}
    if design.pendulum is None:
        all_figures["drawing.svg"] = replace(all_figures["drawing.svg"], caption="Block and base, to scale.")
    return all_figures


def _front(points: Sequence[FrontPoint], design: Design) -> Table:
    """Return a table with the answer for each upper bound of the bob's mass."""
    rows: list[tuple[Cell, ...]] = []
    for p in points:
        # A bound without a recommended pendulum has its status instead.
        if p.pendulum is None:
            rows.append((f"{number(p.most)} kg", p.status.replace("_", " "), None))
            continue
        size = f"{words.point(p.pendulum)}, ζ = {number(float(p.pendulum.damping_ratio))}"
        benefit = None if math.isnan(p.benefit[0]) else interval(*p.benefit)
        rows.append((f"{number(p.most)} kg", size, benefit))
    own = "The last row is this report's design."
    if points[-1].pendulum != design.pendulum:
        own = "This report's design has no row, because a lighter bob reduces the mean tilt at least as much."
    caption = f"Each row is a separate design with its own validation runs. {own}"
    head = "upper bound of the mass", "equivalent point mass", "reduction of the mean tilt (95 % interval)"
    return Table(head, tuple(rows), caption)


def _assumptions(design: Design) -> list[str]:
    """List the assumptions of the search and of the validation, each as a paragraph."""
    scene, problem, gyration = design.scene, design.problem, design.scene.block.radius_of_gyration
    radius = f"with a radius of gyration of {number(gyration or 0.0)} m about the centroid"
    inertia = "a uniform rectangle" if gyration is None else radius
    text = [
        f"The block is rigid, {inertia}, and rocks about its two lower edges. It neither slides nor bounces.",
        f"Energy losses: {words.losses(scene.block)}. k is the moment of friction over M g b. e is the "
        "ratio of the angular rates after and before an impact on the base.",
        "The bob is a point mass on a massless rod. The hinge is in the middle of the top and has a viscous "
        "damper.",
    ]
    # Only the default scatter of Housner's e has a source.
    is_measured = problem.scatter.get("restitution") == MEASURED
    limits = "; ".join(map(words.limit, problem.run_limits)) or "none"
    orbits = "; ".join(words.limit(limit) for limit in problem.limits if not limit.of_motion)
    of_orbits = f" Limits on the settled motion under each condition: {orbits}." if orbits else ""
    return [
        *text,
        problem.assumed_excitation,
        problem.runs_in_words,
        "The search and the trial runs use the linear equations (25) of Collini et al. (2016) without their "
        "misprints, solved exactly. The validation runs use the nonlinear equations (4).",
        f"Scatter of the validation runs: {problem.scatter_in_words()}. A range is uniformly distributed. "
        f"Each run has the same values with and without the pendulum.{_SOURCE if is_measured else ''}",
        f"Limits, which all but {percent(problem.allowed)} of the runs in which the block stands must "
        f"keep: {limits}.{of_orbits}",
    ]


def _repeat(design: Design, job_toml: str, directory: Path | None) -> list[Block]:
    """Return the command and the job file that repeat the search, and the versions of the packages."""
    out: list[Block] = []
    if directory is not None:
        out += [
            Code(repeat(directory)),
            Text("This command writes explore.html, an interactive page of this design, beside this page:"),
            Code(f"tpd explore {shlex.quote(str(directory))}"),
        ]
    if job_toml:
        out += [Text("The file scene.toml in the folder of this report contains:"), Code(job_toml)]
    versions = ", ".join(f"{name} {v}" for name, v in files.versions().items())
    return [
        *out,
        Text(f"Seed {design.seed}. Made with {versions}. The file design.json contains all results."),
    ]
