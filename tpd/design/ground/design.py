"""Pendulum for a block under ground motions: the answer of the search and of its judgement."""

from __future__ import annotations

import enum
from dataclasses import dataclass

import numpy as np

from tpd.core.conditions import Conditions
from tpd.core.scene import Block, Pendulum
from tpd.design.criteria import Limit, Risk
from tpd.design.ground.demand import Demand
from tpd.design.ground.groups import Role
from tpd.design.ground.judgement import Benefit, Judged, benefit_of
from tpd.design.ground.parts import Parts
from tpd.design.ground.search import Evaluated, GroundSearch
from tpd.design.ground.surface import Surface
from tpd.design.space import DesignSpace


class GroundStatus(enum.Enum):
    """Worth of the answer; the value is the sentence that a report opens with."""

    found = (
        "A PENDULUM WAS FOUND: on ground motions that it was not tuned to the block rocks less with it, and "
        "on no group of motions does it do significant harm. That is no verdict of safety: read the shares."
    )
    tuned_only = (
        "A PENDULUM WAS TUNED TO THESE MOTIONS ALONE: there is no other earthquake to judge it on, so that "
        "nothing is claimed about the next."
    )
    unproven = (
        "NO PENDULUM WORTH HANGING: on ground motions that the best design was not tuned to no benefit is "
        "significant."
    )
    harmful = (
        "NO PENDULUM WORTH HANGING: the best design does significant harm on at least one group of ground "
        "motions."
    )
    no_improvement = (
        "NO PENDULUM WORTH HANGING: no design in this space puts a smaller demand on the block than none."
    )
    none_feasible = (
        "NO PENDULUM WORTH HANGING: no design that was followed keeps to the limits in the share of the runs "
        "that was asked for."
    )
    no_uplift = "NO PENDULUM IS NEEDED: none of these ground motions lifts the bare block."
    interrupted = "INTERRUPTED: what follows is the best that had been followed by then, and was not judged."

    @property
    def is_sound(self) -> bool:
        """Whether the answer may be used: a design found and judged, or none needed."""
        return self in (GroundStatus.found, GroundStatus.no_uplift)


@dataclass(frozen=True, kw_only=True)
class GroundDesign:
    """Answer of a search on ground motions, with all inputs."""

    block: Block
    gravity: float
    space: DesignSpace
    conditions: Conditions
    """Conditions of the group that the design is tuned to."""
    demand: Demand
    risk: Risk
    limits: tuple[Limit, ...]
    allowed: float
    """Share of the runs in which the block stands that may break a limit."""
    method: GroundSearch
    seed: int
    scatter: dict[str, float]
    status: GroundStatus
    pendulum: Pendulum | None
    """The design that is offered; None where none is."""
    best: np.ndarray | None
    """(mu, lam, zeta) of the best design that was followed, offered or not."""
    value: float
    """Risk of the best design, and of the bare block."""
    trend: tuple[float, float]
    """Risk of the best design as the response surface sees it, and its standard deviation."""
    bare: float
    searched: Evaluated | None
    surface: Surface | None
    names: tuple[str, ...]
    """Limited quantities, the columns of `searched.sizes`."""
    judged: tuple[Judged, ...]
    parts: Parts | None

    @property
    def benefit(self) -> Benefit | None:
        """Benefit over all motions that were held out; None where nothing was judged on others."""
        return benefit_of(self.judged)

    @property
    def held_out(self) -> tuple[Judged, ...]:
        """Groups that the design was not tuned to."""
        return tuple(g for g in self.judged if g.role is Role.held_out)

    def __str__(self) -> str:
        lines = [self.status.value]
        if self.pendulum is not None:
            p = self.pendulum
            damping = f"damping ratio {float(p.damping_ratio):.3g}"
            lines.append(f"  bob {float(p.mass):.4g} kg, rod {float(p.length):.4g} m, {damping}")
        # Every group with its interval: a mean alone would claim too much.
        for g in self.judged:
            d = g.difference
            lines.append(
                f"  {g.name} ({g.motions} motions, {g.events} earthquakes): overturned {g.overturned[0]:.1%} "
                f"without and {g.overturned[1]:.1%} with it, {d.mean:+.1%} ({d.low:+.1%} to {d.high:+.1%})"
            )
        return "\n".join(lines)
