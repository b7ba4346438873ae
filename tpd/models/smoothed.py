"""Model of the equations (25) or (4) with smoothed sign functions, integrated by diffrax."""

from __future__ import annotations

from collections.abc import Callable
from typing import Any

import diffrax
import equinox as eqx
import jax
import jax.numpy as jnp
import optimistix
from jax.lax import stop_gradient
from jaxtyping import Array, Bool, Float

from tpd.compiled.columns import SWING, TILT, TILT_RATE
from tpd.compiled.rows import row_of
from tpd.compiled.simulate import HarmonicForcing, Run, SteadyNumbers, follow
from tpd.core import checks
from tpd.models.base import MOST_PERIODS, Model, setting
from tpd.models.piecewise import Piecewise
from tpd.models.smoothed_orbit import Cycle, settle, solve_steady
from tpd.scene.parameters import Parameters
from tpd.scene.pytrees import Number, State
from tpd.scene.status import Status
from tpd.theory.equations import Equations, Linear, Terms, smoothed_rates

_MOST_STEPS = 1_000_000
"""Largest number of solver steps of a trajectory."""
_DIVERGED = 1e3
"""Angle (rad) or rate (rad per unit tau) at which a motion has diverged: angles have no meaning there."""

Field = Callable[[Any, State, Any], State]


def rocking_scale(p: Parameters) -> Number:
    """Return the tilt (rad) of free rocking at the forcing frequency, for one harmonic and a bob at rest.

    It is (4/pi)(1 + mu) nu / ([1 + mu rho (kappa^2 + nu^2)] xi^2 + 1 + kappa mu), which follows from (27)
    with f = 0.
    """
    linear = Linear(p)
    return (4.0 / jnp.pi) * linear.weight / (linear.m11 * p.xi**2 + linear.tilt)


class Smoothed(Model):
    """Equations with smoothed signs: tanh(x/width) replaces sgn(x), so that an ODE solver applies.

    The solver is one of diffrax, and its derivatives are those of the smoothed motion. The smoothing width of
    the tilt is `sharpness` times `rocking_scale`, and that of the rate is xi times as large, because the bias
    depends on the ratio of the width to the size of the orbit. If the amplitude is below `HUM` widths, the
    status is rest: a smoothed block at rest creeps and vibrates slightly, and its derivatives are
    meaningless. The default width is small because a transient from rest depends on the width more than the
    orbit does.

    With linear and parametric terms, impacts are smoothed as well. Their bias increases as e decreases. In
    one scene it is 4e-4 of the amplitude at e = 0.5, 3e-3 at 0.2, 1e-2 at 0.1, and 0.1 where an impact nearly
    stops the block. For k = 0 the derivative with respect to k is wrong by tens of per cent, because the
    solver chooses its steps for the motion, on which the thin friction layer has no effect.

    From the same initial state the smoothed block may settle into another motion than the exact one. Where
    friction nearly holds the block, its tilt is wrong by tens of per cent, because a smoothed motion cannot
    stick. `steady_state` therefore compares the amplitude with that of the exact motion, and the status is
    inexact if they differ by more than 5 %. With the parametric term no exact motion is available for
    comparison.

    Attributes:
        terms: terms of the equations, see `Terms`.
        sharpness: smoothing width divided by the expected tilt.
        solver: diffrax solver for transients and trajectories.
        rtol: relative tolerance of transients and trajectories.
        cycle_rtol: relative tolerance of the settled period.
        tolerance: repetition error at which Newton's method takes over.
        max_periods: largest number of forcing periods to follow.
        max_steps: largest number of solver steps in one forcing period.
        samples: number of samples of the settled period.

    Example:
        >>> import tpd
        >>> p = tpd.Parameters(nu=0.2, mu=0.05, lam=0.8, zeta=0.1, k=0.05, f=0.3, xi=3.0)
        >>> model = tpd.Smoothed(terms=tpd.Terms.parametric, sharpness=0.01)
        >>> trajectory = tpd.simulate(p, [0.1, 0.0, 0.0, 0.0], [0.0, 1.0, 2.0], model=model)
        >>> [round(float(tilt), 3) for tilt in trajectory.ys[:, 0]]
        [0.1, -0.028, -0.1]
    """

    HUM = 10.0
    """Amplitude, in smoothing widths, below which a motion counts as rest."""

    terms: Terms = setting("terms", checks.instance, Terms.linear, Terms)
    """Terms of the equations: linear (25), (25) with the parametric term, or nonlinear (4)."""
    sharpness: checks.Real = setting("sharpness", checks.within, 0.002, 1e-6, 1.0)
    """Smoothing width divided by the expected tilt. A smaller width is more accurate and slower. Below 3e-6
    the solver no longer resolves the derivatives in the smoothing layer, although the amplitude is correct.
    Below 1e-4 the solver may reach `max_steps` on a block at rest, and its steps may miss impacts, so a
    motion does not settle."""
    solver: diffrax.AbstractSolver = eqx.field(default_factory=diffrax.Tsit5, kw_only=True)
    """diffrax solver for transients and trajectories. The settled period uses `Dopri8`."""
    rtol: checks.Real = setting("rtol", checks.tolerance, 1e-6)
    """Relative tolerance of transients and trajectories; the absolute tolerance is a hundredth of it."""
    cycle_rtol: checks.Real = setting("cycle_rtol", checks.tolerance, 1e-12)
    """Relative tolerance of the settled period, from which the derivatives are computed."""
    tolerance: checks.Real = setting("tolerance", checks.tolerance, 1e-4)
    """Repetition error, relative to the scale of the state, at which Newton's method takes over."""
    max_periods: checks.Whole = setting("max_periods", checks.count, 400, 1, MOST_PERIODS)
    """Largest number of forcing periods to follow while the motion does not repeat."""
    max_steps: checks.Whole = setting("max_steps", checks.count, 4096, 1, 100_000)
    """Largest number of solver steps in one forcing period."""
    samples: checks.Whole = setting("samples", checks.count, 64, 1, 100_000)
    """Number of samples of one settled period, which bracket the turning points."""

    @property
    def round_off(self) -> float:
        """Residual of the period map, relative to the scale of the state, that is due to rounding."""
        return 10.0 * self.cycle_rtol

    def widths(self, p: Parameters) -> tuple[Number, Number]:
        """Smoothing widths of the tilt (rad) and of its rate (rad per unit tau)."""
        # Angles and rates of the orbit have different sizes, and each has its own width.
        width = self.sharpness * rocking_scale(p)
        return width, p.xi * width

    def resolution(self, p: Parameters) -> Number:
        """Return the largest |phi| (rad) that the model cannot distinguish from rest: `HUM` widths."""
        width, _ = self.widths(p)
        return self.HUM * width

    def check(self, p: Parameters) -> None:
        """Raise `ValueError` for impacts that this model cannot smooth.

        With linear and parametric terms these are impacts that stop the block (e = 0). With the equations (4)
        these are all impacts with loss, because the law of an impact then depends on psi.
        """
        least, advice = 1e-3, " in the smoothed model: use `Piecewise`"
        if self.terms is Terms.nonlinear:
            least, advice = 1.0, " in the smoothed equations (4): use `Nonlinear`"
        checks.within("e", p.velocity_ratio, least, 1.0, advice, every=True)

    def settle(self, p: Parameters, y0: State) -> Run:
        """Integrate from the state `y0` at tau = 0, one forcing period after another, until they repeat."""
        field = smoothed_rates(p, *self.widths(p), self.terms)
        # An overturning block grows without limit. The limit on its tilt ends the transient.
        limit = Equations(p, self.terms).beyond_return
        # The largest angles of the transient are taken from 17 samples per period, which is enough to
        # recognise a repetition. The settled period is computed with `cycle`.
        times = jnp.linspace(0.0, 1.0, 17) * p.period

        def one_period(y: State) -> tuple[Any, ...]:
            ys, bounded = self._integrate(field, y, times)
            # If the solver reaches its limit on steps, later states are infinite. They are replaced by the
            # first state, and the status is then event_bound and not overturned.
            ys = jnp.where(bounded | jnp.isfinite(ys), ys, y[None])
            sizes = jnp.max(jnp.abs(ys[:, : SWING + 1]), axis=0)
            return ys[-1], sizes, ~(sizes[TILT] < limit), bounded

        return settle(one_period, p, y0, tolerance=self.tolerance, max_periods=self.max_periods)

    def solve_steady(self, x: Any, slopes: int) -> tuple[SteadyNumbers, Any]:
        """Return the steady state and the slopes (6, 10) of amplitude, swing and state."""
        # Both are one JAX program, and Newton's method needs most of the derivatives in any case.
        del slopes
        return solve_steady(x, self)

    def settle_exactly(self, p: Parameters, y0: State) -> Run | None:
        """Return the exact motion from `y0`; None with the parametric term, which has no exact solution."""
        if self.terms is Terms.parametric:
            return None
        if self.terms is Terms.linear:
            return Piecewise().settle(p, y0)
        return follow(Terms.nonlinear, row_of(p), HarmonicForcing(self.max_periods), y0=y0)

    def cycle(self, p: Parameters, periods: Any, y: State) -> Cycle:
        """Integrate forcing periods from `y` with a small tolerance, for derivatives in forward mode."""
        field = smoothed_rates(p, *self.widths(p), self.terms)
        times = jnp.linspace(0.0, 1.0, self.samples + 1) * p.period

        def one_period(_: Array, carry: tuple) -> tuple:
            y, sizes, sides = carry
            # The settled period has a small tolerance, because its derivatives are used.
            ys, _ = self._integrate(field, y, times, precise=True)
            peaks = jax.vmap(lambda i: self._peak(field, times, ys, i))(jnp.arange(2))
            # The two sides are compared by their samples: in a symmetric motion these are mirror images.
            tilts = stop_gradient(ys[:, TILT])
            sides = jnp.maximum(sides, jnp.stack([jnp.max(tilts), jnp.max(-tilts)]))
            return ys[-1], jnp.maximum(sizes, peaks), sides

        first = (y, jnp.zeros(2), jnp.zeros(2))
        y, sizes, sides = jax.lax.fori_loop(0, periods, one_period, first)
        return Cycle(y, sizes, jnp.abs(sides[0] - sides[1]) / jnp.max(sides))

    def trajectory(
        self, p: Parameters, y0: State, times: Float[Array, "times"]
    ) -> tuple[Float[Array, "times 4"], Status]:
        """Return the smoothed states at `times` and the status, from the state `y0` at `times[0]`."""
        field = smoothed_rates(p, *self.widths(p), self.terms)
        # An overturning motion diverges. Without this event the solver would reduce its steps for ever.
        diverged = diffrax.Event(lambda t, y, args, **_: jnp.abs(y[TILT]) > _DIVERGED)
        ys, bounded = self._integrate(field, y0, times, until=diverged, max_steps=_MOST_STEPS)
        overturned = ~(jnp.max(jnp.abs(ys[:, TILT])) < Equations(p, self.terms).beyond_return)
        status = Status.where(overturned, Status.overturned, Status.rocking)
        return ys, Status.where(bounded, status, Status.event_bound)

    def _integrate(
        self,
        field: Field,
        y: State,
        times: Float[Array, "times"],
        *,
        precise: bool = False,
        until: diffrax.Event | None = None,
        max_steps: int | None = None,
    ) -> tuple[Float[Array, "saved 4"], Bool[Array, ""]]:
        """Return the states at `times`, and whether the number of steps stayed within its limit.

        With `precise` and an event `until`, the only state is the one at which the event ends the motion.
        """
        # An event of a precise run is the turning point of `_peak`. It needs only the final state, and a
        # small first step.
        rtol = self.cycle_rtol if precise else self.rtol
        # Forward derivatives need no stored steps, and a design has few parameters. If the steps do not
        # suffice, the result has a status, so the solver must not raise.
        solution = diffrax.diffeqsolve(
            diffrax.ODETerm(field),
            diffrax.Dopri8() if precise else self.solver,
            times[0],
            times[-1],
            1e-3 * (times[-1] - times[0]) / (10.0 if precise and until is not None else 1.0),
            y,
            saveat=diffrax.SaveAt(t1=True) if precise and until is not None else diffrax.SaveAt(ts=times),
            stepsize_controller=diffrax.PIDController(rtol=rtol, atol=0.01 * rtol),
            adjoint=diffrax.ForwardMode(),
            event=until,
            max_steps=self.max_steps if max_steps is None else max_steps,
            throw=False,
        )
        ys: Any = solution.ys
        return ys, solution.result != diffrax.RESULTS.max_steps_reached

    def _peak(self, field: Field, times: Array, ys: Array, i: Array) -> Number:
        """Return the largest |phi| (i = 0) or |psi| (i = 1) of an orbit, at a turning point.

        The integration starts at the sample before the largest one and ends where the rate vanishes. A peak
        before the first sample of an orbit is also a peak before its last sample.
        """
        # An overturning motion has no peak, and an overflow must not reach the root finder.
        bounded = jnp.all(jnp.abs(stop_gradient(ys)) < _DIVERGED)
        ys = jnp.where(bounded, ys, 0.0)
        # The largest sample itself would have a wrong derivative, because it is at a fixed time and its rate
        # is not zero. At the peak the rate is zero. A window of two and a half samples contains the peak on
        # either side of the largest sample.
        angles, rates = stop_gradient(ys)[:, i], stop_gradient(ys)[:, TILT_RATE + i]
        j = jnp.argmax(jnp.abs(angles))
        # If the largest sample is the first one and decreases, the peak is before it. Because the orbit is
        # periodic, this peak is also before the last sample.
        j = jnp.where((j == 0) & (angles[0] * rates[0] < 0), times.size - 1, j)
        before = jnp.maximum(j - 1, 0)
        outward = jnp.sign(angles[j])

        def rate(t: Number, y: State, args: None, **_: object) -> Number:
            del t, args
            return outward * y[TILT_RATE + i]

        turning = diffrax.Event(rate, optimistix.Newton(rtol=1e-10, atol=1e-10), direction=False)
        window = times[before] + jnp.array([0.0, 2.5]) * (times[1] - times[0])
        (peak,), _ = self._integrate(field, ys[before], window, precise=True, until=turning)
        return jnp.where(bounded, jnp.abs(peak[i]), jnp.inf)
