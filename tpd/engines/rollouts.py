"""Runs of MuJoCo: blocks with pendulums through given accelerations of the base, many at once."""

from __future__ import annotations

import math
import os
from collections.abc import Callable, Sequence
from typing import Any, NamedTuple

import numpy as np

from tpd.core.progress import unreported
from tpd.engines.rigid_body import RigidBody

FALLEN = 1.3
"""Tilt beyond which a block has overturned, rad."""
_CHUNK = 2000
"""Time steps between two looks at the runs."""
_LIFTED = 1e-3
"""Height over the half height above which a corner is off the floor."""

Accelerations = Callable[[np.ndarray], np.ndarray]
"""Accelerations of the base (runs, steps), m/s^2, at times (steps,) from the start of the runs."""


class EngineRuns(NamedTuple):
    """Runs of an engine: arrays of shape (n,)."""

    overturned: np.ndarray
    peak: np.ndarray
    """Largest |phi|, rad; infinite where the block overturns."""
    settled: np.ndarray
    """Largest |phi| at the end of a run, rad; infinite where the block overturns."""
    relative: np.ndarray
    """Largest |psi - phi|, rad, up to an overturning."""
    slid: np.ndarray
    """Largest shift of a corner on the floor, m, up to an overturning."""
    bounced: np.ndarray
    """Whether both corners were off the floor at once, up to an overturning."""

    def first(self, n: int) -> EngineRuns:
        """The first n of the runs."""
        return EngineRuns(*(x[:n] for x in self))


def available() -> str:
    """Version of MuJoCo.

    Raises:
        ValueError: it is not installed.
    """
    try:
        return str(_mujoco().__version__)
    except ImportError as error:
        raise ValueError(
            "the engine MuJoCo is not installed: pip install 'tpd[engines]' brings it"
        ) from error


def _mujoco() -> Any:
    """Import MuJoCo, which is optional. Its types do not name what its compiled module has."""
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
    """Follow n runs of blocks of one size, with one time step.

    Args:
        bodies: of every run; all have a pendulum, or none has.
        starts: (phi, psi, phi', psi') in rad and rad/s, shape (n, 4); a tilted block stands on its corner.
        shaking: accelerations of the base of all runs.
        duration: of every run, s.
        late: time from which the tilt of a run counts as settled, s.
        workers: threads; default the number of cores.
        progress: called with the share that is done.
    """
    from mujoco import rollout

    mujoco = _mujoco()
    models = [mujoco.MjModel.from_xml_string(body.mjcf()) for body in bodies]
    threads = min(workers or os.cpu_count() or 1, len(models))
    datas = [mujoco.MjData(models[0]) for _ in range(threads)]
    full = mujoco.mjtState.mjSTATE_FULLPHYSICS
    states = np.zeros((len(models), mujoco.mj_stateSize(models[0], full)))
    # Time comes first in a state, then positions and velocities.
    states[:, 1:] = [placed(body, start) for body, start in zip(bodies, starts, strict=True)]
    found, left, step, done = Found(bodies), np.arange(len(models)), bodies[0].step, 0
    steps = np.ceil(duration / step).astype(int)
    # In chunks, so that an overturned block is followed no further and an interruption is heard.
    while left.size:
        n = int(min(_CHUNK, steps[left].max() - done))
        times = step * (done + np.arange(n))
        control = np.repeat(shaking(times)[left, :, None], models[0].nu, axis=2)
        some = [models[i] for i in left]
        passed, _ = rollout.rollout(some, datas[: min(threads, len(some))], states[left], control)
        found.see(left, np.asarray(passed), late, steps[left] - done)
        states[left], done = np.asarray(passed)[:, -1], done + n
        left = left[~found.overturned[left] & (steps[left] > done)]
        progress(min(1.0, done / float(steps.max())) if left.size else 1.0)
    return found.runs()


def _largest(values: np.ndarray, where: np.ndarray) -> np.ndarray:
    """Largest size of each row (n, m) where it counts, (n,)."""
    return np.max(np.where(where, np.abs(values), 0.0), axis=1)


class Found:
    """Largest sizes met so far."""

    def __init__(self, bodies: Sequence[RigidBody]) -> None:
        n, one = len(bodies), bodies[0]
        self.a = np.array([body.half_width for body in bodies])
        self.b, self.has_pendulum = one.half_height, one.bob > 0.0
        self.overturned, self.bounced = np.zeros(n, dtype=bool), np.zeros(n, dtype=bool)
        self.peak, self.settled, self.relative, self.slid = np.zeros((4, n))

    def see(self, rows: np.ndarray, passed: np.ndarray, late: np.ndarray, steps: np.ndarray) -> None:
        """Take the states of some runs (rows, steps, state) in."""
        time, x, z, tilt = np.moveaxis(passed[:, :, :4], 2, 0)
        # An overturned block goes on falling, and a run that has come to its end goes on: both count no more.
        fell = np.logical_or.accumulate(~(np.abs(tilt) < FALLEN), axis=1)
        counts = ~fell & (np.arange(tilt.shape[1])[None] < steps[:, None])
        self.overturned[rows] |= np.any(fell & (np.arange(tilt.shape[1])[None] < steps[:, None]), axis=1)
        self.peak[rows] = np.maximum(self.peak[rows], _largest(tilt, counts))
        at_end = counts & (time >= late[rows, None])
        self.settled[rows] = np.maximum(self.settled[rows], _largest(tilt, at_end))
        if self.has_pendulum:
            self.relative[rows] = np.maximum(self.relative[rows], _largest(passed[:, :, 4], counts))
        cos, sin, a = np.cos(tilt), np.sin(tilt), self.a[rows, None]
        off = np.ones_like(counts)
        for side in (-1.0, 1.0):
            height = z + self.b * (1.0 - cos) - side * a * sin
            down = height < _LIFTED * self.b
            shift = x + side * a * cos - self.b * sin - side * a
            self.slid[rows] = np.maximum(self.slid[rows], _largest(shift, counts & down))
            off &= ~down
        self.bounced[rows] |= np.any(off & counts, axis=1)

    def runs(self) -> EngineRuns:
        """The runs, sizes of overturned ones infinite."""
        peak, settled = (np.where(self.overturned, math.inf, v) for v in (self.peak, self.settled))
        return EngineRuns(self.overturned, peak, settled, self.relative, self.slid, self.bounced)


def placed(body: RigidBody, start: np.ndarray) -> np.ndarray:
    """Positions and velocities of a block that stands on its corner."""
    tilt, psi, tilt_rate, psi_rate = (float(v) for v in start)
    side = 1.0 if tilt >= 0.0 else -1.0
    # A start says how the block is turned; where it stands follows from the corner that it stands on.
    # From the corner to the centre of mass, turned by the tilt.
    dx, dz = -side * body.half_width, body.half_height
    cos, sin = math.cos(tilt), math.sin(tilt)
    x, z = dx * cos + dz * sin, dz * cos - dx * sin
    at = [side * body.half_width + x, z - body.half_height, tilt]
    moving = [tilt_rate * z, -tilt_rate * x, tilt_rate]
    if body.bob > 0.0:
        return np.array([*at, psi - tilt, *moving, psi_rate - tilt_rate])
    return np.array([*at, *moving])


def free_rocking(body: RigidBody) -> float:
    """Return the velocity ratio of the first impact of a block without pendulum and friction, released from
    half of its toppling tilt: the square root of the ratio of the energies after and before the impact. NaN
    if there is no impact."""
    mujoco = _mujoco()
    model = mujoco.MjModel.from_xml_string(body.mjcf())
    data = mujoco.MjData(model)
    assert max(body.bob, body.friction) == 0.0, "friction and a bob change the energy between impacts"
    half_of_toppling = 0.5 * math.atan2(body.half_width, body.half_height)
    state = placed(body, np.array([half_of_toppling, 0.0, 0.0, 0.0]))
    data.qpos[:], data.qvel[:] = state[:3], state[3:]
    # A contact of this stiffness ends after some time constants, in which the block hardly moves.
    around = round(12.0 * body.contact_time / body.step)
    energies, impact = [], math.inf
    for step in range(10_000_000):
        mujoco.mj_step(model, data)
        (vx, vz, rate), height = data.qvel, data.qpos[1]
        kinetic = 0.5 * body.mass * (vx**2 + vz**2) + 0.5 * body.inertia * rate**2
        energies.append(float(kinetic + body.mass * body.gravity * height))
        if data.qpos[2] < 0.0:
            impact = min(impact, step)
        if step == impact + around:
            # An impact right after the release leaves no motion before it to compare with.
            return math.sqrt(energies[step] / energies[step - 2 * around]) if impact >= around else math.nan
    return math.nan
