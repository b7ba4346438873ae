"""A pendulum as it is built: its size as a body, its loads, readings on site, and how much the benefit moves
with what is not known exactly."""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass, replace
from typing import TYPE_CHECKING, Any, NamedTuple

import numpy as np

from tpd.answers.paired import LEAST
from tpd.answers.shaking_history import shaking_history
from tpd.answers.statistics import Interval, fall
from tpd.core.progress import Progress
from tpd.design.criteria import Room, limit_of
from tpd.scene.bob import Bob
from tpd.scene.conditions import Conditions
from tpd.scene.ground_motion import Pulse
from tpd.scene.scene import Harmonic, Pendulum, Scene
from tpd.scene.status import status_name
from tpd.theory import turning_tilts, uplift

if TYPE_CHECKING:
    from tpd.design.ground.design import GroundDesign
    from tpd.design.result import Design, HarmonicDesign

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
STANDING = "stood", "rocked"
"""Statuses of a block that stands at the end of a motion."""
_RUNS = 256
"""Most paired runs of a moved harmonic scene."""
_PULLED, _HALF, _MOST = 0.1, 0.5, 400
"""Tilt of a pull test over that of toppling, the share of it that is waited for, and most impacts counted."""


class Loads(NamedTuple):
    """Largest values over the motions in which the block stands, by the linear equations, without impacts.
    They need not occur at once."""

    tension: float
    """Force along the rod, N."""
    hinge: float
    """Force of the hinge on the block, N."""
    rate: float
    """Angular rate between rod and block, rad/s."""
    friction: float
    """Horizontal over vertical force at the base: with a smaller coefficient of friction the base slides."""
    motions: int
    """Motions that were followed over time."""


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


class Moved(NamedTuple):
    """Benefit where a quantity is not what it was said to be."""

    name: str
    """Name in `tpd.scene.conditions.FACTORS`; empty where nothing was moved."""
    width: float
    """Share by which it was moved to either side."""
    low: Interval
    """Fall of the mean tilt with the quantity less by its width."""
    high: Interval


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
    frequency: float
    """Own frequency without the damper in the block that stands, Hz."""
    damping: float
    """Moment of the hinge per angular rate, N m s/rad."""
    rebound: float
    """Angle that the pendulum reaches on the other side after a release, over that of the release."""
    weight: float
    """Weight of the bob on the top of the block, N."""
    loads: Loads | None
    """None where the block stands in none of the motions."""
    lifts: tuple[float, float] | None
    """Acceleration of the base over gravity at which the resting block lifts under the harmonic, with the
    pendulum that has settled and without; None on ground motions."""
    lifts_slow_fast: tuple[float, float]
    """This with the pendulum under shakings that are very slow and very fast for it."""
    pull: PullTest
    moved: tuple[Moved, ...]
    """Empty where an interruption left it out."""

    @property
    def damper_moment(self) -> float:
        """Largest moment of the damper, N m; NaN without loads."""
        return self.damping * self.loads.rate if self.loads else math.nan

    @property
    def damper_power(self) -> float:
        """Largest power of the damper, W; NaN without loads."""
        return self.damper_moment * self.loads.rate if self.loads else math.nan


def build_of(design: Design, moved: tuple[Moved, ...] = ()) -> Build | None:
    """The pendulum of a design as it is built; None where none is offered."""
    hung, scene = design.pendulum, design.scene
    if hung is None:
        return None
    room, g = limit_of(design.limits, Room), float(scene.gravity)
    bob = room.bob if isinstance(room, Room) else Bob()
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
        lifts=_lifts(scene, hung) if isinstance(scene.motion, Harmonic) else None,
        lifts_slow_fast=(capacity / (1.0 + 2.0 * mu), capacity),
        pull=pull_test(scene),
        moved=moved,
    )


def _lifts(scene: Scene, hung: Pendulum) -> tuple[float, float]:
    """See `Build.lifts`."""
    with_it, without = (
        float(p.f / (1.0 - uplift(p).margin)) for p in (scene.parameters(hung), scene.parameters())
    )
    return with_it, without


def _strongest(design: Any) -> list[Any]:
    """Motions of a design's conditions, those in which the rod turns most if there are many."""
    c, motion = design.conditions, design.scene.motion
    if c.motions:
        return _of_motions(design)
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


def _of_motions(design: Any) -> list[Any]:
    """Ground motions that a design is tuned to, as strong as its conditions say: those in which the block
    stands by the linear equations and the rod turns most against it."""
    objective = design.objective
    turned = objective.evaluate(design.best[None]).relative[0]
    order = [i for i in np.argsort(-np.nan_to_num(turned, posinf=-1.0, nan=-1.0)) if np.isfinite(turned[i])]
    which, motions = np.asarray(objective.conditions.which), objective.conditions.motions
    return [motions[int(which[i])].scaled(float(objective.factors[i])) for i in order[:_MOTIONS]]


def loads_of(scenes: Sequence[Scene], pendulum: Pendulum) -> Loads | None:
    """Largest loads over the motions of scenes in which the block stands; None where it stands in none."""
    found = [shaking_history(scene, pendulum) for scene in scenes]
    # A block that falls takes its pendulum along.
    stands = [h for h in found if status_name(h.status) in STANDING]
    if not stands:
        return None
    each = np.array([(*h.loads(pendulum), h.needed_friction) for h in stands])
    tension, hinge, rate, friction = map(float, each.max(axis=0))
    return Loads(tension, hinge, rate, friction, len(stands))


def pull_test(scene: Scene) -> PullTest:
    """Pull-and-release test of the bare block: what to expect if it loses as much as was said."""
    block, g = scene.block, float(scene.gravity)
    nu, k = float(block.slenderness), float(block.friction or 0.0)
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


def moved_of(design: Design, progress: Progress | None = None) -> tuple[Moved, ...]:
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
        if progress is not None:
            progress("what the benefit hangs on", done, len(names))
        width = _MOVED[name]
        sides = [design.saved_under(*_changed(design, name, sign * width), _RUNS) for sign in (-1.0, 1.0)]
        out.append(Moved(name, width, *sides))
    if progress is not None:
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


def saved_under_harmonic(design: HarmonicDesign, scene: Scene, more: Conditions, runs: int) -> Interval:
    """Fall of the mean tilt over the paired runs that judged, in a changed scene."""
    from tpd.design.by_runs import PairedRuns

    winner = design.winner
    assert winner is not None
    assert winner.paired is not None
    ensemble = winner.paired.hung.ensemble
    # Where e is what is moved it does not scatter as well.
    width = ensemble.restitution if scene is design.scene else 0.0
    some = replace(ensemble, size=min(ensemble.size, runs), restitution=width)
    found = PairedRuns(scene, design.conditions * more, some, design.worth, None)
    assert design.pendulum is not None
    gain = found.of(design.pendulum)[1]
    return Interval(gain.value, gain.low, gain.high)


def saved_under_motions(design: GroundDesign, scene: Scene, more: Conditions) -> Interval:
    """Fall of the mean tilt over the motions that were held out, or all if none were, in a changed scene."""
    from tpd.design.ground.groups import Role
    from tpd.design.ground.judgement import scatter_of

    groups = [g for g in design.groups if g.role is Role.held_out] or list(design.groups)
    scales = sorted(set(design.conditions.scales))
    hung, bare, clusters = [], [], []
    assert design.best is not None
    both = np.stack([[0.0, *design.best[1:]], design.best])
    for g in groups:
        scatter = scatter_of(scene.block, design.ensemble)
        if scene is not design.scene:
            scatter.pop("restitution", None)
        conditions = Conditions.records(
            g.motions, scales, intensity=design.conditions.intensity, scatter=scatter, seed=design.seed
        )
        there = replace(design.objective, block=scene.block, conditions=conditions * more)
        tilt = there.check(both).severity
        known = np.isfinite(tilt).all(axis=0)
        bare.append(tilt[0, known])
        hung.append(tilt[1, known])
        clusters.append(np.repeat(g.events, len(scales))[known])
    return fall(*map(np.concatenate, (hung, bare, clusters)), least=LEAST)
