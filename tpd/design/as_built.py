"""The pendulum as it is built, and what the report shows beside a design: loads, readings on site, how the
benefit depends on what is not known exactly, motions from rest and responses."""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass, replace
from functools import partial
from typing import NamedTuple

import numpy as np

from tpd.answers.motion_history import motion_history
from tpd.answers.paired import PairedRuns
from tpd.answers.response import BAND, Response, frequencies, settled_response
from tpd.answers.statistics import Interval
from tpd.answers.steady_state import sampled, simulate
from tpd.core.progress import Progress, unreported
from tpd.design.criteria import bob_of
from tpd.design.design import Design, FrontPoint
from tpd.design.problem import Variation
from tpd.models.compiled import Piecewise
from tpd.scene.bob import STEEL, Bob
from tpd.scene.conditions import Conditions
from tpd.scene.parameters import as_arrays
from tpd.scene.scene import HOUSNER, Block, Harmonic, Pendulum, Scene, paper_scene
from tpd.scene.status import STANDING, Status, is_one_of
from tpd.theory.equations import Terms
from tpd.theory.free_rocking import equivalent_friction, turning_tilts

_BAND = frequencies(1.0, *BAND, 41)
"""Frequencies of a response, in shares of the scene's own."""
_VARIED = {
    "restitution": 0.5,
    "friction": 0.5,
    "slenderness": 0.05,
    "amplitude": 0.1,
    "frequency": 0.05,
    "mass": 0.05,
    "length": 0.05,
    "damping": 0.4,
}
"""Shares by which a quantity is varied; of a restitution it is the loss, 1 - e."""
_USUAL = 1.0 / 3.0
"""Tilt over nu at which friction and impacts are made to lose the same energy."""
_SEED = 3
"""Number of the seed of the comparisons, after those of trials and validation."""
YIELD = 235e6
"""Yield stress of structural steel S235, Pa (EN 10025-2, up to 16 mm thick)."""
SAFETY = 3.0
"""Yield stress over the largest stress, for fatigue, impacts of the block and stronger motions."""
ARM, _PLACE, STOPPING = 0.25, 3.0, 0.1
"""Arm of the linear damper over the rod; least distance between axis and wall over half of its stroke, which
leaves a damper as long as its stroke; way of a stop over the free way of the bob."""
_PULLED, _HALF, _MOST = 0.1, 0.5, 400
"""Tilt of a pull test over that of toppling, the share of it that is waited for, and most impacts counted."""


class Loads(NamedTuple):
    """Largest values over the motions in which the block stands, by the linear equations, without impacts.
    They need not occur at once. Of a swing from the largest angle, if the block stands in no motion."""

    tension: float
    """Force along the rod, N."""
    hinge: float
    """Force of the hinge on the block, N."""
    rate: float
    """Angular rate between rod and block, rad/s."""
    friction: float
    """Horizontal over vertical force at the base: with a smaller coefficient of friction the base slides. NaN
    if the block stands in no motion."""
    motions: int
    """Motions in which the block stands, of those that were followed over time."""


class Parts(NamedTuple):
    """First sizes of the parts, SI units: steel with the yield stress `YIELD`, of which the largest stress is
    the share 1/`SAFETY`. Formulas of the strength of materials, such as those of Roark."""

    rod_diameter: float
    """Round bar under the largest tension N and the largest moment M of the damper, rounded up to whole mm:
    4 N/(pi d^2) + 32 M/(pi d^3) = stress."""
    rod_mass: float
    """Mass of this rod, kg."""
    pin_diameter: float
    """Pin of the hinge in double shear under the largest force V of the hinge and the linear damper, rounded
    up to whole mm: 2 V/(pi d^2) = stress/sqrt(3), the shear by the criterion of von Mises."""
    arm: float
    """Distance from the hinge, along the rod, of a horizontal linear damper between rod and wall."""
    coefficient: float
    """Its force over its speed, N s/m: c/arm^2 has at small angles the moment c times the rate."""
    force: float
    """Its largest force, moment/arm."""
    stroke: float
    """Difference between its largest and its least length, 2 arm times the largest angle."""
    speed: float
    """Its largest speed, arm times the largest rate."""
    stop: float
    """Distance of a stop from the axis of the block, which the bob reaches in no more than the allowed share
    of the runs; that of the wall if it is less or no run is known, and NaN if no wall is known either."""
    stop_way: float
    """Way in which the stop brings the bob to rest before the wall; NaN if the bob has no free way."""
    stop_force: float
    """Largest force of a stop that is a linear spring: m l^2 rate^2/way, from the energy of the bob."""


class PullTest(NamedTuple):
    """The bare block is pulled at its top, released, and left alone: its losses follow from its turns."""

    tilt: float
    """rad; a tenth of that of toppling."""
    sway: float
    """Way of the top, m."""
    force: float
    """Horizontal force at the top that lifts the resting block, N."""
    impacts: int
    """Impacts until the tilt at a turn is at most half of the first; 0 if that takes too many, or friction
    holds the block."""
    seconds: float
    """Time until then."""


class Sensitivity(NamedTuple):
    """Benefit where a quantity differs from what was stated, by paired runs of the linear equations."""

    name: str
    """Name in `tpd.scene.conditions.FACTORS`; empty for the stated quantities."""
    width: float
    """Share by which the quantity is varied to either side."""
    low: Interval
    """Fall of the mean tilt with the quantity less by its width."""
    high: Interval


class LossCase(NamedTuple):
    """The pendulum where the block loses its energy in another way, by the linear equations."""

    name: str
    """"friction", "impacts" or "friction and impacts"."""
    friction: float
    velocity_ratio: float
    """e without a pendulum."""
    runs: PairedRuns


@dataclass(frozen=True, kw_only=True)
class Build:
    """A pendulum as it is built; SI units."""

    bob: Bob
    mass: float
    """Mass of the body, kg: a part of it swings as the point of the equations, the rest loads the top; NaN
    where no body does that."""
    dead: float
    """Mass of body and rod that loads the top and does not swing, kg."""
    bob_width: float
    bob_height: float
    rod: float
    """From the hinge to the centre of the bob, that then swings as often as the point of the equations;
    NaN where no rod does that."""
    rod_share: float
    """Mass of a steel rod for ten times the bob's weight, over that of the bob."""
    depth: float
    """From the hinge to the lower end of the bob that hangs."""
    wall: float
    """From the axis of the block to the wall; NaN where no cavity is known."""
    reach: float
    """How far the body comes from the axis in all but the allowed share of the runs of `Design.turned`; NaN
    where none is known."""
    angle: float
    """Angle between rod and block in all but this share, rad; without these runs that of `Design.swing`."""
    frequency: float
    """Own frequency without the damper in the block that stands, Hz."""
    damping: float
    """Moment of the hinge per angular rate, N m s/rad."""
    rebound: float
    """Angle that the pendulum reaches on the other side after a release, over that of the release."""
    weight: float
    """Weight of the bob on the top of the block, N."""
    loads: Loads
    lifts: tuple[float, float] | None
    """Acceleration of the base over gravity at which the resting block lifts under the harmonic, with the
    pendulum that has settled and without; None on ground motions."""
    lifts_slow_fast: tuple[float, float]
    """This with the pendulum under shakings that are very slow and very fast for it."""
    pull: PullTest
    parts: Parts | None = None
    """None where no body acts as the point of the equations."""

    @property
    def damper_moment(self) -> float:
        """Largest moment of the damper, N m."""
        return self.damping * self.loads.rate

    @property
    def damper_power(self) -> float:
        """Largest power of the damper, W."""
        return self.damper_moment * self.loads.rate


@dataclass(frozen=True, kw_only=True)
class TimeHistory:
    """One motion from rest under the scene's own shaking, shapes (times,)."""

    with_pendulum: bool
    time: np.ndarray
    """s"""
    tilt: np.ndarray
    """phi, rad; NaN after an overturning, and where the model has no answer."""
    bob: np.ndarray
    """psi, rad."""
    overturned: bool
    """Whether the block overturns."""


@dataclass(frozen=True, kw_only=True)
class Details:
    """Everything that a report shows beside the design; None or empty where a part does not apply."""

    build: Build | None = None
    """None where no pendulum is offered."""
    sensitivity: tuple[Sensitivity, ...] = ()
    losses: tuple[LossCase, ...] = ()
    histories: tuple[TimeHistory, ...] = ()
    """First 24 periods from rest, with harmonic excitation."""
    responses: tuple[Response, ...] = ()
    """Over frequency from rest, without a pendulum and with the one that is offered; only where the
    conditions differ in the motion of the base alone."""
    front: tuple[FrontPoint, ...] = ()


def details(
    design: Design, *, front: tuple[FrontPoint, ...] = (), progress: Progress = unreported
) -> Details:
    """Compute everything that a report shows beside the design, once.

    Args:
        design: the answer of `optimise`.
        front: the answer of `tpd.front`, to be shown as well.
        progress: called with (stage, units done, of how many).

    Raises:
        RuntimeError: JAX is in 32-bit mode.
    """
    out = Details(
        build=build_of(design),
        sensitivity=sensitivity_of(design, progress),
        losses=losses_of(design, progress),
        front=front,
    )
    scene, pendulum = design.scene, design.pendulum
    if not isinstance(scene.motion, Harmonic):
        return out
    responses: tuple[Response, ...] = ()
    if set(design.conditions.factors) <= {"amplitude", "frequency"}:
        values = scene.motion.frequency * _BAND
        cases = (None,) if pendulum is None else (None, pendulum)
        how = {"progress": progress}
        responses = tuple(
            settled_response(scene, "frequency", values, pendulum=case, **how) for case in cases
        )
    return replace(out, histories=time_histories(scene, pendulum), responses=responses)


def time_histories(scene: Scene, pendulum: Pendulum | None) -> tuple[TimeHistory, ...]:
    """Return histories from rest by the exact solution: without and, if there is one, with the pendulum."""
    cases, out = (None,) if pendulum is None else (None, pendulum), []
    for case in cases:
        p = as_arrays(scene.parameters(case))
        tau = sampled(p)
        motion = simulate(p, np.zeros(4), tau, model=Piecewise())
        tilt, bob = np.asarray(motion.ys).T[:2]
        found = {"time": np.asarray(tau) / scene.rate, "tilt": tilt, "bob": bob}
        falls = bool(motion.status == Status.overturned)
        out.append(TimeHistory(with_pendulum=case is not None, overturned=falls, **found))
    return tuple(out)


def build_of(design: Design) -> Build | None:
    """Return the pendulum of a design as it is built; None where none is offered."""
    pendulum, scene = design.pendulum, design.scene
    if pendulum is None:
        return None
    bob, g = bob_of(design.problem.limits), float(scene.gravity)
    mass, length, zeta = float(pendulum.mass), float(pendulum.length), float(pendulum.damping_ratio)
    block, mu = scene.block, mass / float(scene.block.mass)
    body, rod = bob.built(mass, length, g)
    half, rod_share = float(bob.half_height(body)), bob.rod_share(rod, g)
    problem = design.problem
    # No angle is interpolated between two runs.
    largest = partial(np.quantile, q=1.0 - problem.allowed, method="higher")
    angle = float(largest(design.turned)) if design.turned.size else min(design.swing, 0.5 * math.pi)
    motions = problem.strongest_motions(problem.ratios(pendulum))
    loads = loads_of([Scene(block, m, g) for m in motions], pendulum) or free_swing(pendulum, angle, g)
    # Rod and hinge carry the whole body: the part that does not swing is taken to pull as the rest does.
    up = body * (1.0 + rod_share) / mass if math.isfinite(body) else 1.0
    # Both limits of |B| f = (1 + mu) nu + k, see `tpd.theory.uplift`.
    capacity = (1.0 + mu) * float(block.slenderness) + float(block.friction)
    build = Build(
        bob=bob,
        mass=body,
        dead=body * (1.0 + rod_share) - mass,
        bob_width=2.0 * float(bob.radius(body)),
        bob_height=2.0 * half,
        rod=rod,
        rod_share=rod_share,
        depth=rod + half,
        wall=math.nan if block.cavity_width is None else 0.5 * float(block.cavity_width),
        reach=float(bob.reach(body, rod, angle)) if design.turned.size else math.nan,
        angle=angle,
        frequency=math.sqrt(g / length) / (2.0 * math.pi),
        damping=float(pendulum.hinge_damping(g)),
        rebound=math.exp(-math.pi * zeta / math.sqrt(1.0 - zeta**2)) if zeta < 1.0 else 0.0,
        weight=body * (1.0 + rod_share) * g,
        loads=loads._replace(tension=loads.tension * up, hinge=loads.hinge * up),
        lifts=problem.lifts(pendulum),
        lifts_slow_fast=(capacity / (1.0 + 2.0 * mu), capacity),
        pull=pull_test(scene),
    )
    return replace(build, parts=parts_of(build, mass * length**2)) if math.isfinite(body) else build


def parts_of(build: Build, inertia: float) -> Parts:
    """Return the sizes of the parts from the largest loads; formulas: see `Parts`.

    Args:
        build: the pendulum as it is built.
        inertia: moment of inertia of the pendulum about its hinge, kg m^2: that of the point.
    """
    loads, stress, arm = build.loads, YIELD / SAFETY, ARM * build.rod
    moment, half = build.damper_moment, build.wall / _PLACE
    if arm * build.angle > half:
        arm = half / build.angle
    # The three roots add up to zero and one is positive: its real part is the largest.
    rod = max(np.roots([math.pi * stress, 0.0, -4.0 * loads.tension, -32.0 * moment]).real)
    # The hinge withstands the force of a linear damper, which a damper at the hinge has not.
    pin = math.sqrt(2.0 * math.sqrt(3.0) * (loads.hinge + moment / arm) / (math.pi * stress))
    rod, pin = (1e-3 * math.ceil(1e3 * float(d)) for d in (rod, pin))
    stop = float(np.fmin(build.reach, build.wall))
    free = stop - 0.5 * build.bob_width
    # The stop must not let the bob through to the wall.
    way = float(np.fmin(STOPPING * free, build.wall - stop))
    way = way if way > 0.0 else math.nan
    return Parts(
        rod_diameter=rod,
        rod_mass=STEEL * 0.25 * math.pi * rod**2 * build.rod,
        pin_diameter=pin,
        arm=arm,
        coefficient=build.damping / arm**2,
        force=moment / arm,
        stroke=2.0 * arm * build.angle,
        speed=arm * loads.rate,
        stop=stop,
        stop_way=way,
        stop_force=inertia * loads.rate**2 / way,
    )


def sensitivity_of(design: Design, progress: Progress = unreported) -> tuple[Sensitivity, ...]:
    """Return how the benefit depends on what is not known exactly, one quantity after the other, on the same
    runs of the linear equations; empty where no pendulum is offered."""
    if design.pendulum is None:
        return ()
    scene = design.scene
    absent = {
        "restitution": float(scene.block.velocity_ratio) == 1.0,
        "friction": not scene.block.friction,
    }
    names = [name for name in _VARIED if not absent.get(name, False)]
    # The same runs with nothing varied: fewer than those that validate, they give another number.
    same = _compared(design).benefit
    out = [Sensitivity("", 0.0, same, same)]
    for done, name in enumerate(names):
        progress("sensitivity", done, len(names))
        width = _VARIED[name]
        low, high = (_compared(design, *_varied(scene, name, sign * width)) for sign in (-1.0, 1.0))
        out.append(Sensitivity(name, width, low.benefit, high.benefit))
    progress("sensitivity", len(names), len(names))
    return tuple(out)


def losses_of(design: Design, progress: Progress = unreported) -> tuple[LossCase, ...]:
    """Return the pendulum where the block loses energy by friction alone, by impacts alone, and by both;
    empty where none is offered."""
    if design.pendulum is None:
        return ()
    out, models = [], loss_models(design.scene)
    for done, (name, block) in enumerate(models.items()):
        progress("other energy losses", done, len(models))
        runs = _compared(design, replace(design.scene, block=block))
        out.append(LossCase(name, float(block.friction), float(block.velocity_ratio), runs))
    return tuple(out)


def _compared(design: Design, scene: Scene | None = None, more: Conditions | None = None) -> PairedRuns:
    """Paired runs of the linear equations in a changed scene or under a further condition."""
    problem, pendulum = design.problem, design.pendulum
    assert pendulum is not None
    varied = Variation(Terms.linear.value, scene, more)
    return problem.paired_runs(problem.ratios(pendulum), problem.run_seed(_SEED), varied)


def loss_models(scene: Scene) -> dict[str, Block]:
    """Return the block with the losses of friction, of impacts and of both: its own where it has them, else a
    friction that loses as much as the impacts, or Housner's impacts."""
    block = scene.block
    # The losses are those of the block alone, whatever moves its base: any harmonic serves.
    p = Scene(block, paper_scene().motion, scene.gravity).parameters()
    e = float(block.velocity_ratio)
    k = float(block.friction)
    impacts = HOUSNER if e == 1.0 else block.restitution
    friction = k or float(equivalent_friction(p, _USUAL * float(p.nu))) if e < 1.0 else k
    return {
        "friction": replace(block, friction=friction, restitution=1.0),
        "impacts": replace(block, friction=0.0, restitution=impacts),
        "friction and impacts": replace(block, friction=friction, restitution=impacts),
    }


def _varied(scene: Scene, name: str, share: float) -> tuple[Scene | None, Conditions | None]:
    """Scene or further condition in which a quantity differs by a share."""
    if name != "restitution":
        return None, Conditions({name: np.array([1.0 + share])})
    # A factor on e would exceed 1; and an e that follows the block's shape is moved as well.
    e = 1.0 - (1.0 - float(scene.block.velocity_ratio)) * (1.0 + share)
    return replace(scene, block=replace(scene.block, restitution=max(e, 0.0))), None


def loads_of(scenes: Sequence[Scene], pendulum: Pendulum) -> Loads | None:
    """Return the largest loads over the motions of scenes in which the block stands; None where it
    stands in none."""
    found = [motion_history(scene, pendulum) for scene in scenes]
    # A block that falls takes its pendulum along.
    stands = [h for h in found if is_one_of(h.status, *STANDING)]
    if not stands:
        return None
    each = np.array([(*h.loads(pendulum), h.needed_friction) for h in stands])
    tension, hinge, rate, friction = map(float, each.max(axis=0))
    return Loads(tension, hinge, rate, friction, len(stands))


def free_swing(pendulum: Pendulum, angle: float, gravity: float) -> Loads:
    """Return the loads of an undamped swing from rest at an angle (rad), in a block that does not move.

    By the conservation of energy the rate at the lowest point is sqrt(2 g (1 - cos angle)/l), and the tension
    m g (3 - 2 cos angle)."""
    fall = gravity * (1.0 - math.cos(angle))
    tension = float(pendulum.mass) * (gravity + 2.0 * fall)
    return Loads(tension, tension, math.sqrt(2.0 * fall / float(pendulum.length)), math.nan, 0)


def pull_test(scene: Scene) -> PullTest:
    """Return the pull-and-release test of the bare block: what to expect if it loses as much energy as
    was stated."""
    block, g = scene.block, float(scene.gravity)
    nu, k = float(block.slenderness), float(block.friction)
    tilt, rate, impacts = _PULLED * nu, float(scene.rate), 0
    taus = np.zeros(1)
    if tilt < nu - k:
        turns, taus = turning_tilts(nu, k, float(block.velocity_ratio), tilt, _MOST)
        reached = np.flatnonzero(turns <= _HALF * tilt)
        impacts = int(reached[0]) if reached.size else 0
    return PullTest(
        tilt=tilt,
        sway=tilt * float(block.height),
        # The force acts at twice the height of the weight.
        force=0.5 * (nu + k) * float(block.mass) * g,
        impacts=impacts,
        seconds=float(taus[impacts]) / rate if impacts else math.nan,
    )
