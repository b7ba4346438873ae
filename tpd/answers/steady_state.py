"""Steady states and trajectories of every model, and their exact derivatives.

A settled motion is a fixed point y* of the period map P. Following the motion gives an approximation, and
Newton's method on P gives the fixed point. The implicit function theorem then gives its derivative,
dy*/dp = (I - DP)^-1 dP/dp, so a gradient costs a few periods, however long the transient was. There are
nine parameters and four states, but many time steps, so forward mode along these periods is cheaper than
reverse mode. The result is linear in the direction of the derivative, so forward and reverse mode can
both use it. The derivative does not exist where a multiplier is on the unit circle.
"""

from __future__ import annotations

import math
from collections.abc import Callable
from functools import lru_cache, partial
from typing import Any

import equinox as eqx
import jax
import jax.core
import jax.numpy as jnp
import numpy as np
from jax.flatten_util import ravel_pytree
from jaxtyping import Array, Bool, Float, Int

from tpd.compiled.columns import NU, WIDTH
from tpd.compiled.derivatives import joined, primal, refused
from tpd.compiled.simulate import SteadyNumbers
from tpd.core import checks
from tpd.core.formatting import counted_periods, number
from tpd.models.base import Choice, Model
from tpd.models.piecewise import Piecewise
from tpd.scene.parameters import Parameters, as_arrays, check_parameters
from tpd.scene.pytrees import Number, State, single
from tpd.scene.status import SETTLED, Status, is_one_of, status_name


class Steady(eqx.Module):
    """Steady state that a motion settles into. Angles are in rad.

    `amplitude`, `swing` and `state` are differentiable in every parameter if `status` is rocking, sticking or
    rest. Otherwise their derivatives are NaN, and `status` gives the reason. The exception is the status
    inexact: the derivatives are then those of the smoothed motion. The following derivatives are also NaN:

    - of swing and state of an undamped bob (zeta = 0) under a block at rest. This bob swings for ever, and
      its swing depends on how the block came to rest;
    - of the swing of a bob at rest, because |psi| has a corner there;
    - of `multiplier`, `lyapunov` and `estimate`, and all second derivatives.

    Derivatives with respect to the initial state are zero where the others are numbers. For mu = 0 the swing
    is that of a bob that is too light to act on the block. For an overturned block amplitude and swing are
    infinite.

    Attributes:
        amplitude: largest |phi| of the settled motion, rad.
        swing: largest |psi| of the settled motion, rad.
        status: outcome, see `tpd.Status`.
        periods: number of forcing periods in one period of the motion.
        multiplier: largest modulus of the Floquet multipliers. The motion attracts if it is below 1.
        symmetric: whether the motion is its own mirror image half a period later.
        lyapunov: rate at which neighbouring motions separate, per unit tau.
        state: (phi, psi, phi', psi') at tau = 0 modulo the forcing period; for the signs see `y0` of
            `simulate`.
        elapsed: number of forcing periods until the motion repeated.
        estimate: estimated relative error of the amplitude, for `Auto` and `Smoothed`.
        model: name of the model that `Auto` selected.
        reason: sentence that gives the reason for this selection.
    """

    amplitude: Number
    """Largest |phi| of the settled motion, rad."""
    swing: Number
    """Largest |psi| of the settled motion, rad."""
    status: Status
    """Outcome of the motion."""
    periods: Int[Array | np.ndarray, "..."] | int
    """Number of forcing periods in one period of the motion."""
    multiplier: Number
    """Largest modulus of the Floquet multipliers. The motion attracts if it is below 1. NaN if the motion is
    not periodic."""
    symmetric: Bool[Array, "..."] | np.bool_
    """Whether the motion is its own mirror image half a period later."""
    lyapunov: Number
    """Rate at which neighbouring motions separate, per unit tau; negative if they approach. It is exact for a
    periodic motion. For a motion that does not repeat it is an estimate, which only `Piecewise` computes.
    Otherwise it is NaN."""
    state: Float[Array | np.ndarray, "... 4"]
    """(phi, psi, phi', psi') at tau = 0 modulo the forcing period."""
    elapsed: Int[Array | np.ndarray, "..."] | int
    """Number of forcing periods until the motion repeated."""
    estimate: Number = math.nan
    """Estimated relative error of the amplitude. If `Auto` selected the model, it is the error estimate of
    `Auto`. For `Smoothed` it is the relative difference from the exact amplitude that is reached from the
    same initial state: infinite if only one of the two motions rests or overturns, and NaN if the exact
    motion is unknown. For other models it is NaN."""
    model: str = eqx.field(static=True, default="")
    """Name of the model that `Auto` selected."""
    reason: str = eqx.field(static=True, default="")
    """Sentence that gives the reason for this selection."""

    def __str__(self) -> str:
        if not (checks.is_concrete(self.amplitude) and jnp.ndim(self.amplitude) == 0):
            # A batch has no single status, and traced values are unknown.
            return repr(self)
        lines = [
            f"{status_name(self.status)}: {Status[self.status]}",
            f"  amplitude    {self.amplitude:.6g} rad",
            f"  swing        {self.swing:.6g} rad",
            f"  multiplier   {number(float(self.multiplier))}",
            f"  repeats      after {counted_periods(int(self.periods))}",
        ]
        selected = f"  model        {self.model}, estimated error {self.estimate:.2g}: {self.reason}"
        return "\n".join([*lines, selected] if self.model else lines)


class Trajectory(eqx.Module):
    """States of a motion at given dimensionless times.

    Attributes:
        times: dimensionless times tau, shape (times,).
        ys: states (phi, psi, phi', psi') in rad and rad per unit tau, shape (times, 4).
        status: outcome of the motion within these times.
    """

    times: Float[Array, "times"]
    """Dimensionless times tau."""
    ys: Float[Array, "times 4"]
    """States (phi, psi, phi', psi'), in rad and rad per unit tau."""
    status: Status
    """Outcome of the motion within these times."""


_MOST_TIMES = 1_000_000
"""Largest number of times of a trajectory."""


@lru_cache(maxsize=1)
def _default() -> Piecewise:
    """Return the default model, which is cached: making it takes a third of the time of a call."""
    return Piecewise()


def steady_state(
    p: Parameters,
    *,
    model: Model | Choice | None = None,
    y0: checks.Vector | None = None,
    throw: bool = False,
) -> Steady:
    """Compute the motion into which the block settles from an initial state.

    Args:
        p: dimensionless parameters. Derivatives with respect to them are exact.
        model: `Piecewise()`, the exact solution of the linear model (default); `Smoothed()`;
            `Nonlinear()`, the nonlinear model; or `Auto()`, which selects a model.
            The amplitude of `Smoothed()` is compared with that of the exact motion from the same initial
            state. If they differ by more than 5 %, the status is inexact, see `Steady.estimate`.
        y0: initial state (phi, psi, phi', psi') at tau = 0, in rad and rad per unit tau. By default block
            and bob are at rest.
        throw: whether to raise an error if the status is not rocking, sticking or rest.

    Returns:
        The steady state. `jax.jit`, `jax.vmap` and `jax.grad` apply, except with `Auto()`.

    Raises:
        ValueError: bad input, or a parameter that the model cannot represent.
        RuntimeError: JAX is in 32-bit mode.

    Example:
        >>> import dataclasses
        >>> import jax, tpd
        >>> p = tpd.Parameters(nu=0.2, mu=0.05, lam=0.8, zeta=0.1, k=0.05, f=0.3, xi=3.0)
        >>> steady = tpd.steady_state(p)
        >>> tpd.status_name(steady.status), round(float(steady.amplitude), 4), round(float(steady.swing), 3)
        ('rocking', 0.0552, 0.102)
        >>> amplitude = lambda zeta: tpd.steady_state(dataclasses.replace(p, zeta=zeta)).amplitude
        >>> round(float(jax.grad(amplitude)(0.1)), 6)
        -0.001383
    """
    check_parameters(p)
    model = _default() if model is None else model
    checks.flag("throw", throw)
    start: Any = np.zeros(4) if y0 is None else checks.state(y0)
    if isinstance(model, Model):
        # The method of the class is called, because Equinox wraps a method of an object, which takes longer
        # than the check itself.
        model.__class__.check(model, p)  # pyright: ignore[reportArgumentType]
        steady = _steady_state(p, model, start)
    else:
        steady = checks.instance("model", model, (Model, Choice)).steady(p, start)
    if throw:
        settled = is_one_of(steady.status, *SETTLED)
        # The error is attached to the amplitude, so that it is also raised inside compiled programs.
        steady = eqx.tree_at(
            lambda s: s.amplitude, steady, steady.status.error_if(jnp.asarray(steady.amplitude), ~settled)
        )
    return steady


def simulate(
    p: Parameters, y0: checks.Vector, times: checks.Vector, *, model: Model | None = None
) -> Trajectory:
    """Compute the states of a motion at given times, from the initial state `y0` at `times[0]`.

    After an overturning the states of the linear model and their derivatives are NaN, and the status is
    overturned. Derivatives with respect to `p` and `y0` are exact in forward and reverse mode; derivatives
    with respect to `times` exist in forward mode only.

    Args:
        p: dimensionless parameters.
        y0: initial state (phi, psi, phi', psi'), in rad and rad per unit tau. A positive acceleration of the
            base, which is -f sin(xi tau) in g, tilts a block at rest to positive phi and swings the bob to
            negative psi.
        times: increasing dimensionless times tau, shape (n,).
        model: `Piecewise()` (default), `Smoothed()` or `Nonlinear()`, see `steady_state`.

    Raises:
        ValueError: bad input, or a parameter that the model cannot represent.
        RuntimeError: JAX is in 32-bit mode.

    Example:
        >>> import tpd
        >>> p = tpd.Parameters(nu=0.2, mu=0.05, lam=0.8, zeta=0.1, k=0.05, f=0.3, xi=3.0)
        >>> trajectory = tpd.simulate(p, [0.1, 0.0, 0.0, 0.0], [0.0, 1.0, 2.0])
        >>> trajectory.ys.shape
        (3, 4)
        >>> [round(float(tilt), 4) for tilt in trajectory.ys[:, 0]]
        [0.1, -0.026, -0.0983]
    """
    check_parameters(p)
    model = _default() if model is None else model
    checks.instance("model", model, Model)
    model.check(p)
    clock = checks.increasing("times", times)
    # Ctrl-C has no effect until compiled code returns, hence the limits on times and periods.
    checks.count("number of times", clock.size, most=_MOST_TIMES)
    p, longest = single(p), f"{model.most_periods} forcing periods in one call"
    checks.at_most("times[-1] - times[0]", clock[-1] - clock[0], model.most_periods * p.period, longest)
    clock = jnp.asarray(clock)
    ys, status = _trajectory(as_arrays(p), model, checks.state(y0), clock)
    return Trajectory(clock, ys, status)


def sampled(p: Parameters, periods: int = 24, per_period: int = 60) -> Float[Array, "times"]:
    """Return dimensionless times over the first forcing periods, close enough together for a drawing."""
    return jnp.asarray(np.linspace(0.0, 1.0, per_period * periods + 1) * periods) * p.period


@eqx.filter_jit
def _trajectory(p: Parameters, model: Model, y0: State, times: Array) -> tuple[Array, Status]:
    ys, status = _states_at(p, y0, times, model=model)
    # The derivatives of states that are NaN are NaN as well, and not zero.
    return refused(ys, jnp.isfinite(ys)), status


@eqx.filter_custom_jvp
def _states_at(p: Parameters, y0: State, times: Array, *, model: Model) -> tuple[Array, Status]:
    return model.trajectory(p, y0, times)


@_states_at.def_jvp
def _states_at_jvp(primals: tuple, tangents: tuple, *, model: Model) -> tuple:
    """Compute all derivatives of one trajectory with respect to parameters and initial state.

    The result is their product with the tangents, which is linear in the tangents and can be transposed for
    reverse mode. The derivative with respect to the times is available in forward mode only.
    """
    p, y0, times = primals
    x, unflatten = ravel_pytree((p, y0))

    def run(x: Float[Array, "n"]) -> tuple[Array, Status]:
        p, y0 = unflatten(x)
        return model.trajectory(p, y0, times)

    def push(direction: Float[Array, "n"]) -> tuple[Array, Array, Status]:
        return jax.jvp(run, (x,), (direction,), has_aux=True)

    ys, slopes, status = jax.vmap(push, out_axes=(None, -1, None))(jnp.eye(x.size))
    # JAX passes None as the tangent of an input that is not differentiated.
    moved = jax.tree.map(
        lambda tangent, x: jax.tree.map(jnp.zeros_like, x) if tangent is None else tangent,
        *(tangents[:2], (p, y0)),
        is_leaf=lambda leaf: leaf is None,
    )
    out = slopes @ ravel_pytree(moved)[0]
    if tangents[2] is not None:
        out = out + jax.jvp(lambda t: model.trajectory(p, y0, t)[0], (times,), (tangents[2],))[1]
    return (ys, status), (out, jax.tree.map(lambda _: None, status))


def _steady_state(p: Parameters, model: Model, y0: State) -> Steady:
    # Derivatives are computed only if JAX asks for them, and then together with the value. Forward and
    # reverse mode, nested to any depth, cost one product with the slopes, and never differentiate the loops
    # that solve for the orbit.
    values = (*p.numbers, *y0)
    if not all(isinstance(x, float) for x in values):
        if any(np.size(x) != 1 for x in values):
            raise ValueError("`p` must be single numbers: `jax.vmap` and `tpd.in_chunks` take batches")
        values = tuple(checks.plain("p", x, single=True) for x in values)
    solve = partial(model.__class__.solve_steady, model)
    x, traced = primal(values), [i for i, x in enumerate(values) if not checks.is_concrete(x)]
    if not traced:
        answer, _ = solve(x, 0)
    elif isinstance(x, np.ndarray):
        # JAX differentiates with respect to known numbers.
        answer = _joined(values, *solve(x, _needed(traced)))
    else:
        answer = _traced(values, traced, solve)
    # The object is built from its leaves, because its fields are annotated as JAX arrays, and known numbers
    # are NumPy numbers.
    return jax.tree.unflatten(_structure(), answer)


def _needed(traced: list[int]) -> int:
    """Return the number of parameters, from the first on, whose slopes are needed.

    The last one, the height of the hinge, is rarely needed.
    """
    return WIDTH if WIDTH - 1 in traced else WIDTH - 1


def _traced(values: tuple, traced: list[int], solve: Callable[..., Any]) -> SteadyNumbers:
    """Return the answer in a JAX program, of which only the values with the indices `traced` are inputs."""

    def with_inputs(inputs: tuple) -> tuple:
        by_index = dict(zip(traced, inputs, strict=True))
        return tuple(by_index.get(i, x) for i, x in enumerate(values))

    # Value and slopes come from one solution, so that a gradient costs no second one.
    @jax.custom_jvp
    def settled(*inputs: Any) -> SteadyNumbers:
        answer, _ = solve(primal(with_inputs(inputs)), 0)
        return answer

    @settled.defjvp
    def _(inputs: tuple, directions: tuple) -> tuple[SteadyNumbers, SteadyNumbers]:
        answer, slopes = solve(primal(with_inputs(inputs)), _needed(traced))
        return jax.jvp(lambda *x: _joined(with_inputs(x), answer, slopes), inputs, directions)

    return settled(*(jnp.asarray(values[i], dtype=jnp.float64) for i in traced))


def _joined(values: tuple, answer: SteadyNumbers, slopes: Any) -> SteadyNumbers:
    """Return the answer, which depends on parameters and initial state with the slopes of its sizes."""

    # A settled orbit does not depend on the initial state, so the derivatives with respect to the
    # initial state are zero, or NaN.
    def column(i: int) -> Any:
        return slopes[:, i] if i < WIDTH else 0.0 * slopes[:, NU]

    unknown = (lambda _: np.float64(np.nan),) * 3
    rules = (lambda i: column(i)[0]), (lambda i: column(i)[1]), (lambda i: column(i)[2:]), *unknown
    fields = joined(values, tuple(getattr(answer, name) for name in _DEPENDING), rules)
    return answer._replace(**dict(zip(_DEPENDING, fields, strict=True)))


_DEPENDING = "amplitude", "swing", "state", "multiplier", "lyapunov", "estimate"
"""Fields that depend on the parameters. The derivatives of the last three are not computed."""


@lru_cache(maxsize=1)
def _structure() -> Any:
    """Return the pytree structure of a `Steady`."""

    def example() -> Steady:
        none, count, no = jnp.zeros(()), jnp.zeros((), int), jnp.zeros((), bool)
        return Steady(none, none, Status.failed, count, none, no, none, jnp.zeros(4), count, none)

    # Only traced: the first array of a process takes JAX 0.1 s.
    return jax.tree.structure(jax.eval_shape(example))
