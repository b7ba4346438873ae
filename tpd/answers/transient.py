"""Motion of a block and its pendulum through a pulse or a record, and after it."""

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

from tpd.core import checks
from tpd.core.checks import Real, Whole
from tpd.exact.derivatives import refused
from tpd.exact.rows import ground_row_of
from tpd.exact.runs import Followed, GroundForcing, follow
from tpd.exact.terms import GRAZING, ROCKED, SHAKEN, STOOD
from tpd.models.base import AbstractModel
from tpd.models.compiled import Nonlinear, Piecewise
from tpd.scene.ground_motion import LONGEST_FREE, GroundMotion
from tpd.scene.parameters import Parameters
from tpd.scene.pytrees import Number, single
from tpd.scene.scene import Pendulum, Scene
from tpd.scene.status import Status, code_of, codes_of, status_name, status_of

FREE = 20.0
"""Free motion that is followed after a ground motion by default, s."""
MAX_EVENTS = 200_000
"""Events of a motion beyond one for each piece, at most."""


class Transient(eqx.Module):
    """Largest angles and outcome of a block under a ground motion: rad, and s from its beginning.

    Angles, their times and the state are differentiable in every SI quantity of block, pendulum and gravity,
    in the size of the motion and its time scale, in the start and in the free time, if the status is stood
    or rocked. So is the time of the first uplift, also of a block that overturns. Elsewhere derivatives are
    NaN and `status` says why. NaN as well are those of a time that is infinite or that of the beginning, of
    the time of the overturning, and all second derivatives; counts have none.

    By the nonlinear equations (`Nonlinear`) all derivatives are NaN, because nobody computes them. Every
    landing is an impact, and the block overturns at a tilt of a right angle, which it must reach before the
    end.
    """

    tilt: Number
    """Largest |phi|; infinite if the block overturns."""
    swing: Number
    """Largest |psi|, the rod's angle from the vertical; 0 without a pendulum."""
    relative: Number
    """Largest |psi - phi|, the angle between rod and block; 0 without a pendulum."""
    tilt_time: Number
    swing_time: Number
    relative_time: Number
    impacts: Int[Any, "..."]
    """Impacts on the base, all hops of a rattle included down to the one that is called rest: slower than
    2e-7 nu (phi' in tau) by `Piecewise` (with a restitution of 0.9999 or more than up to 8e-5 nu, where
    slower ones would exhaust `max_events`), than `rest_rate` nu by `Nonlinear`. Their number depends on that;
    `MotionHistory.impacts_above` counts those above a stated rate."""
    uplift_time: Number
    """Time at which the block leaves its base for the first time; infinite if it never does."""
    overturning_time: Number
    """Time from which the block is beyond return; infinite if it does not overturn."""
    state: Float[Any, "... 4"]
    """(phi, psi, phi', psi') in rad and rad/s at the end."""
    status: Status
    """stood, rocked, overturned, grazing (an event was touched without crossing: no derivative), event_bound
    or failed."""

    def __str__(self) -> str:
        if not (checks.is_concrete(self.tilt) and jnp.ndim(self.tilt) == 0):
            return repr(self)
        lines = [f"{status_name(self.status)}: {Status[self.status]}"]
        with_it = float(self.swing) != 0.0
        for name in ("tilt", "swing", "relative") if with_it else ("tilt",):
            at = f"at {getattr(self, name + '_time'):.4g} s"
            lines.append(f"  {name:9s} {getattr(self, name):.6g} rad {at}")
        lines.append(f"  impacts   {int(self.impacts)}, all of a rattle included until it is called rest")
        if math.isfinite(self.uplift_time):
            lines.append(f"  uplift    at {self.uplift_time:.4g} s")
        if math.isfinite(self.overturning_time):
            lines.append(f"  falls     at {self.overturning_time:.4g} s")
        return "\n".join(lines)


def transient(
    scene: Scene,
    pendulum: Pendulum | None = None,
    *,
    y0: checks.Vector | None = None,
    model: AbstractModel | None = None,
    free: Real = FREE,
    max_events: Whole = MAX_EVENTS,
) -> Transient:
    """Follow a block, with or without a pendulum, through the pulse or record of its scene.

    With `Piecewise()` the linear equations (25) with the base acceleration in the place of the harmonic are
    solved exactly: a record is linear between its samples, and no event is missed. After the motion the block
    moves freely for `free` seconds; a last arc that leads beyond return overturns it however far it has come
    by then. See `Transient` for what the answers of the nonlinear equations mean.

    Args:
        scene: a block under a `Pulse` or a `Record`.
        pendulum: None is the bare block.
        y0: start (phi, psi, phi', psi') in rad and rad/s; at rest by default.
        model: `Piecewise()`, the exact solution of the linear equations (default); or `Nonlinear()`, the
            nonlinear equations (4), with the model's `rtol` and `rest_rate`.
        free: free motion after the ground motion, s.
        max_events: events allowed beyond one for each piece of the motion.

    Raises:
        ValueError: bad input, or a model that cannot follow this block under such a motion.
        RuntimeError: JAX is in 32-bit mode.
    """
    checks.require_x64()
    checks.instance("scene", scene, Scene)
    checks.instance("motion", scene.motion, GroundMotion, ": harmonics are for `tpd.steady_state`")
    model = Piecewise() if model is None else model
    free = checks.within("free", free, 0.0, LONGEST_FREE, " s")
    max_events = checks.count("max_events", max_events, most=1_000_000)
    p, rate = single((scene.ground_parameters(pendulum), scene.rate))
    start = np.zeros(4) if y0 is None else checks.state(y0)
    bob = 0.0 if pendulum is None else 1.0
    xp = checks.namespace(*jax.tree.leaves((p, rate, free, start)))
    # Rates are per unit tau inside, and per second outside.
    speeds = xp.stack([x * xp.ones(()) for x in (1.0, 1.0, rate, rate)])
    pieces = xp.asarray(scene.motion.pieces())
    found = _followed(model, p, pieces, free * rate, start / speeds, max_events)
    return _answer(found, rate, speeds, bob, xp)


def _answer(found: Any, rate: Any, speeds: Any, bob: float, xp: Any) -> Transient:
    """The motion in seconds; `bob` is 0 without a pendulum, and `xp` NumPy if all numbers are known."""
    code = xp.asarray(found.status).astype(int)
    # On one side of such a motion there is an event more: it has no derivative.
    touched = (code == ROCKED) & (found.transversality < GRAZING)
    sound = ((code == ROCKED) | (code == STOOD)) & ~touched
    status = xp.where(touched, code_of(Status.grazing), xp.asarray(codes_of(SHAKEN))[code])
    # The angles of a bare block's bob, which is too light to be felt, are nobody's.
    with_it = xp.array([1.0, bob, bob])
    if xp is np:
        seconds, kept = (lambda tau, usable: tau / rate), (lambda x, usable: x)
    else:
        seconds, kept = partial(_seconds, rate), refused
    times = seconds(found.times, sound[..., None] & (with_it > 0.0))
    fallen = sound | (status == code_of(Status.overturned))
    return Transient(
        tilt=kept(found.tilt, sound),
        swing=kept(found.swing if bob else xp.zeros_like(found.swing), sound),
        relative=kept(found.relative if bob else xp.zeros_like(found.relative), sound),
        tilt_time=times[..., 0],
        swing_time=times[..., 1],
        relative_time=times[..., 2],
        impacts=xp.asarray(found.impacts).astype(int),
        uplift_time=seconds(found.lifted, fallen),
        overturning_time=seconds(found.fell, sound),
        state=kept(found.state * speeds * xp.array([1.0, bob, 1.0, bob]), sound),
        status=status_of(status.astype(np.int32)),
    )


def _seconds(rate: Any, tau: Any, usable: Any) -> Any:
    """A time in seconds, infinite if it is not finite, with its derivative where that is usable and the time
    is not that of the beginning."""
    still = stop_gradient(tau)
    there = jnp.isfinite(still)
    known = refused(_finite(tau) / rate, usable & there & (still > 0.0))
    return known + jnp.where(there, 0.0, jnp.inf)


@jax.custom_jvp
def _finite(x: Any) -> Any:
    """`x`, or 0 where it is not finite, with the derivative of `x` in both cases."""
    return jnp.where(jnp.isfinite(x), x, 0.0)


@_finite.defjvp
def _finite_jvp(primals: tuple, tangents: tuple) -> tuple:
    return _finite(*primals), tangents[0]


def _followed(model: Any, p: Parameters, pieces: Any, free: Any, start: Any, most: int) -> Followed:
    """The motion of a model.

    Raises:
        ValueError: a model that does not follow such a motion.
    """
    checks.instance("model", model, (Piecewise, Nonlinear))
    limits: dict[str, Any] = {"events": most}
    # What the exact solution calls rest under a ground motion does not depend on the model.
    if isinstance(model, Nonlinear):
        limits |= {"rtol": model.rtol, "rest_rate": model.rest_rate}
    row, forcing = ground_row_of(p), GroundForcing([pieces], free)
    return follow(model.equations, row, forcing, y0=start, **limits)
