"""Notes of a report: dangers such as overturning and wall contact, and other facts for the conclusions."""

from __future__ import annotations

import math
from collections.abc import Iterator, Mapping

import numpy as np

from tpd.answers.response import Response, window
from tpd.core.formatting import number, pair_of, percent
from tpd.design.as_built import Details
from tpd.design.design import Design
from tpd.design.harmonic import ExactMotions
from tpd.design.reasons import reduced
from tpd.limits import Clearance, limit_of
from tpd.report.blocks import Note, Severity, danger, note
from tpd.report.words import exceeding, finite_max, overturned_between
from tpd.scene.bob import Bob
from tpd.scene.scene import Block, Pendulum

LARGE_STROKE = 0.3
"""Swing (rad) above which a note warns: sin(psi) is 1.5 % below psi at 0.3 rad, and the difference grows with
the square of psi."""
_MANY = 1.5
"""Factor on the half width of a 95 % interval for a comparison at many frequencies: a dozen differences that
share no runs then all lie within their intervals with a probability of 96 %."""
SLOW = 0.95
"""Floquet multiplier above which the report notes that an orbit attracts slowly."""


def notes(design: Design, details: Details) -> tuple[Note, ...]:
    """Return all notes on a design, the dangers first, otherwise in the order of the generators below."""
    block, all_notes = design.scene.block, list[Note]()
    if float(block.velocity_ratio) == 1.0 and not block.friction:
        all_notes.append(
            note("The block loses no energy at all, unlike any real block. Give it a restitution.")
        )
    if design.sliding and design.sliding.slides:
        all_notes.append(danger(design.sliding.sentence))
    all_notes += [*_runs(design), *_failures(details), *_responses(details), *_earthquakes(design)]
    # Steady motions exist only under a harmonic.
    if design.pendulum and len(cases := design.exact_motions) == 2:
        _, exact = cases
        all_notes += [*_from_rest(design, *cases), *_settled(exact), *_orbits(design, *cases)]
        if limit_of(design.problem.limits, Clearance) is None:
            all_notes += _without_walls(design, exact, design.pendulum)
    return tuple(sorted(all_notes, key=lambda n: n.severity is not Severity.danger))


def _failures(details: Details) -> Iterator[Note]:
    """Yield a danger for each part whose failure makes the block overturn more often than no pendulum or, if
    a smaller tilt is required, makes its mean tilt larger."""
    for of in details.of("failure"):
        names = ["overturned", *(["mean tilt"] if of.measure == "tilt" else [])]
        if worse := [(name, x) for name in names if (x := of.runs.change(name)).low > 0.0]:
            name, x = worse[0]
            what = "MORE RUNS OVERTURN" if name == "overturned" else "THE MEAN TILT IS LARGER"
            shares = (percent(share, 1) for share in (x.with_pendulum, x.without_pendulum))
            yield danger(
                f"IF A PART FAILS ({of.words.upper()}), {what} THAN WITHOUT A PENDULUM: "
                "{} against {}. Maintain this part, and inspect it.".format(*shares)
            )


def _runs(design: Design) -> Iterator[Note]:
    """Yield notes on the validation runs: exceeded limits, no fewer overturnings, missing answers."""
    runs, best = design.runs, design.best
    if runs is None or best is None:
        return
    if design.pendulum is not None:
        # A job can allow wall contact in any share of the runs. This note compares with the usual share, so
        # that the reader learns of frequent wall contact even if the job allows it.
        usual = design.problem.usual_contacts
        if limit_of(design.problem.limits, Clearance) is not None and best.over_limit > usual:
            yield danger(f"{exceeding(best.over_limit, design.problem.allowed)}.")
        required = design.problem.requirements.at_least
        if best.reported_runs and best.deciding_runs and runs.reduction(best.measure)[0].mean < required:
            # Runs that took no part in the decision can miss the requirement by chance although the decision
            # was right.
            yield note(
                f"In the runs that were used to choose the pendulum, "
                f"{reduced(best.deciding_runs, best.measure)}. At least {percent(required)} is required. "
                "The report quotes independent runs, which show less."
            )
    if runs.undecided:
        yield note(
            f"{runs.undecided} of {len(runs.is_answered)} runs have no result (too many events) and are left "
            "out. A pendulum is recommended only if the verdict does not depend on their outcome."
        )


def _from_rest(design: Design, without_pendulum: ExactMotions, exact: ExactMotions) -> Iterator[Note]:
    """Yield a note if the block overturns from rest with the pendulum, one motion for each condition."""
    # There is one motion from rest for each condition, by the exact model.
    pendulum, without = (m.status == "overturned" for m in (exact, without_pendulum))
    worse, better = np.flatnonzero(pendulum & ~without), int(np.sum(without & ~pendulum))
    if pendulum.any():
        is_stated = (design.conditions.factor_rows() == 1.0).all(axis=1)
        stated = ", among them the stated one" if (pendulum & is_stated).any() else ""
        first = f" (first: {design.conditions.label(int(worse[0]))})" if worse.size else ""
        # A single motion close to overturning is chance, so only the counts of both cases are compared.
        yield (danger if worse.size and worse.size >= better else note)(
            f"In motions from rest by the linear model, the block OVERTURNS with the pendulum under "
            f"{pendulum.sum()} of {pendulum.size} conditions{stated}, and without it under {without.sum()}. "
            f"The pendulum causes overturning under {worse.size}{first}, and prevents it under {better}."
        )


def _without_walls(design: Design, exact: ExactMotions, pendulum: Pendulum) -> list[Note]:
    """Return at most one note, on the first motion in which the bob as a body would touch the walls.

    This check is needed only if the search had no limit on the clearance.
    """
    angles = {
        "in the settled motion": exact.settled_swing + exact.settled_tilt,
        "in the transient from rest": exact.tilt + exact.swing,
    }
    if not design.problem.rest_counts:
        # Then other initial states than rest count as well, and the orbits may be larger.
        nu = design.scene.block.slenderness * design.conditions.column("slenderness")
        orbits = exact.orbits.swing[0] + exact.orbits.tilt[0] * nu
        angles["in the settled motion"] = np.concatenate([angles["in the settled motion"], orbits])
    # An overturned motion has infinite angles. It is reported by another note.
    largest = {when: finite_max(x) for when, x in angles.items()}
    if design.rod_angle.size:
        largest["in half of the validation runs"] = float(np.median(design.rod_angle))
    return wall_contacts(design.scene.block, pendulum, largest)[:1]


def wall_contacts(block: Block, pendulum: Pendulum, angles: Mapping[str, float]) -> list[Note]:
    """Return a note for every angle at which a solid steel ball would touch the block's walls.

    Args:
        block: block with its cavity or frame.
        pendulum: equivalent point pendulum.
        angles: largest angles (rad) between rod and block, by a phrase that says in which motion they occur.
            The sum of the largest swing and the largest tilt is a safe value.
    """
    bob = Bob()
    wall, mass, length = 0.5 * block.clear_width, pendulum.mass, pendulum.length
    trial = np.linspace(0.0, 0.5 * math.pi, 1571)
    # The reach grows with the angle, so the last angle without contact is the limit.
    clear = trial[np.asarray(bob.reach(mass, length, trial)) <= wall]
    fits = f"up to an angle of {clear[-1]:.3g} rad" if clear.size else "at no angle"
    return [
        danger(
            f"{when[0].upper() + when[1:]} the bob, as {bob}, would reach {touched[0]} m from the block's "
            f"axis and TOUCH the walls, which are {touched[1]} m from it. The simulations do not include "
            f"wall contact. The bob stays clear of the walls {fits} between rod and block. A search without "
            "`--exactly` and `--no-walls` limits the clearance."
        )
        for when, angle in angles.items()
        if (reach := float(bob.reach(mass, length, angle))) > wall and (touched := pair_of(reach, wall, 3))
    ]


def _settled(exact: ExactMotions) -> Iterator[Note]:
    """Yield notes on the settled motion: other attractors, large swing, slow attraction."""
    n, rocks = exact.status.size, np.isin(exact.status, ("rocking", "sticking"))
    # A positive uplift margin means that a block at rest stays at rest.
    if count := int(np.sum(rocks & (exact.margin > 0.0))):
        where = f" under {count} of {n} conditions" if n > 1 else ""
        yield note(
            f"Rest is a stable state with this pendulum{where}, but the transient from rest leads to rocking."
        )
    if (swing := finite_max(exact.settled_swing)) > LARGE_STROKE:
        yield note(f"At a swing of {swing:.2f} rad the linear model of the pendulum is inaccurate.")
    if (multiplier := finite_max(exact.multiplier[rocks])) > SLOW:
        yield note(f"The settled motion attracts slowly (Floquet multiplier {multiplier:.3f}).")


def _orbits(design: Design, without_pendulum: ExactMotions, exact: ExactMotions) -> Iterator[Note]:
    """Yield notes on conditions under which the orbits of the search do not describe the whole motion."""
    if exact.value > without_pendulum.value:
        of = design.problem.objective_in_words
        yield note(f"The objective of the descents ({of}) is larger with this pendulum than without it.")
    e = exact.orbits
    if not design.problem.rest_counts and not np.all(e.attracts):
        under = f"Under {np.sum(~e.attracts)} of {e.attracts.size} conditions"
        yield note(f"{under} the search found no attracting symmetric orbit.")


def _earthquakes(design: Design) -> Iterator[Note]:
    """Yield notes on records without the name of their earthquake, and on designs of cross-fitting that
    differ."""
    # Records of one earthquake must be in the same group, which needs the name of the earthquake.
    nameless = sum(getattr(m, "event", None) == "" for m in design.conditions.motions)
    best, alike = design.best, design.equivalent
    if best is not None and best.crossed is not None and alike is not None and design.pendulum is not None:
        # Designs from other earthquakes that differ more than equally good designs are a sign of chance.
        masses, (low, high) = best.crossed.T[0], alike.T[0]
        if masses.min() < low or masses.max() > high:
            sizes = ", ".join(f"{number(x * design.scene.block.mass, 3)} kg" for x in masses)
            yield note(
                f"The groups of earthquakes lead to different pendulums ({sizes}), outside of the range that "
                "performs equally well. Choose the pendulum with care, or state more earthquakes."
            )
    if nameless and (len(design.problem.groups) > 1 or design.problem.crossed):
        yield note(
            f"{nameless} of the records name no earthquake and count as one. State their earthquakes by "
            "`records.events` (--event FILE=NAME)."
        )


def _responses(details: Details) -> Iterator[Note]:
    """Yield a danger on frequencies at which the block overturns more often with the pendulum."""
    if len(details.responses) < 2:
        return
    # The order is that of `tpd.details`.
    without_pendulum, pendulum = details.responses
    is_worse = overturns_more(without_pendulum, pendulum)
    if is_worse.any():
        excess = pendulum.overturning[0] - without_pendulum.overturning[0]
        # The note quotes the frequency with the largest increase.
        i = int(np.argmax(np.where(is_worse, excess, -1.0)))
        low, high = pendulum.frequency[is_worse][[0, -1]]
        where = f"Between {low:.3g} and {high:.3g} Hz" if high > low else f"At {low:.3g} Hz"
        shares = overturned_between(details.responses, *window(pendulum.frequency[i]))
        yield danger(
            f"{where} the block OVERTURNS more often with the pendulum ({shares}). Linear model, same "
            "base amplitude."
        )


def overturns_more(without_pendulum: Response, pendulum: Response) -> np.ndarray:
    """Return whether significantly more of the runs near each frequency overturn with the pendulum.

    The whole Newcombe interval of the difference of the two shares, widened for many frequencies, must lie
    above zero.
    """
    # For each case: the share, and the ends of its Wilson interval.
    (value, low, _), (other, _, high) = pendulum.overturning, without_pendulum.overturning
    return value - other > _MANY * np.hypot(value - low, high - other)
