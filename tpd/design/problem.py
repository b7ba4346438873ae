"""The question of a design: inputs, checked before anything is compiled, defaults, and the objective."""

from __future__ import annotations

from collections.abc import Iterable
from dataclasses import dataclass, fields, replace
from functools import cached_property
from typing import Any

import numpy as np

from tpd.answers.attractors import StartKind, Starts
from tpd.answers.ensemble import Ensemble
from tpd.core import checks
from tpd.design.criteria import (
    DEFAULT_LIMITS,
    DesignSpace,
    Limit,
    Mass,
    Risk,
    Room,
    Worth,
    check_limits,
    limit_of,
)
from tpd.design.orbits import Orbits, geometry_of
from tpd.design.settings import Descent
from tpd.design.smoothed_orbits import SMOOTHED
from tpd.models.piecewise import Piecewise
from tpd.scene.conditions import Conditions, check_restitution, under_all
from tpd.scene.parameters import as_arrays
from tpd.scene.scene import Block, Harmonic, Scene, check_shaking

_KINDS = {
    "space": DesignSpace,
    "conditions": Conditions,
    "starts": Starts,
    "risk": Risk,
    "ensemble": Ensemble,
    "worth": Worth,
}


@dataclass(frozen=True, kw_only=True, repr=False)
class Question:
    """Inputs of `tpd.optimise`, complete and checked."""

    scene: Scene
    """On ground motions its motion is the first of them."""
    space: DesignSpace
    """Within the limit on the bob's mass, if there is one."""
    conditions: Conditions
    """On ground motions those of the group that a design is tuned to."""
    risk: Risk
    limits: tuple[Limit, ...]
    method: Any
    """A `Descent`; on ground motions a `GroundSearch`."""
    ensemble: Ensemble
    """On ground motions its widths are those of block and installation in the judgement."""
    worth: Worth
    seed: int

    @property
    def inputs(self) -> dict[str, Any]:
        """All fields by their names: an answer repeats its question."""
        return {f.name: getattr(self, f.name) for f in fields(self)}


def check_given(seed: checks.Whole, **given: Any) -> int:
    """Return the seed; raise unless JAX has 64 bits, it is a whole number, and each input is of its class.
    None stands for a default."""
    checks.require_x64()
    seed = checks.seed("seed", seed)
    for name, value in given.items():
        checks.optional(name, value, _KINDS[name])
    return seed


def within_mass(space: DesignSpace, block: Block, limits: tuple[Limit, ...]) -> DesignSpace:
    """The space within the limit on the bob's mass, if there is one.

    Raises:
        ValueError: a mass below the least bob of the space.
    """
    limit, (low, high) = limit_of(limits, Mass), space.mass_ratio
    if not isinstance(limit, Mass):
        return space
    # A bound is kept exactly by every method; a constraint only to its tolerance.
    most = limit.kg / float(block.mass)
    if most <= low:
        raise ValueError(
            f"`mass` must be above the least bob of the design space, {low * block.mass:g} kg, but is "
            f"{limit.kg:g} kg"
        )
    return replace(space, mass_ratio=(low, min(high, most)))


def check_moves(scene: Scene, conditions: Conditions, space: DesignSpace) -> None:
    """Raise `ValueError` where nothing shakes the block, or where a quantity scatters that is zero."""
    if not scene.motion.amplitude > 0.0:
        raise ValueError(
            f"`amplitude` must be above 0 in a search, but is {scene.motion.amplitude:g}: nothing shakes the "
            "block"
        )
    check_scatter(scene, {name for name, v in conditions.factors.items() if np.ptp(v) > 0.0}, space)
    motion, factor = scene.motion, conditions.column
    check_shaking(motion.amplitude * factor("amplitude"), motion.frequency * factor("frequency"))


def check_cavity(block: Block, limits: tuple[Limit, ...]) -> None:
    """Raise `ValueError` where limits ask for room inside a block whose cavity is not stated."""
    if limit_of(limits, Room) is None or block.cavity_width is not None:
        return
    raise ValueError(
        "`cavity_width`, the width in m between the walls that the bob swings within, must be given, but is "
        "not, and no pendulum hangs inside a solid block: state it (--cavity, or `cavity_width` in [block] "
        "or of `Block`), or ask for no room (--no-walls, `room = false` in [limits], or limits without "
        "`Room`)"
    )


def check_scatter(scene: Scene, names: Iterable[str], space: DesignSpace | None = None) -> None:
    """Raise `ValueError` for a name out of `FACTORS` of a quantity that is zero or absent: a factor on it
    would change nothing."""
    zero = {
        "friction": scene.block.friction == 0.0,
        "damping": space is not None and space.damping_ratio == 0.0,
    }
    for name in names:
        if zero.get(name, False):
            raise ValueError(f"`{name}` cannot scatter by a share of itself: it is 0")
        if name == "restitution":
            check_restitution(scene)


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
        method: Descent | None = None,
        ensemble: Ensemble | None = None,
        worth: Worth | None = None,
        seed: checks.Whole = 0,
    ) -> Problem:
        """Problem of a scene; None stands for the default everywhere.

        Raises:
            ValueError: bad input.
            RuntimeError: JAX is in 32-bit mode.
        """
        given = {"space": space, "conditions": conditions, "starts": starts, "risk": risk}
        seed = check_given(seed, **given, ensemble=ensemble, worth=worth)
        checks.instance("scene", scene, Scene)
        checks.optional("method", method, Descent)
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
        method = Descent() if method is None else method
        model: Any = method.model
        if model is None:
            # Where impacts take much, the bias of smoothed ones comes near to the tolerance of the ends.
            smooth = bool(np.all(np.asarray(heaviest.velocity_ratio) >= _SMOOTH))
            model = SMOOTHED if smooth else Piecewise()
        model.check(heaviest)
        method = replace(method, model=model)
        limits = check_limits(DEFAULT_LIMITS if limits is None else limits)
        check_cavity(scene.block, limits)
        starts = Starts.any() if starts is None else starts
        if starts.kind is StartKind.sampled:
            raise ValueError(
                "`starts` of a design must be Starts.any() or Starts.rest(), but is a sampled set: its runs "
                "begin where `ensemble` says"
            )
        ensemble = (Ensemble() if ensemble is None else ensemble).seeded(seed)
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
        return Orbits(
            *common, geometry_of(scene, conditions, self.limits), self.starts.kind is StartKind.rest
        )

    @cached_property
    def objective(self) -> Orbits:
        """These, with the tilts of the bare block known to limits that compare with them."""
        return self.orbits.against_bare()
