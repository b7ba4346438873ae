"""Newton step of a symmetric orbit and of its derivatives, from half a forcing period.

diffrax integrates the smoothed equations over the half period.

Four numbers u = (phi, psi, gamma, psi') describe a symmetric orbit: the state at its upper turn, where
phi' = 0, and the phase gamma of the forcing at the turn. Let y(u) be this state and P the state half a period
later. The orbit is symmetric if P is the mirror image of y(u). One integration with tangents in the state y,
the design x and the phase gives P and its derivatives. These give one Newton step of the orbit and, by the
implicit function theorem, the derivative of u:

    F(u, x) = P + y(u) = 0,     u <- u - F_u^-1 F,     du/dx = -F_u^-1 P_x.

The first component of u is the amplitude, so no search for a peak is necessary. If a design changes
little between two steps, orbit and design converge together. Each step returns its residual |F| as an
estimate of its error.
"""

from __future__ import annotations

from collections.abc import Callable
from functools import lru_cache, partial
from itertools import combinations
from typing import Any, NamedTuple

import diffrax
import jax
import jax.numpy as jnp
import numpy as np
from jax.lax import stop_gradient
from jaxtyping import Array, Float

from tpd.compiled.columns import SWING, SWING_RATE, TILT, TILT_RATE
from tpd.models.smoothed import Field, Smoothed
from tpd.scene.conditions import under
from tpd.scene.parameters import Parameters, as_arrays
from tpd.scene.pytrees import Number
from tpd.theory.equations import Linear, smoothed_rates

_VALUE, _DESIGN, _PHASE = 0, slice(4, 7), 7
"""Layout of an array with tangents. Row `_VALUE` of the array is the value. Among the eight directions of the
derivatives the first four are those of the state, then follow the three of the design and the phase."""
_SAMPLES = 32
"""Number of samples of the bob angle in half a period. The largest one is next to the turn of the bob."""
_STEPS = 256
"""Largest number of solver steps. About 50 steps are usual, and a batch waits for its slowest element."""


class HalfPeriod(NamedTuple):
    """State after half a period with its derivatives, and the other inputs of a Newton step."""

    end: Array
    """State at the end and its derivatives, shape (9, 4). The derivatives are those with respect to the four
    components of the first state, the design (mu, lam, zeta), and the phase of the forcing."""
    swing: Array
    """Largest |psi| (rad) and its derivatives in the same order, shape (9,)."""
    start: Array
    """State at the beginning, shape (4,)."""
    units: Array
    """Unit of each component of the state, shape (4,): nu for angles, xi nu for rates."""
    felt: Array
    """1 for each component of the state that acts on the block, otherwise 0, shape (4,). A bob without mass
    (mu = 0) does not act on the block."""
    done: Array
    """Whether the solver stayed within its limit on the number of steps."""


class Step(NamedTuple):
    """Orbits after one Newton step, with their derivatives with respect to the design (mu, lam, zeta)."""

    turn: np.ndarray
    """phi (rad, the amplitude), psi (rad), phase of the forcing (rad) and psi' at the upper turn, (n, 4)."""
    slope: np.ndarray
    """Derivatives of `turn`, shape (n, 4, 3). Row 0 is the derivative of the amplitude."""
    swing: np.ndarray
    """Largest |psi|, rad, shape (n,)."""
    swing_slope: np.ndarray
    """Derivatives of `swing`, shape (n, 3)."""
    residual: np.ndarray
    """Largest component of F, in units of nu for angles and xi nu for rates, shape (n,)."""
    multiplier: np.ndarray
    """Largest modulus of the Floquet multipliers over a whole period, shape (n,)."""
    reserve: np.ndarray
    """Distance from the loss of stability, shape (n,): the smallest of `fold`, `symmetry` and `torus` of
    `tpd.answers.symmetric_orbits.Margins`."""
    solved: np.ndarray
    """Whether the solver stayed within its limit on the steps and all numbers are finite, shape (n,)."""


@lru_cache(maxsize=8)
def half_period(model: Smoothed) -> Callable[[tuple[Parameters, Array, Array, Array]], HalfPeriod]:
    """Return a function that follows half a period of one orbit, as a pure JAX function.

    Its argument is a tuple: the parameters without the pendulum, the design (3,), the factors of the
    condition (8,), and the turn u (4,).
    """

    def run(args: tuple[Parameters, Array, Array, Array]) -> HalfPeriod:
        p, design, factors, turn = args
        q, start = as_arrays(under(p, design, factors)), turn.at[TILT_RATE].set(0.0)
        times = 0.5 * q.period * jnp.linspace(0.0, 1.0, _SAMPLES + 1)
        # Design and phase enter through the vector field. Its tangents in their directions are computed once,
        # before the integration.
        directions = jnp.eye(8)[:, _DESIGN], jnp.eye(8)[:, _PHASE]
        motion_at, at = partial(_motion, model, p, factors), (design, turn[TILT_RATE])
        motion, motion_tangents = _with_tangents(motion_at, at, directions)

        def rates(time: Any, z: Any, args: Any) -> Array:
            """Return the rates of the state and of its derivatives, shape (9, 4)."""

            def rate(motion: tuple[Field, Array], y: Array) -> Array:
                field, begin = motion
                return field(begin + time, y, args)

            value, slopes = _with_tangents(rate, (motion, z[_VALUE]), (motion_tangents, z[1:]))
            return jnp.concatenate([value[None], slopes])

        # The derivatives are integrated together with the state. `jax.jacfwd` of the solver returns the same
        # numbers, but traces the solver three more times, and every process has to trace.
        first = jnp.concatenate([start[None], jnp.eye(8, 4)])
        zs, done = _integrate(model, rates, q.period, first, _VALUE, diffrax.SaveAt(ts=times))
        directions = motion_tangents, jnp.moveaxis(zs[:, 1:], 1, 0)
        swing_at = partial(_largest_swing, times)
        swing, swing_slopes = _with_tangents(swing_at, (motion, zs[:, _VALUE]), directions)
        bob = jnp.where(q.mu > 0.0, 1.0, 0.0)
        return HalfPeriod(
            end=zs[-1],
            swing=jnp.concatenate([swing[None], swing_slopes]),
            start=start,
            units=q.nu * jnp.stack([jnp.ones_like(q.xi), jnp.ones_like(q.xi), q.xi, q.xi]),
            felt=jnp.stack([jnp.ones_like(bob), bob, jnp.ones_like(bob), bob]),
            done=done,
        )

    return run


class Remaining(NamedTuple):
    """Factor by which a disturbance of the block falls, with its derivatives along three directions."""

    value: Array
    """Factor per forcing period, see `tpd.limits.Settling`."""
    slope: Array
    """Derivatives of the factor with respect to the design (mu, lam, zeta), shape (3,)."""
    done: Array
    """Whether the solver stayed within its limit on the number of steps."""


@lru_cache(maxsize=8)
def remaining(model: Smoothed) -> Callable[[tuple[Parameters, Array, Array, Array, Array]], Remaining]:
    """Return a function that follows disturbances of one orbit over half a period, as a pure JAX function.

    Its argument is a tuple: the parameters without the pendulum, the design (3,), the factors of the
    condition (8,), the turn u (4,), and the derivatives of the turn with respect to the design (4, 3).

    The four variational equations give the derivative G of the half-period map. They are differentiated once
    more, along the change of the orbit with the design.
    """

    def run(args: tuple[Parameters, Array, Array, Array, Array]) -> Remaining:
        p, design, factors, turn, turn_slope = args
        # The turn moves along the branch of orbits as the design changes. Without it the derivative would be
        # that of a motion that is no orbit.
        at, along = (design, turn[TILT_RATE]), (jnp.eye(3), turn_slope[TILT_RATE])
        motion, motion_tangents = _with_tangents(partial(_motion, model, p, factors), at, along)

        def rates(time: Any, z: Any, args: Any) -> Array:
            """Return the rates of the state and four disturbances (5, 4), and of their derivatives along
            three directions, shape (4, 5, 4)."""

            def rate(motion: tuple[Field, Array], y: Array) -> Array:
                field, begin = motion

                def of(state: Array) -> Array:
                    return field(begin + time, state, args)

                value, moved = _with_tangents(of, (y[_VALUE],), (y[1:],))
                return jnp.concatenate([value[None], moved])

            value, slopes = _with_tangents(rate, (motion, z[_VALUE]), (motion_tangents, z[1:]))
            return jnp.concatenate([value[None], slopes])

        q, start = as_arrays(under(p, design, factors)), turn.at[TILT_RATE].set(0.0)
        # Four disturbances in the directions of the state give the matrix of the half-period map.
        # The third component of u is the phase, and phi' is zero at the turn of every design.
        first = jnp.concatenate([start[None], jnp.eye(4)])
        moved = jnp.zeros((3, 5, 4)).at[:, _VALUE].set(turn_slope.at[TILT_RATE].set(0.0).T)
        first, place = jnp.concatenate([first[None], moved]), (_VALUE, _VALUE)
        (end,), done = _integrate(model, rates, q.period, first, place, diffrax.SaveAt(t1=True))

        def after_turn(x: Array, u: Array) -> tuple[Array, Number]:
            q = as_arrays(under(p, x, factors))
            return _after_turn(q, u), q.xi

        turned, turned_moved = _with_tangents(after_turn, (design, turn), (jnp.eye(3), turn_slope.T))
        value, slope = _with_tangents(_factor, (end[_VALUE, 1:], *turned), (end[1:, 1:], *turned_moved))
        return Remaining(value, slope, done)

    return run


def _after_turn(q: Parameters, turn: Float[Array, "4"]) -> Float[Array, "4 4"]:
    """Return the matrix that carries a disturbance past the turn.

    At the turn a smoothed orbit is in the middle of the layer in which friction changes its sign, and an
    exact orbit is beyond the layer. Within the layer only the rates change, and a neighbour that is early by
    a time is early by the same time beyond it.
    """
    linear, state, sine = Linear(q), turn.at[TILT_RATE].set(0.0), jnp.sin(turn[TILT_RATE])
    within, beyond = (linear.rates(state, 1.0, drag, sine) for drag in (0.0, -1.0))
    return jnp.eye(4) + jnp.outer((beyond - within) / within[TILT_RATE], jnp.eye(4)[TILT_RATE])


def _factor(tangents: Float[Array, "4 4"], after_turn: Float[Array, "4 4"], xi: Number) -> Number:
    """Return the factor of `tpd.limits.Settling` from the disturbances after half a period, one in each row,
    from the matrix that carries them past the turn, and from the forcing frequency."""
    half = after_turn @ -tangents.T @ jnp.linalg.inv(after_turn)
    two = jnp.linalg.matrix_power(half, 4)
    scale = jnp.stack([jnp.ones_like(xi), xi])
    relative = scale[None] / scale[:, None]
    block = np.ix_([TILT, TILT_RATE], [TILT, TILT_RATE])
    after_two, after_four = (0.5 * jnp.sum((power[block] * relative) ** 2) for power in (two, two @ two))
    return after_two**0.125 * after_four**0.0625


def _motion(
    model: Smoothed, p: Parameters, factors: Array, design: Array, phase: Array
) -> tuple[Field, Array]:
    """Return the vector field of a design and the time at which the motion begins."""
    q = as_arrays(under(p, design, factors))
    return smoothed_rates(q, *model.widths(q), model.terms), phase / q.xi


def _integrate(
    model: Smoothed, rates: Callable[..., Array], period: Number, first: Array, state: Any, saveat: Any
) -> tuple[Any, Array]:
    """Integrate over half a period. Return what `saveat` requests, and whether the steps were enough.

    The error of the state alone, at its place in the array, controls the steps. The tangents do not change
    them.
    """
    solution = diffrax.diffeqsolve(
        diffrax.ODETerm(rates),
        model.solver,
        0.0 * period,
        0.5 * period,
        1e-3 * period,
        first,
        saveat=saveat,
        stepsize_controller=diffrax.PIDController(
            rtol=model.rtol, atol=0.01 * model.rtol, norm=lambda z: jnp.sqrt(jnp.mean(z[state] ** 2))
        ),
        adjoint=diffrax.ForwardMode(),
        max_steps=_STEPS,
        throw=False,
    )
    return solution.ys, solution.result == diffrax.RESULTS.successful


def _with_tangents(function: Callable[..., Any], at: Any, directions: Any) -> tuple[Any, Any]:
    """Return the value of a function of several arguments, and its derivatives in several directions."""
    return jax.vmap(lambda *d: jax.jvp(function, at, d), out_axes=(None, 0))(*directions)


@np.errstate(all="ignore")
def newton(turn: np.ndarray, half: HalfPeriod) -> Step:
    """Return the orbits (n, 4) after one Newton step, from the half periods that begin at their turns."""
    finite = np.all(np.isfinite(half.end), axis=(1, 2)) & np.all(np.isfinite(half.swing), axis=1)
    by = np.where(finite[:, None, None], half.end[:, 1:], 0.0)
    # The third component of u is the phase. It takes the place of phi', which is zero at the turn.
    components = [TILT, SWING, _PHASE, SWING_RATE]
    jacobian = np.swapaxes(by[:, components] + np.eye(8, 4)[components], 1, 2)
    # NumPy raises an error for the whole batch if one matrix is singular. Such a matrix is replaced by the
    # identity, and its orbit is marked as not solved at the end.
    regular = finite & (np.abs(np.linalg.det(jacobian)) > 0.0)
    jacobian = np.where(regular[:, None, None], jacobian, np.eye(4))
    residual = half.end[:, _VALUE] + half.start
    moved = -np.linalg.solve(jacobian, residual[:, :, None]).squeeze(-1)
    slope = -np.linalg.solve(jacobian, np.swapaxes(by[:, _DESIGN], 1, 2))
    swing_u = half.swing[:, 1:][:, components]
    # Derivative G of the mirrored half-period map. Its eigenvalues g decide whether the orbit attracts.
    g = np.linalg.eigvals(-by[:, :4] * (half.felt[:, :, None] * half.felt[:, None]))
    pairs = np.stack([g[:, i] * g[:, j] for i, j in combinations(range(4), 2)], axis=1)
    # The products vanish at an eigenvalue +1, at an eigenvalue -1, and at a pair on the unit circle.
    margins = [np.prod(1.0 - g, axis=1), np.prod(1.0 + g, axis=1), np.prod(1.0 - pairs, axis=1)]
    step = Step(
        turn=turn + moved,
        slope=slope,
        swing=half.swing[:, _VALUE] + np.sum(swing_u * moved, axis=1),
        swing_slope=half.swing[:, 1:][:, _DESIGN] + np.einsum("ni,nij->nj", swing_u, slope),
        residual=np.max(np.abs(residual) / half.units, axis=1),
        multiplier=np.max(np.abs(g), axis=1) ** 2,
        reserve=np.min(np.real(margins), axis=0),
        solved=half.done & regular,
    )
    sound = [np.isfinite(x).reshape(len(turn), -1).all(axis=1) for x in step[:-1]]
    return step._replace(solved=step.solved & np.all(sound, axis=0))


def _largest_swing(
    times: Float[Array, "samples"], motion: tuple[Field, Number], ys: Float[Array, "samples 4"]
) -> Number:
    """Return the largest |psi| of half a period.

    The largest value is at a turn of the bob, or at an impact, where the rate of the bob changes its sign by
    a jump. `motion` is the vector field and the time at which the motion begins.
    """
    field, begin = motion
    times = begin + times
    # The half periods before and after this one are its mirror images, so the samples next to the two
    # ends are known.
    step = times[1] - times[0]
    ys = jnp.concatenate([-ys[-2:-1], ys, -ys[1:2]])
    times = jnp.concatenate([times[:1] - step, times, times[-1:] + step])
    # Sample i is the largest one. Its neighbour j is on the side to which |psi| increases.
    i = 1 + jnp.argmax(jnp.abs(stop_gradient(ys)[1:-1, SWING]))
    side = jnp.sign(stop_gradient(ys)[i, SWING])
    j = jnp.where(side * stop_gradient(ys)[i, SWING_RATE] > 0.0, i + 1, i - 1)
    here, there, to = ys[i], ys[j], times[j] - times[i]
    pull, back = field(times[i], here, None)[SWING_RATE], field(times[j], there, None)[SWING_RATE]
    # Each sample has a parabola from its angle, rate and acceleration. Either the top of the first parabola
    # lies between the two samples, or an impact lies between them. In the second case the parabolas intersect
    # at the impact: the secant and one Newton step give the time of the intersection.
    top = -here[SWING_RATE] / jnp.where(pull == 0.0, 1.0, pull)
    turns = (side * pull < 0.0) & (jnp.abs(stop_gradient(top)) <= step)
    slope = jnp.where(turns, 1.0, here[SWING_RATE] - there[SWING_RATE])
    crossing = (there[SWING] - here[SWING] - there[SWING_RATE] * to) / slope
    apart = here[SWING] + here[SWING_RATE] * crossing + 0.5 * pull * crossing**2
    apart = apart - there[SWING] - there[SWING_RATE] * (crossing - to) - 0.5 * back * (crossing - to) ** 2
    crossing = crossing - apart / jnp.where(turns, 1.0, slope + pull * crossing - back * (crossing - to))
    when = jnp.where(turns, top, crossing)
    # A time outside the interval means that neither case applies: the sample itself is the largest value.
    between = jnp.abs(stop_gradient(when)) <= step
    when = jnp.where(between, when, 0.0)
    return side * (here[SWING] + here[SWING_RATE] * when + 0.5 * pull * when**2)
