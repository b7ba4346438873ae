"""The problem that a search solves: inputs checked, defaults filled in, the objective chosen."""

from __future__ import annotations

from collections.abc import Iterable
from dataclasses import dataclass, replace
from functools import cached_property

import numpy as np

from tpd.analysis.attractors import StartKind, Starts
from tpd.core import checks
from tpd.core.conditions import Conditions, under_all
from tpd.core.fingerprints import fingerprint, of_sources
from tpd.core.parameters import Parameters, as_arrays
from tpd.core.scene import Harmonic, Scene
from tpd.design.criteria import DEFAULT_LIMITS, Limit, Mass, Risk, check_limits, limit_of
from tpd.design.inputs import check_cavity, check_moves, check_types
from tpd.design.methods import SMOOTHED, Descent, Method, describe
from tpd.design.objective import Orbits, geometry_of
from tpd.design.space import DesignSpace
from tpd.design.worth import Worth
from tpd.models.piecewise import Piecewise

_SMOOTH = 0.2
"""Least velocity ratio of impacts under which descents smooth them."""


@dataclass(frozen=True)
class Problem:
    """Inputs of `optimise`, complete and checked."""

    scene: Scene
    space: DesignSpace
    """Within the limit on the bob's mass, if there is one."""
    starts: Starts
    method: Method
    objective: Orbits
    worth: Worth
    seed: int

    @staticmethod
    def of(
        scene: Scene,
        space: DesignSpace | None,
        conditions: Conditions | None,
        starts: Starts | None,
        risk: Risk | None,
        limits: Iterable[Limit] | None,
        method: Method | None,
        seed: int,
        worth: Worth | None = None,
    ) -> Problem:
        """Problem of a scene; None stands for the default everywhere.

        Raises:
            ValueError: bad input.
            RuntimeError: JAX is in 32-bit mode.
        """
        checks.require_x64()
        checks.count("seed", seed, least=0)
        if isinstance(scene, Scene) and not isinstance(scene.motion, Harmonic):
            raise ValueError(
                "the motion of `scene` must be a harmonic: give pulses and records by "
                "`conditions=tpd.Conditions.records(...)`"
            )
        check_types(scene, space, conditions, starts, risk, method)
        conditions = Conditions.around(scene) if conditions is None else conditions
        space = DesignSpace() if space is None else space
        check_moves(scene, conditions, space)
        p = as_arrays(scene.parameters())
        # Housner's restitution is least with the heaviest bob.
        heaviest = under_all(p, space.full(space.bounds[1])[None], conditions)
        method = _with_model(Descent() if method is None else method, heaviest)
        if isinstance(method, Descent) and method.model is not None:
            method.model.check(heaviest)
        limits = check_limits(DEFAULT_LIMITS if limits is None else limits)
        check_cavity(scene.block, limits)
        space = _narrowed(space, scene, limits)
        starts = Starts.any() if starts is None else starts
        if starts.kind is StartKind.sampled:
            raise ValueError(
                "`starts` of a design must be Starts.any() or Starts.rest(), but is a sampled set: its runs "
                "begin where `ensemble` says"
            )
        risk = Risk.worst() if risk is None else risk
        common = p, conditions, space, risk, limits, geometry_of(scene, conditions)
        objective = Orbits(*common, rest_counts=starts.kind is StartKind.rest)
        worth = Worth() if worth is None else worth
        return Problem(scene, space, starts, method, objective, worth, seed)

    def against_bare(self) -> Problem:
        """This problem with the tilts of the bare block known to limits that compare with them."""
        # Not in `of`: it compiles, and bad input must be refused before that.
        return replace(self, objective=self.objective.against_bare())

    @cached_property
    def identity(self) -> str:
        """Fingerprint of everything on which the ends of the searches depend."""
        o, method = self.objective, self.method
        steps = method.taken(method.steps) if isinstance(method, Descent) else ()
        criteria = o.risk, [(limit.name, limit) for limit in o.limits]
        settings = describe(method), np.round(steps, 12), self.seed
        return fingerprint(
            of_sources(), self.scene, o.conditions, self.space, *criteria, self.starts, *settings
        )


def _with_model(method: Method, p: Parameters) -> Method:
    """The method with the model that `Descent` takes by default: smoothed signs, or the exact orbits where
    impacts take so much that the bias of smoothed ones comes near to the tolerance of the ends."""
    if not isinstance(method, Descent) or method.model is not None:
        return method
    smooth = bool(np.all(np.asarray(p.velocity_ratio) >= _SMOOTH))
    return replace(method, model=SMOOTHED if smooth else Piecewise())


def _narrowed(space: DesignSpace, scene: Scene, limits: tuple[Limit, ...]) -> DesignSpace:
    """The space within the limit on the bob's mass.

    Raises:
        ValueError: a mass below the least bob of the space.
    """
    limit = limit_of(limits, Mass)
    if not isinstance(limit, Mass):
        return space
    return narrowed_to(space, scene.block.mass, limit.kg)


def narrowed_to(space: DesignSpace, block_mass: float, kg: float) -> DesignSpace:
    """The space with bobs of at most so many kilogrammes.

    Raises:
        ValueError: a mass below the least bob of the space.
    """
    low, high = space.mass_ratio
    # A bound is kept exactly by every method; a constraint only to its tolerance.
    most = kg / block_mass
    if most <= low:
        raise ValueError(
            f"`mass` must be above the least bob of the design space, {low * block_mass:g} kg, but is "
            f"{kg:g} kg"
        )
    return replace(space, mass_ratio=(low, min(high, most)))
