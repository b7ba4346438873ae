"""Interface of a model. `steady_state` and `simulate` use every model through this interface."""

from __future__ import annotations

from abc import abstractmethod
from collections.abc import Callable
from typing import Any, ClassVar

import equinox as eqx
from jaxtyping import Array, Float

from tpd.compiled.rows import row_of
from tpd.compiled.simulate import HarmonicForcing, Limits, Run, SteadyNumbers, follow, solve_steady
from tpd.compiled.trajectories import trajectory
from tpd.scene.parameters import Parameters
from tpd.scene.pytrees import State
from tpd.scene.status import Status
from tpd.theory.equations import Terms

MOST_PERIODS = 800
"""Default for the largest number of forcing periods in one call of a model."""
COMPILED_PERIODS = 100_000
"""Largest number of forcing periods in one call of a model that compiled code solves. So many periods take
half a second, or some seconds if the motion has many events."""


def setting(name: str, check: Callable[..., Any], default: Any, *bounds: Any) -> Any:
    """Return a field for a model: `check(name, value, *bounds)` checks every value and converts it."""
    # The check is a converter and not a part of `__check_init__`, because Equinox warns about array values
    # before it calls `__check_init__`.
    convert = lambda value: check(name, value, *bounds)  # noqa: E731
    return eqx.field(converter=convert, default=default, static=True, kw_only=True)


class AbstractChoice(eqx.Module):
    """A rule that selects a model for given parameters."""

    @abstractmethod
    def steady(self, p: Parameters, y0: State) -> Any:
        """Return the steady state of the selected model. The parameters must be plain numbers."""


class AbstractModel(eqx.Module):
    """A model of block and pendulum in dimensionless form."""

    most_periods: ClassVar[int] = MOST_PERIODS
    """Largest number of forcing periods in one call. Ctrl-C cannot interrupt a call."""

    @abstractmethod
    def check(self, p: Parameters) -> None:
        """Raise `ValueError` if the model cannot represent these parameters."""

    @abstractmethod
    def settle(self, p: Parameters, y0: State) -> Run:
        """Follow the motion from the state `y0` at tau = 0 until it repeats."""

    @abstractmethod
    def solve_steady(self, x: Any, slopes: int) -> tuple[SteadyNumbers, Any]:
        """Return the steady state and the slopes (6, 10) of amplitude, swing and state.

        `x` has the ten parameters and the four numbers of the initial state. The slopes count only for the
        first `slopes` parameters.
        """

    @abstractmethod
    def trajectory(
        self, p: Parameters, y0: State, times: Float[Array, "times"]
    ) -> tuple[Float[Array, "times 4"], Status]:
        """Return the states at `times` and the status of the motion that begins with `y0` at `times[0]`."""


class AbstractCompiled(AbstractModel):
    """A model whose equations are solved by compiled code (Numba).

    The compiled code also decides when a motion has settled, after how many periods the motion repeats, and
    which status it has. Subclasses cannot change these decisions. A model with another flow must be an
    `AbstractFlow`.
    """

    max_periods: eqx.AbstractVar[int]
    max_events: eqx.AbstractVar[int]
    tolerance: eqx.AbstractVar[float]
    rest_rate: eqx.AbstractVar[float]
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
        # By default compiled code has limits of its own; those of the model replace them.
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
