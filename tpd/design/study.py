"""Computations behind a report: time histories, responses, comparison of models, sensitivities."""

from __future__ import annotations

import math
from dataclasses import replace
from typing import Any

import numpy as np

from tpd.answers.response import Response, frequencies, settled_response
from tpd.answers.steady_state import sampled, simulate
from tpd.core.progress import Progress, unreported
from tpd.design.build import Build, FrontPoint, Moved, Study, TimeHistory, loads_of, pull_test
from tpd.design.criteria import bob_of
from tpd.design.orbits import geometry_of
from tpd.design.result import Design, HarmonicDesign
from tpd.models.piecewise import Piecewise
from tpd.scene.conditions import Conditions
from tpd.scene.ground_motion import Pulse
from tpd.scene.parameters import as_arrays
from tpd.scene.scene import Harmonic, Pendulum, Scene
from tpd.scene.status import status_name
from tpd.theory import uplift

_BAND = frequencies(1.0, 0.7, 1.5, 41)
"""Frequencies of a response, in shares of the scene's own."""
_MOTIONS = 24
"""Most motions that are followed over time for loads."""
_CYCLES = 40
"""Periods of a harmonic from rest in which the loads are largest."""
_MOVED = {
    "restitution": 0.5,
    "friction": 0.5,
    "slenderness": 0.05,
    "amplitude": 0.1,
    "frequency": 0.05,
    "mass": 0.05,
    "length": 0.05,
    "damping": 0.4,
}
"""Shares by which a quantity is moved; of a restitution it is the loss, 1 - e."""
_RUNS = 256
"""Most paired runs of a moved harmonic scene."""


def study(design: Design, *, front: tuple[FrontPoint, ...] = (), progress: Progress | None = None) -> Study:
    """Compute everything that a report shows beside the design, once.

    Args:
        design: the answer of `optimise`.
        front: the answer of `tpd.front`, to be shown as well.
        progress: called with (stage, units done, units in all).

    Raises:
        RuntimeError: JAX is in 32-bit mode.
    """
    harmonic = design if isinstance(design, HarmonicDesign) else None
    used = () if harmonic is None else usage(harmonic)
    moved = moved_of(design, progress or unreported)
    out = Study(build=build_of(design, moved), front=front, usage=used)
    if harmonic is None:
        return out
    # A response over frequency belongs to conditions that differ in the motion of the base alone.
    varied = set(design.conditions.factors) <= {"amplitude", "frequency"}
    responses = _responses(harmonic, progress) if varied else None
    return replace(out, histories=time_histories(design.scene, design.pendulum), responses=responses)


def time_histories(scene: Scene, pendulum: Pendulum | None) -> tuple[TimeHistory, ...]:
    """Histories from rest by the exact solution: bare and, if there is one, with the pendulum."""
    cases, out = (None,) if pendulum is None else (None, pendulum), []
    for hung in cases:
        p = as_arrays(scene.parameters(hung))
        tau = sampled(p)
        motion = simulate(p, np.zeros(4), tau, model=Piecewise())
        tilt, bob = np.asarray(motion.ys).T[:2]
        found = {"time": np.asarray(tau) / scene.rate, "tilt": tilt, "bob": bob}
        falls = status_name(motion.status) == "overturned"
        out.append(TimeHistory(with_pendulum=hung is not None, overturned=falls, **found))
    return tuple(out)


def _responses(design: HarmonicDesign, progress: Progress | None) -> tuple[Response, ...]:
    values = design.scene.motion.frequency * _BAND
    cases = (None,) if design.pendulum is None else (None, design.pendulum)
    return tuple(
        settled_response(design.scene, "frequency", values, pendulum=hung, progress=progress)
        for hung in cases
    )


def usage(design: HarmonicDesign) -> tuple[tuple[str, float], ...]:
    """Limited quantities of the best design over their limits, the largest of all conditions."""
    if design.best is None:
        return ()
    evaluation, bare = design.best.evaluation, design.bare.evaluation
    tilt = np.where(bare.attracts[0], bare.tilt[0], np.nan)
    where = replace(geometry_of(design.scene, design.conditions, design.limits), bare_tilt=tilt)
    sizes = [size for limit in design.limits for size in limit.sizes(evaluation, where)]
    return tuple((size.name, float(np.max(size.value))) for size in sizes)


def build_of(design: Design, moved: tuple[Moved, ...] = ()) -> Build | None:
    """The pendulum of a design as it is built; None where none is offered."""
    hung, scene = design.pendulum, design.scene
    if hung is None:
        return None
    bob, g = bob_of(design.limits), float(scene.gravity)
    mass, length, zeta = float(hung.mass), float(hung.length), float(hung.damping_ratio)
    block, mu = scene.block, mass / float(scene.block.mass)
    body, rod = bob.built(mass, length, g)
    half, rod_share = float(bob.half_height(body)), bob.rod_share(rod, g)
    reach = bob.reach(body, rod, design.turned)
    loads = loads_of([Scene(block, m, g) for m in _strongest(design)], hung)
    # Rod and hinge carry the whole body: the part that does not swing is taken to pull as the rest does.
    up = body * (1.0 + rod_share) / mass if math.isfinite(body) else 1.0
    # Both limits of |B| f = (1 + mu) nu + k, see `tpd.theory.uplift`.
    capacity = (1.0 + mu) * float(block.slenderness) + float(block.friction or 0.0)
    lifts = None
    if isinstance(scene.motion, Harmonic):
        both = scene.parameters(hung), scene.parameters()
        with_it, without = (float(p.f / (1.0 - uplift(p).margin)) for p in both)
        lifts = with_it, without
    return Build(
        bob=bob,
        mass=body,
        dead=body * (1.0 + rod_share) - mass,
        bob_width=2.0 * float(bob.radius(body)),
        bob_height=2.0 * half,
        rod=rod,
        rod_share=rod_share,
        depth=rod + half,
        wall=math.nan if block.cavity_width is None else 0.5 * float(block.cavity_width),
        reach=float(np.quantile(reach, 1.0 - design.strikes_allowed, method="higher"))
        if np.size(reach)
        else math.nan,
        frequency=math.sqrt(g / length) / (2.0 * math.pi),
        damping=float(hung.hinge_damping(g)),
        rebound=math.exp(-math.pi * zeta / math.sqrt(1.0 - zeta**2)) if zeta < 1.0 else 0.0,
        weight=body * (1.0 + rod_share) * g,
        loads=None if loads is None else loads._replace(tension=loads.tension * up, hinge=loads.hinge * up),
        lifts=lifts,
        lifts_slow_fast=(capacity / (1.0 + 2.0 * mu), capacity),
        pull=pull_test(scene),
        moved=moved,
    )


def _strongest(design: Any) -> list[Any]:
    """Motions of a design's conditions, those in which the rod turns most if there are many."""
    c, motion = design.conditions, design.scene.motion
    if c.motions:
        # Those in which the block stands by the linear equations.
        objective = design.objective
        turned = objective.evaluate(design.best[None]).relative[0]
        order = np.argsort(-np.nan_to_num(turned, posinf=-1.0, nan=-1.0))
        known = [i for i in order if np.isfinite(turned[i])][:_MOTIONS]
        motions, factors = objective.conditions.motions, objective.factors
        return [motions[int(objective.conditions.which[i])].scaled(float(factors[i])) for i in known]
    found = [
        Pulse.sine_train(
            acceleration=float(motion.amplitude * a * (motion.rate * w) ** 2),
            frequency=float(motion.frequency * w),
            cycles=_CYCLES,
        )
        for a, w in zip(c.column("amplitude"), c.column("frequency"), strict=True)
    ]
    # Rod and damper are loaded most near the pendulum's own frequency, not by the strongest shaking.
    stroke = np.zeros(len(found)) if design.best is None else design.best.evaluation.stroke[0]
    order = np.argsort(-np.nan_to_num(stroke, posinf=-1.0, nan=-1.0), kind="stable")
    return [found[i] for i in order[:_MOTIONS]]


def moved_of(design: Design, progress: Progress = unreported) -> tuple[Moved, ...]:
    """How the benefit moves with what is not known exactly, one quantity after the other, on the runs that
    judged; empty where no pendulum is offered."""
    if design.pendulum is None:
        return ()
    block, out = design.scene.block, []
    lossless = float(block.velocity_ratio) == 1.0
    absent = {"restitution": lossless, "friction": not block.friction}
    names = [name for name in _MOVED if not absent.get(name, False)]
    # The same runs with nothing moved: fewer than those that judged, they give another number.
    same = design.saved_under(design.scene, Conditions(), _RUNS)
    out.append(Moved("", 0.0, same, same))
    for done, name in enumerate(names):
        progress("what the benefit hangs on", done, len(names))
        width = _MOVED[name]
        sides = [design.saved_under(*_changed(design, name, sign * width), _RUNS) for sign in (-1.0, 1.0)]
        out.append(Moved(name, width, *sides))
    progress("what the benefit hangs on", len(names), len(names))
    return tuple(out)


def _changed(design: Design, name: str, share: float) -> tuple[Scene, Conditions]:
    """Scene and further condition in which a quantity differs by a share."""
    scene = design.scene
    if name != "restitution":
        return scene, Conditions({name: np.array([1.0 + share])})
    # A factor on e would exceed 1; and an e that follows the block's shape is moved as well.
    e = 1.0 - (1.0 - float(scene.block.velocity_ratio)) * (1.0 + share)
    block = replace(scene.block, restitution=max(e, 0.0))
    return Scene(block, scene.motion, scene.gravity), Conditions()
