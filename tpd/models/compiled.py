"""Models that compiled code solves: the exact piecewise solution of the linear equations (25), and Taylor
series of the nonlinear equations (4). Both have true signs."""

from __future__ import annotations

from typing import Any, ClassVar

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


class Nonlinear(AbstractCompiled):
    """Taylor series joined at their events: no smoothing, and steps within a relative tolerance.

    As in the paper, a crossing of phi = 0 without loss leaves both rates as they are. At an impact with loss
    (e < 1) the rod pulls block and bob along itself, at the bob's angle: see `tpd.scene.impacts`. With
    Housner's e it conserves the angular momentum of block and bob about the new corner.

    Values only: derivatives are NaN, and so are multipliers and the Lyapunov exponent. A motion that repeats
    is called rocking or sticking because it was reached, and one that does not repeat is not_settled.
    """

    rtol: checks.Real = setting("rtol", checks.tolerance, 1e-10)
    """Relative tolerance of a step."""
    max_periods: checks.Whole = setting("max_periods", checks.count, 400, 1, COMPILED_PERIODS)
    """Forcing periods to follow before giving up on a repetition."""
    max_events: checks.Whole = setting("max_events", checks.count, 2000, 1, COMPILED_PERIODS)
    """Bound on the events of one forcing period."""
    tolerance: checks.Real = setting("tolerance", checks.tolerance, 1e-9)
    """Repetition error that counts as settled."""
    rest_rate: checks.Real = setting("rest_rate", checks.tolerance, 1e-4)
    """An impact slower than this (phi' in units of nu) that the block can be held after is rest; the error is
    of the order of its square."""

    equations: ClassVar[Terms] = Terms.nonlinear

    @property
    def accuracy(self) -> dict[str, Any]:
        """Settings of the compiled code for a part of a motion, by their names."""
        return {**super().accuracy, "rtol": self.rtol}

    @property
    def limits(self) -> Limits:
        """Settings of the compiled code for a steady state."""
        settled = {"periods": self.max_periods, "tolerance": self.tolerance}
        return tuple({**settled, **self.accuracy}.items())
