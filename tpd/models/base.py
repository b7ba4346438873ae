"""Interface of a model. `steady_state` and `simulate` use every model through this interface."""

from __future__ import annotations

from abc import abstractmethod
from collections.abc import Callable
from typing import Any, ClassVar, Protocol, runtime_checkable

import equinox as eqx
import jax.numpy as jnp
from jaxtyping import Array, Float

from tpd.compiled.simulate import Run, SteadyNumbers
from tpd.scene.parameters import Parameters
from tpd.scene.pytrees import State
from tpd.scene.status import Status

MOST_PERIODS = 800
"""Default for the largest number of forcing periods in one call of a model."""


def setting(name: str, check: Callable[..., Any], default: Any, *bounds: Any) -> Any:
    """Return a field for a model: `check(name, value, *bounds)` checks every value and converts it."""
    # The check is a converter and not a part of `__check_init__`, because Equinox warns about array values
    # before it calls `__check_init__`.
    convert = lambda value: check(name, value, *bounds)  # noqa: E731
    return eqx.field(converter=convert, default=default, static=True, kw_only=True)


@runtime_checkable
class Choice(Protocol):
    """A rule that selects a model, such as `Auto`."""

    def steady(self, p: Parameters, y0: State) -> Any:
        """Return the steady state of the selected model. The parameters must be plain numbers."""


class Model(eqx.Module):
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


def scale_of(p: Any, *, bob: Any = None) -> Float[Array, "4"]:
    """Return the scales of (phi, psi, phi', psi') to which the difference of two states is compared.

    A bob without mass (mu = 0) cannot move the block. The scales of its angle and rate are then infinite, so
    its state is ignored, unless `bob` is true.
    """
    rate = jnp.maximum(p.xi, 1.0)
    swing = jnp.where(jnp.asarray(p.mu) > 0 if bob is None else bob, p.nu + p.f, jnp.inf)
    # Errors of rates are divided by the forcing frequency or, at low frequencies, by the rate of the block.
    return jnp.stack([p.nu * jnp.ones(()), swing, p.nu * rate, swing * rate])
