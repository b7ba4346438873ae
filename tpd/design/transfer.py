"""Transfer of a recommended pendulum to the sets of records of FEMA P695 that its design did not use."""

from __future__ import annotations

import re
from dataclasses import replace
from typing import Any, NamedTuple

import numpy as np

from tpd.answers.paired import Change, PairedRuns
from tpd.answers.run_table import follow_scaled
from tpd.answers.transient import FREE
from tpd.core.progress import Progress, unreported
from tpd.design.problem import Problem
from tpd.records.sets import SETS, fema_p695
from tpd.scene.ground_motion import earthquakes_of, events_of
from tpd.scene.scene import Pendulum
from tpd.theory.equations import Terms

LEVELS = (1.5, 2.0, 3.0, 4.0)
"""Peak accelerations of the records over the acceleration that lifts the block."""
_OF_SET = re.compile(r"RSN\d+/.* \d{4}/")
"""Beginning of the name of a record of `fema_p695`."""


class Transfer(NamedTuple):
    """Records of another set under which the stated block overturns, with and without the pendulum."""

    name: str
    """Name of the set, out of `tpd.records.sets.SETS`."""
    overturned: tuple[Change, ...]
    """Shares that overturn at each of `LEVELS`, which is the name, with the interval of their difference over
    earthquakes."""
    motions: int
    """Number of records."""
    earthquakes: int
    """Number of earthquakes of these records."""
    common: int
    """Number of these earthquakes of which the design used other records."""


def transfer_of(
    problem: Problem, pendulum: Pendulum, progress: Progress = unreported
) -> tuple[Transfer, ...] | str:
    """Follow the block under the sets of FEMA P695 of which a problem has no record, by the nonlinear
    equations.

    The result is empty if the problem has no record of a set of FEMA P695. It is a sentence if the records
    are not installed.
    """
    motions = [motion for group in problem.groups for motion in group.motions]
    used = {name for motion in motions if _OF_SET.match(name := getattr(motion, "name", ""))}
    if not used:
        return ()
    try:
        sets = {name: fema_p695(name) for name in SETS}
    except ImportError as error:
        return f"The effect of the pendulum under the other sets is unknown: {error}."
    out, block, gravity = list[Transfer](), problem.scene.block, float(problem.scene.gravity)
    lifts = problem.at_rest.uplift * gravity
    for name, records in sets.items():
        # A design does not transfer to records that it used itself.
        if not used.isdisjoint(record.name for record in records):
            continue
        progress(f"records of {name}", len(out), len(sets))
        # The stated block without scatter, as in a fragility.
        factors = np.outer([lifts / float(record.pga) for record in records], LEVELS)
        how: dict[str, Any] = {"gravity": gravity, "free": FREE, "equations": Terms.nonlinear, "brief": True}
        runs = follow_scaled(block, [pendulum, None], records, factors, **how)
        one, other = (runs.of(np.array(i)).reshape(-1) for i in range(2))
        # The levels of a record are neighbours.
        level, quakes = (x.ravel() for x in np.meshgrid(LEVELS, earthquakes_of(records)))
        pairs = PairedRuns(with_pendulum=one, without_pendulum=other, group=level, labels=(), cluster=quakes)
        at_level = (replace(pairs, counted=level == x).change("overturned") for x in LEVELS)
        shares = tuple(x._replace(name=f"{at:g}") for at, x in zip(LEVELS, at_level, strict=True))
        # Other stations of an earthquake that the design used are not independent of it.
        events = events_of([*motions, *records])
        own, common = set(events[len(motions) :]), set(events[: len(motions)])
        out.append(Transfer(name, shares, len(records), len(own), len(own & common)))
    return tuple(out)
