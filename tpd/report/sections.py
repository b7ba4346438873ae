"""Sections of a report: validation runs, other losses, limits, motions, search and records."""

from __future__ import annotations

import math
from collections import Counter
from collections.abc import Mapping, Sequence

import numpy as np

from tpd.answers.paired import PairedRuns
from tpd.answers.runs import Runs, label_of_ramp
from tpd.core.formatting import number
from tpd.design.as_built import Details
from tpd.design.criteria import LABELS
from tpd.design.design import Design
from tpd.design.harmonic import ExactMotions
from tpd.design.orbits import KINDS
from tpd.records.read import facts, same_earthquakes
from tpd.report import words
from tpd.report.blocks import Block, Cell, Listing, Table, Text
from tpd.scene.record import Record

_ROWS, _MOST = 40, 8
"""Most conditions in a table, evenly over all of them, and most rows of limits that are left out."""
_SCATTERED = {
    "mass": "the bob's mass",
    "length": "the rod's length",
    "damping": "the hinge's damping",
    "amplitude": "amplitude of the excitation",
}
"""Names of what scatters, where one word is not enough."""


def sections(
    design: Design, details: Details, figures: Mapping[str, Sequence[Block]], notes: Sequence[str]
) -> dict[str, list[Block]]:
    """Return blocks by the titles of their sections, in the order of a report; empty ones are left out later.

    Args:
        design, study: what the report is about.
        figures: blocks of pictures by name.
        notes: notes of the reader on the files of the records.
    """
    runs = over_runs(design)
    return {
        "Validation runs": [*figures["benefit"], *runs] if runs else [],
        "Other energy losses": other_losses(details),
        "What limits the design": limiting(design),
        "Nearby frequencies": [*figures["response"]],
        "Motion from rest": [*figures["motion"]],
        "Settled motion": settled(design, figures["conditions"]),
        "Search": searched(design, figures["search"]),
        "Rejected designs": rejected(design),
        "Records": records(design, notes),
    }


def over_runs(design: Design) -> list[Block]:
    """Return shares and sizes over the runs that validate the best design, and for each condition."""
    runs = design.runs
    if runs is None:
        return []
    cases = runs.with_pendulum, runs.without_pendulum
    rows: list[tuple[Cell, ...]] = []
    worst = runs.change("worst severity")
    shares = f"{worst.with_pendulum:.1%}", f"{worst.without_pendulum:.1%}"
    rows.append(("tilt over ν, worst tenth of the runs", *shares))
    if runs.cluster is None:
        for ramp in cases[0].share_by_ramp():
            shares = (str(o.share_by_ramp()[ramp]) for o in cases)
            rows.append((f"overturned, {label_of_ramp(ramp)}", *shares))
    rows.append(("overturned", *(str(o.share_overturned) for o in cases)))
    rows.append(("at rest in the end", *(str(o.share_at_rest) for o in cases)))
    for what, quantity in (("largest tilt", "tilt"), ("settled tilt", "settled_tilt")):
        rows.append((f"{what}, 50, 90, 99 % of the runs (rad)", *(_quantiles(o, quantity) for o in cases)))
    rows.append(("bob's largest angle, 50, 90, 99 % (rad)", _quantiles(cases[0], "swing"), None))
    by_width = dict[float, list[str]]()
    for name, width in design.problem.scatter.items():
        by_width.setdefault(width, []).append(_SCATTERED.get(name, name))
    listed = (f"{', '.join(names)} ±{100.0 * width:.2g} %" for width, names in sorted(by_width.items()))
    # The benefit counts only motions that are held out; this table has all runs.
    of = (
        runs.description if runs.counted is None else f"All {len(runs.known)} runs, of every group of motions"
    )
    caption = (
        f"{of}{_which(design)}. Scatter: {'; '.join(listed) or 'none'}. In brackets: 95 % "
        "confidence. Tilt: settled, 100 % where the block overturns or tilts to ν or further."
    )
    table = Table(("", "with pendulum", "without"), tuple(rows), caption)
    return [table, Text(runs.overturning_in_words), *_by_part(runs)]


def _quantiles(runs: Runs, angle: str) -> str:
    return ", ".join("overturned" if math.isinf(x) else number(x, 3) for x in runs.quantiles(angle))


def _which(design: Design) -> str:
    """Which runs these are, and what those showed that decided."""
    best = design.best
    if best is None or best.quoted is None or best.decided is None:
        return ""
    before = f"; designs rejected before: {len(design.validated) - 1}" if design.validated[1:] else ""
    decided = words.reduced(best.decided, best.measure)
    return f", which no decision has used{before}. In the runs that decided, {decided}"


def _by_part(runs: PairedRuns) -> list[Block]:
    """Mean tilt for every condition or group of motions, and every kind of start; nothing for one only."""
    # The starts are the last parts, and remain where there are too many conditions for a table.
    parts = runs.parts if len(runs.labels) <= 32 else runs.parts[len(runs.labels) :]
    rows = tuple(
        (p.label, f"{p.with_pendulum:.0%}", f"{p.without_pendulum:.0%}", "yes" if p.is_worse else "no")
        for p in parts
        if not math.isnan(p.with_pendulum)
    )
    if len(rows) < 2:
        return []
    caption = (
        "Mean tilt over ν of the same runs. Significantly worse: higher by more than "
        f"{runs.worse:.0%}, at the 5 % level."
    )
    return [Table(("condition", "with pendulum", "without", "significantly worse"), rows, caption)]


def other_losses(details: Details) -> list[Block]:
    """Return the pendulum where the block loses its energy in another way."""
    if not details.losses:
        return []
    rows: list[tuple[Cell, ...]] = []
    for case in details.losses:
        shares = (case.runs.change(name) for name in ("overturned", "at rest"))
        cells = (f"{c.with_pendulum:.1%} / {c.without_pendulum:.1%}" for c in shares)
        losses = f"k = {number(case.friction, 3)}, e = {number(case.velocity_ratio, 4)}"
        rows.append((case.name, losses, case.runs.benefit_in_words, *cells))
    head = ("losses", "", "benefit", "overturned, with / without", "at rest, with / without")
    caption = (
        f"{details.losses[0].runs.description} each, with other losses of the block: they are its least "
        "known data."
    )
    return [Table(head, tuple(rows), caption)]


def limiting(design: Design) -> list[Block]:
    """Return limits that keep better designs out, and the best design without each."""
    trials = design.trials
    if trials is None:
        return []
    counts = {
        LABELS.get(n, n): int(np.sum(x > 1.0)) for n, x in zip(trials.names, trials.sizes.T, strict=True)
    }
    over = ", ".join(f"{name} {n}" for name, n in counts.items() if n)
    sentence = (
        f"Of {len(trials.designs)} designs with trial runs {int(trials.feasible.sum())} keep to all limits"
    )
    best = trials.best_without()
    broken = [name for name, x in zip(trials.names, trials.sizes.T, strict=True) if np.any(x > 1.0)]
    rows = [_row(design, "all limits", best)]
    for name in broken:
        other = trials.best_without(name)
        # A row that repeats the first would only hide those that differ.
        if other != best:
            rows.append(_row(design, f"without the limit on {LABELS.get(name, name)}", other))
    head = ("", "bob (kg)", "length (m)", "ζ", "mean tilt over ν, trend")
    gain = "Best trial, and the best one if a limit is left out: this is what loosening the limit would gain."
    if len(rows) == 1:
        gain = "Best trial. No better one exceeds a single limit."
    caption = f"{gain} Without a pendulum: {trials.without_pendulum:.1%}."
    said = f"{sentence}{f'; designs that exceed a limit: {over}' if over else ''}."
    used = ", ".join(f"{LABELS.get(n, n)} {x:.0%}" for n, x in words.usage(design).items())
    if used:
        share = f"{1.0 - design.problem.allowed:.0%} of the validation runs in which the block stands"
        said += f" Share of each limit that the best design uses in {share}: {used}."
    return [Text(said), Table(head, tuple(rows[:_MOST]), caption)]


def _row(design: Design, name: str, i: int | None) -> tuple[Cell, ...]:
    trials = design.trials
    assert trials is not None
    if i is None:
        return (name, *(None,) * 3, "no design")
    hung = design.problem.pendulum(trials.designs[i])
    return (name, float(hung.mass), float(hung.length), float(hung.damping_ratio), f"{trials.trend[i]:.1%}")


def settled(design: Design, figure: Sequence[Block]) -> list[Block]:
    """Return the exact settled motion under every condition, with harmonic excitation."""
    without, best, n = design.problem.without_pendulum, design.best, len(design.conditions)
    if without is None:
        return []
    with_it = None if best is None else best.exact
    risk = design.problem.risk.name
    rows: list[tuple[Cell, ...]] = [(f"{risk} tilt without a pendulum", words.risk(design, without.value))]
    if with_it is not None:
        rows.append((f"{risk} tilt with the pendulum", words.risk(design, with_it.value)))
        rows.append(("stroke of the bob", words.angle(design.swing)))
    out: list[Block] = [
        Table(("", "value"), tuple(rows), f"{words.source_of_tilts(design)}, linear equations."),
        *figure,
    ]
    if n == 1:
        return out
    cells: list[tuple[Cell, ...]] = []
    for i in map(int, np.unique(np.linspace(0, n - 1, min(n, _ROWS)).astype(int))):
        row = [design.conditions.label(i), *_motion(design, without, i)]
        if with_it is not None:
            row += [*_motion(design, with_it, i), float(with_it.orbits.swing[0, i])]
        cells.append(tuple(row))
    head = ("condition", "tilt without (rad)", "orbit without", "from rest without")
    head += () if with_it is None else ("tilt with (rad)", "orbit with", "from rest with", "stroke (rad)")
    caption = "From rest: outcome of one motion by the linear equations."
    if with_it is not None and design.pendulum is None:
        caption += " The design shown came nearest and is not recommended."
    return [*out, Table(head, tuple(cells), caption)]


def _motion(design: Design, of: ExactMotions, i: int) -> tuple[Cell, ...]:
    """Tilt (rad) and kind of orbit under a condition, and the outcome from rest."""
    e, nu = of.orbits, design.scene.block.slenderness * design.conditions.column("slenderness")[i]
    tilt, kind = float(e.tilt[0, i] * nu), KINDS[int(e.kind[0, i])].replace("_", " ")
    return tilt if math.isfinite(tilt) else None, kind, str(of.status[i]).replace("_", " ")


def searched(design: Design, figure: Sequence[Block]) -> list[Block]:
    """Return how the space was searched."""
    trials, search = design.trials, design.search
    if trials is None:
        return []
    text = f"{len(trials.designs)} designs were evaluated by trial runs of the linear equations"
    unknown = int(trials.undecided.sum())
    text += f" ({unknown} runs without an answer are left out)." if unknown else "."
    if search is not None and search.statuses:
        ends = "; ".join(f"{n} {what}" for what, n in Counter(s.value for s in search.statuses).items())
        text += (
            f" The descents began from {search.description} (seed {design.seed}) and evaluated "
            f"{search.evaluations} designs. Ends: {ends}. "
            f"{search.message}"
        )
        sound, lost = len(search.confirmed), int(np.sum(search.stopped))
        if np.any(search.mismatch):
            text += (
                f" The exact solution confirms {sound} of {len(search.ends)} ends; the smoothed orbits were "
                f"lost {lost} times on the way."
            )
    return [*figure, Text(text)]


def rejected(design: Design) -> list[Block]:
    """Return the designs that were validated and rejected."""
    rows = tuple(
        (
            *map(float, v.design),
            None if v.runs is None else v.runs.benefit_in_words,
            "; ".join(v.refusals),
        )
        for v in design.validated
        if v.reasons
    )
    return (
        [Table(("μ", "λ", "ζ", "benefit", "reasons"), rows, "Designs that were validated and rejected.")]
        if rows
        else []
    )


def records(design: Design, notes: Sequence[str]) -> list[Block]:
    """Return a table of the records of each group, and the notes on their files."""
    rows: list[tuple[Cell, ...]] = []
    groups = words.groups(design)
    for name, motions in groups.items():
        for f in (facts(m) for m in motions if isinstance(m, Record)):
            sizes = f["samples"], f["step_s"], f["duration_s"], f["pga_g"]
            noted = "; ".join(f["notes"]) or None
            rows.append((name, f["source"] or f["name"], f["earthquake"], *sizes, noted))
    head = ("group", "file", "earthquake", "samples", "step (s)", "length (s)", "PGA (g)", "notes")
    table = [Table(head, tuple(rows), "PGA as read, before any scale.")] if rows else []
    every = [m for motions in groups.values() for m in motions]
    listed = dict.fromkeys([*notes, *same_earthquakes(every)])
    return [*table, *([Listing(tuple(listed))] if listed else [])]
