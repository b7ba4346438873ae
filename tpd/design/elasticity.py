"""Elasticities of the risk at a design in the quantities that conditions vary."""

from __future__ import annotations

import math

import numpy as np

from tpd.core.conditions import FACTORS, Conditions
from tpd.core.progress import Progress
from tpd.design.objective import Orbits
from tpd.design.verified import Verified


def elasticities_of(objective: Orbits, of: Verified, progress: Progress | None) -> dict[str, float]:
    """d ln(value)/d ln(factor): by central differences of 0.1 %."""
    step, out, e = 1e-3, {}, objective.p.e
    # Above 1 there is no restitution, so that a difference to both sides needs room.
    varies = e is not None and float(e) * (1.0 + step) <= 1.0
    names = [x for x in FACTORS if x != "restitution" or varies]
    for i, name in enumerate(names):
        if progress is not None:
            progress("elasticities", i + 1, len(names))
        sides = []
        for factor in (1.0 - step, 1.0 + step):
            changed = objective.over(objective.conditions * Conditions({name: np.array([factor])}))
            sides.append(float(changed.value(changed.evaluate(of.design[None]))[0]))
        out[name] = (sides[1] - sides[0]) / (2.0 * step * abs(of.value)) if of.value else math.nan
    return out
