"""Content of a report as typed data: what was found, how far to rely on it, how to repeat it.

Nothing is solved here: all numbers come from the design and its study.
"""

from __future__ import annotations

import math
import shlex
from collections.abc import Sequence
from pathlib import Path

from tpd.core import files
from tpd.core.formatting import number
from tpd.design.as_built import Details
from tpd.design.design import Design, FrontPoint
from tpd.report import answer, construction, sections, words
from tpd.report.blocks import Block, Cell, Code, Figure, Listing, Report, Section, Severity, Table, Text
from tpd.report.notes import notes
from tpd.scene.conditions import MEASURES

CAPTIONS = {
    "drawing.svg": (
        "The block on its base and its pendulum, to scale, with dimensions",
        "To scale; the pendulum to a larger scale as it is to be built. Dashed: the bob at the ends of its "
        "swing. The rod differs from the length in the equations because of the size of the bob and the mass "
        "of the rod.",
    ),
    "animation.gif": (
        "Animation of the block on its moving base, without the pendulum and with it",
        "First seconds from rest under the scene's own excitation, linear equations.",
    ),
    "benefit.svg": (
        "Mean tilt with the pendulum (filled) and without (open), over all runs and under each condition",
        "Validation runs: the further a dot lies to the left of its square, the better. Above the line: all "
        "runs, with the 95 % interval of the difference as a bar. A tilt of 1 is the slenderness, at "
        "which the block topples; overturned runs count as 1.",
    ),
    "response.svg": (
        "Settled amplitude over frequency, and share of runs that overturn, without (open) and with (filled)",
        "Above: settled motion from rest, linear equations; triangles and crosses: the block overturns. "
        "Below: share of the runs from rest within 5 % of each frequency that overturn, with its 95 % "
        "interval, because a single run near overturning is chance. Dotted: the frequency of the scene.",
    ),
    "motion.svg": (
        "Tilt of the block without and with the pendulum, and angle of the rod, against time from rest",
        "First periods from rest under the scene's own excitation, linear equations: grey without the "
        "pendulum, blue with it. A block that stands here may overturn later. A limit on the stroke (dotted) "
        "applies to the settled motion only.",
    ),
    "search.png": (
        "Tilt over mass ratio and length ratio as a shaded field, with edges of the limits and the answer",
        "The darker, the larger the mean tilt: trend of the trial runs, at the damping of the best design "
        "(the "
        "star). Hatched: a limit is exceeded; each edge has the name of its limit. Lines: paths of the "
        "descents.",
    ),
    "conditions.svg": (
        "Tilt and bob angle over the quantity that the conditions differ in, with and without a pendulum",
        "Lines: largest steady tilt of the attracting orbits. Near the top: the block overturns from rest.",
    ),
    "front.svg": (
        "Fall of the mean tilt against the mass of the bob",
        "Each point is a design whose bob may be no heavier than a bound, plotted over its own mass.",
    ),
}
"""Alternative text of every picture, and a caption that says what to see."""


def content(
    design: Design,
    details: Details,
    job_toml: str = "",
    directory: Path | None = None,
    name: str = "",
    date: str = "",
    said: Sequence[str] = (),
) -> Report:
    """Build the report of a design.

    Args:
        design: the answer of `optimise`.
        study: everything else that is shown, from `tpd.details`.
        job_toml: the job file that repeats the run; left out if empty.
        directory: where the report lies, for the command that repeats the run.
        name: of the project, for the title.
        date: of the report, for the title.
        said: notes of the reader on the files of the records.
    """
    found = notes(design, details)
    drawn = names(design, details)
    # By the stem of their names; empty lists where there is none.
    there = {n.partition(".")[0]: [Figure(n, *said)] if n in drawn else [] for n, said in CAPTIONS.items()}
    parts: dict[str, list[Block]] = {
        "Notes": [n for n in found if n.severity is not Severity.danger],
        "Build it": construction.section(design, details),
    } | sections.sections(design, details, there, said)
    front: list[Block] = [*there["front"], _front(details.front)] if details.front else []
    parts |= {
        "Lighter pendulums": front,
        "Assumptions": [Listing(tuple(_assumptions(design)))],
        "How to repeat it": _repeat(design, job_toml, directory),
    }
    runs = design.runs
    rows = (*(("project", name) for _ in range(bool(name))), *answer.pairs(design, details))
    return Report(
        title=words.title(design.scene, name, date),
        verdict=answer.verdict(design, details),
        dangers=tuple(n for n in found if n.severity is Severity.danger),
        answer=Table(("", ""), tuple(rows)),
        comparison=None if runs is None else words.comparison(runs),
        figures=(*there["drawing"], *there["animation"]),
        sections=tuple(Section(t, tuple(b)) for t, b in parts.items() if b),
    )


def names(design: Design, details: Details) -> tuple[str, ...]:
    """Names of the pictures that there is data for."""
    harmonic = design.problem.without_pendulum is not None
    there = {
        "benefit.svg": design.runs is not None,
        "conditions.svg": harmonic and len(design.conditions) > 1 and design.conditions.axis is not None,
        "search.png": design.trials is not None and design.trials.process is not None,
        "response.svg": bool(details.responses),
        "motion.svg": bool(details.histories),
        "front.svg": bool(details.front),
        "drawing.svg": True,
        "animation.gif": bool(details.histories),
    }
    return tuple(name for name, exists in there.items() if exists)


def _front(points: Sequence[FrontPoint]) -> Table:
    """The answer for every largest mass of the bob."""
    rows: list[tuple[Cell, ...]] = []
    for p in points:
        if p.pendulum is None:
            rows.append((f"{number(p.most)} kg", p.status.replace("_", " "), None))
            continue
        with_it = f"{number(p.pendulum.mass)} kg on {number(p.pendulum.length)} m, ζ = "
        saved, low, high = p.saved
        fall = None if math.isnan(saved) else f"{saved:.0%} ({low:.0%} to {high:.0%})"
        rows.append((f"{number(p.most)} kg", f"{with_it}{number(float(p.pendulum.damping_ratio))}", fall))
    caption = (
        "Every row is a design of its own, with validation runs of its own; the last is the design itself."
    )
    return Table(("bob at most", "pendulum", "reduction of the mean tilt (95 %)"), tuple(rows), caption)


def _assumptions(design: Design) -> list[str]:
    scene, problem, own = design.scene, design.problem, design.scene.block.radius_of_gyration
    inertia = "uniform rectangle" if own is None else f"radius of gyration {number(own)} m about the centroid"
    text = [
        f"A rigid block ({inertia}) that rocks about its two lower edges: it neither slides nor bounces.",
        "Energy losses (friction is a moment over M g b; e is the ratio of the tilting rates after and "
        f"before an impact on the base): {words.losses(scene.block)}.",
        "A point bob on a massless rod from the middle of the top, with a viscous hinge.",
    ]
    limits = "; ".join(map(words.limit, problem.limits)) or "none"
    scatter = ", ".join(f"{n} ±{w:.1%}" for n, w in problem.scatter.items()) or "nothing"
    intensity = ""
    if design.conditions.motions:
        intensity = f" ({MEASURES[design.conditions.intensity]})"
        text.append(f"{'; '.join(design.conditions.description)}{intensity}, from rest.")
    else:
        more = "" if len(design.conditions) == 1 else ", before the conditions change it"
        text.append(
            f"A harmonic motion of the base, {number(scene.motion.amplitude)} m · sin(2π · "
            f"{number(scene.motion.frequency)} Hz · t){more}, horizontal and in the plane; g = "
            f"{number(scene.gravity)} m/s²."
        )
    return [
        *text,
        "Search and trial runs: linear equations (25) of Collini et al. (2016), misprints corrected, solved "
        "exactly. Validation runs: nonlinear equations (4).",
        f"Scatter of the validation runs: {scatter}, each uniform, and the same in both cases.",
        f"Limits, for all but {problem.allowed:.0%} of the runs in which the block stands: {limits}.",
    ]


def _repeat(design: Design, job_toml: str, directory: Path | None) -> list[Block]:
    out: list[Block] = []
    if directory is not None:
        scene, to = shlex.quote(str(directory / "scene.toml")), shlex.quote(f"{directory}-again")
        out.append(Code(f"tpd optimise --scene {scene} --out {to}"))
        out += [
            Text("This command writes explore.html, an interactive page of this design, beside this page:"),
            Code(f"tpd explore {shlex.quote(str(directory))}"),
        ]
    if job_toml:
        out += [Text("The file scene.toml beside this page holds:"), Code(job_toml)]
    made = ", ".join(f"{name} {v}" for name, v in files.versions().items())
    return [*out, Text(f"Seed {design.seed}. Made with {made}. The file design.json holds all results.")]
