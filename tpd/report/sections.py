"""Sections of a report: validation runs, variations, limits, motions, search and records."""

from __future__ import annotations

import math
from collections import Counter
from collections.abc import Callable, Sequence
from dataclasses import astuple, replace

import numpy as np

from tpd.answers.paired import PairedRuns
from tpd.answers.run_table import Runs
from tpd.core.formatting import interval, number, pair_of, percent, unanswered
from tpd.design.as_built import Build, Details
from tpd.design.design import Design
from tpd.design.reasons import reduced
from tpd.design.sizes import MOTION_KINDS
from tpd.design.trials import Trials
from tpd.limits import LABELS, MEASURED, STILL, Clearance
from tpd.records.read import same_earthquakes
from tpd.report import words
from tpd.report.blocks import Block, Cell, Listing, Table, Text

_ROWS, _MOST = 40, 8
"""Largest number of conditions in a table, chosen evenly from all; largest number of rows on limits."""
_SOUND = "The reduction remains significant in all variations of the linear runs."


def sections(
    design: Design, details: Details, picture: Callable[[str], Sequence[Block]]
) -> dict[str, list[Block]]:
    """Return the blocks of each section by its title, in the order of the report.

    A section without blocks is an empty list, which `content` leaves out.

    Args:
        design: the answer of `optimise`.
        details: further results that the report shows, from `tpd.details`.
        picture: function that returns a list with the figure of a file, or an empty list.
    """
    return {
        "Validation runs": over_runs(design),
        "Depends on": depends_on(design, details),
        "What limits the design": limiting(design, details.build),
        "Nearby frequencies": [*picture("response.svg")],
        "Motion from rest": [*picture("motion.svg"), *picture("animation.gif")],
        "Settled motion": settled(design),
        "Appendix: search": searched(design, picture("search.png")),
        "Appendix: rejected designs": rejected(design),
        "Appendix: records": records(design),
    }


def over_runs(design: Design) -> list[Block]:
    """Return results of the validation runs of the best design, over all runs and for each condition."""
    runs = design.runs
    if runs is None:
        return []
    cases = runs.with_pendulum, runs.without_pendulum
    rows: list[tuple[Cell, ...]] = []
    # All rows of the table have the same runs, also those of the search records.
    worst = replace(runs, counted=None).change("worst tilt")
    shares = (percent(x, 1) for x in (worst.with_pendulum, worst.without_pendulum))
    rows.append(("mean tilt of the 10 % of the runs with the largest tilt (of ν)", *shares))
    # All ground motions begin at rest, and grow as recorded.
    if runs.cluster is None:
        by_case = [o.share_by_start() for o in cases]
        rows += [(f"overturned, {start}", *(str(by[start]) for by in by_case)) for start in by_case[0]]
    for name, of_level in design.problem.levels.items():
        shares = (str(o.of(of_level).share_overturned) for o in cases)
        rows.append((f"overturned, {name}", *shares))
    rows.append(("overturned, all runs", *(str(o.share_overturned) for o in cases)))
    rows.append(("at rest at the end", *(str(o.share_at_rest) for o in cases)))
    for name, quantity in (("largest tilt", "tilt"), ("settled tilt", "settled_tilt")):
        rows.append((f"{name} (rad): 50, 90, 99 % quantiles", *(_quantiles(o, quantity) for o in cases)))
    # The bob angle without a pendulum has no meaning.
    rows.append(("largest bob angle (rad): 50, 90, 99 % quantiles", _quantiles(cases[0], "swing"), None))
    # The benefit counts the motions that were not used for the design. This table has all runs.
    described = (
        runs.description if runs.counted is None else f"All {len(runs.is_answered)} runs of all groups"
    )
    caption = (
        f"{described}.{_role(design)} Scatter: {design.problem.scatter_in_words()}. In brackets: 95 % "
        "interval. ν is the slenderness, the tangent of the toppling angle; overturned runs count as 100 % "
        "of ν."
    )
    table = Table(("", "with pendulum", "without pendulum"), tuple(rows), caption)
    # The summary has the rates, and this section also what they depend on.
    yearly = [Text(f"{text}.") for text in design.problem.yearly(runs.annual_rates)]
    return [table, Text(runs.overturning_in_words), *yearly, *_by_part(runs)]


def _quantiles(runs: Runs, angle: str) -> str:
    return ", ".join("overturned" if math.isinf(x) else number(x, 3) for x in runs.quantiles(angle))


def _role(design: Design) -> str:
    """Return sentences that tell these runs from the runs that decided; empty if all runs are the same."""
    best = design.best
    if best is None or best.reported_runs is None or best.deciding_runs is None:
        return ""
    if best.reported_runs is best.deciding_runs:
        return " The same runs decided whether the pendulum is recommended."
    n = len(design.validated) - 1
    before = f" {n} {'design was' if n == 1 else 'designs were'} rejected before." if n else ""
    decided = reduced(best.deciding_runs, best.measure)
    counts = "were not used to choose the design, and their reduction counts"
    return f" These runs {counts}.{before} In the runs that were used, {decided}."


def _by_part(runs: PairedRuns) -> list[Block]:
    """Return the mean tilt for each condition or group of motions, and for each kind of start.

    The list is empty if there is only one part.
    """
    # A table of more than 32 conditions is too long. The kinds of start, which come last, always remain.
    parts = runs.parts if len(runs.labels) <= 32 else runs.parts[len(runs.labels) :]
    rows = tuple(
        (p.label, *map(percent, (p.with_pendulum, p.without_pendulum)), "yes" if p.is_worse else "no")
        for p in parts
        if not math.isnan(p.with_pendulum)
    )
    # A single row would repeat the table of all runs.
    if len(rows) < 2:
        return []
    caption = (
        "Mean tilt of the same runs in per cent of ν. Significantly worse: higher with the pendulum by more "
        f"than {percent(runs.worse)}, at the 5 % significance level."
    )
    head = "condition or kind of start", "with pendulum", "without pendulum", "significantly worse"
    return [Table(head, rows, caption)]


def depends_on(design: Design, details: Details) -> list[Block]:
    """Return the table of all variations of the design, and the variations that make the benefit
    insignificant."""
    if not details.variations:
        return []
    rows = list[tuple[Cell, ...]]()
    for of in details.variations:
        # Each row has both cases, because a difference alone hides how much remains.
        changes = (of.runs.change(name) for name in ("overturned", "mean tilt"))
        shares = (f"{percent(x.with_pendulum, 1)} / {percent(x.without_pendulum, 1)}" for x in changes)
        points = of.difference and words.points(*astuple(of.difference))
        rows.append((of.words, *shares, points))
    about, text, reduction = "", list[Block](), "difference of the reduction"
    if stated := details.of("stated"):
        runs, measure = stated[0].runs, stated[0].measure
        reduction, gain = f"reduction of the {MEASURED[measure]}, minus as stated", runs.reduction(measure)[0]
        about = (
            f"{runs.description}: the stated reduction is {interval(gain.mean, gain.low, gain.high)}. "
            "These runs only compare cases: the reduction that counts is the one in the verdict. Other sets "
            "of records: nonlinear model, no scatter, no stated case. "
            f"Tolerances in the validation runs: {design.problem.scatter_in_words()}. Build it describes how "
            "to measure the quantities; ν follows from bearing width and height of the centroid. Worn edges "
            "or a soft bearing leave a part of the base, 70 to 91 % in tests of four wooden blocks: state a "
            "known share as `effective_width`. "
        )
        if details.equivalent_widening:
            about += (
                f"The pendulum has the same effect as a block {words.wider(details.equivalent_widening)}. "
            )
        # A wider base is no risk of the pendulum, and other records have no stated reduction.
        kinds = {"stated", "quantity", "losses", "width", "hinge"}
        weak = "; ".join(of.words for of in details.of(*kinds) if not of.runs.reduction(measure)[1])
        text = [Text(f"The reduction is not significant in these linear runs: {weak}." if weak else _SOUND)]
    caption = (
        f"{about}Hinge stuck and damper lost: validation runs, with the failed part / without a pendulum. "
        "Wider bases: validation runs, of the whole block on a wider base without a pendulum / as "
        "stated, with the same height, depth and density; the difference is from the pendulum."
    )
    shares = (f"{x}, with / without" for x in ("overturned", "mean tilt (of ν)"))
    return [Table(("varied", *shares, reduction), tuple(rows), caption), *text]


def limiting(design: Design, build: Build | None = None) -> list[Block]:
    """Return which limits exclude better designs, and the best design without each of these limits."""
    trials, used = design.trials, _utilisation(design, build)
    if trials is None:
        return used
    # A ratio above 1 exceeds the limit, and an unknown one does not keep it.
    counts = {n: int(np.sum(~(x <= 1.0))) for n, x in zip(trials.names, trials.sizes.T, strict=True)}
    over = ", ".join(f"{LABELS.get(name, name)} {n}" for name, n in counts.items() if n)
    text = f"{int(trials.feasible.sum())} of {len(trials.designs)} designs with trial runs keep all limits."
    text += f" Number of designs that exceed each limit, or for which it is unknown: {over}." if over else ""
    # `best_without` ignores the limits that are its arguments.
    best = trials.best_without()
    rows = [_row(design, trials, "all limits", best)]
    for name in (name for name, n in counts.items() if n):
        other = trials.best_without(name)
        # A row equal to the first would hide the rows that differ.
        if other != best:
            rows.append(_row(design, trials, f"without the limit on {LABELS.get(name, name)}", other))
    head = ("", "mass (kg)", "length (m)", "damping ratio ζ", "mean tilt (of ν)")
    others = "Other rows: best design without that limit."
    if len(rows) == 1:
        others = "No design that exceeds only one limit is better."
    caption = (
        f"First row: best design of the trial runs that keeps all limits. {others} Mean tilts are estimates "
        "from a trend over all designs. Without a pendulum the mean tilt is "
        f"{percent(trials.without_pendulum, 1)} of ν."
    )
    return [*used, Text(text), Table(head, tuple(rows[:_MOST]), caption)]


def _utilisation(design: Design, build: Build | None) -> list[Block]:
    """Return a table of the limits with the utilisation by the best design."""
    shares = {name: x for name, x in design.usage.items() if not math.isnan(x)}
    limits = {of.name: of for of in design.problem.limits}
    rows = tuple(
        (
            LABELS.get(name, name),
            words.limit(limits[name]) if name in limits else words.limit_of_size(name, design, build),
            _concerns(name, design),
            pair_of(shares[name], 1.0, 0, percent)[0] if name in shares else None,
        )
        for name in {**limits, **shares}
    )
    # A rejected design shows by its utilisations which limit it exceeds.
    which = "recommended pendulum" if design.pendulum else "nearest design"
    caption = (
        f"Utilisation: quantity of the {which} divided by its limit, in {words.kept(design)}. For the "
        "reserve, a lower bound, it is the limit divided by the quantity. At 100 % the limit is reached."
    )
    return [Table(("quantity", "limit", "concerns", "utilisation"), rows, caption)] if shares else []


def _concerns(name: str, design: Design) -> str:
    """Return which motions a limited quantity is taken from. Mass and size of the body have no motion."""
    if name in STILL:
        return "bob as built"
    # The bob must not touch the walls during the transient either. Runs under ground motions do not settle.
    if name == Clearance.name or design.problem.has_earthquakes:
        return "each whole run"
    limit = next(of for of in design.problem.limits if of.name == name)
    return f"settled motion of each {'run' if limit.of_motion else 'condition'}"


def _row(design: Design, trials: Trials, name: str, i: int | None) -> tuple[Cell, ...]:
    """Return a row of the table on limits for the i-th trial design; None for no design."""
    if i is None:
        return (name, *(None,) * 3, "no design")
    pendulum, tilt = design.problem.pendulum(trials.designs[i]), percent(trials.trend[i], 1)
    return (name, float(pendulum.mass), float(pendulum.length), float(pendulum.damping_ratio), tilt)


def settled(design: Design) -> list[Block]:
    """Return the exact settled motion under each condition; an empty list under ground motions."""
    motions, n = design.exact_motions, len(design.conditions)
    if not motions:
        return []
    cases = list(zip(("without", "with"), motions, strict=False))
    rows = [(f"largest tilt {case} pendulum", words.settled_tilt(design, of)) for case, of in cases]
    name = f"{design.problem.objective_in_words} ({design.problem.risk.name})"
    rows += [(f"{name}, {case} pendulum", number(of.value, 3)) for case, of in cases]
    if design.pendulum is not None:
        rows.append(("largest bob angle", words.angle(design.swing)))
    source = "Tilts: largest attracting symmetric orbit, over all initial states"
    if design.problem.rest_counts:
        source = "Tilts: zero where the block can rest, else those of the largest attracting symmetric orbit"
    caption = f"{source}. Linear model."
    out: list[Block] = [Table(("", "value"), tuple(rows), caption)]
    # A table with one condition would repeat the table above.
    if n == 1:
        return out
    cells: list[tuple[Cell, ...]] = []
    # The orbits have tilts in units of the slenderness, which a condition may vary.
    nu = design.scene.block.slenderness * design.conditions.column("slenderness")
    # With more conditions than rows, the rows are spread evenly over all conditions.
    for i in map(int, np.unique(np.linspace(0, n - 1, min(n, _ROWS)).astype(int))):
        row: list[Cell] = [design.conditions.label(i)]
        for of in motions:
            tilt, kind = float(of.orbits.tilt[0, i] * nu[i]), MOTION_KINDS[int(of.orbits.kind[0, i])]
            row += [tilt if math.isfinite(tilt) else None, kind.replace("_", " ")]
            row.append(str(of.status[i]).replace("_", " "))
        cells.append((*row, *(float(of.orbits.swing[0, i]) for of in motions[1:])))
    columns = "tilt (rad)", "orbit", "from rest"
    head = ("condition", *(f"without: {name}" for name in columns))
    if motions[1:]:
        head += (*(f"with: {name}" for name in columns), "with: bob angle (rad)")
    caption = "Tilt, orbit and bob angle: attracting orbit. From rest: outcome of one run. Linear model."
    if motions[1:] and design.pendulum is None:
        caption += " This design came nearest and is not recommended."
    return [*out, Table(head, tuple(cells), caption)]


def searched(design: Design, figure: Sequence[Block]) -> list[Block]:
    """Return a text on the search, with its picture."""
    trials, search = design.trials, design.search
    if trials is None:
        return []
    # Under ground motions there is no gradient to follow.
    text = f"Trial runs of the linear model evaluated {len(trials.designs)} designs."
    if search is not None:
        ends = "; ".join(f"{n} {what}" for what, n in Counter(s.value for s in search.statuses).items())
        text = (
            f"Descents by the gradient minimised {design.problem.objective_in_words} of the steady motion. "
            f"They started from {search.description} (seed {design.seed}) and evaluated {search.evaluations} "
            f"designs: {ends}. Runs then corrected the limits {len(search.corrected) - 1} times, and the "
            "descents continued from there (numbers in the picture)."
        )
    return [*figure, Text(text + unanswered(int(trials.undecided.sum())))]


def rejected(design: Design) -> list[Block]:
    """Return a table of the designs that did not pass the validation, with the reasons."""
    rows = tuple(
        (*map(float, v.design), v.runs and v.runs.benefit_in_words, "; ".join(v.refusals))
        for v in design.validated
        if v.reasons
    )
    head = ("mass ratio μ", "length ratio λ", "damping ratio ζ", "benefit", "reasons")
    return [Table(head, rows, "Designs that did not pass the validation.")] if rows else []


def records(design: Design) -> list[Block]:
    """Return a table of the records in each group of motions, and the notes on their files."""
    rows: list[tuple[Cell, ...]] = []
    for name, f in words.records(design):
        sizes = f["samples"], f["step_s"], f["duration_s"], f["pga_g"]
        rows.append((name, f["source"] or f["name"], f["earthquake"], *sizes, "; ".join(f["notes"]) or None))
    head = ("group", "file", "earthquake", "samples", "time step (s)", "duration (s)", "PGA (g)", "notes")
    caption = "PGA: largest acceleration in the file, before scaling."
    table = [Table(head, tuple(rows), caption)] if rows else []
    # The same earthquake can have different names in two files. The user has to check such
    # records.
    every = [m for group in design.problem.groups for m in group.motions]
    notes = design.problem.job.file_notes if design.problem.job else ()
    listed = dict.fromkeys([*notes, *same_earthquakes(every)])
    return [*table, *([Listing(tuple(listed))] if listed else [])]
