"""Models that compiled code solves.

Taylor series follow the linear equations (25) and the nonlinear equations (4) from event to event. Both
models keep the sign functions and smooth nothing.
"""

from __future__ import annotations

from typing import Any, ClassVar

import equinox as eqx
from jaxtyping import Array, Float

from tpd.compiled.rows import row_of
from tpd.compiled.simulate import HarmonicForcing, Limits, Run, SteadyNumbers, follow, solve_steady
from tpd.compiled.trajectories import trajectory
from tpd.core import checks
from tpd.models.base import Model, setting
from tpd.scene.parameters import Parameters
from tpd.scene.pytrees import State
from tpd.scene.status import Status
from tpd.theory.equations import Terms

COMPILED_PERIODS = 100_000
"""Largest number of forcing periods in one call of a model that compiled code solves. So many periods take
half a second, or some seconds if the motion has many events."""


class Compiled(Model):
    """A model whose equations are solved by compiled code (Numba).

    The compiled code also decides when a motion has settled, after how many periods the motion repeats, and
    which status it has. Subclasses cannot change these decisions.
    """

    max_periods: eqx.AbstractVar[int]
    tolerance: eqx.AbstractVar[float]
    rest_rate: eqx.AbstractVar[float]
    max_events: checks.Whole = setting("max_events", checks.count, 2000, 1, COMPILED_PERIODS)
    """Largest number of steps and events in one forcing period."""
    lyapunov_periods: checks.Whole = setting("lyapunov_periods", checks.count, 100, 0, 10_000)
    """Number of forcing periods in which the separation of neighbouring motions is measured if a motion does
    not repeat."""
    equations: ClassVar[Terms]
    most_periods: ClassVar[int] = COMPILED_PERIODS

    @property
    def accuracy(self) -> dict[str, Any]:
        """Settings, by their names, with which the compiled code follows a part of a motion."""
        return {name: x for name, x in self.limits if name in ("events", "rest_rate", "rtol")}

    @property
    def limits(self) -> Limits:
        """Settings with which the compiled code computes a steady state."""
        # The fields have the names of the settings. Reading them through `vars` is five times faster than
        # through the attributes of an Equinox module, and this is a notable part of a call of `steady_state`.
        return tuple((name.removeprefix("max_"), x) for name, x in vars(self).items())

    def check(self, p: Parameters) -> None:
        """Accept the parameters: compiled models can represent every valid set."""

    def settle(self, p: Parameters, y0: State) -> Run:
        """Follow the motion from the state `y0` at tau = 0 until it repeats or comes to rest for good."""
        # The limits of the model replace the default limits of compiled code.
        forcing = HarmonicForcing(self.max_periods)
        settings = {**self.accuracy, "tolerance": self.tolerance}
        return follow(self.equations, row_of(p), forcing, y0=y0, **settings)

    def solve_steady(self, x: Any, slopes: int) -> tuple[SteadyNumbers, Any]:
        """Return the steady state and the slopes (6, 10) of amplitude, swing and state."""
        return solve_steady(self.equations, x, self.limits, slopes)

    def trajectory(
        self, p: Parameters, y0: State, times: Float[Array, "times"]
    ) -> tuple[Float[Array, "times 4"], Status]:
        """Return the states at `times` and the status of the motion that begins with `y0` at `times[0]`."""
        return trajectory(self.equations, p, y0, times, **self.accuracy)


class Piecewise(Compiled):
    """Exact solution of the linear equations (25): arcs that are joined at events.

    The model has no smoothing, and no errors apart from those of rounding. Taylor series give the arcs, whose
    closed form is `tpd.theory.arc`. On an arc the block rotates with either sign of the
    tilt and of its rate, sticks away from the base, or rests on the base. If an impact is slower than
    `rest_rate` and the block can remain at rest after it, the model sets the block to rest. This ends a
    rattling motion, and the error is of the order of `rest_rate` squared.

    The code runs on the processor of the host, one motion after another, even if JAX uses another device
    (see `tpd.compiled.calling`).

    Attributes:
        max_periods: largest number of forcing periods to follow.
        max_events: largest number of steps and events in one forcing period.
        tolerance: repetition error at which Newton's method takes over.
        rest_rate: rate (phi' in units of nu) below which an impact can end in rest.
        lyapunov_periods: forcing periods in which the Lyapunov exponent is measured.

    Example:
        >>> import tpd
        >>> p = tpd.Parameters(nu=0.2, mu=0.05, lam=0.8, zeta=0.1, k=0.05, f=0.3, xi=3.0)
        >>> round(float(tpd.steady_state(p, model=tpd.Piecewise(max_periods=200)).amplitude), 5)
        0.05518
    """

    max_periods: checks.Whole = setting("max_periods", checks.count, 500, 1, COMPILED_PERIODS)
    """Largest number of forcing periods to follow while the motion does not repeat."""
    tolerance: checks.Real = setting("tolerance", checks.tolerance, 1e-6)
    """Repetition error, relative to the scale of the state, at which Newton's method takes over."""
    rest_rate: checks.Real = setting("rest_rate", checks.tolerance, 2e-7)
    """Rate (phi' in units of nu) below which an impact can end in rest."""

    equations: ClassVar[Terms] = Terms.linear


class Nonlinear(Compiled):
    """Nonlinear equations (4), solved with Taylor series that are joined at events.

    The model has no smoothing, and its steps satisfy a relative tolerance. As in the paper, a crossing of
    phi = 0 without loss leaves both rates unchanged. At an impact with loss (e < 1) the rod exerts an impulse
    on block and bob along its own direction, which is that of the bob's angle (see `tpd.scene.impacts`). With
    Housner's e the impact conserves the angular momentum of block and bob about the new corner.

    Attributes:
        rtol: relative tolerance of a step.
        max_periods: largest number of forcing periods to follow.
        max_events: largest number of events in one forcing period.
        tolerance: repetition error below which a motion is settled.
        rest_rate: rate (phi' in units of nu) below which an impact can end in rest.
        lyapunov_periods: forcing periods in which the Lyapunov exponent is measured.

    Example:
        >>> import tpd
        >>> p = tpd.Parameters(nu=0.2, mu=0.05, lam=0.8, zeta=0.1, k=0.05, f=0.3, xi=3.0)
        >>> linear, nonlinear = (tpd.steady_state(p, model=m) for m in (tpd.Piecewise(), tpd.Nonlinear()))
        >>> round(float(linear.amplitude), 4), round(float(nonlinear.amplitude), 4)
        (0.0552, 0.0554)
    """

    rtol: checks.Real = setting("rtol", checks.tolerance, 1e-10)
    """Relative tolerance of a step."""
    max_periods: checks.Whole = setting("max_periods", checks.count, 400, 1, COMPILED_PERIODS)
    """Largest number of forcing periods to follow while the motion does not repeat."""
    tolerance: checks.Real = setting("tolerance", checks.tolerance, 1e-9)
    """Repetition error, relative to the scale of the state, below which a motion is settled."""
    rest_rate: checks.Real = setting("rest_rate", checks.tolerance, 1e-4)
    """Rate (phi' in units of nu) below which an impact ends in rest if the block can remain at rest after it.
    The error is of the order of its square."""

    equations: ClassVar[Terms] = Terms.nonlinear
