"""The ladder of models: the cheapest that is good enough for a scene answers, and says why.

| rung | what it is | what it neglects |
|---|---|---|
| uplift | a closed form: the block never lifts | angles squared, by the resting bob |
| exact | the exact solution of the linear equations | terms of second order in the angles |
| nonlinear | the nonlinear equations, integrated from event to event | nothing of (4) |

The error of the exact rung against the nonlinear one is estimated from its own answer: each dropped
term changes weight, forcing, spring or coupling by a share known from the angles, and the gradient
says what such a change does to the amplitude. So the estimate grows where the answer is sensitive,
near a fold above all.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from functools import lru_cache
from typing import Any

import equinox as eqx
import jax
import jax.numpy as jnp
import numpy as np

from tpd import checks
from tpd.balance import uplift
from tpd.models.interface import AbstractModel
from tpd.models.piecewise import Piecewise
from tpd.models.segmented import Segmented
from tpd.parameters import Parameters, as_arrays
from tpd.status import SETTLED, status_name
from tpd.steady import Steady, at_rest, steady_state

_SURE = 1e-5
"""Relative error of the nonlinear rung: that of its integration."""


@dataclass(frozen=True, kw_only=True)
class Auto:
    """Settings of the choice: `steady_state(p, model=Auto(tolerance=...))` climbs until a rung's
    estimated relative error of the amplitude is within the tolerance.

    Raises:
        ValueError: a tolerance that is not between 0 and 1.
    """

    tolerance: float = 0.05

    def __post_init__(self) -> None:
        checks.positive("tolerance", self.tolerance)
        checks.within("tolerance", self.tolerance, 0.0, 1.0)


@dataclass(frozen=True, kw_only=True)
class Answer:
    """What the ladder says; angles in rad."""

    amplitude: float
    """Largest |phi| of the settled motion."""
    stroke: float
    """Largest |psi|."""
    status: str
    """Name of the `Status`."""
    rung: str
    """uplift, exact or nonlinear."""
    estimate: float
    """Estimated relative error of the amplitude; of a block at rest, of the moment that lifts it."""
    reason: str
    """Why this rung, in a sentence."""
    steady: Steady | None
    """The solution behind it, with its gradient's function; None of the closed form."""


def answer(p: Parameters, *, auto: Auto | None = None, y0: Any = None) -> Answer:
    """The settled motion from `y0` (default at rest) by the cheapest rung within the tolerance.

    Args:
        p: dimensionless parameters, plain numbers.
        auto: the tolerance; default 5 %.
        y0: start (phi, psi, phi', psi') at tau = 0, rad and rad per unit tau.

    Raises:
        ValueError: bad input, or traced or batched parameters.
        RuntimeError: JAX is in 32-bit mode.
    """
    checks.require_x64()
    if not all(checks.is_concrete(x) and np.ndim(x) == 0 for x in jax.tree.leaves(p)):
        raise ValueError("`Auto` chooses by numbers: `p` must hold plain numbers, but is traced or batched")
    auto = Auto() if auto is None else auto
    fixed, start = as_arrays(p), jnp.asarray(at_rest() if y0 is None else y0, dtype=jnp.float64)
    closed = _closed_form(fixed, start, auto.tolerance)
    if closed is not None:
        return closed
    steady, error = _exact(fixed, start)
    name, estimate = status_name(steady.status), float(error)
    if name in SETTLED and estimate <= auto.tolerance:
        why = f"its estimated error {estimate:.2g} is within the tolerance {auto.tolerance:g}"
        return _answer(steady, "exact", estimate, f"the linear equations do: {why}")
    top = _solver(Segmented())(fixed, start)
    if name in SETTLED:
        why = f"the linear equations may be off by {estimate:.2g}, beyond the tolerance {auto.tolerance:g}"
    else:
        why = f"the linear equations end {name}, which says nothing about their error"
    return _answer(top, "nonlinear", _SURE, why)


def _answer(steady: Steady, rung: str, estimate: float, reason: str) -> Answer:
    return Answer(
        amplitude=float(steady.amplitude),
        stroke=float(steady.stroke),
        status=status_name(steady.status),
        rung=rung,
        estimate=estimate,
        reason=reason,
        steady=steady,
    )


def _closed_form(p: Parameters, y0: jax.Array, tolerance: float) -> Answer | None:
    """The answer where the block can never lift, with a reserve for what is neglected."""
    rests, reach = (float(x) for x in _still(p, y0))
    margin, neglected = float(uplift(p).margin), dropped_at_rest(float(p.nu), reach)
    if not rests or neglected > min(tolerance, margin):
        return None
    reason = (
        f"the block cannot lift: {margin:.1%} of the moment that would is in reserve, and what is neglected "
        f"changes it by {neglected:.2g}"
    )
    stroke = float(uplift(p).stroke)
    return Answer(
        amplitude=0.0,
        stroke=stroke,
        status="rest",
        rung="uplift",
        estimate=neglected,
        reason=reason,
        steady=None,
    )


@eqx.filter_jit
def _still(p: Parameters, y0: jax.Array) -> tuple[jax.Array, jax.Array]:
    """Whether the block is done at its start, and how far the bob reaches."""
    record = Piecewise().lane(p, y0).record
    return record.rests, record.strokes[0]


def dropped_at_rest(nu: float, reach: float) -> float:
    """Share by which terms dropped from (4) change the moment on a resting block under a bob that
    swings to `reach` (rad): its cosines and sines to second order, and S = 2 cos psi -+ nu sin psi."""
    return 0.5 * nu * reach + reach**2


@lru_cache(maxsize=1)
def _compiled() -> Callable[[Parameters, jax.Array], tuple[Steady, jax.Array]]:
    def both(p: Parameters, y0: jax.Array) -> tuple[Steady, jax.Array]:
        def size(p: Parameters) -> tuple[jax.Array, Steady]:
            steady = steady_state(p, y0=y0)
            return steady.amplitude, steady

        slope, steady = jax.jacrev(size, has_aux=True)(p)
        return steady, dropped(p, steady, slope)

    return eqx.filter_jit(both)


def _exact(p: Parameters, y0: jax.Array) -> tuple[Steady, jax.Array]:
    return _compiled()(p, y0)


def dropped(p: Parameters, steady: Steady, slope: Parameters) -> jax.Array:
    """Estimated relative change of the amplitude by the terms of (4) that (25) drops.

    With the settled sizes phi and psi: the weight's moment changes by the shares f phi (the parametric
    term) and phi^2/2, the forcing by (phi^2 + psi^2)/2, the bob's spring by psi^2/6, and the coupling by
    nu (phi + psi)/2 and (phi + psi)^2/2; what such a share does follows from the elasticities
    d ln phi/d ln(nu, f, lam, mu). A bob's spring and the length of its rod act alike.
    """
    phi, psi = steady.amplitude, steady.stroke * (p.mu > 0)

    def elasticity(by: Any, x: Any) -> Any:
        return jnp.abs(by * x / jnp.where(phi > 0, phi, 1.0))

    lean = phi + psi
    coupling = 0.5 * p.nu * lean + 0.5 * lean**2
    weight = elasticity(slope.nu, p.nu) * (p.f * phi + 0.5 * phi**2)
    forcing = elasticity(slope.f, p.f) * 0.5 * (phi**2 + psi**2)
    spring = elasticity(slope.lam, p.lam) * (psi**2 / 6.0 + coupling)
    bob = elasticity(slope.mu, p.mu) * coupling
    resting = 0.5 * p.nu * steady.stroke + steady.stroke**2
    margin = uplift(p).margin
    at_rest = jnp.where(resting < margin, resting, jnp.inf)
    return jnp.where(phi > 0, weight + forcing + spring + bob, at_rest)


@lru_cache(maxsize=8)
def _solver(model: AbstractModel) -> Callable[[Parameters, Any], Steady]:
    return eqx.filter_jit(lambda p, y0: steady_state(p, model=model, y0=y0))
