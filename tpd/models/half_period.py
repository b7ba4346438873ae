"""One step of an orbit and of its derivatives: half a forcing period of the smoothed equations by diffrax.

A symmetric orbit is described by the state at its upper turn, phi' = 0, and by the phase of the forcing
there: four numbers u = (phi, psi, gamma, psi'). With P the state half a period later, -P must be the state
again.
One integration with tangents in the state y, the design x and the phase gives P and its derivatives, and with
them one Newton step of the orbit and the derivative of u by the implicit function theorem,

    F(u, x) = P + y(u) = 0,     u <- u - F_u^-1 F,     du/dx = -F_u^-1 P_x.

The first number of u is the amplitude, so no peak has to be looked for. If a design moves little between two
steps, orbit and design converge together; the residual |F| goes with every step as its own estimate of the
error.
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

from tpd.exact.terms import SWING, SWING_RATE, TILT, TILT_RATE
from tpd.models.smoothed import Field, Smoothed
from tpd.scene.conditions import under
from tpd.scene.parameters import Parameters, as_arrays
from tpd.scene.pytrees import Number
from tpd.theory.equations import smoothed_rates

_VALUE, _DESIGN, _PHASE = 0, slice(4, 7), 7
"""Row of a value before its derivatives; directions of these after the state's own four: the design's three,
and the phase."""
_SAMPLES = 32
"""Samples of the bob's way in half a period, of which the largest is beside its turn."""
_STEPS = 256
"""Bound on the solver's steps: some 50 are usual, and in a batch all wait for the slowest."""


class HalfPeriod(NamedTuple):
    """The state after half a period, with derivatives, and what a Newton step needs beside them."""

    end: Array
    """The state at the end and its derivatives, (9, 4): in the four numbers of the first state, in the design
    (mu, lam, zeta), and in the phase of the forcing."""
    swing: Array
    """Largest |psi|, rad, and the same derivatives, (9,)."""
    start: Array
    """The first state."""
    units: Array
    """Sizes of the numbers of a state: nu for angles, xi nu for rates."""
    felt: Array
    """1 for the numbers of a state that act on the block; a bob without mass (mu = 0) does not."""
    done: Array
    """Whether the solver kept its bound on the steps."""


class Step(NamedTuple):
    """Orbits after one step, and their derivatives with respect to the design (mu, lam, zeta)."""

    turn: np.ndarray
    """phi, the largest of the orbit, and psi (rad), phase of the forcing (rad) and psi' at the upper turn."""
    slope: np.ndarray
    """Its derivatives, (4, 3); the first row is that of the amplitude."""
    swing: np.ndarray
    """Largest |psi|, rad."""
    swing_slope: np.ndarray
    residual: np.ndarray
    """Largest difference from an orbit, over nu for angles and xi nu for rates."""
    multiplier: np.ndarray
    """Largest modulus of the Floquet multipliers over a whole period."""
    reserve: np.ndarray
    """Distance from where the orbit stops attracting, as `tpd.Margins` has it: the least of fold, symmetry
    and torus."""
    solved: np.ndarray
    """Whether the solver kept its bound on the steps and all numbers are finite."""


@lru_cache(maxsize=8)
def half_period(model: Smoothed) -> Callable[[tuple[Parameters, Array, Array, Array]], HalfPeriod]:
    """Function of (parameters of the bare block, design (3,), factors of the condition (8,), turn (4,)) that
    follows half a period; pure JAX."""

    def run(args: tuple[Parameters, Array, Array, Array]) -> HalfPeriod:
        p, design, factors, turn = args
        q = as_arrays(under(p, design, factors))
        start = jnp.stack([turn[TILT], turn[SWING], jnp.zeros_like(turn[TILT]), turn[SWING_RATE]])
        times = 0.5 * q.period * jnp.linspace(0.0, 1.0, _SAMPLES + 1)

        def motion_at(x: Array, phase: Array) -> tuple[Field, Array]:
            """The field, and the time at which the motion begins."""
            q = as_arrays(under(p, x, factors))
            return smoothed_rates(q, *model.widths(q), model.terms), phase / q.xi

        # Eight directions: the state's own four, the design's three, and the phase.
        ways = jnp.eye(8)[:, _DESIGN], jnp.eye(8)[:, _PHASE]
        motion, turned = _along(motion_at, (design, turn[TILT_RATE]), ways)

        def rates(time: Any, z: Any, args: Any) -> Array:
            """Rates of the state and of its derivatives, (9, 4)."""

            def rate(motion: tuple[Field, Array], y: Array) -> Array:
                field, begin = motion
                return field(begin + time, y, args)

            value, slopes = _along(rate, (motion, z[_VALUE]), (turned, z[1:]))
            return jnp.concatenate([value[None], slopes])

        # The derivatives are solved beside the state. `jax.jacfwd` of the solver gives the same numbers, but
        # traces it three times more, and every process has to trace.
        solution = diffrax.diffeqsolve(
            diffrax.ODETerm(rates),
            model.solver,
            times[0],
            times[-1],
            1e-3 * q.period,
            jnp.concatenate([start[None], jnp.eye(8, 4)]),
            saveat=diffrax.SaveAt(ts=times),
            # The steps are those of the state alone.
            stepsize_controller=diffrax.PIDController(
                rtol=model.rtol, atol=0.01 * model.rtol, norm=lambda z: jnp.sqrt(jnp.mean(z[_VALUE] ** 2))
            ),
            adjoint=diffrax.ForwardMode(),
            max_steps=_STEPS,
            throw=False,
        )
        zs: Array = solution.ys  # type: ignore[assignment]
        ways = turned, jnp.moveaxis(zs[:, 1:], 1, 0)
        bob_of = partial(_largest_bob, times)
        swing, by_stroke = _along(bob_of, (motion, zs[:, _VALUE]), ways)
        bob = jnp.where(q.mu > 0.0, 1.0, 0.0)
        return HalfPeriod(
            end=zs[-1],
            swing=jnp.concatenate([swing[None], by_stroke]),
            start=start,
            units=q.nu * jnp.stack([jnp.ones_like(q.xi), jnp.ones_like(q.xi), q.xi, q.xi]),
            felt=jnp.stack([jnp.ones_like(bob), bob, jnp.ones_like(bob), bob]),
            done=solution.result == diffrax.RESULTS.successful,
        )

    return run


def _along(function: Callable[..., Any], at: Any, ways: Any) -> tuple[Any, Any]:
    """A function of several arguments, and its derivatives in several directions."""
    return jax.vmap(lambda *way: jax.jvp(function, at, way), out_axes=(None, 0))(*ways)


@np.errstate(all="ignore")
def newton(turn: np.ndarray, half: HalfPeriod) -> Step:
    """The step of orbits (n, 4) from what half a period did to them."""
    finite = np.all(np.isfinite(half.end), axis=(1, 2)) & np.all(np.isfinite(half.swing), axis=1)
    by = np.where(finite[:, None, None], half.end[:, 1:], 0.0)
    # The numbers of u are no state: the phase stands in the place of phi', which is zero.
    own = [TILT, SWING, _PHASE, SWING_RATE]
    jacobian = np.swapaxes(by[:, own] + np.eye(8, 4)[own], 1, 2)
    # NumPy refuses a whole batch for one matrix that is singular; what is put here is marked below.
    regular = finite & (np.abs(np.linalg.det(jacobian)) > 0.0)
    jacobian = np.where(regular[:, None, None], jacobian, np.eye(4))
    residual = half.end[:, _VALUE] + half.start
    moved = -np.linalg.solve(jacobian, residual[:, :, None]).squeeze(-1)
    slope = -np.linalg.solve(jacobian, np.swapaxes(by[:, _DESIGN], 1, 2))
    swing_u = half.swing[:, 1:][:, own]
    # The derivative of the mirrored half period: its eigenvalues say whether the orbit attracts.
    g = np.linalg.eigvals(-by[:, :4] * (half.felt[:, :, None] * half.felt[:, None]))
    pairs = np.stack([g[:, i] * g[:, j] for i, j in combinations(range(4), 2)], axis=1)
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


def _largest_bob(
    times: Float[Array, "samples"], motion: tuple[Field, Number], ys: Float[Array, "samples 4"]
) -> Number:
    """Largest |psi|, at a turn of the bob, or at an impact where its rate jumps to the other side. `motion`
    is the field, and the time at which the motion begins."""
    field, begin = motion
    times = begin + times
    # The half periods before and after are mirror images.
    step = times[1] - times[0]
    ys = jnp.concatenate([-ys[-2:-1], ys, -ys[1:2]])
    times = jnp.concatenate([times[:1] - step, times, times[-1:] + step])
    i = 1 + jnp.argmax(jnp.abs(stop_gradient(ys)[1:-1, SWING]))
    side = jnp.sign(stop_gradient(ys)[i, SWING])
    j = jnp.where(side * stop_gradient(ys)[i, SWING_RATE] > 0.0, i + 1, i - 1)
    here, there, to = ys[i], ys[j], times[j] - times[i]
    pull, back = field(times[i], here, None)[SWING_RATE], field(times[j], there, None)[SWING_RATE]
    # The top of the parabola lies between the two samples, or an impact stands between: then both parabolas
    # end where they meet, by the secant and one step of Newton.
    top = -here[SWING_RATE] / jnp.where(pull == 0.0, 1.0, pull)
    turns = (side * pull < 0.0) & (jnp.abs(stop_gradient(top)) <= step)
    fall = jnp.where(turns, 1.0, here[SWING_RATE] - there[SWING_RATE])
    meets = (there[SWING] - here[SWING] - there[SWING_RATE] * to) / fall
    apart = here[SWING] + here[SWING_RATE] * meets + 0.5 * pull * meets**2
    apart = apart - there[SWING] - there[SWING_RATE] * (meets - to) - 0.5 * back * (meets - to) ** 2
    meets = meets - apart / jnp.where(turns, 1.0, fall + pull * meets - back * (meets - to))
    when = jnp.where(turns, top, meets)
    between = jnp.abs(stop_gradient(when)) <= step
    when = jnp.where(between, when, 0.0)
    return side * (here[SWING] + here[SWING_RATE] * when + 0.5 * pull * when**2)
