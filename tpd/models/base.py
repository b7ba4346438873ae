"""The interface of a model; `steady_state` and `simulate` do the rest for every model alike."""

from __future__ import annotations

from abc import abstractmethod
from collections.abc import Callable
from typing import Any, ClassVar

import equinox as eqx
from jaxtyping import Array, Bool, Float

from tpd.exact.rows import row_of
from tpd.exact.runs import HarmonicForcing, Limits, Settled, follow
from tpd.exact.trajectories import trajectory
from tpd.scene.parameters import Parameters
from tpd.scene.pytrees import Number, State
from tpd.scene.status import Status
from tpd.theory.equations import Terms

MOST_PERIODS = 800
"""Most forcing periods in one call of a model, by default."""
COMPILED_PERIODS = 100_000
"""Most forcing periods in one call of a model that compiled code solves: half a second of work, or some
seconds with many events."""


def setting(name: str, check: Callable[..., Any], default: Any, *bounds: Any) -> Any:
    """Return a field of a model that holds what a check returns for a value."""
    # Not in `__check_init__`: Equinox warns of an array before that.
    convert = lambda value: check(name, value, *bounds)  # noqa: E731
    return eqx.field(converter=convert, default=default, static=True, kw_only=True)


class Cycle(eqx.Module):
    """One period of a motion, differentiable in forward mode."""

    end: State
    amplitude: Number
    swing: Number
    memory: Any
    """As `Settled.memory`, at the end."""
    transversality: Number
    """Least rate at which the motion met an event, over the usual rate: 0 if it grazed one, infinite for a
    model without events."""
    asymmetry: Number
    """Difference between the largest tilts to either side, over the amplitude."""
    closed: Bool[Array, ""]
    """Whether the discrete mode at the end is that at the beginning; true for a model without modes."""


class AbstractChoice(eqx.Module):
    """A way to choose among models."""

    @abstractmethod
    def steady(self, p: Parameters, y0: State) -> Any:
        """The `Steady` of the model chosen for these parameters, plain numbers."""


class AbstractModel(eqx.Module):
    """A model of block and pendulum in dimensionless form."""

    most_periods: ClassVar[int] = MOST_PERIODS
    """Most forcing periods in one call, which Ctrl-C cannot stop."""

    @abstractmethod
    def check(self, p: Parameters) -> None:
        """Raise `ValueError` if the model cannot represent these parameters."""

    @abstractmethod
    def settle(self, p: Parameters, y0: State) -> Settled:
        """Follow the motion from `y0` at tau = 0 until it repeats itself."""

    @abstractmethod
    def trajectory(
        self, p: Parameters, y0: State, times: Float[Array, "times"]
    ) -> tuple[Float[Array, "times 4"], Status]:
        """The states at `times`, from `y0` at `times[0]`."""


class AbstractCompiled(AbstractModel):
    """A model of equations that compiled code solves.

    Compiled code also decides when a motion has settled, after how many periods it repeats, and what its
    status is. A subclass changes nothing of that: a model with another flow is an `AbstractFlow`.
    """

    max_periods: eqx.AbstractVar[int]
    max_events: eqx.AbstractVar[int]
    tolerance: eqx.AbstractVar[float]
    rest_rate: eqx.AbstractVar[float]
    equations: ClassVar[Terms]
    most_periods: ClassVar[int] = COMPILED_PERIODS

    @property
    def accuracy(self) -> dict[str, Any]:
        """Settings of the compiled code for a part of a motion, by their names."""
        return {"events": self.max_events, "rest_rate": self.rest_rate}

    @property
    @abstractmethod
    def limits(self) -> Limits:
        """Settings of the compiled code for a steady state."""

    def check(self, p: Parameters) -> None:
        """Every valid set of parameters is representable."""

    def settle(self, p: Parameters, y0: State) -> Settled:
        """Follow the motion from `y0` at tau = 0 until it repeats or rests for good."""
        forcing = HarmonicForcing(self.max_periods)
        how = {**self.accuracy, "tolerance": self.tolerance}
        return follow(self.equations, row_of(p), forcing, y0=y0, **how)

    def trajectory(
        self, p: Parameters, y0: State, times: Float[Array, "times"]
    ) -> tuple[Float[Array, "times 4"], Status]:
        """The states at `times`, from `y0` at `times[0]`."""
        return trajectory(self.equations, p, y0, times, **self.accuracy)


class AbstractFlow(AbstractModel):
    """A model whose motions programs of JAX follow and differentiate, by the rules of
    `tpd.answers.period_map` and `tpd.models.settling`."""

    @property
    @abstractmethod
    def round_off(self) -> float:
        """Residual of the period map, relative to its scale, that counts as round-off."""

    @abstractmethod
    def resolution(self, p: Parameters) -> Number:
        """The largest |phi| that the model cannot tell from rest."""

    def settle_exactly(self, p: Parameters, y0: State) -> Settled | None:
        """The motion from `y0` by the same equations without smoothing: None of a model that smooths nothing,
        or of equations that are solved with smoothing alone. Not differentiated."""
        del p, y0
        return None

    @abstractmethod
    def cycle(self, p: Parameters, settled: Settled, y: State) -> Cycle:
        """Run `settled.periods` forcing periods from the state `y` at tau = 0."""
