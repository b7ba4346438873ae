"""One step of an orbit and of its derivatives: half a forcing period of the smoothed equations by diffrax.

A symmetric orbit is described by the state at its upper turn, phi' = 0, and by the phase of the forcing
there: four numbers u = (phi, psi, gamma, psi'). With P the state half a period later, -P must be the state
again.
One integration with tangents in the state y and in the design x gives P and its derivatives, and with them
one Newton step of the orbit and the derivative of u by the implicit function theorem,

    F(u, x) = P + y(u) = 0,     u <- u - F_u^-1 F,     du/dx = -F_u^-1 P_x.

The first number of u is the amplitude, so no peak has to be looked for. The derivative with respect to gamma
needs no tangent of its own: the same motion begun a little later arrives a little later,

    xi P_gamma = f(P) - P_y f(y),     f the vector field.

If a design moves little between two steps, orbit and design converge together; the residual |F| goes with
every step as its own estimate of the error.
"""

from __future__ import annotations

from collections.abc import Callable
from functools import lru_cache
from typing import Any, NamedTuple

import diffrax
import jax
import jax.numpy as jnp
import numpy as np
from jax.lax import stop_gradient
from jaxtyping import Array, Bool, Float

from tpd.core.conditions import under
from tpd.core.equations import smoothed_rates
from tpd.core.parameters import Number, Parameters, State, as_arrays
from tpd.models.smoothed import Field, Smoothed

_SAMPLES = 32
"""Samples of the bob's way in half a period, of which the largest is beside its turn."""
_STEPS = 256
"""Bound on the solver's steps: some 50 are usual, and in a batch all wait for the slowest."""


class HalfPeriod(NamedTuple):
    """An orbit after one step, and its derivatives with respect to the design (mu, lam, zeta)."""

    turn: Float[Array, "4"]
    """phi, the largest of the orbit, and psi (rad), phase of the forcing (rad) and psi' at the upper turn."""
    slope: Float[Array, "4 3"]
    """Its derivatives; the first row is that of the amplitude."""
    stroke: Number
    """Largest |psi|, rad."""
    stroke_slope: Float[Array, "3"]
    residual: Number
    """Largest difference from an orbit, over nu for angles and xi nu for rates."""
    multiplier: Number
    """Largest modulus of the Floquet multipliers over a whole period."""
    reserve: Number
    """Distance from where the orbit stops attracting, as `tpd.Margins` has it: the least of fold, symmetry
    and torus."""
    solved: Bool[Array, ""]
    """Whether the solver kept its bound on the steps and all numbers are finite."""


@lru_cache(maxsize=8)
def half_period(model: Smoothed) -> Callable[[tuple[Parameters, Array, Array, Array]], HalfPeriod]:
    """Function of (parameters of the bare block, design (3,), factors of the condition (8,), turn (4,))
    that makes one step; pure JAX."""

    def step(args: tuple[Parameters, Array, Array, Array]) -> HalfPeriod:
        p, design, factors, turn = args
        begin = jnp.stack([turn[0], turn[1], jnp.zeros_like(turn[0]), turn[3]])

        def field_at(x: Array) -> tuple[Parameters, Field]:
            q = as_arrays(under(p, x, factors))
            return q, smoothed_rates(q, *model.widths(q), model.terms)

        def run(y: State, x: Array) -> tuple:
            q, field = field_at(x)
            times = turn[2] / q.xi + 0.5 * q.period * jnp.linspace(0.0, 1.0, _SAMPLES + 1)
            solution = diffrax.diffeqsolve(
                diffrax.ODETerm(field),
                model.solver,
                times[0],
                times[-1],
                1e-3 * q.period,
                y,
                saveat=diffrax.SaveAt(ts=times),
                stepsize_controller=diffrax.PIDController(rtol=model.rtol, atol=0.01 * model.rtol),
                adjoint=diffrax.ForwardMode(),
                max_steps=_STEPS,
                throw=False,
            )
            ys: Array = solution.ys  # type: ignore[assignment]
            done = solution.result == diffrax.RESULTS.successful
            found = ys[-1], _largest_bob(field, times, ys)
            return found, (found, done)

        # Forward mode: seven directions, and one solve carries all of them.
        jacobians, ((end, stroke), done) = jax.jacfwd(run, argnums=(0, 1), has_aux=True)(begin, design)
        ((by_y, by_x), (stroke_y, stroke_x)) = jacobians
        q, field = field_at(design)
        start = turn[2] / q.xi
        flow, later = field(start, begin, None), field(start + 0.5 * q.period, end, None)
        by_phase = (later - by_y @ flow) / q.xi
        residual = end + begin
        units = jnp.eye(4)
        columns = [by_y[:, i] + units[i] for i in (0, 1, 3)]
        jacobian = jnp.stack([columns[0], columns[1], by_phase, columns[2]], axis=1)
        both = jnp.linalg.solve(jacobian, jnp.concatenate([residual[:, None], by_x], axis=1))
        moved, slope = -both[:, 0], -both[:, 1:]
        # The bob's largest angle does not change when the window over the orbit is moved.
        stroke_u = jnp.stack([stroke_y[0], stroke_y[1], -(stroke_y @ flow) / q.xi, stroke_y[3]])
        # G, the derivative of the mirrored half period: its eigenvalues say whether the orbit attracts.
        # A bob without mass does not act on the block: what is left are the block's own and two zeros.
        felt = jnp.where(q.mu > 0.0, jnp.ones(4), jnp.array([1.0, 0.0, 1.0, 0.0]))
        half = -by_y * jnp.outer(felt, felt)
        scale = q.nu * jnp.stack([jnp.ones_like(q.xi), jnp.ones_like(q.xi), q.xi, q.xi])
        out = HalfPeriod(
            turn=turn + moved,
            slope=slope,
            stroke=stroke + stroke_u @ moved,
            stroke_slope=stroke_x + stroke_u @ slope,
            residual=jnp.max(jnp.abs(residual) / scale),
            multiplier=_spectral_radius(half) ** 2,
            reserve=_reserve(half),
            solved=done,
        )
        finite = jnp.stack([jnp.all(jnp.isfinite(x)) for x in out[:-1]])
        return out._replace(solved=done & jnp.all(finite))

    return step


def _spectral_radius(m: Float[Array, "n n"]) -> Number:
    """Largest modulus of the eigenvalues, as the limit of |m^k|^(1/k)."""

    def square(_: Any, carry: tuple) -> tuple:
        power, log, share = carry
        size = jnp.maximum(jnp.max(jnp.abs(power)), 1e-300)
        power = power / size
        return power @ power, log + share * jnp.log(size), 0.5 * share

    # The powers 2^k: rounding of one counts as little as its logarithm does, and double eigenvalues are no
    # exception.
    return jnp.exp(jax.lax.fori_loop(0, 50, square, (m, 0.0, 1.0))[1])


def _reserve(half: Float[Array, "4 4"]) -> Number:
    """The least of det(I - G), det(I + G) and the product of 1 - g_i g_j over all pairs of eigenvalues, which
    are the eigenvalues of the matrix of all minors of two rows."""
    (i, j), units = np.triu_indices(4, 1), jnp.eye(6)
    minors = half[i][:, i] * half[j][:, j] - half[i][:, j] * half[j][:, i]
    return jnp.min(
        jnp.stack([jnp.linalg.det(x) for x in (units[:4, :4] - half, units[:4, :4] + half, units - minors)])
    )


def _largest_bob(field: Field, times: Float[Array, "samples"], ys: Float[Array, "samples 4"]) -> Number:
    """Largest |psi|, at a turn of the bob, or at an impact where its rate jumps to the other side."""
    # The half periods before and after are mirror images.
    step = times[1] - times[0]
    ys = jnp.concatenate([-ys[-2:-1], ys, -ys[1:2]])
    times = jnp.concatenate([times[:1] - step, times, times[-1:] + step])
    i = 1 + jnp.argmax(jnp.abs(stop_gradient(ys)[1:-1, 1]))
    side = jnp.sign(stop_gradient(ys)[i, 1])
    j = jnp.where(side * stop_gradient(ys)[i, 3] > 0.0, i + 1, i - 1)
    here, there, to = ys[i], ys[j], times[j] - times[i]
    pull, back = field(times[i], here, None)[3], field(times[j], there, None)[3]
    # The top of the parabola lies between the two samples, or an impact stands between: then both parabolas
    # end where they meet, by the secant and one step of Newton.
    top = -here[3] / jnp.where(pull == 0.0, 1.0, pull)
    turns = (side * pull < 0.0) & (jnp.abs(stop_gradient(top)) <= step)
    fall = jnp.where(turns, 1.0, here[3] - there[3])
    meets = (there[1] - here[1] - there[3] * to) / fall
    apart = here[1] + here[3] * meets + 0.5 * pull * meets**2
    apart = apart - there[1] - there[3] * (meets - to) - 0.5 * back * (meets - to) ** 2
    meets = meets - apart / jnp.where(turns, 1.0, fall + pull * meets - back * (meets - to))
    when = jnp.where(turns, top, meets)
    between = jnp.abs(stop_gradient(when)) <= step
    when = jnp.where(between, when, 0.0)
    return side * (here[1] + here[3] * when + 0.5 * pull * when**2)
