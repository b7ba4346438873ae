"""The problem that a search solves: inputs checked, defaults filled in, the objective chosen."""

from __future__ import annotations

from collections.abc import Iterable
from dataclasses import dataclass, replace
from functools import cached_property

import numpy as np

from tpd.answers.attractors import StartKind, Starts
from tpd.answers.ensemble import Ensemble
from tpd.core import checks
from tpd.core.fingerprints import fingerprint, of_sources
from tpd.design.criteria import DEFAULT_LIMITS, DesignSpace, Limit, Risk, Worth, check_limits
from tpd.design.methods import SMOOTHED, Descent, Method, describe
from tpd.design.objective import Orbits, geometry_of
from tpd.design.question import Question, check_cavity, check_given, check_moves, within_mass
from tpd.models.piecewise import Piecewise
from tpd.scene.conditions import Conditions, check_restitution, under_all
from tpd.scene.parameters import Parameters, as_arrays
from tpd.scene.scene import Harmonic, Scene

_SMOOTH = 0.2
"""Least velocity ratio of impacts under which descents smooth them."""


@dataclass(frozen=True, kw_only=True)
class Problem(Question):
    """A question about harmonic shaking, with what the searches make small."""

    starts: Starts

    @staticmethod
    def of(
        scene: Scene,
        space: DesignSpace | None = None,
        *,
        conditions: Conditions | None = None,
        starts: Starts | None = None,
        risk: Risk | None = None,
        limits: Iterable[Limit] | None = None,
        method: Method | None = None,
        ensemble: Ensemble | None = None,
        worth: Worth | None = None,
        seed: int = 0,
    ) -> Problem:
        """Problem of a scene; None stands for the default everywhere.

        Raises:
            ValueError: bad input.
            RuntimeError: JAX is in 32-bit mode.
        """
        given = {"space": space, "conditions": conditions, "starts": starts, "risk": risk}
        check_given(seed, **given, ensemble=ensemble, worth=worth)
        checks.instance("scene", scene, Scene)
        if method is not None:
            checks.instance("method", method, Method)
        if not isinstance(scene.motion, Harmonic):
            raise ValueError(
                "the motion of `scene` must be a harmonic: give pulses and records by "
                "`conditions=tpd.Conditions.records(...)`"
            )
        conditions = Conditions.around(scene) if conditions is None else conditions
        space = DesignSpace() if space is None else space
        check_moves(scene, conditions, space)
        # Housner's restitution is least with the heaviest bob.
        heaviest = under_all(as_arrays(scene.parameters()), space.full(space.bounds[1])[None], conditions)
        method = _with_model(Descent() if method is None else method, heaviest)
        if isinstance(method, Descent) and method.model is not None:
            method.model.check(heaviest)
        limits = check_limits(DEFAULT_LIMITS if limits is None else limits)
        check_cavity(scene.block, limits)
        starts = Starts.any() if starts is None else starts
        if starts.kind is StartKind.sampled:
            raise ValueError(
                "`starts` of a design must be Starts.any() or Starts.rest(), but is a sampled set: its runs "
                "begin where `ensemble` says"
            )
        ensemble = Ensemble(seed=seed) if ensemble is None else ensemble
        if ensemble.restitution:
            check_restitution(scene)
        return Problem(
            scene=scene,
            space=within_mass(space, scene.block, limits),
            conditions=conditions,
            starts=starts,
            risk=Risk.worst() if risk is None else risk,
            limits=limits,
            method=method,
            ensemble=ensemble,
            worth=Worth() if worth is None else worth,
            seed=seed,
        )

    @cached_property
    def orbits(self) -> Orbits:
        """Symmetric orbits of designs under all conditions; nothing is compiled yet."""
        scene, conditions = self.scene, self.conditions
        common = as_arrays(scene.parameters()), conditions, self.space, self.risk, self.limits
        return Orbits(*common, geometry_of(scene, conditions), self.starts.kind is StartKind.rest)

    @cached_property
    def objective(self) -> Orbits:
        """These, with the tilts of the bare block known to limits that compare with them."""
        return self.orbits.against_bare()

    @cached_property
    def identity(self) -> str:
        """Fingerprint of everything on which the ends of the searches depend."""
        method = self.method
        steps = method.taken(method.steps) if isinstance(method, Descent) else ()
        criteria = self.risk, [(limit.name, limit) for limit in self.limits]
        settings = describe(method), np.round(steps, 12), self.seed
        return fingerprint(
            of_sources(), self.scene, self.conditions, self.space, *criteria, self.starts, *settings
        )


def _with_model(method: Method, p: Parameters) -> Method:
    """The method with the model that `Descent` takes by default: smoothed signs, or the exact orbits where
    impacts take so much that the bias of smoothed ones comes near to the tolerance of the ends."""
    if not isinstance(method, Descent) or method.model is not None:
        return method
    smooth = bool(np.all(np.asarray(p.velocity_ratio) >= _SMOOTH))
    return replace(method, model=SMOOTHED if smooth else Piecewise())
