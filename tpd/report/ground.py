"""Report of a design on ground motions: verdict, parts, groups, how to repeat it."""

from __future__ import annotations

from collections.abc import Iterator
from pathlib import Path
from typing import Any

import numpy as np

from tpd.core import files
from tpd.core.formatting import number
from tpd.core.scene import Pendulum
from tpd.design.criteria import THICKNESS, Room, limit_of
from tpd.design.front import FrontPoint
from tpd.design.ground.design import GroundDesign
from tpd.design.ground.groups import Role, unnamed
from tpd.design.ground.judgement import Judged, scatter_of
from tpd.design.ground.search import SPARE
from tpd.design.reading import VERSION
from tpd.report import scene_words, tables, words
from tpd.report.blocks import (
    Block,
    Cell,
    Code,
    Figure,
    Listing,
    Note,
    Report,
    Section,
    Table,
    danger,
    information,
    warning,
)
from tpd.report.html import html
from tpd.report.json import plain
from tpd.report.text import text

_INTENSITIES = {
    "pga_star": "PGA/(g tan α)",
    "pgv_star": "p PGV/(g tan α)",
    "pga": "PGA, m/s²",
    "pgv": "PGV, m/s",
    "scale": "factor on each motion",
}


def write(
    directory: Path,
    design: GroundDesign,
    command: str = "",
    sources: list[str] | None = None,
    points: tuple[FrontPoint, ...] = (),
    tables: dict[str, Any] | None = None,
) -> list[Path]:
    """Write report, numbers and pictures; each file appears complete or not at all. Returns the files.

    Args:
        directory: made if it does not exist.
        design: the answer.
        command: that repeats the run.
        sources: files, folders and sets that the motions come from.
        points: answers with lighter bobs, see `tpd.front`.
    """
    report = content(design, command, points)
    written = [
        files.place(directory / "report.txt", text(report)),
        files.place(directory / "design.json", as_json(design, command, sources, points, tables)),
    ]
    if design.searched is not None:
        written.append(files.place(directory / "designs.csv", _designs(design)))
    if design.judged:
        written.append(files.place(directory / "groups.csv", _groups(design)))
    # Numbers are on disk before the pictures are drawn.
    drawn = dict(_pictures(design, points))
    written += [files.place(directory / name, png) for name, png in drawn.items()]
    written.append(files.place(directory / "report.html", html(report, drawn)))
    return written


def content(design: GroundDesign, command: str = "", points: tuple[FrontPoint, ...] = ()) -> Report:
    """Build the report of a design on ground motions."""
    scene = design.scene
    falls = any(g.overturns_more or g.strikes > design.worth.broken for g in design.judged)
    falls = falls or (design.benefit is not None and design.benefit.overturned.is_above)
    # Danger is for overturning and strikes alone.
    say = information if design.status.is_sound else danger if falls else warning
    verdict = say(design.headline)
    parts: dict[str, list[Block]] = {
        "Block": [information("; ".join(line.strip() for line in scene_words.block_lines(scene)))],
        "Before anything else": list(notes(design)),
        "The answer": _answer(design),
        "On ground motions": _judged(design),
        "Parts": _parts(design),
        "What a kilogramme pays": _front(points),
        "The block": _figure(design, "drawing.png", "The block with its pendulum, to scale"),
        "Where it was searched": _search(design),
        "Assumptions": [Listing(tuple(_assumptions(design)))],
        "How to repeat it": _repeat(design, command),
    }
    sections = tuple(Section(title, tuple(blocks)) for title, blocks in parts.items() if blocks)
    return Report(f"{scene_words.title(scene)} on ground motions", verdict, sections)


def notes(design: GroundDesign) -> Iterator[Note]:
    """Notes that somebody who would build the design must read first."""
    block, benefit = design.scene.block, design.benefit
    if block.restitution is None and not block.friction:
        yield warning(
            "The block loses no energy at all: no real block rocks like that. Give it a restitution."
        )
    if benefit is not None and design.pendulum is not None and not benefit.overturned.is_below:
        yield warning(
            "On motions that were held out the tilts are smaller, but the number of overturnings is not "
            f"significantly so: {benefit.overturned.words()} of the runs."
        )
    # Without the name of its earthquake a record that is held out may be of one that was tuned to.
    nameless = unnamed(design.conditions.motions)
    if nameless and any(g.role is Role.held_out for g in design.judged):
        yield warning(
            f"{nameless} of the records name no earthquake: motions that were held out may belong to an "
            "earthquake that the design was tuned to. Give the names (--event), or a folder for each."
        )
    for g in design.judged:
        if g.overturns_more:
            more = (g.difference if g.difference.is_above else g.linear).words()
            yield danger(f"On {g.name} the block overturns more often with the pendulum: {more}.")
        if g.tilt.is_above:
            more = g.tilt.words(share=False)
            yield warning(f"On {g.name} the mean tilt/ν is larger with the pendulum: {more}.")
        if g.strikes > design.worth.broken:
            yield danger(
                f"On {g.name} with scattered blocks a limit is broken in {g.strikes:.1%} of the runs that "
                f"stand ({g.linear_strikes:.1%} by the linear equations); {design.worth.broken:.1%} are "
                "allowed."
            )
        if g.undecided:
            yield warning(
                f"On {g.name} {_unknown(g)} runs have no answer (too many events). They are left out, and "
                "a design is offered only if the verdict is the same whichever way they end."
            )
    yield from _unknown_in_search(design)
    if design.pendulum is not None and design.best is not None:
        yield from _at_bounds(design, design.best)


def _unknown(g: Judged) -> str:
    """Number of runs without an answer, and of all: bare and hung by both sets of equations."""
    return f"{g.undecided} of {4 * g.motions * len(g.stripes)}"


def _unknown_in_search(design: GroundDesign) -> Iterator[Note]:
    found = design.searched
    if found is not None and found.undecided.any():
        yield warning(
            f"In the search {int(found.undecided.sum())} of {len(found.value) * len(design.conditions)} runs "
            f"have no answer (too many events), with {int((found.undecided > 0).sum())} of "
            f"{len(found.value)} designs: their tilt is that of the other runs."
        )


def _at_bounds(design: GroundDesign, best: np.ndarray) -> Iterator[Note]:
    unit = design.space.scaled(best)
    # A bound that the answer lies on may hide a better one beyond it.
    for name, x in zip(("mass", "length", "damping"), unit, strict=False):
        if not 0.01 < x < 0.99:
            side = "largest" if x > 0.5 else "least"
            yield information(f"The answer has the {side} {name} of the design space.")


def _answer(design: GroundDesign) -> list[Block]:
    hung, best = design.pendulum, design.best
    tilt = [("tilt/ν without a pendulum", number(design.bare), "over the motions it is tuned to")]
    if best is not None:
        trend = f"trend {number(design.trend[0])} ± {number(design.trend[1])}"
        tilt.insert(0, ("tilt/ν with the best design", number(design.value), trend))
    if hung is None or best is None:
        rows: tuple[tuple[Cell, ...], ...] = (("pendulum", "none to offer", None), *tilt)
        if best is not None:
            rows += (("best design, not offered", "μ = {:.4g}, λ = {:.4g}, ζ = {:.3g}".format(*best), None),)
        return [Table(("", "value", "remark"), rows)]
    hinge = f"{number(float(hung.hinge_damping(design.scene.gravity)))} N m s/rad"
    rows = (
        ("mass of the bob", f"{number(float(hung.mass))} kg", f"μ = {number(best[0])}"),
        ("length of the pendulum", f"{number(float(hung.length))} m", f"λ = {number(best[1])}"),
        words.rod(hung, words.bob_of(design.limits), design.scene.gravity),
        ("damping of the hinge", hinge, f"ζ = {number(best[2])} of critical"),
        *tilt,
        *_usage(design),
    )
    caption = (
        "Tilt: largest tilt over the slenderness of each run, an overturning as 1, by the linear equations; "
        f"{design.risk.name} over all runs."
    )
    return [Table(("", "value", "remark"), rows, caption)]


def _usage(design: GroundDesign) -> list[tuple[Cell, ...]]:
    """Rows of limits and how much of each is used by the allowed share of the runs."""
    found = design.searched
    if found is None or design.best is None:
        return []
    # The best design is one of those that were followed.
    linear = found.sizes[int(np.flatnonzero(np.all(found.designs == design.best, axis=1))[0])]
    used = linear if design.usage is None else design.usage
    which = "linear equations" if design.usage is None else "nonlinear equations"
    share = f"{which}, all but {design.worth.broken:.0%} of the standing runs"
    return [
        (
            f"limit on the {name}",
            f"{x:.1%} used",
            "half the rod's length" if name == THICKNESS else f"{share}; {y:.1%} by the linear ones",
        )
        for name, x, y in zip(design.names, used, linear, strict=True)
    ]


def _judged(design: GroundDesign) -> list[Block]:
    if not design.judged:
        return []
    head = ("group", "motions", "earthquakes", "overturned without", "with it", "difference (95 %)")
    more = ("tilt/ν, difference (95 %)", "linear equations", "verdicts changed")
    strikes = f"limits broken ({design.worth.broken:.0%} allowed)", "no answer"
    rows = tuple(_row(g) for g in design.judged)
    caption = (
        "Runs of the nonlinear equations, each motion at each intensity, without and with the pendulum on "
        "the same block with scattered properties. Intervals take the runs of one earthquake as one. Linear "
        "equations: difference of the share overturned. Verdicts changed: share of the runs in which both "
        "sets of equations differ on overturning. Limits broken: share of the runs that stand, in brackets "
        "by the linear equations. No answer: runs that met too many events, of both sets of "
        "equations, bare and hung; all shares and means leave them out."
    )
    out: list[Block] = [
        *_figure(design, "groups.png", "Share of motions that overturn the block"),
        Table((*head, *more, *strikes), rows, caption),
    ]
    if design.benefit is not None:
        b = design.benefit
        out.append(
            information(
                f"Over all motions that were held out: {b.overturned.words()} of the runs overturned; the "
                f"mean tilt over the slenderness changes by {b.tilt.words(share=False)}, which is "
                f"{b.saved.mean:.0%} less ({design.worth.at_least:.0%} were asked for)."
            )
        )
    return out


def _row(g: Judged) -> tuple[Cell, ...]:
    role = g.name if g.role is Role.tuned or g.name == g.role.value else f"{g.name} (held out)"
    before, after = (f"{x:.1%}" for x in g.overturned)
    sizes = g.difference.words(), g.tilt.words(share=False), g.linear.words(), f"{g.changed:.1%}"
    strikes = f"{g.strikes:.1%} ({g.linear_strikes:.1%})", _unknown(g)
    return role, str(g.motions), str(g.events), before, after, *sizes, *strikes


def _parts(design: GroundDesign) -> list[Block]:
    p = design.parts
    if p is None:
        return []
    rows = (
        ("weight of the bob on the top", f"{number(p.weight)} N"),
        ("largest force along the rod", f"{number(p.rod_tension)} N"),
        ("largest force of the hinge", f"{number(p.hinge_force)} N"),
        ("damper of the hinge", f"{number(p.damper)} N m s/rad"),
        ("largest moment of the damper", f"{number(p.damper_moment)} N m"),
        ("largest power of the damper", f"{number(p.damper_power)} W"),
        ("largest rate between rod and block", f"{number(p.rate)} rad/s"),
        (
            "largest angle between rod and block",
            f"{number(p.angle)} rad, by the nonlinear equations ({number(p.linear_angle)} rad by the linear)",
        ),
    )
    caption = (
        f"Largest values over the {p.motions} motions with the largest angles in which the block stands, on "
        "the nominal block; linear equations but for the angle, which is the largest of all motions. Impacts "
        "of the block, and of the bob on a wall, are left out: take a factor of safety."
    )
    return [Table(("load", "value"), rows, caption)]


def _front(points: tuple[FrontPoint, ...]) -> list[Block]:
    if not points:
        return []
    name = "Fall of the mean tilt on motions held out, over the mass of the bob"
    return [Figure("front.png", name, f"{name}."), tables.front(points)]


def _search(design: GroundDesign) -> list[Block]:
    found = design.searched
    if found is None:
        return []
    n = len(design.conditions)
    counts = (
        f"{len(found.value)} designs were followed under {n} motions each: {design.method.starts} over the "
        f"whole space, the others where the surface promised most. {int(found.feasible.sum())} keep to the "
        f"limits, {int(found.spares.sum())} with {SPARE:.0%} of each to spare, as the search asks for."
    )
    return [
        information(counts),
        *_figure(
            design, "search.png", "Trend of the tilt over mass and length ratio, and the designs followed"
        ),
    ]


def _assumptions(design: GroundDesign) -> Iterator[str]:
    scatter = ", ".join(
        f"{name} ±{width:.0%}" for name, width in scatter_of(design.scene.block, design.ensemble).items()
    )
    yield "A rigid block that rocks about its two lower edges: it neither slides nor bounces."
    yield f"Energy losses: {words.losses(design.scene.block)}."
    yield "A point bob on a massless rod from the middle of the top, with a viscous hinge."
    yield (
        "; ".join(design.conditions.description)
        + f" ({_INTENSITIES[design.conditions.intensity]}), from rest."
    )
    yield f"Judged with scatter of {scatter or 'nothing'}, each uniform."
    yield "Search by the linear equations, exact between the samples; verdict by the nonlinear equations."
    limits = "; ".join(map(words.limit, design.limits)) or "none"
    yield f"Limits, for all but {design.worth.broken:.0%} of the standing runs: {limits}."


def _repeat(design: GroundDesign, command: str) -> list[Block]:
    made = ", ".join(f"{name} {v}" for name, v in files.versions().items())
    said = information(f"Seed {design.seed}. Made with {made}. The file design.json holds all results.")
    return [*([Code(command)] if command else []), said]


def as_json(
    design: GroundDesign,
    command: str = "",
    sources: list[str] | None = None,
    points: tuple[FrontPoint, ...] = (),
    tables: dict[str, Any] | None = None,
) -> str:
    """The design as sorted JSON."""
    found, hung = design.searched, design.pendulum
    # Everything that repeats the run, and all that was found.
    gravity = design.scene.gravity
    entries = {
        "version": VERSION,
        "status": design.status.name,
        "status_message": design.headline,
        "reasons": list(design.reasons),
        "notes": list(notes(design)),
        "pendulum": hung,
        "hinge_damping_N_m_s_per_rad": None if hung is None else float(hung.hinge_damping(gravity)),
        "best": None if design.best is None else dict(zip(("mu", "lam", "zeta"), design.best, strict=True)),
        "value": {"best": design.value, "trend": design.trend, "bare": design.bare},
        "benefit": None if design.benefit is None else plain(design.benefit._asdict()),
        "groups": [_group(g) for g in design.judged],
        "usage": None if design.usage is None else dict(zip(design.names, design.usage, strict=True)),
        "parts": design.parts,
        "front": list(points),
        "searched": None if found is None else found._asdict(),
        "block": design.scene.block,
        "gravity": gravity,
        "settings": design.settings,
        "records": sources or [],
        "job": tables,
        "seed": design.seed,
        "command": command,
        "versions": files.versions(),
    }
    return files.as_json(plain(entries))


def _group(g: Judged) -> dict[str, Any]:
    names = ("name", "role", "motions", "events", "stripes", "overturned", "difference", "linear", "tilt")
    medians = [fit.median for fit in g.fits]
    more = {
        "counts": list(g.counts),
        "unknown": list(g.unknown),
        "strikes": g.strikes,
        "linear_strikes": g.linear_strikes,
        "changed": g.changed,
        "undecided": g.undecided,
    }
    return {**{name: getattr(g, name) for name in names}, **more, "medians": medians}


def _designs(design: GroundDesign) -> str:
    found = design.searched
    assert found is not None
    head = ("mu", "lam", "zeta", "value", "overturned", "undecided", *design.names)
    columns = found.designs, found.value, found.overturned, found.undecided, found.sizes
    rows = ((*d, v, o, int(u), *s) for d, v, o, u, s in zip(*columns, strict=True))
    return files.as_csv(head, rows)


def _groups(design: GroundDesign) -> str:
    rows = (
        (g.name, stripe, g.motions, *(int(x[i]) for x in (*g.counts, *g.unknown)))
        for g in design.judged
        for i, stripe in enumerate(g.stripes)
    )
    head = ("group", "intensity", "motions", "overturned_bare", "overturned_hung")
    return files.as_csv((*head, "undecided_bare", "undecided_hung"), rows)


def _pictures(design: GroundDesign, points: tuple[FrontPoint, ...]) -> Iterator[tuple[str, bytes]]:
    from tpd.plot import drawing, style
    from tpd.plot.front import plot_front
    from tpd.plot.ground_design import plot_groups, plot_search

    if points:
        yield "front.png", style.png(plot_front(points).figure)
    if design.judged:
        yield "groups.png", style.png(plot_groups(design)[0].figure)
    if design.searched is not None:
        yield "search.png", style.png(plot_search(design).figure)
    room = limit_of(design.limits, Room)
    stroke = 0.0 if design.parts is None else design.parts.angle
    bob = room.bob if isinstance(room, Room) else None
    hung: Pendulum | None = design.pendulum
    yield "drawing.png", style.png(drawing.plot_scene(design.scene, hung, stroke=stroke, bob=bob).figure)


def _figure(design: GroundDesign, name: str, caption: str) -> list[Block]:
    there = {
        "groups.png": bool(design.judged),
        "search.png": design.searched is not None,
        "drawing.png": True,
    }
    return [Figure(name, caption, f"{caption}.")] if there[name] else []
