"""The interface of a model; `steady_state` and `simulate` do the rest for every model alike."""

from __future__ import annotations

from abc import abstractmethod
from collections.abc import Callable
from typing import Any, ClassVar

import equinox as eqx
from jaxtyping import Array, Float

from tpd.exact.linear import Cycle
from tpd.exact.runs import Settled
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
