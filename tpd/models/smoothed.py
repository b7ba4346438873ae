"""The equations (25) or (4) with smoothed signs, integrated by diffrax."""

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

from tpd.core import checks
from tpd.exact.rows import row_of
from tpd.exact.runs import HarmonicForcing, Settled, follow
from tpd.exact.terms import SWING, TILT, TILT_RATE
from tpd.models.base import MOST_PERIODS, AbstractFlow, Cycle, setting
from tpd.models.compiled import Piecewise
from tpd.models.settling import Period, settle
from tpd.scene.parameters import Parameters
from tpd.scene.pytrees import Number, State
from tpd.scene.status import Status
from tpd.theory.equations import Equations, Linear, Terms, smoothed_rates

_MOST_STEPS = 1_000_000
"""Most steps of a trajectory."""
_ABSURD = 1e3
"""rad (and rad per unit tau): far beyond any angle that means something."""

Field = Callable[[Any, State, Any], State]


def rocking_scale(p: Parameters) -> Number:
    """The tilt of free rocking at the forcing frequency, one harmonic and a still bob:
    (4/pi)(1 + mu) nu / ([1 + mu rho (4 + nu^2)] xi^2 + 1 + 2 mu), from (27) with f = 0."""
    linear = Linear(p)
    return (4.0 / jnp.pi) * linear.weight / (linear.m11 * p.xi**2 + linear.tilt)


class Smoothed(AbstractFlow):
    """sgn(x) replaced by tanh(x/width), so that an ODE solver and its gradients apply.

    The widths are `sharpness` times `rocking_scale` for the tilt, and xi times that for its rate,
    because the bias depends on the width against the orbit's own size. What moves less than
    `HUM` widths is reported at rest: the smoothed block hums there, and its slope means nothing.
    A transient from rest is more sensitive to the widths than the orbit it leads to, hence the
    small default.

    An impact is smoothed as well, for linear and parametric terms. Its bias grows as e falls: in one scene
    4e-4 of the amplitude at e = 0.5, 3e-3 at 0.2, 1e-2 at 0.1, 0.1 where the block all but stops at impacts.
    Where k = 0 the derivative in k is off by tens of per cent: steps follow the motion, which does not feel
    friction's layer.

    From the same start the smoothed block may settle into another motion than the exact one, and its tilt
    while friction nearly holds the block is off by tens of per cent: no smoothed motion sticks. So
    `steady_state` compares the amplitude with the exact one, and says inexact where they differ by more than
    5 %; with the parametric term there is no exact motion to compare with.
    """

    HUM = 10.0

    terms: Terms = setting("terms", checks.instance, Terms.linear, Terms)
    """Linear (25), with its parametric term, or nonlinear (4)."""
    sharpness: checks.Real = setting("sharpness", checks.within, 0.002, 1e-6, 1.0)
    """Smoothing width over the expected tilt; smaller is more accurate and slower. Below 3e-6 the solver no
    longer resolves derivatives in the layer, though the amplitude is right; below 1e-4 it may run out of
    steps on a resting block, and steps may pass over impacts, so that a motion does not settle."""
    solver: diffrax.AbstractSolver = eqx.field(default_factory=diffrax.Tsit5, kw_only=True)
    """Integrates transients and trajectories; the settled period uses `Dopri8`."""
    rtol: checks.Real = setting("rtol", checks.tolerance, 1e-6)
    """Relative tolerance of transients and trajectories; absolute is a hundredth of it."""
    cycle_rtol: checks.Real = setting("cycle_rtol", checks.tolerance, 1e-12)
    """Relative tolerance of the settled period, whose derivatives are used."""
    tolerance: checks.Real = setting("tolerance", checks.tolerance, 1e-4)
    """Repetition error at which following ends and Newton's method takes over."""
    max_periods: checks.Whole = setting("max_periods", checks.count, 400, 1, MOST_PERIODS)
    max_steps: checks.Whole = setting("max_steps", checks.count, 4096, 1, 100_000)
    """Bound on the solver steps of one forcing period."""
    samples: checks.Whole = setting("samples", checks.count, 64, 1, 100_000)
    """Samples of one settled period, among which turning points are bracketed."""

    @property
    def round_off(self) -> float:
        """Residual of the period map that counts as round-off."""
        return 10.0 * self.cycle_rtol

    def widths(self, p: Parameters) -> tuple[Number, Number]:
        """Smoothing widths of the tilt (rad) and of its rate (rad per unit tau)."""
        width = self.sharpness * rocking_scale(p)
        return width, p.xi * width

    def resolution(self, p: Parameters) -> Number:
        """The hum of a resting smoothed block."""
        width, _ = self.widths(p)
        return self.HUM * width

    def check(self, p: Parameters) -> None:
        """Raise `ValueError` for impacts without a smoothed counterpart: those that leave no rate at all
        (e = 0), and with (4), whose law depends on psi, all that lose energy."""
        least, told = 1e-3, " in the smoothed model: take `Piecewise`"
        if self.terms is Terms.nonlinear:
            least, told = 1.0, " in the smoothed equations (4): take `Nonlinear`"
        checks.within("e", p.velocity_ratio, least, 1.0, told, every=True)

    def settle(self, p: Parameters, y0: State) -> Settled:
        """Integrate from `y0` at tau = 0, one forcing period after another, until they repeat."""
        field = smoothed_rates(p, *self.widths(p), self.terms)
        # The bound on the tilt makes an overturning block end its transient: it would grow without end.
        limit, no = Equations(p, self.terms).beyond_return, jnp.zeros((), bool)
        times = jnp.linspace(0.0, 1.0, 17) * p.period

        def one_period(y: State, memory: None) -> Period:
            ys, bounded = self._integrate(field, y, times)
            # What a solver out of steps did not reach is infinite.
            ys = jnp.where(bounded | jnp.isfinite(ys), ys, y[None])
            amplitude, swing = jnp.max(jnp.abs(ys[:, TILT])), jnp.max(jnp.abs(ys[:, SWING]))
            lost = ~(amplitude < limit)
            return Period(ys[-1], memory, amplitude, swing, no, lost, ~bounded, no, amplitude, swing)

        return settle(one_period, p, y0, None, tolerance=self.tolerance, max_periods=self.max_periods)

    def settle_exactly(self, p: Parameters, y0: State) -> Settled | None:
        """The exact motion from `y0`, by compiled code; that of the parametric term is not known."""
        if self.terms is Terms.parametric:
            return None
        if self.terms is Terms.linear:
            return Piecewise().settle(p, y0)
        return follow(Terms.nonlinear, row_of(p), HarmonicForcing(self.max_periods), y0=y0)

    def cycle(self, p: Parameters, settled: Settled, y: State) -> Cycle:
        """Integrate the settled periods from `y` with tight tolerance and forward sensitivities."""
        field = smoothed_rates(p, *self.widths(p), self.terms)
        times = jnp.linspace(0.0, 1.0, self.samples + 1) * p.period

        def one_period(_: Array, carry: tuple) -> tuple:
            y, sizes, sides = carry
            ys, _ = self._integrate(field, y, times, precise=True)
            peaks = jax.vmap(lambda i: self._peak(field, times, ys, i))(jnp.arange(2))
            # The samples of a symmetric motion are each other's mirror images.
            tilts = stop_gradient(ys[:, TILT])
            sides = jnp.maximum(sides, jnp.stack([jnp.max(tilts), jnp.max(-tilts)]))
            return ys[-1], jnp.maximum(sizes, peaks), sides

        first = (y, jnp.zeros(2), jnp.zeros(2))
        y, sizes, sides = jax.lax.fori_loop(0, settled.periods, one_period, first)
        (amplitude, swing), (right, left) = sizes, sides
        asymmetry = jnp.abs(right - left) / jnp.max(sides)
        never, closed = jnp.full_like(asymmetry, jnp.inf), jnp.ones((), bool)
        return Cycle(y, amplitude, swing, None, never, asymmetry, closed)

    def trajectory(
        self, p: Parameters, y0: State, times: Float[Array, "times"]
    ) -> tuple[Float[Array, "times 4"], Status]:
        """The smoothed states at `times`, from `y0` at `times[0]`."""
        field = smoothed_rates(p, *self.widths(p), self.terms)
        # Without an end the steps of a motion that overturns would shrink for ever.
        absurd = diffrax.Event(lambda t, y, args, **_: jnp.abs(y[TILT]) > _ABSURD)
        ys, bounded = self._integrate(field, y0, times, until=absurd, max_steps=_MOST_STEPS)
        lost = ~(jnp.max(jnp.abs(ys[:, TILT])) < Equations(p, self.terms).beyond_return)
        status = Status.where(lost, Status.overturned, Status.rocking)
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
        """States at `times`, of a `precise` motion with an event the one where it ends the motion, and
        whether the bound on the steps was kept."""
        rtol = self.cycle_rtol if precise else self.rtol
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
        """The largest |phi| (i = 0) or |psi| (i = 1): from the sample before the largest one,
        integrate until the rate vanishes. An orbit's peak before its first sample is the same as
        that before its last."""
        # An overturning motion has no peak, and its overflow must not reach the root finder.
        bounded = jnp.all(jnp.abs(stop_gradient(ys)) < _ABSURD)
        ys = jnp.where(bounded, ys, 0.0)
        # The largest sample lies beside the peak, and its derivative is that of a fixed time: wrong by the
        # rate there times the derivative of the peak's time. At the peak itself the rate is zero. The window
        # of two and a half samples holds the peak wherever it lies beside the largest sample.
        angles, rates = stop_gradient(ys)[:, i], stop_gradient(ys)[:, TILT_RATE + i]
        j = jnp.argmax(jnp.abs(angles))
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
