"""Sections of a report that only a design on ground motions has."""

from __future__ import annotations

from collections.abc import Mapping, Sequence

from tpd.core import files
from tpd.design.ground.design import GroundDesign
from tpd.design.ground.judgement import Judged, Role
from tpd.design.ground.search import SPARE
from tpd.report.blocks import Block, Cell, Table, Text
from tpd.report.notes import unknown


def sections(design: GroundDesign, figures: Mapping[str, Sequence[Block]]) -> dict[str, list[Block]]:
    """Blocks by the titles of their sections, in the order of a report; empty ones are left out later."""
    return {
        "Over the runs": _judged(design, figures["groups"]),
        "Where it was searched": _search(design, figures["search"]),
    }


def _judged(design: GroundDesign, figure: Sequence[Block]) -> list[Block]:
    if not design.judged:
        return []
    head = ("group", "motions", "earthquakes", "overturned without", "with it", "difference (95 %)")
    more = ("tilt/ν, difference (95 %)", "linear equations", "verdicts changed")
    strikes = f"limits broken ({design.worth.broken:.0%} allowed)", "no answer"
    caption = (
        "Runs of the nonlinear equations, each motion at each intensity, without and with the pendulum on "
        "the same block with scattered properties. Intervals take the runs of one earthquake as one. Linear "
        "equations: difference of the share overturned. Verdicts changed: share of the runs in which both "
        "sets of equations differ on overturning. Limits broken: share of the runs that stand, in brackets "
        "by the linear equations. No answer: runs that met too many events, of both sets of "
        "equations, bare and hung; all shares and means leave them out."
    )
    return [*figure, Table((*head, *more, *strikes), tuple(map(_row, design.judged)), caption)]


def _row(g: Judged) -> tuple[Cell, ...]:
    role = g.name if g.role is Role.tuned or g.name == g.role.value else f"{g.name} (held out)"
    before, after = (f"{x:.1%}" for x in g.overturned)
    sizes = g.difference.words(), g.tilt.words(share=False), g.linear.words(), f"{g.changed:.1%}"
    strikes = f"{g.strikes:.1%} ({g.linear_strikes:.1%})", unknown(g)
    return role, str(g.motions), str(g.events), before, after, *sizes, *strikes


def _search(design: GroundDesign, figure: Sequence[Block]) -> list[Block]:
    found = design.searched
    if found is None:
        return []
    counts = (
        f"{len(found.value)} designs were followed in {len(design.conditions)} runs each: "
        f"{design.method.starts} over the whole space, the others where the surface promised most. "
        f"{int(found.feasible.sum())} keep to the limits, {int(found.spares.sum())} with {SPARE:.0%} of each "
        f"to spare, as the search asks for. Trend of the {design.risk.name} tilt/ν at the best "
        f"{design.trend[0]:.4g} ± {design.trend[1]:.2g}, {design.bare:.4g} without a pendulum."
    )
    return [*figure, Text(counts)]


def designs_csv(design: GroundDesign) -> str:
    """CSV with a row for every design that was followed."""
    found = design.searched
    assert found is not None
    head = ("mu", "lam", "zeta", "value", "overturned", "undecided", *design.names)
    columns = found.designs, found.value, found.overturned, found.undecided, found.sizes
    rows = ((*d, v, o, int(u), *s) for d, v, o, u, s in zip(*columns, strict=True))
    return files.as_csv(head, rows)


def groups_csv(design: GroundDesign) -> str:
    """CSV with a row for every group at every intensity."""
    rows = (
        (g.name, stripe, g.motions, *(int(x[i]) for x in (*g.counts, *g.unknown)))
        for g in design.judged
        for i, stripe in enumerate(g.stripes)
    )
    head = ("group", "intensity", "motions", "overturned_bare", "overturned_hung")
    return files.as_csv((*head, "undecided_bare", "undecided_hung"), rows)
