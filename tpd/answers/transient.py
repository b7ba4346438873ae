"""Motion of a block with or without a pendulum during a pulse or a record, and after it."""

from __future__ import annotations

import math
from functools import partial
from typing import Any

import equinox as eqx
import jax
import jax.numpy as jnp
import numpy as np
from jax.lax import stop_gradient
from jaxtyping import Float, Int

from tpd.compiled.columns import GRAZING, WIDTH
from tpd.compiled.derivatives import refused, unknown_in
from tpd.compiled.rows import ground_row_of
from tpd.compiled.simulate import GroundForcing, follow
from tpd.core import checks
from tpd.core.checks import Real, Whole
from tpd.models.base import Model
from tpd.models.piecewise import Nonlinear, Piecewise
from tpd.scene.ground_motion import LONGEST_FREE, GroundMotion
from tpd.scene.pytrees import Number, single
from tpd.scene.scene import Pendulum, Scene
from tpd.scene.status import STANDING, Status, code_of, is_one_of, status_name, status_of

FREE = 20.0
"""Default duration of the free motion that is followed after a ground motion, s."""
MAX_EVENTS = 200_000
"""Default for the largest number of events of a motion, in addition to one for each piece of the record."""


class Transient(eqx.Module):
    """Largest angles and outcome of a block under a ground motion.

    Angles are in rad, and times in s from the beginning of the motion.

    Angles, their times and the state are differentiable if the status is stood or rocked: with respect to
    every SI quantity of block, pendulum and gravity, to the size and the time scale of the motion, to the
    initial state and to the free time. The time of the first uplift is also differentiable if the block
    overturns. Otherwise the derivatives are NaN, and `status` gives the reason. The derivatives of a time
    that is infinite or zero, of the time of overturning, those in the samples of a record and in the cycles
    and the phase of a pulse, and all second derivatives are also NaN. Counts have no derivatives.

    With the nonlinear model (`Nonlinear`) the block overturns if its tilt reaches a right angle. A run whose
    energy is sufficient for this continues beyond its end until the outcome is certain.

    Attributes:
        tilt: largest |phi|, rad; infinite if the block overturns.
        swing: largest |psi|, rad; 0 without a pendulum.
        rod_angle: largest |psi - phi|, rad; 0 without a pendulum.
        tilt_time, swing_time, rod_angle_time: times at which these angles are reached, s.
        impacts: number of impacts on the base.
        uplift_time: time of the first uplift, s; infinite if the block stays on its base.
        overturning_time: time from which the block cannot return, s; infinite if it does not overturn.
        state: (phi, psi, phi', psi') at the end, rad and rad/s.
        status: outcome.
    """

    tilt: Number
    """Largest |phi|, rad; infinite if the block overturns."""
    swing: Number
    """Largest |psi|, the angle of the rod from the vertical, rad; 0 without a pendulum."""
    rod_angle: Number
    """Largest |psi - phi|, the angle between rod and block, rad; 0 without a pendulum."""
    tilt_time: Number
    """Time at which the largest |phi| is reached, s."""
    swing_time: Number
    """Time at which the largest |psi| is reached, s."""
    rod_angle_time: Number
    """Time at which the largest |psi - phi| is reached, s."""
    impacts: Int[Any, "..."]
    """Number of impacts on the base. All impacts of a rattling motion count until the block is set to rest.
    `Piecewise` sets the block to rest after an impact slower than 2e-7 nu (phi' in tau). With a restitution
    of 0.9999 or more this rate is up to 8e-5 nu, because slower impacts would exceed `max_events`.
    `Nonlinear` uses `rest_rate` times nu. The number depends on these rates;
    `tpd.answers.motion_history.MotionHistory.impacts_above` counts the impacts above a given rate."""
    uplift_time: Number
    """Time at which the block leaves its base for the first time, s; infinite if it never does."""
    overturning_time: Number
    """Time from which the block cannot return, s; infinite if it does not overturn."""
    state: Float[Any, "... 4"]
    """(phi, psi, phi', psi') at the end, in rad and rad/s."""
    status: Status
    """Outcome: stood, rocked, overturned, grazing (the motion only just reaches an event, and there is no
    derivative), event_bound or failed."""

    def __str__(self) -> str:
        if not (checks.is_concrete(self.tilt) and jnp.ndim(self.tilt) == 0):
            # A batch has no single status, and traced values are unknown.
            return repr(self)
        lines = [f"{status_name(self.status)}: {Status[self.status]}"]
        has_pendulum = float(self.swing) != 0.0
        for name in ("tilt", "swing", "rod_angle") if has_pendulum else ("tilt",):
            at = f"at {getattr(self, name + '_time'):.4g} s"
            lines.append(f"  {name:9s} {getattr(self, name):.6g} rad {at}")
        lines.append(f"  impacts   {int(self.impacts)}, including all impacts of a rattling motion")
        if math.isfinite(self.uplift_time):
            lines.append(f"  uplift    at {self.uplift_time:.4g} s")
        if math.isfinite(self.overturning_time):
            lines.append(f"  overturns at {self.overturning_time:.4g} s")
        return "\n".join(lines)


def transient(
    scene: Scene,
    pendulum: Pendulum | None = None,
    *,
    y0: checks.Vector | None = None,
    model: Model | None = None,
    free: Real = FREE,
    max_events: Whole = MAX_EVENTS,
) -> Transient:
    """Follow a block, with or without a pendulum, during the pulse or record of its scene and after it.

    `Piecewise()` solves the linear equations (25) exactly, with the base acceleration instead of the
    harmonic: a record is linear between its samples, and no event is missed. After the ground motion the
    block moves freely for `free` seconds. If its last arc cannot return, the block overturns, whatever its
    tilt at the end is. `Transient` explains the results of the nonlinear model.

    Args:
        scene: a block under a `Pulse` or a `Record`.
        pendulum: pendulum of the block; None for the block without a pendulum.
        y0: initial state (phi, psi, phi', psi') in rad and rad/s; at rest by default. A positive acceleration
            of the base tilts a block at rest to positive phi, and swings the bob to negative psi.
        model: `Piecewise()`, the exact solution of the linear model (default), or `Nonlinear()`, the
            nonlinear equations (4), of which `rtol` and `rest_rate` are used.
        free: duration of the free motion after the ground motion, s.
        max_events: largest number of events, in addition to one for each piece of the ground motion.

    Returns:
        Largest angles, times and outcome. `jax.jit`, `jax.vmap` and `jax.grad` apply.

    Raises:
        ValueError: bad input, or a model that cannot follow this block under such a motion.
        RuntimeError: JAX is in 32-bit mode.

    Example:
        >>> import tpd
        >>> block = tpd.Block(width=1.0, height=6.0, mass=9000.0, restitution=0.9595)
        >>> scene = tpd.Scene(block, tpd.Pulse.one_sine(frequency=1.2375, acceleration=3.0))
        >>> result = tpd.transient(scene, tpd.Pendulum(mass=450.0, length=0.9, damping_ratio=0.1))
        >>> tpd.status_name(result.status), round(float(result.tilt), 4)
        ('rocked', 0.0597)
    """
    checks.require_x64()
    checks.instance("scene", scene, Scene)
    checks.instance("excitation", scene.excitation, GroundMotion, ": harmonics are for `tpd.steady_state`")
    chosen: Any = Piecewise() if model is None else model
    free = checks.within("free", free, 0.0, LONGEST_FREE, " s")
    max_events = checks.count("max_events", max_events, most=1_000_000)
    p, rate = single((scene.ground_parameters(pendulum), scene.rate))
    start = np.zeros(4) if y0 is None else checks.state(y0)
    bob = 0.0 if pendulum is None else 1.0
    # NumPy if all numbers are known, otherwise JAX.
    xp = checks.namespace(*jax.tree.leaves((p, rate, free, start)))
    # Rates are per unit tau in compiled code, and per second for the user.
    speeds = xp.stack([x * xp.ones(()) for x in (1.0, 1.0, rate, rate)])
    pieces = xp.asarray(scene.excitation.pieces())
    limits: dict[str, Any] = {"events": max_events, **accuracy_of(chosen)}
    # The height of the hinge is the last parameter, and is known unless it is differentiated.
    limits["parameters"] = WIDTH - 1 if checks.is_concrete(p.kappa) else WIDTH
    forcing = GroundForcing([stop_gradient(pieces)], free * rate)
    run = follow(chosen.equations, ground_row_of(p), forcing, y0=start / speeds, **limits)
    if checks.is_traced(pieces):
        run = run._replace(**{name: getattr(run, name) + unknown_in(pieces) for name in _DEPENDING})
    return _answer(run, rate, speeds, bob, xp)


_DEPENDING = "tilt", "swing", "rod_angle", "times", "uplift_time", "overturning_time", "state"
"""Results of a run that have derivatives."""


def _answer(run: Any, rate: Any, speeds: Any, bob: float, xp: Any) -> Transient:
    """Convert a run to SI units.

    `bob` is 0 without a pendulum and 1 with it. `xp` is NumPy if all numbers are known, otherwise JAX.
    """
    code = code_of(run.status)
    rocked = code == code_of(Status.rocked)
    # A motion that touches an event has one event more on one side of these parameters, and no derivative.
    touched = rocked & (run.transversality < GRAZING)
    # Only these outcomes have derivatives.
    sound = is_one_of(code, *STANDING) & ~touched
    status = xp.where(touched, code_of(Status.grazing), code)
    # Without a pendulum the equations have a bob that is too light to act on the block. Its angles are
    # replaced by zero.
    has_angle = xp.array([1.0, bob, bob])
    if xp is np:
        # Known numbers have no derivatives to correct.
        seconds, kept = (lambda tau, usable: tau / rate), (lambda x, usable: x)
    else:
        # Traced numbers also need the correct derivatives, or NaN.
        seconds, kept = partial(_seconds, rate), refused
    times = xp.moveaxis(seconds(run.times, sound[..., None] & (has_angle > 0.0)), -1, 0)
    angles = {"tilt": run.tilt, "swing": run.swing, "rod_angle": run.rod_angle}
    shown = {n: x if bob or n == "tilt" else xp.zeros_like(x) for n, x in angles.items()}
    # The block lifts before it overturns, so the time of uplift has a derivative in this case as well.
    has_uplift_slope = sound | (status == code_of(Status.overturned))
    return Transient(
        **{name: kept(angle, sound) for name, angle in shown.items()},
        **{f"{name}_time": time for name, time in zip(angles, times, strict=True)},
        impacts=xp.asarray(run.impacts).astype(int),
        uplift_time=seconds(run.uplift_time, has_uplift_slope),
        overturning_time=seconds(run.overturning_time, sound),
        state=kept(run.state * speeds * xp.array([1.0, bob, 1.0, bob]), sound),
        status=status_of(status.astype(np.int32)),
    )


def _seconds(rate: Any, tau: Any, usable: Any) -> Any:
    """Convert a time to seconds. A time that is not finite becomes infinite.

    The derivative is NaN where it is not `usable`, and for an infinite time or the time zero.
    """
    fixed = stop_gradient(tau)
    is_finite = jnp.isfinite(fixed)
    # The infinite value is added after the division, because infinity divided by the rate has a derivative of
    # NaN.
    finite = refused(_finite(tau) / rate, usable & is_finite & (fixed > 0.0))
    return finite + jnp.where(is_finite, 0.0, jnp.inf)


@jax.custom_jvp
def _finite(x: Any) -> Any:
    """Return `x`, or 0 where it is not finite, with the derivative of `x` in both cases."""
    return jnp.where(jnp.isfinite(x), x, 0.0)


@_finite.defjvp
def _finite_jvp(primals: tuple, tangents: tuple) -> tuple:
    return _finite(*primals), tangents[0]


def accuracy_of(model: Any) -> dict[str, Any]:
    """Return the settings of a model under a ground motion, by their names.

    Raises:
        ValueError: the model cannot follow a ground motion.
    """
    checks.instance("model", model, (Piecewise, Nonlinear))
    # Only `Nonlinear` has settings here. The exact solution has its own rate of rest under a ground motion.
    return {"rtol": model.rtol, "rest_rate": model.rest_rate} if isinstance(model, Nonlinear) else {}
