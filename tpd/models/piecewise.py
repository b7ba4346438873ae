"""The exact piecewise solution of the linear equations, with true signs."""

from __future__ import annotations

from typing import ClassVar

from tpd.core import checks
from tpd.exact.runs import Limits
from tpd.models.base import COMPILED_PERIODS, AbstractCompiled, setting
from tpd.theory.equations import Terms


class Piecewise(AbstractCompiled):
    """Closed-form arcs joined at their events: no smoothing and no time-step error.

    Arcs slip in all four sign combinations, stick off the base, or rest on it. An impact slower
    than `rest_rate` (phi' in units of nu) that the block can be held after counts as rest, which
    ends rattling; the error is of the order of its square. All of it is compiled code that runs on the host's
    processor, one motion after another, also where JAX has another device: see `tpd.exact.calling`.
    """

    max_periods: checks.Whole = setting("max_periods", checks.count, 500, 1, COMPILED_PERIODS)
    """Forcing periods to follow before giving up on a repetition."""
    max_events: checks.Whole = setting("max_events", checks.count, 2000, 1, COMPILED_PERIODS)
    """Bound on the steps and events of one forcing period."""
    tolerance: checks.Real = setting("tolerance", checks.tolerance, 1e-6)
    """Repetition error at which following ends and Newton's method takes over."""
    rest_rate: checks.Real = setting("rest_rate", checks.tolerance, 2e-7)
    lyapunov_periods: checks.Whole = setting("lyapunov_periods", checks.count, 100, 0, 10_000)
    """Periods over which the separation of neighbours is measured, should a motion not repeat."""

    equations: ClassVar[Terms] = Terms.linear

    @property
    def limits(self) -> Limits:
        """Settings of the compiled code for a steady state."""
        # From where they are kept: by its name a field of an equinox module takes five times as long.
        of = vars(self)
        settled = ("periods", of["max_periods"]), ("tolerance", of["tolerance"])
        met = ("events", of["max_events"]), ("rest_rate", of["rest_rate"])
        return *settled, *met, ("lyapunov", of["lyapunov_periods"])
