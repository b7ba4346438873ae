"""Elasticities of the risk at a design in the quantities that conditions vary."""

from __future__ import annotations

import math

import numpy as np

from tpd.analysis.attractors import StartKind
from tpd.core.conditions import FACTORS, Conditions
from tpd.core.progress import Progress
from tpd.design.followed import Followed
from tpd.design.objective import AbstractObjective
from tpd.design.verified import Verified


def elasticities_of(
    objective: AbstractObjective, of: Verified, progress: Progress | None
) -> dict[str, float]:
    """d ln(value)/d ln(factor): by central differences of 0.1 %. For sampled starts from the exact
    derivatives, of the pendulum's three only, because a difference would be one of jumps of single starts
    between basins."""
    if isinstance(objective, Followed) and objective.starts.kind is StartKind.sampled:
        return _from_slopes(objective, of)
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


def _from_slopes(objective: Followed, of: Verified) -> dict[str, float]:
    """Elasticities in mass, length and damping ratio from the derivatives of the merits, weighted as the risk
    measure weights them; empty where a motion that counts has none."""
    e, n = of.evaluation, len(objective.conditions)
    left, weights = 1.0, np.zeros(n)
    for i in np.argsort(-e.merit[0], kind="stable"):
        weights[i] = min(objective.risk.cap(n), left)
        left -= weights[i]
    if np.any(np.broadcast_to(e.unsettled, e.kind.shape)[0][weights > 0.0]):
        return {}
    slopes = weights @ e.merit_slope[0]
    names = ("mass", "length", "damping")
    return {k: float(g * x / abs(of.value)) for k, g, x in zip(names, slopes, of.design, strict=True)}
