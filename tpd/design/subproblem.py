"""Subproblem of a step of sequential programming: the capped weighted worst of linear models in a box.

For every design, with steps d from it in a box, it is

    min over d of  max over w of sum w_i (v_i + g_i d) + C sum max(c_j + h_j d, 0) + d B d/2,

where the weights w sum to one and none exceeds the cap. By duality the inner maximum is the minimum over one
more number s of  s + cap sum max(v_i + g_i d - s, 0).  So the subproblem is convex, with as many variables as
the design has and one more, however many conditions there are. Newton's method on a smoothed form solves it,
to a few 1e-4 of the spread of the values at worst (random programmes) and 1e-8 typically.
"""

from __future__ import annotations

from typing import NamedTuple

import jax
import jax.numpy as jnp
import numpy as np
from jaxtyping import Array, Float

from tpd.core.batch import in_chunks

PENALTY = 10.0
"""Weight C of a violated constraint in the merit: exact as long as no multiplier exceeds it."""
_SHARPEST = 1e-9
"""Last width of the smoothing, over the first."""
_LEVELS, _NEWTON = 12, 5
"""Widths of the smoothing on the way there, and most Newton steps at each."""
_HALVINGS = 12
"""Most halvings of a Newton step."""
_BISECTIONS = 40
"""Bisections for s: to about a thousandth of the last width."""
_FEW = 64
"""Constraints that a subproblem has, if no more can matter."""
_BATCH = 4
"""Subproblems solved at once, on each core."""


class Linearisation(NamedTuple):
    """n functions and l constraints (<= 0) at m designs, and their slopes along d scaled coordinates."""

    value: np.ndarray
    """(m, n)"""
    slope: np.ndarray
    """(m, n, d)"""
    limit: np.ndarray
    """(m, l)"""
    limit_slope: np.ndarray
    """(m, l, d)"""

    def at(self, rows: np.ndarray | slice) -> Linearisation:
        """Linearisation at some of the designs."""
        return Linearisation(*(x[rows] for x in self))


def solve_subproblem(
    at: Linearisation, curve: np.ndarray, box: tuple[np.ndarray, np.ndarray], cap: float, merit: np.ndarray
) -> tuple[np.ndarray, np.ndarray, tuple[np.ndarray, np.ndarray]]:
    """Steps (k, d), the gains that the models promise, and the weights of functions and constraints.

    Args:
        at: functions and constraints at k designs.
        curve: B, shape (k, d, d).
        box: least and largest steps, (k, d) each.
        cap: largest weight of one function.
        merit: merits at the designs, (k,), from which the gains are counted.
    """
    rows = within_reach(at, box)
    near = at._replace(
        limit=np.take_along_axis(at.limit, rows, axis=1),
        limit_slope=np.take_along_axis(at.limit_slope, rows[..., None], axis=1),
    )
    move, value, weights, others = in_chunks(_solved, (*near, curve, *box, cap), chunk=_BATCH)
    by = np.zeros_like(at.limit)
    np.put_along_axis(by, rows, others, axis=1)
    return move, merit - value, (weights, by)


def prepare_steps(at: Linearisation) -> None:
    """Compile `solve_subproblem` for problems of this shape; the numbers do not matter."""
    some = at.at(slice(1))._replace(limit=np.full((1, at.limit.shape[1]), -1.0))
    d = some.slope.shape[2]
    box = np.full((1, d), -1e-6), np.full((1, d), 1e-6)
    solve_subproblem(some, np.eye(d)[None], box, 1.0, np.zeros(1))


def within_reach(at: Linearisation, box: tuple[np.ndarray, np.ndarray]) -> np.ndarray:
    """The constraints, (k, few), that a step within the box may break by their linear models, and others to
    fill up; all of them where more may."""
    ends = (at.limit_slope * side[:, None] for side in box)
    most = at.limit + np.sum(np.maximum(*ends), axis=2)
    count = most.shape[1]
    if np.sum(most > 0.0, axis=1).max(initial=0) <= _FEW < count:
        return np.argpartition(-most, _FEW, axis=1)[:, :_FEW]
    return np.tile(np.arange(count), (len(most), 1))


class _Program(NamedTuple):
    """One subproblem in shares u of its box, so that Newton's matrix is well scaled however small the box is.
    The variables are z = (u, s), shape (d + 1,)."""

    value: Float[Array, "n"]
    """Functions at the box's lower corner."""
    slope: Float[Array, "n d"]
    limit: Float[Array, "l"]
    """Constraints at the box's lower corner."""
    limit_slope: Float[Array, "l d"]
    tilt: Float[Array, "d"]
    """Slope of d B d/2 at the lower corner."""
    curve: Float[Array, "d d"]
    cap: Float[Array, ""]

    def excesses(self, z: Array) -> tuple[Array, Array]:
        """Functions above s, (n,), and constraints, (l,)."""
        u, s = z[:-1], z[-1]
        return self.value + self.slope @ u - s, self.limit + self.limit_slope @ u

    def total(self, z: Array, width: Array) -> Array:
        """Smoothed subproblem: max(x, 0) is width softplus(x/width), and a logarithmic wall of the same width
        keeps u inside the box; infinite outside."""
        v, c = self.excesses(z)
        soft = width * (
            self.cap * jnp.sum(jax.nn.softplus(v / width)) + PENALTY * jnp.sum(jax.nn.softplus(c / width))
        )
        u = z[:-1]
        inside = jnp.all((u > 0) & (u < 1))
        wall = -width * jnp.sum(jnp.log(jnp.where(inside, u, 1.0)) + jnp.log(jnp.where(inside, 1.0 - u, 1.0)))
        bent = self.tilt @ u + 0.5 * u @ self.curve @ u
        return jnp.where(inside, z[-1] + soft + wall + bent, jnp.inf)

    def derivatives(self, z: Array, width: Array) -> tuple[Array, Array]:
        """Gradient (d + 1,) and Hessian (d + 1, d + 1) of `total`, written out: each softplus gives a
        sigmoid p in the gradient and p (1 - p)/width times an outer product in the Hessian."""
        k = self.slope.shape[1]
        v, c = self.excesses(z)
        p, q = jax.nn.sigmoid(v / width), jax.nn.sigmoid(c / width)
        rows = jnp.concatenate([self.slope, -jnp.ones((v.shape[0], 1))], axis=1)
        more = jnp.concatenate([self.limit_slope, jnp.zeros((c.shape[0], 1))], axis=1)
        u = z[:k]
        gradient = self.cap * p @ rows + PENALTY * q @ more
        outward = self.tilt + self.curve @ u - width * (1.0 / u - 1.0 / (1.0 - u))
        gradient = gradient.at[k].add(1.0).at[:k].add(outward)
        hessian = (rows * (self.cap * p * (1 - p) / width)[:, None]).T @ rows
        hessian = hessian + (more * (PENALTY * q * (1 - q) / width)[:, None]).T @ more
        hessian = hessian.at[:k, :k].add(self.curve + jnp.diag(width * (1.0 / u**2 + 1.0 / (1.0 - u) ** 2)))
        # A little of the diagonal more: far from all kinks the sigmoids are flat to rounding.
        return gradient, hessian + jnp.diag(1e-12 + 1e-9 * jnp.diag(hessian))

    def best_level(self, z: Array, width: Array) -> Array:
        """z with the s that is best for its u: the weights cap sigmoid sum to one there, by bisection."""
        v = self.excesses(z.at[-1].set(0.0))[0]

        def halve(_: Array, ends: tuple[Array, Array]) -> tuple[Array, Array]:
            middle = 0.5 * (ends[0] + ends[1])
            above = self.cap * jnp.sum(jax.nn.sigmoid((v - middle) / width)) < 1.0
            return jnp.where(above, ends[0], middle), jnp.where(above, middle, ends[1])

        ends = jnp.min(v) - 30.0 * width, jnp.max(v) + width * jnp.log(v.shape[0] + 1.0)
        low, high = jax.lax.fori_loop(0, _BISECTIONS, halve, ends)
        return z.at[-1].set(0.5 * (low + high))


def _solved(args: tuple[Array, ...]) -> tuple[Array, Array, Array, Array]:
    return _one(*args)


def _one(
    value: Float[Array, "n"],
    slope: Float[Array, "n d"],
    limit: Float[Array, "l"],
    limit_slope: Float[Array, "l d"],
    curve: Float[Array, "d d"],
    low: Float[Array, "d"],
    high: Float[Array, "d"],
    cap: Float[Array, ""],
) -> tuple[Array, Array, Array, Array]:
    """Step, value of the models there, and weights of functions and constraints."""
    span = jnp.maximum(high - low, 1e-12)
    bend = curve * span[:, None] * span[None, :]
    program = _Program(
        value=value + slope @ low,
        slope=slope * span[None],
        limit=limit + limit_slope @ low,
        limit_slope=limit_slope * span[None],
        tilt=bend @ (low / span),
        curve=bend,
        cap=cap,
    )
    steepest = jnp.max(jnp.abs(program.slope))
    # Newton's method at the last width alone would start where all sigmoids are 0 or 1, with a Hessian of
    # zero. From width to width, each a seventh or so of the last, the start lies in the region of quadratic
    # convergence: an interior-point method whose path parameter is the width.
    widest = jnp.maximum(jnp.max(value) - jnp.min(value) + steepest, 1e-6)
    widths = jnp.geomspace(1.0, _SHARPEST, _LEVELS) * widest
    middle = jnp.full(low.shape[0] + 1, 0.5).at[-1].set(jnp.max(value))
    z, _ = jax.lax.scan(lambda z, width: (_at_width(program, z, width), None), middle, widths)
    z = program.best_level(z, widths[-1])
    move = low + span * z[:-1]
    v, c = program.excesses(z)
    p, q = jax.nn.sigmoid(v / widths[-1]), jax.nn.sigmoid(c / widths[-1])
    sharp = z[-1] + cap * jnp.sum(jax.nn.relu(v)) + PENALTY * jnp.sum(jax.nn.relu(c))
    return move, sharp + 0.5 * move @ curve @ move, cap * p, PENALTY * q


def _at_width(program: _Program, z: Array, width: Array) -> Array:
    """Minimiser at one width of the smoothing, from that of the width before."""

    def step(carry: tuple) -> tuple:
        z, _, count = carry
        return *_newton(program, z, width), count + 1

    first = program.best_level(z, width), jnp.ones((), bool), jnp.zeros((), int)
    return jax.lax.while_loop(lambda c: c[1] & (c[2] < _NEWTON), step, first)[0]


def _newton(program: _Program, z: Array, width: Array) -> tuple[Array, Array]:
    """One damped Newton step, and whether another one is worth while."""
    gradient, hessian = program.derivatives(z, width)
    move = -jnp.linalg.solve(hessian, gradient)
    # As far as the box allows, then half of it and so on: the first step that lowers the total.
    u, along = z[:-1], move[:-1]
    toward = jnp.where(along > 0, 1.0 - u, -u)
    room = jnp.min(jnp.where(along == 0, jnp.inf, toward / jnp.where(along == 0, 1.0, along)))
    before, slope = program.total(z, width), gradient @ move
    rounding = 1e-14 * jnp.abs(before)

    def too_long(size: Array) -> Array:
        # A total that is no number counts as too large.
        return ~(program.total(z + size * move, width) <= before + 1e-4 * size * slope + rounding)

    longest = jnp.minimum(1.0, 0.95 * room)
    _, size = jax.lax.while_loop(
        lambda c: (c[0] < _HALVINGS) & too_long(c[1]),
        lambda c: (c[0] + 1, 0.5 * c[1]),
        (jnp.zeros((), int), longest),
    )
    # The gain that is left, half of this slope, is small against the smoothing's own error, or rounding.
    onward = -slope > jnp.maximum(1e-6 * width, rounding)
    good = (size > 0.5**_HALVINGS * longest) & jnp.all(jnp.isfinite(move))
    return jnp.where(good, z + size * move, z), good & onward
