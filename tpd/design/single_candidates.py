"""Designs solved by both models, in order, and what the best of them is worth."""

from __future__ import annotations

import jax
import jax.numpy as jnp
import numpy as np

from tpd.closed_form.no_uplift import uplift
from tpd.core.parameters import Parameters
from tpd.core.progress import Progress
from tpd.core.status import SETTLED, status_name
from tpd.design.result import Candidate, DesignSpace, DesignStatus
from tpd.design.single_found import Found, bare_design, exact
from tpd.design.single_search import Evaluation, with_design
from tpd.models.base import AbstractModel


def candidates(
    p: Parameters,
    found: Found,
    space: DesignSpace,
    tolerance: float,
    model: AbstractModel,
    progress: Progress | None,
) -> list[Candidate]:
    """The bare block and every design found, solved by both models."""
    return solved(p, [bare_design(p), *found.designs(space.stroke)], found, tolerance, model, progress)


def solved(
    p: Parameters,
    designs: list[np.ndarray],
    found: Found,
    tolerance: float,
    model: AbstractModel,
    progress: Progress | None,
) -> list[Candidate]:
    """Designs solved by both models; the one searched with in batches of the size already compiled. After
    Ctrl-C those solved by then, if any."""
    batch = len(found.best)
    out: list[Candidate] = []
    try:
        for begin in range(0, len(designs), batch):
            part = designs[begin : begin + batch]
            padded = np.stack(part + [part[-1]] * (batch - len(part)))
            smoothed = None if found.evaluate is None else found.evaluate(jnp.asarray(padded))
            for i, design in enumerate(part):
                out.append(_candidate(p, design, smoothed, i, tolerance, model))
                if progress is not None:
                    progress("verifying", len(out), len(designs))
    except KeyboardInterrupt:
        if not out:
            raise
    return out


def _candidate(
    p: Parameters,
    design: np.ndarray,
    smoothed: Evaluation | None,
    i: int,
    tolerance: float,
    model: AbstractModel,
) -> Candidate:
    q = with_design(p, jnp.asarray(design))
    settled = exact(p, design)
    amplitude, name = float(settled.amplitude), status_name(settled.status)
    other, other_stroke, other_name = np.nan, np.nan, "not solved"
    if smoothed is not None:
        other, other_stroke = float(smoothed.amplitude[i]), float(smoothed.stroke[i])
        other_name = status_name(jax.tree.map(lambda x: x[i], smoothed.status))
    near = abs(amplitude - other) <= tolerance * max(amplitude, other) + float(model.resolution(q))
    both = {name, other_name} <= set(SETTLED)
    mu, lam, zeta = (float(x) for x in design)
    return Candidate(
        mass_ratio=mu,
        length_ratio=lam,
        damping_ratio=zeta,
        amplitude=amplitude,
        stroke=float(settled.stroke),
        status=name,
        periods=int(settled.periods),
        multiplier=float(settled.multiplier),
        margin=float(uplift(q).margin),
        smoothed_amplitude=other,
        smoothed_stroke=other_stroke,
        smoothed_status=other_name,
        agree=bool(both and near) or name == other_name == "overturned",
    )


def rank(candidates: list[Candidate], space: DesignSpace) -> tuple[Candidate | None, Candidate | None]:
    """The best and the second best candidate, the latter another design and not a neighbour."""
    feasible = [c for c in candidates if c.status in SETTLED and c.stroke <= space.stroke]
    feasible.sort(key=lambda c: (not c.agree, c.amplitude, -c.margin))
    if not feasible:
        return None, None
    low, high = space.bounds

    def place(c: Candidate) -> np.ndarray:
        x = np.array([c.mass_ratio, c.length_ratio, c.damping_ratio])[: low.size]
        return (x - low) / (high - low)

    best = feasible[0]
    others = [c for c in feasible[1:] if np.linalg.norm(place(c) - place(best)) > 0.02]
    return best, others[0] if others else None


def judge(winner: Candidate | None, bare: Candidate, tolerance: float) -> DesignStatus:
    """What the best design is worth by the linear equations."""
    if winner is None:
        return DesignStatus.none_feasible
    if not winner.amplitude < (1.0 - tolerance) * bare.amplitude:
        return DesignStatus.no_improvement
    return DesignStatus.found if winner.agree else DesignStatus.models_disagree
