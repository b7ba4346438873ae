"""Time history of a block under a ground motion, and the forces on its base."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np

from tpd.answers.transient import FREE, MAX_EVENTS
from tpd.compiled.columns import SLIP
from tpd.compiled.rows import ground_row_of
from tpd.compiled.trajectories import history
from tpd.core import checks
from tpd.scene.ground_motion import LONGEST_FREE, GroundMotion
from tpd.scene.pytrees import single
from tpd.scene.scene import Pendulum, Scene
from tpd.scene.status import Status
from tpd.theory.no_uplift import Sliding, sliding_in_runs

STRONG = 0.01
"""Rate, divided by nu omega0, above which an impact counts as strong. Slower impacts belong to a rattling
motion, and their number depends on the rate at which the block is set to rest."""


@dataclass(frozen=True)
class MotionHistory:
    """Time history of a block under a ground motion, from the exact solution of the linear model.

    Rows are NaN from the time at which an overturning block reaches a right angle or counts as overturned
    (`Transient.overturning_time`), and after the end of a motion without a result.
    """

    times: np.ndarray
    """Times, s, shape (times,)."""
    base: np.ndarray
    """Acceleration of the base, m/s^2, shape (times,)."""
    tilt: np.ndarray
    """phi, rad, shape (times,). A positive acceleration of the base tilts a block at rest to positive phi."""
    swing: np.ndarray | None
    """psi, rad, shape (times,); None without a pendulum. A positive acceleration of the base swings a bob at
    rest to negative psi."""
    horizontal: np.ndarray
    """Horizontal force of the ground on the base, N, without the impulses of impacts. Friction must carry
    it."""
    vertical: np.ndarray
    """Upward force of the ground on the base, N."""
    impacts: np.ndarray
    """Times (s) of all impacts, and rates of the tilt after them (rad/s), shape (impacts, 2)."""
    rocking: np.ndarray
    """Whether the block moves on its base, shape (times,)."""
    status: Status
    """Outcome of the motion."""
    bob: np.ndarray | None = None
    """Loads of the pendulum, shape (times, 4): horizontal and vertical force of the hinge on the bob (N),
    angular rate of the rod, and angular rate between rod and block (rad/s). None without a pendulum."""
    toppling: float = np.inf
    """Tilt (rad) at which the block topples according to the linear model, the slenderness."""

    @property
    def overturned(self) -> bool:
        """Whether the block overturns, during the given times or later."""
        return bool(self.status == Status.overturned)

    def loads(self, pendulum: Pendulum) -> tuple[float, float, float]:
        """Return the largest loads of the pendulum of this motion.

        The forces are those of the linear model plus the centripetal force of the rod.

        Returns:
            Largest force along the rod (N), largest force of the hinge (N), and largest angular rate between
            rod and block (rad/s).

        Raises:
            ValueError: the motion has no pendulum.
        """
        if self.bob is None or self.swing is None:
            raise ValueError("a history without a pendulum has no loads on one")
        across, upwards, rate, relative = self.bob.T
        # The linear model neglects the square of the rate, but in a rod this force is often the largest.
        pull = float(pendulum.mass) * float(pendulum.length) * rate**2
        # The force of the hinge is split into the directions along and across the rod.
        tension = upwards * np.cos(self.swing) - across * np.sin(self.swing) + pull
        whole = np.hypot(across - pull * np.sin(self.swing), upwards + pull * np.cos(self.swing))
        return tuple(float(np.nanmax(np.abs(x))) for x in (tension, whole, relative))  # type: ignore[return-value]

    def impacts_above(self, rate: float) -> int:
        """Return the number of impacts after which the rate of the tilt exceeds `rate` (rad/s)."""
        _, rates = self.impacts.T
        return int(np.sum(np.abs(rates) > rate))

    @property
    def needed_friction(self) -> float:
        """Smallest coefficient of friction of the base with which it does not slide, until the end of the
        motion or until the block topples and does not return."""
        until = np.flatnonzero(np.abs(self.tilt) <= self.toppling).max(initial=-1) + 1
        needed = np.abs(self.horizontal[:until]) / np.maximum(self.vertical[:until], 1e-300)
        return float(np.max(needed)) if until else np.nan


def motion_history(
    scene: Scene,
    pendulum: Pendulum | None = None,
    *,
    times: checks.Vector | None = None,
    y0: checks.Vector | None = None,
    free: checks.Real = FREE,
) -> MotionHistory:
    """Compute the time history of a block under the pulse or record of its scene.

    The forces follow from the accelerations along the arcs in closed form. With d the side to which the block
    tilts, a half the width of its base, b and h the heights of centroid and hinge,

        H = M (x'' - b phi'') + m (x'' - h phi'' + l psi''),   V = (M + m) (g + a d phi'').

    Args:
        scene: a block under a `Pulse` or a `Record`.
        pendulum: pendulum of the block; None for the block without a pendulum.
        times: increasing times, s. By default there is one for every piece of the motion, and as many in the
            same interval after the motion.
        y0: initial state (phi, psi, phi', psi') in rad and rad/s; at rest by default. A positive acceleration
            of the base tilts a block at rest to positive phi, and swings the bob to negative psi.
        free: duration of the free motion after the ground motion, s; longer if `times` end later.

    Raises:
        ValueError: bad input.
    """
    checks.instance("scene", scene, Scene)
    row = ground_row_of(single(scene.ground_parameters(pendulum)))
    rate, piece = float(scene.rate), float(scene.excitation.piece)
    pieces = np.asarray(scene.excitation.pieces(), dtype=float)
    shaken, free = len(pieces) * piece, checks.within("free", free, 0.0, LONGEST_FREE, " s")
    if times is None:
        times = np.linspace(0.0, shaken + free, min(20_000, int(len(pieces) + free / piece) + 1))
    clock = checks.increasing("times", times)
    checks.not_negative("times", clock, every=True)
    # The motion is followed until the last of the times, even if the free motion would end earlier.
    free = float(clock[-1]) - shaken if clock[-1] > shaken + free else free
    start = np.zeros(4) if y0 is None else checks.state(y0) / [1.0, 1.0, rate, rate]
    states, impacts, status = history(row, start, pieces, clock * rate, free=free * rate, events=MAX_EVENTS)
    # The equations have no meaning after the block has reached the ground.
    if status == Status.overturned:
        # From the first time at which the tilt is no longer below a right angle, all rows are NaN.
        states[np.cumsum(~(np.abs(states["tilt"]) < 0.5 * np.pi)) > 0] = np.nan
    base = scene.excitation.acceleration_at(clock)
    # Conversion to SI units: tau is time multiplied by omega0.
    up, swinging = states["tilt_pull"] * rate**2, states["swing_pull"] * rate**2
    rates = states["swing_rate"] * rate, (states["swing_rate"] - states["tilt_rate"]) * rate
    mass, z, width = (float(getattr(scene.block, name)) for name in ("mass", "centroid", "base_width"))
    m, length, hinge = 0.0, 0.0, 0.0
    if pendulum is not None:
        m, length, hinge = map(float, (pendulum.mass, pendulum.length, pendulum.hinge_in(scene.block)))
    # A positive tilt moves the hinge to the left, and a positive rod angle moves the bob to the right.
    # The accelerations of hinge and centre of mass follow from the geometry; see the equations above.
    across = m * (base - hinge * up + length * swinging)
    lifting = float(scene.gravity) + 0.5 * width * states["side"] * up
    return MotionHistory(
        clock,
        base,
        states["tilt"],
        None if pendulum is None else states["swing"],
        mass * (base - z * up) + across,
        (mass + m) * lifting,
        np.stack([impacts["time"] / rate, impacts["rate"] * rate], axis=1),
        states["kind"] == SLIP,
        status,
        None if pendulum is None else np.stack([across, m * lifting, *rates], axis=1),
        float(scene.block.slenderness),
    )


def needed_friction(scene: Scene, motions: Sequence[GroundMotion], pendulum: Pendulum | None = None) -> float:
    """Return the coefficient of friction that keeps the base of a block from sliding under motions from rest;
    NaN without motions. See `MotionHistory.needed_friction`."""
    histories = (motion_history(replace(scene, excitation=motion), pendulum) for motion in motions)
    return max((history.needed_friction for history in histories), default=np.nan)


def sliding(scene: Scene, motions: Sequence[GroundMotion], pendulum: Pendulum | None = None) -> Sliding:
    """Return the result of `sliding_in_runs` for a block under motions from rest, without a pendulum and,
    if there is one, with it."""
    cases = {"without a pendulum": None} | ({} if pendulum is None else {"with the pendulum": pendulum})
    needed = {name: needed_friction(scene, motions, case) for name, case in cases.items()}
    return sliding_in_runs(needed, scene.block.base_friction)
