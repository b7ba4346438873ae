"""The pendulum as built, and further results that a report shows with a design.

The results are loads, quantities to measure on site, the variations of the design, motions from rest, and
responses over frequency.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass, replace
from functools import partial
from typing import NamedTuple

import numpy as np

from tpd.answers.motion_history import motion_history, needed_friction
from tpd.answers.response import BAND, Response, frequencies, settled_response
from tpd.answers.run_table import cases_of
from tpd.answers.steady_state import sampled, simulate
from tpd.core.formatting import Printed, number
from tpd.core.progress import Progress, unreported
from tpd.design.design import Design
from tpd.design.first_guess import FirstGuess, follow_guess
from tpd.design.variations import Dependence, EquivalentWidening, dependences, equivalent_widening
from tpd.limits import bob_of
from tpd.models.piecewise import Piecewise
from tpd.scene.bob import STEEL, Bob
from tpd.scene.parameters import as_arrays
from tpd.scene.scene import Pendulum, Scene
from tpd.scene.status import STANDING, Status, is_one_of
from tpd.theory.free_rocking import turning_tilts
from tpd.theory.no_uplift import uplift

_BAND = frequencies(1.0, *BAND, 41)
"""Frequencies of a response, as factors on the frequency of the scene."""
_PERIODS, _MOST_PERIODS, _SAMPLES = 24, 100, 60
"""Forcing periods of a time history if the block does not overturn; largest number of periods, as in a
validation run; and points in a period."""
YIELD = 235e6
"""Yield stress of structural steel S235, Pa (EN 10025-2, up to 16 mm thick)."""
SAFETY = 3.0
"""Yield stress over the largest stress, as a margin for fatigue, impacts of the block and stronger
motions."""
ARM, _PLACE, STOPPING = 0.25, 3.0, 0.1
"""Three ratios: the arm of the linear damper over the length of the rod; the smallest distance between axis
and wall over half the stroke of the damper, so that a damper as long as its stroke fits in; and the stopping
distance of a stop over the free distance of the bob."""
_BREAKAWAY = 0.05
"""Largest moment that may hold the hinge, over m g l."""
_PULL, _HALF, _MOST = 0.1, 0.5, 400
"""Tilt of a pull test over the toppling tilt, share of this tilt at which counting ends, and largest number
of impacts."""


class Loads(NamedTuple):
    """Largest loads over the motions in which the block stands, by the linear model and without impacts.

    The values need not occur at the same time. If the block stands in no motion, they are the values of a
    free swing from the largest angle.
    """

    tension: float
    """Force along the rod, N."""
    hinge: float
    """Force of the hinge on the block, N."""
    rate: float
    """Angular rate between rod and block, rad/s."""
    friction: float
    """Horizontal over vertical force at the base, over all motions of the job until the block topples. The
    base slides if the coefficient of friction is smaller."""
    motions: int
    """Number of motions in which the block stands, out of those that were simulated."""


class Parts(NamedTuple):
    """First sizes of the parts, in SI units.

    The parts are of steel with the yield stress `YIELD`, and the largest stress is 1/`SAFETY` of it. The
    formulas are those of the strength of materials, as in Roark.
    """

    rod_diameter: float
    """Diameter of a round bar under the largest tension N and the largest moment M of the damper, m, rounded
    up to whole mm: 4 N/(pi d^2) + 32 M/(pi d^3) = stress."""
    rod_mass: float
    """Mass of this rod, kg."""
    pin_diameter: float
    """Diameter of the pin of the hinge in double shear under the largest force V of the hinge and of the
    linear damper, m, rounded up to whole mm: 2 V/(pi d^2) = stress/sqrt(3), the shear strength by von
    Mises."""
    arm: float
    """Distance along the rod from the hinge to a horizontal linear damper between rod and wall, m."""
    coefficient: float
    """Force of this damper over its speed, N s/m: at small angles c/arm^2 produces the moment c times the
    rate."""
    force: float
    """Largest force of this damper, moment/arm, N."""
    stroke: float
    """Difference between the largest and the smallest length of this damper, 2 arm times the largest angle,
    m."""
    speed: float
    """Largest speed of this damper, arm times the largest rate, m/s."""
    stop: float
    """Distance of a stop from the axis of the block, m. The bob reaches it in at most the allowed share of
    the runs. It is the distance of the wall if that is smaller or there are no runs, and NaN without a known
    wall."""
    stop_way: float
    """Distance in which the stop brings the bob to rest before the wall, m; NaN if the bob has no free
    distance."""
    stop_force: float
    """Largest force of a stop that is a linear spring, N: m l^2 rate^2/distance, from the energy of the
    bob."""


class PullTest(NamedTuple):
    """Test without a pendulum: the block is pulled at its top and released, and its losses follow from its
    turning points."""

    tilt: float
    """Tilt from which the block is released, rad: one tenth of the toppling tilt."""
    sway: float
    """Displacement of the top, m."""
    force: float
    """Horizontal force at the top that lifts the resting block, N."""
    impacts: int
    """Number of impacts until the tilt at a turning point is at most half of the first tilt. It is 0 if that
    takes too many impacts, or if friction holds the block."""
    seconds: float
    """Time until then, s."""


@dataclass(frozen=True, kw_only=True)
class Build:
    """Pendulum as built, in SI units."""

    bob: Bob
    """Shape and density of the bob."""
    mass: float
    """Mass of the body, kg. A part of it swings like the point of the equations, and the rest only adds
    weight at the top. NaN if no body swings like the point."""
    mass_at_hinge: float
    """Mass of body and rod that only adds weight at the top, kg."""
    bob_width: float
    """Width of the bob, m."""
    bob_height: float
    """Height of the bob, m."""
    rod: float
    """Distance from the hinge to the centre of the bob, m, for which the body has the frequency of the point
    pendulum; NaN if there is no such rod."""
    rod_share: float
    """Mass of a steel rod that carries ten times the weight of the bob, over the mass of the bob."""
    depth: float
    """Distance from the hinge to the lower end of the hanging bob, m."""
    wall: float
    """Distance from the axis of the block to the wall of cavity or frame, m; NaN without."""
    reach: float
    """Largest distance of the body from the axis, m, in all runs of `Design.rod_angle` except the allowed
    share; NaN if there are no runs."""
    angle: float
    """Largest angle between rod and block, rad, in all these runs except the allowed share; NaN if there are
    no runs."""
    frequency: float
    """Natural frequency without the damper, Hz, with the block at rest."""
    damping: float
    """Moment of the hinge damper per angular rate, N m s/rad."""
    rebound: float
    """Angle that the pendulum reaches on the other side after it is released, over the angle of release."""
    weight: float
    """Weight of bob and rod that acts on the top of the block, N."""
    breakaway: float
    """Largest moment that may hold the hinge, N m: 0.05 m g l. In a study of a column four times this moment
    took half of the benefit, and a stuck hinge all of it."""
    impulse: float
    """Vertical impulse on the hinge, N s, at an impact with the largest rate of a block that comes back from
    the toppling tilt without excitation: its hinge then changes its velocity by (1 + e) a omega0 nu."""
    loads: Loads
    """Largest loads on rod, hinge and base."""
    uplift_harmonic: tuple[float, float] | None
    """Base accelerations over gravity that lift the resting block under the harmonic, with a settled pendulum
    and without one; None under ground motions."""
    uplift_slow_fast: tuple[float, float]
    """Base accelerations over gravity that lift the resting block with the pendulum, for a very slow and for
    a very fast excitation."""
    pull: PullTest
    """Pull-and-release test of the block without a pendulum."""
    parts: Parts | None = None
    """Sizes of the parts; None if no body swings like the point of the equations."""


@dataclass(frozen=True, kw_only=True)
class TimeHistory:
    """Motion from rest under the excitation of the scene; arrays of shape (times,)."""

    times: np.ndarray
    """Times, s."""
    tilt: np.ndarray
    """Tilt phi, rad; NaN after the block overturns, and where the model has no result."""
    swing: np.ndarray | None
    """Bob angle psi, rad; None without a pendulum."""
    overturned: bool
    """Whether the block overturns."""


@dataclass(frozen=True, kw_only=True, repr=False)
class Details(Printed):
    """All further results that a report shows with a design. A part that does not apply is None or empty."""

    build: Build | None = None
    """Pendulum as built; None if no pendulum is recommended."""
    variations: tuple[Dependence, ...] = ()
    """Benefit under each variation, the stated design first. Without a recommended pendulum there are only
    wider bases."""
    histories: tuple[TimeHistory, ...] = ()
    """Motions from rest under harmonic excitation, without and with the pendulum."""
    responses: tuple[Response, ...] = ()
    """Steady-state response over frequency after a start from rest, without a pendulum and with the
    recommended one. It is computed only if the conditions differ in the excitation alone."""
    first_guess: FirstGuess | None = None
    """Pendulum of a rule of thumb in the validation runs; None if there are no runs or no such pendulum."""
    equivalent_widening: EquivalentWidening | None = None
    """Widening of the base that has the same effect as the pendulum; None if no pendulum is recommended."""

    def of(self, *kinds: str) -> tuple[Dependence, ...]:
        """Return the variations of these kinds."""
        return tuple(row for row in self.variations if row.kind in kinds)

    def __str__(self) -> str:
        rows = [] if self.build is None else [("build", f"{self.build.bob}, {number(self.build.mass)} kg")]
        names = "variations", "histories", "responses"
        rows += [(name, f"{count} results") for name in names if (count := len(getattr(self, name)))]
        return "\n".join(["Details of a design", *(f"  {name:32}{text}" for name, text in rows)])


def details(design: Design, *, progress: Progress = unreported) -> Details:
    """Compute all further results that a report shows with a design.

    Args:
        design: result of `optimise`.
        progress: function of (stage, units done, total).

    Raises:
        RuntimeError: JAX is in 32-bit mode.

    Example:
        >>> import tpd
        >>> block = tpd.Block(width=0.5, height=1.5, mass=900.0, cavity_width=0.4)
        >>> pulse = tpd.Pulse.one_sine(acceleration=1.0, frequency=1.0)
        >>> conditions = tpd.Conditions.records([pulse], [0.5])
        >>> design = tpd.optimise(block, conditions=conditions, validation_share=0.0)
        >>> tpd.details(design).build is None
        True
    """
    problem, pendulum, runs = design.problem, design.pendulum, design.runs
    rows = dependences(problem, design.best, progress)
    out = Details(
        build=build_of(design),
        variations=rows,
        first_guess=None if runs is None or problem.has_earthquakes else follow_guess(problem, runs),
        equivalent_widening=equivalent_widening(design.best, rows),
    )
    scene = design.scene
    if "motion" not in problem.pictures:
        return out
    responses: tuple[Response, ...] = ()
    # A response is that of the nominal block, so it is shown only if no condition changes the block.
    if set(design.conditions.factors) <= {"amplitude", "frequency"}:
        values = scene.excitation.frequency * _BAND
        answer = partial(settled_response, scene, "frequency", values, progress=progress)
        responses = tuple(answer(pendulum=case) for case in cases_of(pendulum))
    return replace(out, histories=time_histories(scene, pendulum), responses=responses)


def time_histories(scene: Scene, pendulum: Pendulum | None) -> tuple[TimeHistory, ...]:
    """Return motions from rest by the exact solution, without a pendulum and, if there is one, with it.

    They last 24 periods. If the block overturns later, within 100 periods, they last until it has overturned.
    """
    out, last = [], _PERIODS * _SAMPLES
    for case in cases_of(pendulum):
        p = as_arrays(scene.parameters(case))
        tau = sampled(p, _MOST_PERIODS, _SAMPLES)
        motion = simulate(p, np.zeros(4), tau, model=Piecewise())
        # Without a pendulum the equations still have a bob, whose mass is zero. Its angle has no meaning.
        tilt, bob = np.asarray(motion.ys).T[:2]
        swing, overturned = None if case is None else bob, bool(motion.status == Status.overturned)
        times = np.asarray(tau) / scene.rate
        out.append(TimeHistory(times=times, tilt=tilt, swing=swing, overturned=overturned))
        if overturned:
            # One more period shows the block on the ground.
            last = max(last, int(np.isfinite(tilt).sum()) + _SAMPLES)
    cut = ({n: x[: last + 1] for n, x in vars(h).items() if isinstance(x, np.ndarray)} for h in out)
    return tuple(replace(h, **columns) for h, columns in zip(out, cut, strict=True))


def build_of(design: Design) -> Build | None:
    """Return the pendulum of a design as built; None if no pendulum is recommended."""
    pendulum, scene = design.pendulum, design.scene
    if pendulum is None:
        return None
    bob, g = bob_of(design.problem.limits), float(scene.gravity)
    mass, length, zeta = float(pendulum.mass), float(pendulum.length), float(pendulum.damping_ratio)
    block, mu = scene.block, mass / float(scene.block.mass)
    body, rod = bob.built(mass, length, g)
    half, rod_share = float(bob.half_height(body)), bob.rod_share(rod, g)
    problem = design.problem
    angle = problem.reached(design.rod_angle)
    motions = problem.strongest_motions(problem.ratios(pendulum))
    loads = loads_of([Scene(block, m, g) for m in motions], pendulum) or free_swing(pendulum, angle, g)
    friction = needed_friction(scene, problem.stated_motions, pendulum)
    # Rod and hinge carry the whole body. The part that does not swing is assumed to pull like the rest.
    up = body * (1.0 + rod_share) / mass if math.isfinite(body) else 1.0
    # The condition of uplift is |B| f = (1 + mu) nu + k, see `tpd.theory.uplift`. For a very slow excitation
    # |B| is 1 + kappa mu, for a very fast one it is 1.
    capacity = (1.0 + mu) * float(block.slenderness) + float(block.friction)
    wall = 0.5 * float(block.clear_width)
    # At an impact the hinge moves down with the old lower edge, and then up with the new one.
    jump = 0.5 * float((1.0 + block.velocity_ratio) * block.base_width * scene.rate * block.slenderness)
    kappa = float(pendulum.hinge_in(block) / block.centroid)
    lifts = None
    if not problem.has_earthquakes:
        # The margin is 1 - f/f_uplift, which gives the acceleration that lifts the block.
        cases = scene.parameters(pendulum), scene.parameters()
        with_it, without = (float(p.f / (1.0 - uplift(p).margin)) for p in cases)
        lifts = with_it, without
    build = Build(
        bob=bob,
        mass=body,
        mass_at_hinge=body * (1.0 + rod_share) - mass,
        bob_width=2.0 * float(bob.radius(body)),
        bob_height=2.0 * half,
        rod=rod,
        rod_share=rod_share,
        depth=rod + half,
        wall=wall if math.isfinite(wall) else math.nan,
        reach=float(bob.reach(body, rod, angle)),
        angle=angle,
        frequency=math.sqrt(g / length) / (2.0 * math.pi),
        damping=float(pendulum.hinge_damping(g)),
        rebound=math.exp(-math.pi * zeta / math.sqrt(1.0 - zeta**2)) if zeta < 1.0 else 0.0,
        weight=body * (1.0 + rod_share) * g,
        breakaway=_BREAKAWAY * mass * g * length,
        impulse=body * (1.0 + rod_share) * jump,
        loads=loads._replace(tension=loads.tension * up, hinge=loads.hinge * up, friction=friction),
        uplift_harmonic=lifts,
        uplift_slow_fast=(capacity / (1.0 + kappa * mu), capacity),
        pull=pull_test(scene),
    )
    return replace(build, parts=parts_of(build, mass * length**2)) if math.isfinite(body) else build


def parts_of(build: Build, inertia: float) -> Parts:
    """Return the sizes of the parts from the largest loads. The formulas are in `Parts`.

    Args:
        build: the pendulum as built.
        inertia: moment of inertia of the point pendulum about its hinge, kg m^2.
    """
    loads, stress, arm = build.loads, YIELD / SAFETY, ARM * build.rod
    moment, half = build.damping * loads.rate, build.wall / _PLACE
    # A damper that is too long for the cavity gets a shorter arm.
    if arm * build.angle > half:
        arm = half / build.angle
    # The equation for the rod is a cubic without a quadratic term, so its roots sum to zero. One root is
    # positive, and it has the largest real part.
    rod = max(np.roots([math.pi * stress, 0.0, -4.0 * loads.tension, -32.0 * moment]).real)
    # The linear damper pulls on the rod, so its force adds to the load of the hinge. A damper at the
    # hinge would not.
    pin = math.sqrt(2.0 * math.sqrt(3.0) * (loads.hinge + moment / arm) / (math.pi * stress))
    rod, pin = (1e-3 * math.ceil(1e3 * float(d)) for d in (rod, pin))
    stop = float(np.fmin(build.reach, build.wall))
    free = stop - 0.5 * build.bob_width
    # The stop must bring the bob to rest before the wall.
    distance = float(np.fmin(STOPPING * free, build.wall - stop))
    distance = distance if distance > 0.0 else math.nan
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
        stop_way=distance,
        stop_force=inertia * loads.rate**2 / distance,
    )


def loads_of(scenes: Sequence[Scene], pendulum: Pendulum) -> Loads | None:
    """Return the largest loads over the motions in which the block stands, without the friction at the base;
    None if it stands in no motion."""
    histories = [motion_history(scene, pendulum) for scene in scenes]
    # A block that overturns takes its pendulum with it, so its loads do not matter.
    stands = [h for h in histories if is_one_of(h.status, *STANDING)]
    if not stands:
        return None
    # The largest loads of all motions. They need not occur in the same motion.
    tension, hinge, rate = map(float, np.max([h.loads(pendulum) for h in stands], axis=0))
    return Loads(tension, hinge, rate, math.nan, len(stands))


def free_swing(pendulum: Pendulum, angle: float, gravity: float) -> Loads:
    """Return the loads of an undamped swing from rest at an angle (rad), in a block that does not move.

    By the conservation of energy the rate at the lowest point is sqrt(2 g (1 - cos angle)/l), and the tension
    is m g (3 - 2 cos angle).
    """
    fall = gravity * (1.0 - math.cos(angle))
    tension = float(pendulum.mass) * (gravity + 2.0 * fall)
    return Loads(tension, tension, math.sqrt(2.0 * fall / float(pendulum.length)), math.nan, 0)


def pull_test(scene: Scene) -> PullTest:
    """Return the expected results of a pull-and-release test of the block without a pendulum.

    If the test gives other results, the losses of the block differ from the stated ones.
    """
    block, g = scene.block, float(scene.gravity)
    nu, k = float(block.slenderness), float(block.friction)
    # If friction holds the block at this tilt, the test gives no impacts.
    tilt, rate, impacts = _PULL * nu, float(scene.rate), 0
    taus = np.zeros(1)
    if tilt < nu - k:
        turns, taus = turning_tilts(nu, k, float(block.velocity_ratio), tilt, _MOST)
        # Count the impacts until the first turning point at which at most half of the tilt is left.
        below_half = np.flatnonzero(turns <= _HALF * tilt)
        impacts = int(below_half[0]) if below_half.size else 0
    return PullTest(
        tilt=tilt,
        sway=tilt * float(block.height),
        # The force acts at the top, and the weight has the moment (nu + k) M g b.
        force=(nu + k) * float(block.mass) * g * float(block.centroid) / float(block.height),
        impacts=impacts,
        seconds=float(taus[impacts]) / rate if impacts else math.nan,
    )
