"""Runs of Drake: blocks with pendulums through given accelerations of the base, one after another.

The floor is a body of its own, so heavy that block and bob do not move it; a force gives it the acceleration
of the base. The joint between floor and block then has the block's motion on the base.
"""

from __future__ import annotations

import math
import os
from collections.abc import Callable, Sequence
from concurrent.futures import ThreadPoolExecutor
from importlib import import_module
from typing import Any

import numpy as np

from tpd.engines.rigid_body import RADIUS, RigidBody
from tpd.engines.rollouts import Accelerations, Engine, EngineRuns, Found, kept, let_go, placed

_FLOOR = 1e6
"""Mass of the floor over those of block and bob: these disturb its acceleration by a millionth."""
_STIFFNESS = 20.0
"""Stiffness of a contact over that of the block's mass and the contact's time constant."""
_RELAXATION = 0.3
"""Relaxation time of a contact over its time constant: impacts are Housner's then, at both time steps."""
_CHUNK = 2000
"""Time steps between two looks at a run."""


def available() -> str:
    """Version of Drake.

    Raises:
        ValueError: it is not installed.
    """
    try:
        import_module("pydrake")
    except ImportError as error:
        raise ValueError("the engine Drake is not installed: pip install 'tpd[drake]' brings it") from error
    from importlib.metadata import version

    return version("drake")


def follow(
    bodies: Sequence[RigidBody],
    starts: np.ndarray,
    shaking: Accelerations,
    duration: np.ndarray,
    late: np.ndarray,
    *,
    workers: int | None = None,
    progress: Callable[[float], None] | None = None,
) -> EngineRuns:
    """Follow n runs of blocks of one size, with one time step; see `tpd.engines.rollouts.follow`."""
    found, step = Found(bodies), bodies[0].step
    steps = np.ceil(duration / step).astype(int)
    # Times of the longest run: the accelerations of all runs are asked for at once.
    pushes = shaking(step * np.arange(steps.max() + 1))

    def one(i: int) -> None:
        run = _Run(bodies[i], starts[i], pushes[i])
        done = 0
        while done < steps[i] and not found.overturned[i]:
            n = int(min(_CHUNK, steps[i] - done))
            found.see(np.array([i]), run.on(done, n)[None], late, np.array([n]))
            done += n

    with ThreadPoolExecutor(min(workers or os.cpu_count() or 1, len(bodies))) as crew:
        for count, _ in enumerate(crew.map(one, range(len(bodies))), 1):
            if progress is not None:
                progress(count / len(bodies))
    return found.runs()


def free_rocking(body: RigidBody) -> float:
    """Velocity ratio of an impact, see `tpd.engines.rollouts.free_rocking`."""
    # Half of the toppling tilt is given back within two of these times, for slender blocks.
    steps = math.ceil(8.0 * math.sqrt(body.half_height / body.gravity) / body.step)
    run, states = _Run(body, let_go(body), np.zeros(steps + 1)), []
    for done in range(0, steps, _CHUNK):
        states.append(run.on(done, min(_CHUNK, steps - done)))
        if np.any(states[-1][:, 3] < 0.0) and len(states) > 1:
            break
    return kept(body, np.concatenate(states)[:, 1:])


class _Run:
    """A run that is followed in pieces."""

    def __init__(self, body: RigidBody, start: np.ndarray, accelerations: np.ndarray) -> None:
        d = import_module("pydrake.all")
        builder = d.DiagramBuilder()
        plant, heavy = _plant(d, builder, body)
        times = body.step * np.arange(len(accelerations))
        forces = np.zeros((plant.num_velocities(), len(times)))
        forces[0] = heavy * accelerations
        source = builder.AddSystem(d.TrajectorySource(d.PiecewisePolynomial.FirstOrderHold(times, forces)))
        builder.Connect(source.get_output_port(), plant.get_applied_generalized_force_input_port())
        self.log = d.LogVectorOutput(plant.get_state_output_port(), builder, body.step)
        self.simulator = d.Simulator(builder.Build())
        context = plant.GetMyMutableContextFromRoot(self.simulator.get_mutable_context())
        self.step, self.half = body.step, plant.num_velocities()
        state = placed(body, start)
        # The floor comes first in positions and velocities, and Drake's angle of the plane has another sign.
        positions, velocities = (np.concatenate([[0.0], x]) for x in np.split(state, 2))
        positions[3], velocities[3] = -positions[3], -velocities[3]
        plant.SetPositions(context, positions)
        plant.SetVelocities(context, velocities)

    def on(self, done: int, steps: int) -> np.ndarray:
        """Go on for some steps: states after each, time first, then positions and velocities as those of
        MuJoCo."""
        log = self.log.FindMutableLog(self.simulator.get_mutable_context())
        log.Clear()
        # Half a step more, so that rounding leaves no step out.
        self.simulator.AdvanceTo((done + steps + 0.5) * self.step)
        times, states = log.sample_times(), log.data().T.copy()
        states[:, 3] *= -1.0
        states[:, self.half + 3] *= -1.0
        block = np.delete(states, [0, self.half], axis=1)
        return np.concatenate([times[:, None], block], axis=1)[-steps:]


def _plant(d: Any, builder: Any, body: RigidBody) -> tuple[Any, float]:
    """Bodies, joints and contacts, and the mass of the floor."""
    plant, _ = d.AddMultibodyPlant(
        d.MultibodyPlantConfig(
            time_step=body.step,
            discrete_contact_approximation="sap",
            contact_model="point",
            # Floor and block are joined, and touch.
            adjacent_bodies_collision_filters=False,
        ),
        builder,
    )
    plant.mutable_gravity_field().set_gravity_vector([0.0, 0.0, -body.gravity])
    heavy = _FLOOR * (body.mass + body.bob)
    floor = plant.AddRigidBody("floor", _ball(d, heavy, 1.0))
    plant.AddJoint(d.PrismaticJoint("base", plant.world_frame(), floor.body_frame(), [1.0, 0.0, 0.0]))
    block = plant.AddRigidBody("block", _ball(d, body.mass, math.sqrt(2.5 * body.inertia / body.mass)))
    # The plane of a planar joint is x and y of its frame: x and z of the world after a quarter of a turn.
    turn, zero = d.RotationMatrix.MakeXRotation(0.5 * math.pi), [0.0, 0.0, 0.0]
    above = _frame(d, plant, floor, d.RigidTransform(turn, [0.0, 0.0, body.half_height]))
    plant.AddJoint(d.PlanarJoint("plane", above, _frame(d, plant, block, d.RigidTransform(turn, zero))))
    contact = d.ProximityProperties()
    d.AddContactMaterial(
        properties=contact,
        point_stiffness=_STIFFNESS * body.mass / body.contact_time**2,
        friction=d.CoulombFriction(body.sliding, body.sliding),
    )
    contact.AddProperty("material", "relaxation_time", _RELAXATION * body.contact_time)
    radius, b = RADIUS * body.half_height, body.half_height
    # A box, because Drake warns of every half space that it cannot touch what is deformable.
    slab = d.Box(200.0 * b, 200.0 * b, 2.0 * b), d.RigidTransform([0.0, 0.0, -radius - b])
    plant.RegisterCollisionGeometry(floor, slab[1], slab[0], "floor", contact)
    for name, x in (("left", -body.half_width), ("right", body.half_width)):
        corner = d.RigidTransform([x, 0.0, -b])
        plant.RegisterCollisionGeometry(block, corner, d.Sphere(radius), name, contact)
    if body.bob > 0.0:
        at, size = [0.0, 0.0, -body.rod], 1e-5 * body.rod
        inertia = d.UnitInertia.SolidSphere(size).ShiftFromCenterOfMass(at)
        bob = plant.AddRigidBody("bob", d.SpatialInertia(body.bob, at, inertia))
        hinge = _frame(d, plant, block, d.RigidTransform([0.0, 0.0, body.half_height]))
        plant.AddJoint(d.RevoluteJoint("rod", hinge, bob.body_frame(), [0.0, 1.0, 0.0], body.damping))
    plant.Finalize()
    return plant, heavy


def _ball(d: Any, mass: float, radius: float) -> Any:
    """Inertia about the centre of mass of a ball: in the plane only its moment counts."""
    return d.SpatialInertia(mass, [0.0, 0.0, 0.0], d.UnitInertia.SolidSphere(radius))


def _frame(d: Any, plant: Any, of: Any, place: Any) -> Any:
    return plant.AddFrame(d.FixedOffsetFrame(f"{of.name()} {place.translation()}", of.body_frame(), place))


DRAKE = Engine("Drake", available, follow, free_rocking, rubs=False)
