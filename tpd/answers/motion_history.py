"""Time histories of a block under a ground motion, and the forces at its base."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from tpd.answers.runs import rows_of
from tpd.answers.transient import FREE, MAX_EVENTS
from tpd.core import checks
from tpd.exact.terms import SHAKEN, SLIP
from tpd.exact.trajectories import history
from tpd.scene.ground_motion import LONGEST_FREE
from tpd.scene.scene import Pendulum, Scene
from tpd.scene.status import Status

STRONG = 0.01
"""Rate over nu omega0 above which an impact is counted as one: slower ones are a rattle, and how many of them
there are depends on when rattling is called rest."""


@dataclass(frozen=True)
class MotionHistory:
    """Motion over time of a block under a ground motion, from the exact solution of the linear equations.

    Rows are NaN once a block that overturns is past a right angle, and after the end of a motion without an
    answer."""

    times: np.ndarray
    """s, shape (times,)."""
    base: np.ndarray
    """Acceleration of the base, m/s^2."""
    tilt: np.ndarray
    """phi, rad."""
    swing: np.ndarray | None
    """psi, rad; None without a pendulum."""
    horizontal: np.ndarray
    """Force of the ground on the base, N: what friction has to carry, impacts left out."""
    vertical: np.ndarray
    """Force of the ground upwards, N."""
    impacts: np.ndarray
    """Times (s) and tilting rates after them (rad/s) of all impacts, shape (impacts, 2)."""
    rocking: np.ndarray
    """Whether the block moves on its base."""
    status: Status
    bob: np.ndarray | None = None
    """Horizontal and vertical force (N) of the hinge on the bob, angular rate of the rod, and that of the rod
    against the block (rad/s), shape (times, 4); None without a pendulum."""

    @property
    def overturned(self) -> bool:
        """Whether the block overturns, within the times or after them."""
        return bool(self.status == Status.overturned)

    def loads(self, pendulum: Pendulum) -> tuple[float, float, float]:
        """Largest force along the rod and of the hinge (N), and largest angular rate between rod and block
        (rad/s), of the pendulum that was followed.

        The forces are those of the linear equations, with the centripetal force of the rod's rate added.
        """
        if self.bob is None or self.swing is None:
            raise ValueError("a history without a pendulum has no loads on one")
        across, upwards, rate, relative = self.bob.T
        # The linear equations drop the square of the rate, which a rod feels first of all.
        pull = float(pendulum.mass) * float(pendulum.length) * rate**2
        tension = upwards * np.cos(self.swing) - across * np.sin(self.swing) + pull
        whole = np.hypot(across - pull * np.sin(self.swing), upwards + pull * np.cos(self.swing))
        return tuple(float(np.nanmax(np.abs(x))) for x in (tension, whole, relative))  # type: ignore[return-value]

    def impacts_above(self, rate: float) -> int:
        """Number of the impacts after which the block tilts faster than `rate` (rad/s)."""
        _, rates = self.impacts.T
        return int(np.sum(np.abs(rates) > rate))

    @property
    def needed_friction(self) -> float:
        """Largest horizontal over vertical force: a smaller coefficient of friction lets the base slide."""
        return float(np.nanmax(np.abs(self.horizontal) / np.maximum(self.vertical, 1e-300)))


def motion_history(
    scene: Scene,
    pendulum: Pendulum | None = None,
    *,
    times: checks.Vector | None = None,
    y0: checks.Vector | None = None,
    free: checks.Real = FREE,
) -> MotionHistory:
    """Follow a block through the pulse or record of its scene.

    The forces follow from the accelerations along the arcs in closed form: with d the side to which the block
    leans, a its half width and b its half height,

        H = M (x'' - b phi'') + m (x'' - 2 b phi'' + l psi''),   V = (M + m) (g + a d phi'').

    Args:
        scene: a block under a `Pulse` or a `Record`.
        pendulum: None is the bare block.
        times: increasing, s; by default every piece of the motion, and as often after it.
        y0: start (phi, psi, phi', psi') in rad and rad/s; at rest by default.
        free: free motion after the ground motion, s; more if `times` end later.

    Raises:
        ValueError: bad input.
    """
    checks.instance("scene", scene, Scene)
    row = rows_of(scene.block, pendulum, [scene.motion], float(scene.gravity))[0]
    rate, piece = float(scene.rate), float(scene.motion.piece)
    pieces = np.asarray(scene.motion.pieces(), dtype=float)
    shaken, free = len(pieces) * piece, checks.within("free", free, 0.0, LONGEST_FREE, " s")
    if times is None:
        times = np.linspace(0.0, shaken + free, min(20_000, int(len(pieces) + free / piece) + 1))
    clock = checks.increasing("times", times)
    checks.not_negative("times", clock, every=True)
    free = float(clock[-1]) - shaken if clock[-1] > shaken + free else free
    start = np.zeros(4) if y0 is None else checks.state(y0) / [1.0, 1.0, rate, rate]
    found = history(row, start, pieces, clock * rate, free=free * rate, events=MAX_EVENTS)
    states, status = found.states, getattr(Status, SHAKEN[found.status])
    # The equations mean nothing where the block lies down.
    if status == Status.overturned:
        states[np.cumsum(~(np.abs(states["tilt"]) < 0.5 * np.pi)) > 0] = np.nan
    base = scene.motion.acceleration_at(clock)
    # In SI: tau is time over 1/omega0.
    up, swinging = states["tilt_pull"] * rate**2, states["swing_pull"] * rate**2
    rates = states["swing_rate"] * rate, (states["swing_rate"] - states["tilt_rate"]) * rate
    mass, height, width = (float(getattr(scene.block, name)) for name in ("mass", "height", "width"))
    m, length = (0.0, 0.0) if pendulum is None else (float(pendulum.mass), float(pendulum.length))
    # A positive tilt takes the top to the left, and a positive angle of the rod the bob to the right.
    across = m * (base - height * up + length * swinging)
    lifting = float(scene.gravity) + 0.5 * width * states["side"] * up
    return MotionHistory(
        clock,
        base,
        states["tilt"],
        None if pendulum is None else states["swing"],
        mass * (base - 0.5 * height * up) + across,
        (mass + m) * lifting,
        np.stack([found.impacts["time"] / rate, found.impacts["rate"] * rate], axis=1),
        states["kind"] == SLIP,
        status,
        None if pendulum is None else np.stack([across, m * lifting, *rates], axis=1),
    )
