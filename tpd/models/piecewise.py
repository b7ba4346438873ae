"""The exact piecewise solution of the linear equations, with true signs."""

from __future__ import annotations

from functools import lru_cache
from typing import Any, ClassVar

from jaxtyping import Array, Float

from tpd.core import checks
from tpd.exact.linear import Cycle, Limits, cycle, trajectory
from tpd.exact.rows import row_of
from tpd.exact.runs import EVENTS, PERIODS, REST_RATES, TOLERANCE, HarmonicForcing, Settled, follow
from tpd.models.base import AbstractModel, setting
from tpd.scene.parameters import Parameters
from tpd.scene.pytrees import Number, State
from tpd.scene.status import Status
from tpd.theory.equations import Terms

EXACT_PERIODS = 100_000
"""Most forcing periods in one call: half a second of work, or some seconds with many events."""


class Piecewise(AbstractModel):
    """Closed-form arcs joined at their events: no smoothing and no time-step error.

    Arcs slip in all four sign combinations, stick off the base, or rest on it. An impact slower
    than `rest_rate` (phi' in units of nu) that the block can be held after counts as rest, which
    ends rattling; the error is of the order of its square. All of it is compiled code that runs on the host's
    processor, one motion after another, also where JAX has another device: see `tpd.exact.calling`.
    """

    max_periods: checks.Whole = setting("max_periods", checks.count, PERIODS[Terms.linear], 1, EXACT_PERIODS)
    """Forcing periods to follow before giving up on a repetition."""
    max_events: checks.Whole = setting("max_events", checks.count, EVENTS, 1, EXACT_PERIODS)
    """Bound on the steps and events of one forcing period."""
    tolerance: checks.Real = setting("tolerance", checks.tolerance, TOLERANCE)
    """Repetition error at which following ends and Newton's method takes over."""
    rest_rate: checks.Real = setting("rest_rate", checks.tolerance, REST_RATES[Terms.linear])
    lyapunov_periods: checks.Whole = setting("lyapunov_periods", checks.count, 100, 0, 10_000)
    """Periods over which the separation of neighbours is measured, should a motion not repeat."""

    most_periods: ClassVar[int] = EXACT_PERIODS

    def check(self, p: Parameters) -> None:
        """Every valid set of parameters is representable."""

    @property
    def round_off(self) -> float:
        """Residual of the period map that counts as round-off."""
        return 1e-14

    def resolution(self, p: Any) -> Number:
        """Rest is exact here."""
        return 0.0 * p.nu

    @property
    def limits(self) -> Limits:
        """Bounds on following a motion, as `tpd.exact.linear.solve` takes them."""
        return self.max_periods, self.max_events, self.tolerance, self.rest_rate, self.lyapunov_periods

    def settling(self) -> dict[str, Any]:
        """Return the bounds on following a motion until it settles, as `tpd.exact.runs.follow` takes them."""
        return {"events": self.max_events, "tolerance": self.tolerance, "rest_rate": self.rest_rate}

    def settle(self, p: Parameters, y0: State) -> Settled:
        """Follow the motion from `y0` at tau = 0 until it repeats or rests for good."""
        forcing = HarmonicForcing(self.max_periods)
        return follow(Terms.linear, row_of(p), forcing, y0=y0, **self.settling())

    def cycle(self, p: Parameters, settled: Settled, y: State) -> Cycle:
        """Run the orbit's periods from `y`; derivatives pass through every event."""
        return cycle(p, settled, y, self.max_events, self.rest_rate)

    def trajectory(
        self, p: Parameters, y0: State, times: Float[Array, "times"]
    ) -> tuple[Float[Array, "times 4"], Status]:
        """The exact states at `times`, from `y0` at `times[0]`."""
        return trajectory(p, y0, times, self.max_events, self.rest_rate)


@lru_cache(maxsize=64)
def is_exact(kind: type) -> bool:
    """Whether a class of models has the flow of `Piecewise`, so that one compiled call finds a steady state.
    The rules for models with a flow of their own differ in a few cases."""
    flow = ("settle", "cycle", "limits", "resolution", "round_off")
    return issubclass(kind, Piecewise) and all(
        getattr(kind, name) is getattr(Piecewise, name) for name in flow
    )
