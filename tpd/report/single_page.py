"""The page of one design: what a report says, for people to look at, warnings first."""

from __future__ import annotations

import math
import shlex
from dataclasses import dataclass
from pathlib import Path

from tpd.analysis.compare_models import Check
from tpd.analysis.ensemble import Outcomes, Verdict
from tpd.analysis.response import Response
from tpd.analysis.sensitivity import Elasticities
from tpd.core import files
from tpd.core.formatting import number
from tpd.design.job import Job, dump
from tpd.design.result import Candidate, Design
from tpd.report.html import Section, beside, code, figure, listing, page, paragraph, table
from tpd.report.notes import losses, notes, toppling

_DANGER = "DANGER"
_MEANING = {
    "mu": ("mass ratio, bob over block", "μ"),
    "lam": ("length ratio, pendulum over half height", "λ"),
    "zeta": ("damping ratio of the hinge", "ζ"),
    "k": ("friction of the contact", "k"),
    "f": ("base acceleration over g", "f"),
    "xi": ("frequency ratio", "ξ"),
    "nu": ("slenderness, width over height", "ν"),
}


@dataclass(frozen=True)
class Told:
    """All that the page of a design is made of."""

    design: Design
    job: Job
    responses: tuple[Response, ...]
    pictures: dict[str, bytes]
    """By their file names; one that is missing is left out."""
    sensitive: Elasticities
    directory: Path
    """Where the report lies."""
    ladder: Check | None = None


def design_page(told: Told) -> str:
    """The page, complete and by itself."""
    sections = [
        _warnings(told),
        _answer(told.design),
        _shape(told),
        None if told.design.verdict is None else ensemble_section(told.design.verdict),
        _response(told),
        _motion(told),
        _landscape(told),
        _models(told),
        _rounds(told.design),
        elasticity_section(told.sensitive, bare=told.design.pendulum is None),
        _assumed(told.job),
        _repeat(told),
    ]
    block = told.design.scene.block
    title = f"Pendulum for a block of {number(block.width)} m × {number(block.height)} m"
    return page(title, [s for s in sections if s is not None])


def _warnings(told: Told) -> Section:
    said = notes(told.design, told.responses)
    if told.design.verdict is not None and told.design.verdict.harms:
        said.insert(0, f"{_DANGER}: in the ensemble {_more(told.design.verdict)}")
    dangers = [note for note in said if note.startswith(_DANGER)]
    others = [note[0].upper() + note[1:] for note in said if not note.startswith(_DANGER)]
    sound = told.design.status.is_sound
    parts = [
        paragraph(told.design.status.value, "verdict" if sound else "danger"),
        *(paragraph(d, "danger") for d in dangers),
    ]
    return Section("Before anything else", "\n".join([*parts, listing(others)]))


def _answer(design: Design) -> Section:
    pendulum, winner = design.pendulum, design.winner
    bare = ("rocking amplitude without pendulum", _angle(design.amplitude_without), None)
    if pendulum is None or winner is None:
        return Section("The answer", table(("", "value"), [("pendulum", "none to offer"), bare[:2]]))
    topples, limit = toppling(design, winner.mass_ratio), design.space.stroke
    hinge = pendulum.hinge_damping(design.scene.gravity)
    rows = [
        ("mass of the bob", f"{number(pendulum.mass)} kg", f"μ = {number(winner.mass_ratio)}"),
        ("length of the pendulum", f"{number(pendulum.length)} m", f"λ = {number(winner.length_ratio)}"),
        ("damping of the hinge", f"{number(hinge)} N m s/rad", f"ζ = {number(pendulum.damping_ratio)}"),
        (
            "rocking amplitude with it",
            _angle(design.amplitude),
            f"{design.amplitude / topples:.1%} of toppling",
        ),
        bare,
        ("stroke of the bob, settled", _angle(design.stroke), f"{design.stroke / limit:.0%} of the limit"),
        ("largest tilt in 24 periods", _angle(design.peak[0]), f"{design.peak[0] / topples:.0%} of toppling"),
        ("largest bob angle in 24 periods", _angle(design.peak[1]), None),
        ("uplift margin, settled", f"{winner.margin:.1%}", "of the moment that lifts"),
    ]
    caption = (
        "Angles are from the vertical. Toppling: the tilt at which the block falls of itself. "
        f"The stroke limit is {number(limit)} rad."
    )
    return Section("The answer", table(("", "value", "relative"), rows, caption=caption))


def _shape(told: Told) -> Section:
    hung = told.design.pendulum is not None
    pendulum = " with the pendulum hung from the middle of its top" if hung else " without a pendulum"
    stroke = " Dashed: where the bob swings once settled." if hung else ""
    still = _picture(
        told,
        "drawing.png",
        f"The block on its base{pendulum}, to scale, with dimensions",
        f"To scale, dimensions in SI units.{stroke}",
    )
    both = "left without the pendulum, right with it" if hung else "without a pendulum"
    film = _picture(
        told,
        "animation.gif",
        f"Animation of the block on its moving base, {both}",
        f"The first seconds from rest by the exact solution of the linear equations: {both}.",
    )
    return Section("The block and its motion", beside(still, film))


def _response(told: Told) -> Section | None:
    if "response.png" not in told.pictures:
        return None
    motion = told.design.scene.motion
    return Section(
        "Over frequency",
        _picture(
            told,
            "response.png",
            "Settled rocking amplitude against frequency, of the bare block (squares) and with the pendulum",
            f"What the block settles into from rest at the same base amplitude, {number(motion.amplitude)} "
            "m. Crosses near the top: it overturns. The dashed line is the design's frequency, "
            f"{number(motion.frequency)} Hz; the pendulum was chosen for that one only.",
        ),
    )


def _motion(told: Told) -> Section:
    return Section(
        "Over time",
        _picture(
            told,
            "motion.png",
            "Tilt of the block without and with the pendulum, and angle of the bob, against time from rest",
            "The first 24 periods from rest: the exact solution, broad, and the smoothed model of the "
            "search, dashed. Where they part, the motion hangs on details. The stroke limit (dotted) is one "
            "on the settled motion: on the way there the bob may pass it.",
        ),
    )


def _landscape(told: Told) -> Section:
    counts = [f"{told.design.starts.count(s)} {s.value}" for s in dict.fromkeys(told.design.starts)]
    words = f"Searched from {len(told.design.starts)} starts, of which: {'; '.join(counts)}."
    picture = _picture(
        told,
        "search.png",
        "Mass ratio against length ratio: designs screened, search paths, and the answer",
        "Every design tried. Shaded: a block at rest stays at rest. Triangles break the stroke limit, "
        "crosses overturn the block or do not settle; lines are the searches from their starts.",
    )
    return Section("Where it was looked for", paragraph(words) + "\n" + picture)


def _models(told: Told) -> Section:
    design = told.design
    best = "best design" if design.pendulum is not None else "best found, not offered"
    named = ((best, design.winner), ("runner-up", design.runner_up), ("bare block", design.bare))
    head = (
        "",
        "exact (rad)",
        f"{design.searched_with} (rad)",
        "difference",
        "stroke (rad)",
        "multiplier",
        "settles as",
    )
    parts = [
        table(
            head,
            [_candidate(name, c) for name, c in named if c is not None],
            caption="Settled rocking amplitudes by the linear equations, solved in two ways that share "
            "nothing; the largest Floquet multiplier is below 1 where the motion attracts.",
        )
    ]
    if told.ladder is not None:
        parts += [ladder_table(told.ladder), *(paragraph(x, "danger") for x in told.ladder.objections)]
    return Section("What the models say", "\n".join(parts))


def _candidate(name: str, c: Candidate) -> tuple[object, ...]:
    settles = c.status if c.periods == 1 else f"{c.status}, period {c.periods}"
    agree = "" if c.agree or c.smoothed_status == "not solved" else ", MODELS DISAGREE"
    difference = f"{c.difference:.2%}" if math.isfinite(c.difference) else None
    stroke = c.stroke if c.mass_ratio > 0.0 else None
    return (name, c.amplitude, c.smoothed_amplitude, difference, stroke, c.multiplier, settles + agree)


def ladder_table(ladder: Check) -> str:
    """A design by all models that were asked."""
    rows = [
        (r.name, r.amplitude, r.stroke, r.status, round(r.seconds * 1e3, 1), r.neglects) for r in ladder.rungs
    ]
    head = ("model", "amplitude (rad)", "stroke (rad)", "status", "time (ms)", "neglects")
    caption = "The same design from rest by every model, the cheapest first; the last one judges."
    return table(head, rows, caption=caption)


def _rounds(design: Design) -> Section | None:
    if not design.rounds:
        return None
    head = (
        "round",
        "μ",
        "λ",
        "ζ",
        "searched under (rad)",
        "amplitude (rad)",
        "stroke (rad)",
        "status",
        "verdict",
    )
    rows = [
        (
            str(i + 1),
            r.mass_ratio,
            r.length_ratio,
            r.damping_ratio,
            r.limit,
            r.amplitude,
            r.stroke,
            r.status,
            "refused: " + "; ".join(r.objections) if r.objections else "nothing against it",
        )
        for i, r in enumerate(design.rounds)
    ]
    caption = (
        "The best design of the linear equations, put to the nonlinear ones (the amplitudes and strokes "
        "here); where it is refused the search goes on under a corrected stroke limit."
    )
    return Section("Put to the nonlinear equations", table(head, rows, caption=caption))


def elasticity_section(told: Elasticities, *, bare: bool = False) -> Section:
    """What a design, or the bare block, is sensitive to, the strongest first."""
    title = "What the bare block is sensitive to" if bare else "What it is sensitive to"
    if not told.slopes:
        return Section(title, paragraph(f"There is no gradient to tell: {told.refused}."))
    amplitude = told.of == "amplitude"
    words = (
        "Change of the settled rocking amplitude, in per cent, for one per cent more of each parameter."
        if amplitude
        else "The block rests, so its amplitude is zero and flat. Told is the uplift margin instead, of "
        f"which {told.value:.2%} is left: its change, in points of per cent, for one per cent more of each "
        "parameter. Where that eats up what is left, the block lifts."
    )
    head = ("parameter", "", "value", "% for 1 %" if amplitude else "points for 1 %")
    order = sorted(told.slopes, key=lambda name: -abs(told.slopes[name]))
    scale = 1.0 if amplitude else 100.0
    rows = [(*_MEANING[name], told.at[name], f"{scale * told.slopes[name]:+.3g}") for name in order]
    caption = "From the exact gradient at the design; small changes only, and no other motion met on the way."
    return Section(title, paragraph(words) + "\n" + table(head, rows, caption=caption))


def ensemble_section(verdict: Verdict) -> Section:
    """Many runs instead of one, with the pendulum and without."""
    pair = (verdict.hung, verdict.bare)
    rows: list[tuple[object, ...]] = [("overturned", *(str(o.overturned) for o in pair))]
    for ramp in verdict.hung.by_ramp():
        name = "— of sudden starts" if ramp == 0.0 else f"— growing for {ramp:g} s"
        rows.append((name, *(f"{o.by_ramp()[ramp].value:.1%}" for o in pair)))
    rows.append(("at rest in the end", *(str(o.at_rest) for o in pair)))
    for name, of in (("largest tilt", "peak"), ("settled tilt", "amplitude")):
        rows.append((f"{name}: 50, 90, 99 % of the runs (rad)", *(_quantiles(o, of) for o in pair)))
    rows.append(("bob's largest angle: 50, 90, 99 % (rad)", _quantiles(verdict.hung, "peak_stroke"), None))
    runs = verdict.hung.ensemble
    caption = (
        f"{runs.size} runs, seed {runs.seed}: starts, phases, how the shaking grows, and what is uncertain "
        "are scattered alike for both. In brackets: 95 % confidence."
    )
    words = paragraph(_more(verdict).capitalize())
    return Section(
        "Over many runs", words + "\n" + table(("", "with pendulum", "without"), rows, caption=caption)
    )


def _more(verdict: Verdict) -> str:
    return (
        f"{verdict.worse} runs overturn with the pendulum only, and {verdict.better} without it only "
        f"(chance of that or more, were both alike: {verdict.chance:.2g})."
    )


def _quantiles(o: Outcomes, of: str) -> str:
    return ", ".join(number(x) if math.isfinite(x) else "overturned" for x in o.quantiles(of))


def _assumed(job: Job) -> Section:
    scene = job.scene
    block, motion = scene.block, scene.motion
    own = block.radius_of_gyration
    inertia = "uniform rectangle" if own is None else f"radius of gyration {number(own)} m about the centroid"
    return Section(
        "What was assumed",
        listing(
            [
                f"A rigid block ({inertia}) that rocks about its two lower edges: it neither slides nor "
                "bounces.",
                f"What takes its energy: {losses(block)} (friction as a moment over M g b, e the ratio of "
                "the tilting rates after and before an impact on the base).",
                "A point bob on a massless rod from the middle of the top, with a viscous hinge.",
                f"A harmonic motion of the base, {number(motion.amplitude)} m · sin(2π · "
                f"{number(motion.frequency)} Hz · t), horizontal and in the plane; g = "
                f"{number(scene.gravity)} m/s².",
                "A start at rest at t = 0, where the motion is switched on suddenly.",
                "The linear equations (25) of Collini et al. (2016), their misprints corrected, solved "
                "exactly; the nonlinear ones (4) were asked of the design itself, nowhere else.",
                f"A limit of {number(job.space.stroke)} rad on the stroke of the settled motion.",
            ]
        ),
    )


def _repeat(told: Told) -> Section:
    scene = told.directory / "scene.toml"
    again = told.directory.with_name(told.directory.name + "-again")
    command = f"tpd optimise --scene {shlex.quote(str(scene))} --out {shlex.quote(str(again))}"
    parts = [
        code(command),
        paragraph(f"Seed {told.design.seed}. scene.toml, which lies beside this page, holds:"),
        code(dump(told.job)),
        paragraph("Made with " + ", ".join(f"{name} {v}" for name, v in files.versions().items()) + "."),
        paragraph("design.json holds design, search, rounds, responses and elasticities in full."),
    ]
    return Section("How to repeat it", "\n".join(parts))


def _picture(told: Told, name: str, alt: str, caption: str) -> str:
    image = told.pictures.get(name)
    return "" if image is None else figure(image, alt=alt, caption=caption)


def _angle(x: float) -> str:
    if not math.isfinite(x):
        return "overturns"
    return f"{number(x)} rad ({number(math.degrees(x), 3)}°)"
