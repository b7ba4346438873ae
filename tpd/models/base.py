"""The interface of a model; `steady_state` and `simulate` do the rest for every model alike."""

from __future__ import annotations

from abc import abstractmethod
from collections.abc import Callable
from typing import Any, ClassVar

import equinox as eqx
from jaxtyping import Array, Bool, Float, Int

from tpd.scene.parameters import Parameters
from tpd.scene.pytrees import Number, State
from tpd.scene.status import Status

MOST_PERIODS = 800
"""Most forcing periods in one call of a model, by default."""


def setting(name: str, check: Callable[..., Any], default: Any, *bounds: Any) -> Any:
    """Return a field of a model that holds what a check returns for a value."""
    # Not in `__check_init__`: Equinox warns of an array before that.
    convert = lambda value: check(name, value, *bounds)  # noqa: E731
    return eqx.field(converter=convert, default=default, static=True, kw_only=True)


class Settled(eqx.Module):
    """Where a motion has settled. Not differentiated: a start value for its periodic orbit."""

    y: State
    """State at tau = 0 modulo the forcing period."""
    memory: Any
    """Anything else that the model needs to go on from there (the exact model: its discrete mode)."""
    periods: Int[Array, ""]
    """Forcing periods in one period of the motion."""
    amplitude: Number
    """Largest |phi| of the last periods; the answer where there is no periodic orbit."""
    stroke: Number
    """Largest |psi| of the last periods."""
    status: Status
    elapsed: Int[Array, ""]
    """Forcing periods simulated."""
    peak: Number
    """Largest |phi| from the start on."""
    peak_stroke: Number
    """Largest |psi| from the start on."""


class Cycle(eqx.Module):
    """One period of a motion, differentiable in forward mode."""

    end: State
    amplitude: Number
    stroke: Number
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

    @property
    @abstractmethod
    def round_off(self) -> float:
        """Residual of the period map, relative to its scale, that counts as round-off."""

    @abstractmethod
    def check(self, p: Parameters) -> None:
        """Raise `ValueError` if the model cannot represent these parameters."""

    @abstractmethod
    def resolution(self, p: Parameters) -> Number:
        """The largest |phi| that the model cannot tell from rest."""

    @abstractmethod
    def settle(self, p: Parameters, y0: State) -> Settled:
        """Follow the motion from `y0` at tau = 0 until it repeats itself."""

    def settle_exactly(self, p: Parameters, y0: State) -> Settled | None:
        """The motion from `y0` by the same equations without smoothing: None of a model that smooths nothing,
        or of equations that are solved with smoothing alone. Not differentiated."""
        del p, y0
        return None

    @abstractmethod
    def cycle(self, p: Parameters, settled: Settled, y: State) -> Cycle:
        """Run `settled.periods` forcing periods from the state `y` at tau = 0."""

    @abstractmethod
    def trajectory(
        self, p: Parameters, y0: State, times: Float[Array, "times"]
    ) -> tuple[Float[Array, "times 4"], Status]:
        """The states at `times`, from `y0` at `times[0]`."""
