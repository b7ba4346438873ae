"""The equations with smoothed signs under a ground motion, integrated by a solver of diffrax step by step.

The share of a piece that has passed is the solver's time: no step crosses the end of a piece, where the
forcing has a kink or a jump, and the times of steps do not move with the parameters. Largest angles are those
of the solver's dense output within every step.
"""

from __future__ import annotations

from collections.abc import Callable
from typing import Any, NamedTuple

import diffrax
import equinox as eqx
import jax
import jax.numpy as jnp
from jax.custom_derivatives import SymbolicZero
from jax.lax import stop_gradient
from jaxtyping import Array, Bool, Float, Int

from tpd.core import checks
from tpd.core.equations import Equations, Linear, Terms
from tpd.core.parameters import Number, Parameters, State
from tpd.exact.derivatives import once, refused_in
from tpd.exact.modes import Plant
from tpd.models.compiled_linear import packed
from tpd.models.compiled_shaken import Followed
from tpd.models.smoothed import Smoothed

_ANGLES = ((1.0, 0.0), (0.0, 1.0), (-1.0, 1.0))
"""phi, psi and psi - phi as combinations of phi and psi."""
_SHORTEST = 1e-13
"""Step (tau) below which the solver is taken to have failed."""
_LONGEST = 0.125
"""Longest step over the period of the bob or 2 pi: no angle turns twice within it."""
_STOOD, _ROCKED, _OVERTURNED, _EVENT_BOUND, _FAILED = range(5)
"""Numbers of `tpd.models.shaken_kernel.STATUSES`, which loads Numba."""


class _Seen(NamedTuple):
    """Largest angles and counts of a motion so far."""

    angles: Float[Array, "3"]
    """Largest |phi|, |psi| and |psi - phi|."""
    times: Float[Array, "3"]
    impacts: Float[Array, ""]
    side: Float[Array, ""]
    """Side to which the block has tilted last by more than the resolution; 0 before that."""
    lifted: Float[Array, ""]


class _Walk(NamedTuple):
    """A motion on its way."""

    piece: Int[Array, ""]
    share: Float[Array, ""]
    wanted: Float[Array, ""]
    """Length (tau) of the next step."""
    y: State
    memory: Any
    """State of the solver."""
    seen: _Seen
    steps: Int[Array, ""]
    lost: Bool[Array, ""]
    failed: Bool[Array, ""]


class _Ground(NamedTuple):
    """A ground motion as the solver takes it."""

    p: Parameters
    pieces: Float[Array, "pieces 4"]
    lengths: Float[Array, "2"]
    """Durations (tau) of a piece and of the free motion."""
    y: State


def ground_width(model: Smoothed, p: Parameters) -> Number:
    """Smoothing width of the tilt (rad) and of its rate (rad per unit tau) under a ground motion: `sharpness`
    times the tilt at which the block's weight balances."""
    linear = Linear(p)
    return model.sharpness * linear.weight / linear.tilt


def follow_smoothed(
    model: Smoothed, p: Parameters, pieces: Any, free: Any, y0: Any, max_steps: int
) -> Followed:
    """Follow a motion from `y0` through `pieces`, shape (n, 4), and freely for `free` (tau), by at most n + 1
    + `max_steps` steps. The growing coordinate is NaN and the transversality 1.

    `p` are parameters of `Scene.ground_parameters`, with e = 1: otherwise the status is failed. Angles and
    state have derivatives in p, free and y0 in forward and in reverse mode; those in the pieces are NaN, and
    so are those of times, and second ones.

    Raises:
        ValueError: impact loss, or a solver that is implicit or does not estimate its error.
    """
    told = " in the smoothed model under a pulse or a record, which has no impact loss"
    checks.within("e", p.velocity_ratio, 1.0, 1.0, told)
    if not isinstance(model.solver, diffrax.AbstractERK):
        raise ValueError(
            "under a pulse or a record `model.solver` must be an explicit Runge-Kutta method that estimates "
            f"its error, such as `diffrax.Tsit5()`, but is `{type(model.solver).__name__}`"
        )
    x = packed(p).at[6].set(2.0 * jnp.pi / jnp.asarray(p.xi, dtype=jnp.float64))
    z = jnp.concatenate([x, jnp.asarray(free, dtype=jnp.float64)[None]])
    operands = z, jnp.asarray(y0), jnp.asarray(pieces)
    ((tilt, swing, relative), state), (times, counts) = _solved(model, max_steps, *operands)
    growing, status, impacts, lifted, fell, sure = counts
    times, lifted, fell = (refused_in(operands, t) for t in (times, lifted, fell))
    return Followed(tilt, swing, relative, times, state, growing, status, impacts, lifted, fell, sure)


@eqx.filter_jit
def _solved(model: Smoothed, max_steps: int, z: Array, y: Array, pieces: Array) -> tuple[Any, Any]:
    """The three angles and the state at the end; and times and counts. `z` are parameters and free time."""

    def run(z: Array, y: Array, pieces: Array) -> Any:
        return _results(model, _ground(z, y, pieces), max_steps)

    solved = jax.custom_jvp(run)

    def slopes(primals: tuple, tangents: tuple) -> tuple:
        # Along all directions at once: what is linear in the tangents has a reverse mode as well.
        moving = tuple(i for i in (0, 1) if not isinstance(tangents[i], SymbolicZero))
        if moving:

            def both(*inputs: Any) -> Any:
                value = run(*inputs)
                return value[0], value

            # A turn moves as well, which the first derivative does not feel, and a second one would.
            by, value = once(jax.jacfwd(both, argnums=moving, has_aux=True))(*primals)
            parts = [[b @ tangents[i] for b, i in zip(row, moving, strict=True)] for row in by]
            moved = tuple(sum(part[1:], start=part[0]) for part in parts)
        else:
            value = run(*primals)
            moved = tuple(jnp.zeros_like(v) for v in value[0])
        if not isinstance(tangents[2], SymbolicZero):
            # As in the exact model, derivatives in the samples are not computed.
            moved = tuple(m + jnp.nan * jnp.sum(tangents[2]) for m in moved)
        return value, (moved, jax.tree.map(jnp.zeros_like, value[1]))

    solved.defjvp(slopes, symbolic_zeros=True)
    return solved(z, y, pieces)


def _ground(z: Array, y: Array, pieces: Array) -> _Ground:
    nu, mu, lam, zeta, k, f, h, rho, e, free = z
    p = Parameters(nu=nu, mu=mu, lam=lam, zeta=zeta, k=k, f=f, xi=2.0 * jnp.pi / h, rho=rho, e=e)
    # A row of zeros is the free motion. The forcing is minus the base acceleration.
    return _Ground(p, jnp.concatenate([-pieces, jnp.zeros((1, 4))]), jnp.stack([h, free]), y)


def _results(model: Smoothed, ground: _Ground, max_steps: int) -> Any:
    p = ground.p
    width = model.HUM * ground_width(model, p)
    r = _walked(model, ground, width, max_steps)
    arrived = r.piece >= len(ground.pieces)
    falls = arrived & _falls(model, p, r.y)
    finite = jnp.all(jnp.isfinite(r.y))
    lost, rocked = r.lost | falls, jnp.isfinite(r.seen.lifted)
    status = jnp.where(arrived, jnp.where(rocked, _ROCKED, _STOOD), _EVENT_BOUND)
    status = jnp.where(lost, _OVERTURNED, status)
    # A velocity ratio that was traced has not been checked, and the loss is not in these equations.
    status = jnp.where(r.failed | ~finite | (p.velocity_ratio != 1.0), _FAILED, status)
    # A block that has stayed within the resolution hums there, and its slope means nothing.
    tilt = jnp.where(rocked | (status != _STOOD), r.seen.angles[0], 0.0)
    angles = jnp.where(status == _OVERTURNED, jnp.inf, r.seen.angles.at[0].set(tilt))
    angles = jnp.where(status == _FAILED, jnp.nan, angles)
    fell = jnp.where(status == _OVERTURNED, _now(ground, r), jnp.inf)
    sure = jnp.ones_like(fell)
    counts = jnp.nan * sure, status * sure, r.seen.impacts, r.seen.lifted, fell, sure
    return (angles, r.y), jax.tree.map(stop_gradient, (r.seen.times, counts))


def _now(ground: _Ground, r: _Walk) -> Number:
    """Time (tau) of a motion on its way."""
    h, free = ground.lengths
    n = len(ground.pieces) - 1
    done = jnp.minimum(r.piece, n) * h
    return done + jnp.where(r.piece < n, h * r.share, jnp.where(r.piece == n, free * r.share, free))


def _falls(model: Smoothed, p: Parameters, y: State) -> Bool[Array, ""]:
    """Whether a free motion of linear equations that goes on from `y` without another event grows beyond
    return."""
    if model.terms is Terms.nonlinear:
        return jnp.zeros((), bool)
    p, y = stop_gradient(p), stop_gradient(y)
    plant, side = Plant(p), jnp.sign(y[0])
    linear, left = plant.linear, plant.falling.left
    balance = (linear.weight + linear.friction) / linear.tilt
    return side * (left @ y) > left[0] * balance


def _walked(model: Smoothed, ground: _Ground, resolution: Number, max_steps: int) -> _Walk:
    """The motion at its end."""
    p, n = ground.p, len(ground.pieces)
    limit = Equations(p, model.terms).beyond_return
    solver, term = _forward(model.solver), diffrax.ODETerm(_field(model, p))
    longest = 2.0 * jnp.pi * _LONGEST * jnp.minimum(1.0, jnp.sqrt(p.lam * p.inertia_ratio))

    def args(piece: Array) -> tuple[Array, Array]:
        return ground.pieces[piece], jnp.where(piece < n - 1, ground.lengths[0], ground.lengths[1])

    def going(r: _Walk) -> Bool[Array, ""]:
        return (r.piece < n) & ~r.lost & ~r.failed & (r.steps < n + max_steps)

    def step(r: _Walk) -> _Walk:
        forcing, length = args(r.piece)
        d = stop_gradient(length)
        wanted = jnp.minimum(r.wanted, stop_gradient(longest))
        share = jnp.where(d > 0.0, wanted / jnp.where(d > 0.0, d, 1.0), 1.0)
        # A step that would leave a remainder of rounding goes to the end.
        last = share * 1.000001 >= 1.0 - r.share
        end = jnp.where(last, 1.0, r.share + share)
        begins = r.share == 0.0
        y, error, dense, memory, result = solver.step(
            term, r.share, end, r.y, (forcing, length), r.memory, begins
        )
        worst = _worst(model, r.y, y, error)
        worst = jnp.where(result == diffrax.RESULTS.successful, worst, jnp.inf)
        taken = jnp.where(last, (1.0 - r.share) * d, wanted)
        onward = _next_length(taken, wanted, last, worst, solver.order(term))
        kept = worst <= 1.0
        # Within a step, times are those of its piece.
        curve = solver.interpolation_cls(t0=r.share, t1=end, **dense)
        begun = jnp.minimum(r.piece, n - 1) * stop_gradient(ground.lengths[0])
        seen = _looked(r.seen, curve, (r.share, r.y), (end, y), begun, d, stop_gradient(resolution))
        new = _Walk(
            piece=r.piece + jnp.where(last, 1, 0),
            share=jnp.where(last, 0.0, end),
            wanted=onward,
            y=y,
            memory=memory,
            seen=seen,
            steps=r.steps + 1,
            lost=~(jnp.abs(stop_gradient(y[0])) < stop_gradient(limit)),
            failed=r.failed,
        )
        old = r._replace(wanted=onward, steps=r.steps + 1, failed=onward < _SHORTEST)
        return jax.tree.map(lambda a, b: jnp.where(kept, a, b), new, old)

    memory = solver.init(term, jnp.zeros(()), jnp.ones(()), ground.y, args(jnp.zeros((), int)))
    return jax.lax.while_loop(going, step, _begun(ground, memory, resolution))


def _forward(solver: diffrax.AbstractSolver) -> diffrax.AbstractSolver:
    """A solver whose steps have derivatives in forward mode."""
    if isinstance(solver, diffrax.AbstractERK) and solver.scan_kind is None:
        return eqx.tree_at(lambda s: s.scan_kind, solver, "lax", is_leaf=lambda x: x is None)
    return solver


def _begun(ground: _Ground, memory: Any, resolution: Number) -> _Walk:
    y, zero, no = ground.y, jnp.zeros(()), jnp.zeros((), bool)
    angles = jnp.abs(jnp.array(_ANGLES) @ y[:2])
    tilted = angles[0] > resolution
    lifted = jnp.where(tilted, 0.0, jnp.inf)
    seen = _Seen(angles, jnp.zeros(3), zero, jnp.where(tilted, jnp.sign(y[0]), 0.0), lifted)
    count, first = jnp.zeros((), int), 0.1 * stop_gradient(ground.lengths[0])
    return _Walk(count, zero, first, y, memory, jax.tree.map(stop_gradient, seen), count, no, no)


def _field(model: Smoothed, p: Parameters) -> Callable[[Any, State, Any], State]:
    """Derivative of the state in the share of a piece that has passed."""
    equations = Linear(p) if model.terms is Terms.linear else Equations(p, model.terms)
    width = ground_width(model, p)

    def field(share: Any, y: State, args: Any) -> State:
        (c0, c1, c2, c3), length = args
        forcing = c0 + share * (c1 + share * (c2 + share * c3))
        step, drag = jnp.tanh(y[0] / width), jnp.tanh(y[2] / width)
        return length * equations.rates(y, step, drag, forcing)

    return field


def _worst(model: Smoothed, before: State, after: State, error: Any) -> Number:
    """Estimated error of a step over what is allowed; infinite where it has no finite numbers."""
    size = jnp.maximum(jnp.abs(before), jnp.abs(after))
    worst = jnp.max(jnp.abs(error) / (0.01 * model.rtol + model.rtol * size))
    return stop_gradient(jnp.where(jnp.all(jnp.isfinite(after)) & jnp.isfinite(worst), worst, jnp.inf))


def _next_length(taken: Number, wanted: Number, last: Any, worst: Number, order: Any) -> Any:
    """Length of the next step after one of length `taken` whose error is `worst`."""
    grown = taken * jnp.clip(0.9 * jnp.maximum(worst, 1e-10) ** (-1.0 / order), 0.2, 5.0)
    # A step cut short by the end of a piece says that a longer one may be taken, not that it must be short.
    return jnp.where(last & (worst <= 1.0), jnp.maximum(grown, wanted), grown)


def _looked(
    seen: _Seen, curve: Any, before: tuple, after: tuple, begun: Number, d: Number, resolution: Number
) -> _Seen:
    """Largest angles and counts after a step between two shares of a piece, with their states."""
    (lo, y0), (hi, y1) = before, after
    combination = jnp.array(_ANGLES)
    shares = _turns(jax.tree.map(stop_gradient, curve), lo, hi, combination, stop_gradient((y0, y1)))
    # The derivative of a largest angle is that at a fixed time: its rate is zero there.
    met = jnp.abs(jnp.sum(combination * jax.vmap(curve.evaluate)(shares)[:, :2], axis=1))
    ends = jnp.abs(combination @ y1[:2])
    angles, at = jnp.where(met > ends, met, ends), jnp.where(met > ends, shares, hi)
    larger = stop_gradient(angles) > stop_gradient(seen.angles)
    first, then = jnp.abs(stop_gradient(y0[0])), jnp.abs(stop_gradient(y1[0]))
    # The block leaves the resolution on a straight line within a step: these are times to a part of a step.
    part = jnp.clip((resolution - first) / jnp.where(then > first, then - first, 1.0), 0.0, 1.0)
    way = jnp.where(then > resolution, jnp.sign(stop_gradient(y1[0])), 0.0)
    passed = begun + d * (lo + part * (hi - lo))
    return _Seen(
        jnp.where(larger, angles, seen.angles),
        jnp.where(larger, begun + d * at, seen.times),
        seen.impacts + jnp.where(way * seen.side < 0.0, 1.0, 0.0),
        jnp.where(way != 0.0, way, seen.side),
        jnp.where(way != 0.0, jnp.minimum(seen.lifted, passed), seen.lifted),
    )


def _turns(curve: Any, lo: Number, hi: Number, combination: Array, ends: tuple) -> Float[Array, "3"]:
    """Shares at which the three angles turn within a step; its end for those that do not."""
    first, last = combination @ ends[0][2:], combination @ ends[1][2:]
    turns = first * last < 0.0
    a, b, fa, fb = jnp.full(3, lo), jnp.full(3, hi), first, jnp.where(turns, last, -first)
    x, stayed = b, jnp.zeros(3)
    for _ in range(6):
        # Illinois: the false position, where an end that stays twice counts half.
        gap = fb - fa
        x = jnp.where(gap != 0.0, b - fb * (b - a) / jnp.where(gap != 0.0, gap, 1.0), b)
        value = jnp.sum(combination * jax.vmap(curve.evaluate)(x)[:, 2:], axis=1)
        left = value * fa > 0.0
        fa, fb = (
            jnp.where(~left & (stayed < 0.0), 0.5 * fa, fa),
            jnp.where(left & (stayed > 0.0), 0.5 * fb, fb),
        )
        a, fa = jnp.where(left, x, a), jnp.where(left, value, fa)
        b, fb = jnp.where(left, b, x), jnp.where(left, fb, value)
        stayed = jnp.where(left, 1.0, -1.0)
    return jnp.where(turns, jnp.clip(x, lo, hi), hi)
