"""Runs in MuJoCo: many blocks with pendulums at once, under given accelerations of the base."""

from __future__ import annotations

import math
import os
from collections.abc import Callable, Sequence
from typing import Any, NamedTuple

import numpy as np

from tpd.core.formatting import install
from tpd.core.progress import unreported
from tpd.engines.rigid_body import RigidBody

FALLEN = 1.3
"""Tilt beyond which a block has overturned, rad."""
_CHUNK = 2000
"""Number of time steps after which the runs are examined."""
_LIFTED = 1e-3
"""Height divided by that of the centroid above which a corner has left the floor."""

Accelerations = Callable[[np.ndarray], np.ndarray]
"""Function that returns the base accelerations (runs, steps), m/s^2, at the times (steps,) since the
start."""


class EngineRuns(NamedTuple):
    """Results of runs in an engine: arrays of shape (n,)."""

    overturned: np.ndarray
    """Whether the block overturns."""
    tilt: np.ndarray
    """Largest |phi|, rad; infinite if the block overturns."""
    settled_tilt: np.ndarray
    """Largest |phi| at the end of a run, rad; infinite if the block overturns."""
    rod_angle: np.ndarray
    """Largest |psi - phi| before an overturning, rad."""
    slid: np.ndarray
    """Largest displacement of a corner on the floor before an overturning, m."""
    bounced: np.ndarray
    """Whether both corners left the floor at the same time before an overturning."""

    def first(self, n: int) -> EngineRuns:
        """Return the first n runs."""
        return EngineRuns(*(x[:n] for x in self))


def available() -> str:
    """Return the version of MuJoCo.

    Raises:
        ValueError: MuJoCo is not installed.
    """
    try:
        return str(_mujoco().__version__)
    except ImportError as error:
        raise ValueError(f"the engine MuJoCo is not installed: {install('engines')}") from error


def _mujoco() -> Any:
    """Import MuJoCo, which is optional. The result is `Any`, because MuJoCo does not declare its names."""
    import mujoco

    return mujoco


def follow(
    bodies: Sequence[RigidBody],
    starts: np.ndarray,
    shaking: Accelerations,
    duration: np.ndarray,
    late: np.ndarray,
    *,
    workers: int | None = None,
    progress: Callable[[float], None] = unreported,
) -> EngineRuns:
    """Follow n runs of blocks of the same size, with one time step.

    Args:
        bodies: bodies of the runs. Either all or none have a pendulum.
        starts: initial states (phi, psi, phi', psi') in rad and rad/s, shape (n, 4). A tilted block stands on
            its corner.
        shaking: function that returns the accelerations of the base of all runs.
        duration: duration of each run, s.
        late: time from which the tilt of each run counts as settled, s.
        workers: number of threads; all cores by default.
        progress: function that is called with the finished share of the work.
    """
    from mujoco import rollout

    mujoco = _mujoco()
    models = [mujoco.MjModel.from_xml_string(body.mjcf()) for body in bodies]
    # Each thread needs work memory of its own. All models have the same dimensions.
    threads = min(workers or os.cpu_count() or 1, len(models))
    datas = [mujoco.MjData(models[0]) for _ in range(threads)]
    full = mujoco.mjtState.mjSTATE_FULLPHYSICS
    states = np.zeros((len(models), mujoco.mj_stateSize(models[0], full)))
    # A state of MuJoCo begins with the time. Positions and velocities follow.
    states[:, 1:] = [placed(body, start) for body, start in zip(bodies, starts, strict=True)]
    results, remaining, step, done = Maxima(bodies), np.arange(len(models)), bodies[0].step, 0
    steps = np.ceil(duration / step).astype(int)
    # In chunks: overturned blocks are followed no further, and Ctrl-C has an effect between chunks.
    while remaining.size:
        n = int(min(_CHUNK, steps[remaining].max() - done))
        times = step * (done + np.arange(n))
        # Every actuator of a model has the same control, the acceleration of the base.
        control = np.repeat(shaking(times)[remaining, :, None], models[0].nu, axis=2)
        some = [models[i] for i in remaining]
        path, _ = rollout.rollout(some, datas[: min(threads, len(some))], states[remaining], control)
        results.add(remaining, np.asarray(path), late, steps[remaining] - done)
        states[remaining], done = np.asarray(path)[:, -1], done + n
        # A run ends when the block has overturned or its duration is over.
        remaining = remaining[~results.overturned[remaining] & (steps[remaining] > done)]
        progress(min(1.0, done / float(steps.max())) if remaining.size else 1.0)
    return results.runs()


class Maxima:
    """Largest angles and displacements of runs so far."""

    def __init__(self, bodies: Sequence[RigidBody]) -> None:
        n, one = len(bodies), bodies[0]
        # The width may scatter between runs; the height does not.
        self.a = np.array([body.half_width for body in bodies])
        self.b, self.has_pendulum = one.centroid, one.bob > 0.0
        self.overturned, self.bounced = np.zeros(n, dtype=bool), np.zeros(n, dtype=bool)
        self.tilt, self.settled_tilt, self.rod_angle, self.slid = np.zeros((4, n))

    def add(self, rows: np.ndarray, path: np.ndarray, late: np.ndarray, steps: np.ndarray) -> None:
        """Add the states of some runs, shape (rows, steps, state)."""
        # The fourth coordinate of a body with a pendulum is the angle between rod and block.
        time, x, z, tilt, rod_angle, *_ = np.moveaxis(path, 2, 0)
        # States after an overturning or after the end of a run do not count.
        lasts = np.arange(tilt.shape[1]) < steps[:, None]
        fell = np.logical_or.accumulate(~(np.abs(tilt) < FALLEN), axis=1)
        counts = ~fell & lasts
        self.overturned[rows] |= np.any(fell & lasts, axis=1)

        def grow(largest: np.ndarray, values: np.ndarray, where: np.ndarray) -> None:
            sizes = np.where(where, np.abs(values), 0.0)
            largest[rows] = np.maximum(largest[rows], sizes.max(axis=1))

        grow(self.tilt, tilt, counts)
        # The last periods of a run count as settled.
        grow(self.settled_tilt, tilt, counts & (time >= late[rows, None]))
        if self.has_pendulum:
            grow(self.rod_angle, rod_angle, counts)
        # Height and displacement of each corner follow from position and tilt of the block.
        cos, sin, a = np.cos(tilt), np.sin(tilt), self.a[rows, None]
        off = np.ones_like(counts)
        for side in (-1.0, 1.0):
            height = z + self.b * (1.0 - cos) - side * a * sin
            down = height < _LIFTED * self.b
            shift = x + side * a * cos - self.b * sin - side * a
            # A corner slides only while it is on the floor.
            grow(self.slid, shift, counts & down)
            off &= ~down
        self.bounced[rows] |= np.any(off & counts, axis=1)

    def runs(self) -> EngineRuns:
        """Return the results of the runs. The tilts of overturned runs are infinite."""
        tilt, settled_tilt = (np.where(self.overturned, math.inf, v) for v in (self.tilt, self.settled_tilt))
        return EngineRuns(self.overturned, tilt, settled_tilt, self.rod_angle, self.slid, self.bounced)


def placed(body: RigidBody, start: np.ndarray) -> np.ndarray:
    """Return positions and velocities of a block that stands on its corner."""
    tilt, psi, tilt_rate, psi_rate = (float(v) for v in start)
    side = 1.0 if tilt >= 0.0 else -1.0
    # The initial state has the angles only. The position follows from the corner on which the block stands:
    # (x, z) is the vector from this corner to the centre of mass, rotated by the tilt.
    dx, dz = -side * body.half_width, body.centroid
    cos, sin = math.cos(tilt), math.sin(tilt)
    x, z = dx * cos + dz * sin, dz * cos - dx * sin
    at = [side * body.half_width + x, z - body.centroid, tilt]
    # The block rotates about the corner, so its velocity is perpendicular to (x, z).
    moving = [tilt_rate * z, -tilt_rate * x, tilt_rate]
    if body.bob > 0.0:
        return np.array([*at, psi - tilt, *moving, psi_rate - tilt_rate])
    return np.array([*at, *moving])


def free_rocking(body: RigidBody) -> float:
    """Return the coefficient of restitution of the first impact of free rocking in MuJoCo.

    The block, without pendulum and friction, is released from half of its toppling tilt. The coefficient is
    the square root of the ratio of the energies after and before the impact. The result is NaN if there is no
    impact.
    """
    mujoco = _mujoco()
    model = mujoco.MjModel.from_xml_string(body.mjcf())
    data = mujoco.MjData(model)
    assert max(body.bob, body.friction) == 0.0, "friction and a bob change the energy between impacts"
    # The released block stands on one corner, and crosses zero tilt at its first impact.
    half_of_toppling = 0.5 * math.atan2(body.half_width, body.centroid)
    state = placed(body, np.array([half_of_toppling, 0.0, 0.0, 0.0]))
    data.qpos[:], data.qvel[:] = state[:3], state[3:]
    # The contact force of this stiffness ends after some time constants, in which the block moves very
    # little.
    around = round(12.0 * body.contact_time / body.step)
    energies, impact = [], math.inf
    for step in range(10_000_000):
        mujoco.mj_step(model, data)
        (vx, vz, rate), height = data.qvel, data.qpos[1]
        # Without friction the energy changes only at the impact.
        kinetic = 0.5 * body.mass * (vx**2 + vz**2) + 0.5 * body.inertia * rate**2
        energies.append(float(kinetic + body.mass * body.gravity * height))
        if data.qpos[2] < 0.0:
            impact = min(impact, step)
        if step == impact + around:
            # If the impact follows the release too soon, the energy before it is unknown.
            return math.sqrt(energies[step] / energies[step - 2 * around]) if impact >= around else math.nan
    return math.nan
