"""Selection of a model: the cheapest one whose estimated error is within a tolerance.

| model | content | neglects |
|---|---|---|
| uplift | closed form: the block never lifts | second order in the angles of the resting bob |
| one harmonic | closed form: the upper branch of (27) | other harmonics and attractors, second order |
| exact | exact solution of the linear equations (25) | terms of second order in the angles |
| nonlinear | the equations (4), integrated from event to event | nothing of (4) |

The smoothed models are not among them: they cost more than the exact solution and are less accurate.

The error of the linear equations is estimated from their own answer: each dropped term changes weight,
forcing, spring or coupling by a share known from the angles, and the gradient turns this share into a change
of the amplitude. So the estimate grows where the answer is sensitive, near a fold above all.

The estimate holds for the motion that the linear equations reach. The nonlinear equations decide which motion
a start reaches: they are followed from every start that is not near the settled motion, and answer where they
reach another one. A comparison with neighbouring parameters would cost more and miss some of these.
"""

from __future__ import annotations

from dataclasses import replace
from typing import Any, NamedTuple

import equinox as eqx
import jax
import jax.numpy as jnp
import numpy as np
from jaxtyping import Array

from tpd.answers.steady_state import Steady, answered, steady_state
from tpd.core import checks
from tpd.models.base import AbstractChoice, Settled
from tpd.models.compiled_nonlinear import settle_one
from tpd.models.piecewise import Piecewise
from tpd.models.segmented import Segmented
from tpd.models.settling import scale_of
from tpd.scene.impacts import linear_ratio, velocity_ratio
from tpd.scene.parameters import Number, Parameters, State, as_arrays
from tpd.scene.status import SETTLED, Status, is_settled, status_name
from tpd.theory.equations import Linear
from tpd.theory.harmonic_balance import neglected_harmonics, one_harmonic_branches
from tpd.theory.no_uplift import uplift

INTEGRATED = 1e-5
"""Relative error of the nonlinear model: that of its integration, with some to spare."""
SAFETY = 2.0
"""Factor on the estimated error of the linear equations: its parts may add up less well than assumed."""
_NEAR = 0.02
"""Largest distance of a start from the settled motion, in shares of the scales of the state, at which the
linear equations decide alone which motion it reaches."""
_ALIKE = 0.25
"""Largest relative difference between the amplitudes by (25) and by (4) that count as one motion."""
_LIFTS = -0.1
"""Uplift margin below which a block certainly leaves rest, so that the balance may answer for a start at
rest."""


class Auto(AbstractChoice):
    """`steady_state(p, model=Auto(tolerance=...))` takes the cheapest model whose estimated relative error of
    the amplitude is within the tolerance; `model`, `estimate` and `reason` of the result say which model
    answered, with what error, and why.

    The one-harmonic balance does not depend on the start: from rest, a third of random blocks settle into
    another motion than its own (most of them overturn). So it is used with `balance=True` only, for blocks
    that start at rest, cannot stay there and have no impact loss (e = 1): it gives the amplitude of rocking
    where rocking is known to be reached.

    Raises:
        ValueError: a tolerance that is not between 1e-5 and 1.
    """

    tolerance: float = eqx.field(default=0.05, static=True, kw_only=True)
    balance: bool = eqx.field(default=False, static=True, kw_only=True)

    def __check_init__(self) -> None:
        checks.within("tolerance", self.tolerance, INTEGRATED, 1.0)

    def steady(self, p: Parameters, y0: State) -> Steady:
        """The settled motion from `y0` by the cheapest model that is accurate enough.

        Raises:
            ValueError: traced or batched parameters, whose values are not known when a model is chosen.
        """
        if not all(checks.is_concrete(x) and np.ndim(x) == 0 for x in jax.tree.leaves(p)):
            raise ValueError(
                "`Auto` chooses by numbers: `p` must hold plain numbers, but is traced or batched"
            )
        # Each model is asked only if the cheaper ones before it do not answer.
        fixed, limit = as_arrays(p), f"the tolerance {self.tolerance:g}"
        still = _still(fixed, y0)
        if bool(still.rests) and float(still.estimate) <= min(self.tolerance, float(still.reserve)):
            reserve = f"{float(still.reserve):.1%} of the moment that would lift the block is in reserve"
            why = f"the block never lifts: {reserve}, from the start on"
            return _labelled(still.steady, "uplift", still.estimate, why)
        lossless, moved = float(fixed.velocity_ratio) == 1.0, bool(jnp.any(y0 != 0.0))
        if self.balance and lossless and not moved and float(still.margin) < _LIFTS:
            steady, estimate = _balanced(fixed)
            if float(estimate) <= self.tolerance:
                why = "what the balance neglects is estimated to be within " + limit
                return _labelled(steady, "one harmonic", estimate, why)
        steady, estimate = _exact(fixed, y0)
        name = status_name(steady.status)
        close = name in SETTLED and float(estimate) <= self.tolerance
        # Following the nonlinear equations costs most of the time, so that it is left out next to the orbit.
        reached = None if close and bool(_near(fixed, y0, steady)) else settle_one(fixed, y0)
        if close and (reached is None or _same_motion(steady, reached)):
            why = f"what the linear equations drop is estimated to be within {limit}"
            return _labelled(steady, "exact", estimate, why)
        assert reached is not None
        top = _nonlinear(fixed, reached)
        sure = jnp.where(is_settled(top.status), INTEGRATED, jnp.nan)
        return _labelled(top, "nonlinear", sure, _refusal(name, float(estimate), limit, close))


def _refusal(name: str, estimate: float, limit: str, close: bool) -> str:
    """Sentence that says why the linear equations do not answer, from their status and estimated error."""
    if name not in SETTLED:
        return f"the linear equations end {name}, which says nothing about their error"
    if close:
        return f"from this start the linear equations end {name}, and the nonlinear ones reach another motion"
    if not estimate < np.inf:
        return "the error of the linear equations cannot be estimated here"
    return f"the linear equations may be off by {estimate:.2g}, beyond {limit}"


def _labelled(steady: Steady, model: str, estimate: Number, reason: str) -> Steady:
    """The answer with the model that gave it, its estimated error and the reason for the choice."""
    return replace(steady, model=model, estimate=estimate, reason=reason)


class _Still(NamedTuple):
    """A block at its start."""

    rests: Array
    """Whether it can never lift."""
    reserve: Number
    """Least share of the lifting moment that is left over, from the start on."""
    margin: Number
    """Share that is left over once the bob has settled: the uplift margin."""
    estimate: Number
    """Share by which the dropped terms change the moment on it."""
    steady: Steady


@eqx.filter_jit
def _still(p: Parameters, y0: State) -> _Still:
    """The block at its start, in closed form: no motion is followed."""
    linear, lift = Linear(p), uplift(p)
    # Under a block that does not move the bob is a damped oscillator, lam rho psi'' + c_p psi' + psi =
    # f sin(xi tau). Its steady swing is psi = s sin(xi tau) + c cos(xi tau), and the rest of it decays.
    response = linear.f / (1.0 - linear.m22 * p.xi**2 + 1j * linear.c2 * p.xi)
    s, c = jnp.real(response), jnp.imag(response)
    own = jnp.hypot(y0[1] - c, jnp.sqrt(linear.m22) * (y0[3] - p.xi * s))
    # The block stays down if both swings, at their largest, leave something of what holds it.
    pull = (linear.tilt - 1.0 + jnp.abs(linear.bias) / jnp.sqrt(linear.m22)) * own
    reserve, reach = lift.margin - pull / (linear.weight + linear.friction), lift.stroke + own
    rests = (y0[0] == 0.0) & (y0[2] == 0.0) & (reserve >= 0.0)
    # An undamped bob keeps its own swing for ever.
    decays = p.zeta > 0.0
    state = jnp.where(decays, jnp.stack([0.0 * c, c, 0.0 * c, p.xi * s]), y0)
    steady = _closed(Status.rest, jnp.zeros(()), jnp.where(decays, lift.stroke, reach), state)
    return _Still(rests, reserve, lift.margin, _dropped_at_rest(p, reach * (p.mu > 0)), steady)


@eqx.filter_jit
def _balanced(p: Parameters) -> tuple[Steady, Number]:
    """The upper branch of the one-harmonic balance, and the estimated relative error of its amplitude."""

    def size(p: Parameters) -> tuple[Array, tuple]:
        both = one_harmonic_branches(p)
        return both.amplitude[0], (both.stroke[0], both.phase[0], both.exists[0])

    slope, (stroke, phase, exists) = jax.jacfwd(size, has_aux=True)(p)
    amplitude = size(p)[0]
    # The balance gives no phase of the bob, hence no state of it.
    none = jnp.full_like(amplitude, jnp.nan)
    state = jnp.stack([amplitude * jnp.cos(phase), none, p.xi * amplitude * jnp.sin(phase), none])
    steady = _closed(Status.rocking, amplitude, stroke, state)
    estimate = neglected_harmonics(p).bound[0] + dropped(p, amplitude, stroke, slope)
    return steady, jnp.where(exists, estimate, jnp.inf)


def _closed(status: Status, amplitude: Array, stroke: Array, state: State) -> Steady:
    """A closed form as a steady motion; its multiplier and Lyapunov exponent are not known."""
    unknown, yes = jnp.full_like(amplitude, jnp.nan), jnp.ones((), bool)
    one, none = jnp.ones((), int), jnp.zeros((), int)
    return Steady(amplitude, stroke, status, one, unknown, yes, unknown, state, none)


@eqx.filter_jit
def _exact(p: Parameters, y0: State) -> tuple[Steady, Number]:
    """The exact solution of the linear equations, and the estimated relative error of its amplitude."""

    def size(p: Parameters) -> tuple[Number, Steady]:
        steady = steady_state(p, model=Piecewise(lyapunov_periods=0), y0=y0)
        return steady.amplitude, steady

    # e as a number of its own, so that there is a derivative with respect to it.
    p = replace(p, e=jnp.asarray(p.velocity_ratio))
    slope, steady = jax.jacrev(size, has_aux=True)(p)
    return steady, dropped(p, steady.amplitude, steady.stroke, slope)


@eqx.filter_jit
def _near(p: Parameters, y0: State, steady: Steady) -> Array:
    """Whether the start is near the state of the settled motion at tau = 0. Then this motion attracts it, by
    the linear and by the nonlinear equations."""
    return jnp.max(jnp.abs(y0 - steady.state) / scale_of(p)) < _NEAR


@eqx.filter_jit
def _nonlinear(p: Parameters, settled: Settled) -> Steady:
    """The steady state of the nonlinear equations that a start has reached."""
    return answered(p, Segmented(), settled)


def _same_motion(steady: Steady, reached: Settled) -> bool:
    """Whether the nonlinear equations reach the motion that the linear ones settle into. Rocking motions that
    exist side by side have amplitudes far apart, so that a coarse comparison is enough."""
    rests, other = (bool(s == Status.rest) for s in (steady.status, reached.status))
    if rests or other:
        return rests and other
    alike = abs(float(reached.amplitude) - float(steady.amplitude)) <= _ALIKE * float(steady.amplitude)
    return bool(is_settled(reached.status)) and int(reached.periods) == int(steady.periods) and alike


def _dropped_at_rest(p: Parameters, reach: Number) -> Number:
    """Share by which terms dropped from (4) change the moment on a resting block under a bob that
    swings to `reach`: nu/2 psi from S = 2 cos psi -+ nu sin psi, and what is of second order."""
    return 0.5 * p.nu * reach + reach**2


def _dropped_at_impacts(p: Parameters, reach: Number) -> Number:
    """Largest change of the velocity ratio of an impact by a bob at +-`reach`."""
    e, sine, cosine = p.velocity_ratio, jnp.sin(reach), jnp.cos(reach)
    of = e, p.nu, p.mu, p.lam, p.inertia_ratio
    return jnp.maximum(
        *[jnp.abs(velocity_ratio(*of, side, sine, cosine) - linear_ratio(*of)) for side in (1.0, -1.0)]
    )


def dropped(p: Parameters, phi: Number, psi: Number, slope: Any) -> Number:
    """Estimated relative change of the amplitude `phi` by the terms of (4) that (25) drops.

    The weight's moment changes by the shares f phi (the parametric term) and phi^2/2, the forcing by
    (phi^2 + psi^2)/2, the bob's spring by psi^2/6, the coupling by nu (phi + psi)/2 and (phi + psi)^2/2, and
    e by what the pull of a bob at +-psi changes; their effect on phi follows from the elasticities
    d ln phi/d ln(nu, f, lam, mu) and from d phi/d e.
    For a block at rest the estimate is the share of the moment, infinite where it exceeds the uplift margin.

    Args:
        p: dimensionless parameters.
        phi: settled amplitude, rad.
        psi: settled stroke, rad.
        slope: d phi/d p, as `jax.grad` gives it where `p.e` is a number.
    """
    # A bob without mass swings, but the block does not feel it.
    felt = psi * (p.mu > 0)

    def elasticity(by: Any, x: Number) -> Number:
        return jnp.abs(by * x / jnp.where(phi > 0, phi, 1.0))

    lean = phi + felt
    coupling = 0.5 * p.nu * lean + 0.5 * lean**2
    weight = elasticity(slope.nu, p.nu) * (p.f * phi + 0.5 * phi**2)
    forcing = elasticity(slope.f, p.f) * 0.5 * (phi**2 + felt**2)
    spring = elasticity(slope.lam, p.lam) * (felt**2 / 6.0 + coupling)
    bob = elasticity(slope.mu, p.mu) * coupling
    impacts = elasticity(slope.e, _dropped_at_impacts(p, felt))
    resting = _dropped_at_rest(p, felt)
    at_rest = jnp.where(resting < uplift(p).margin, resting, jnp.inf)
    # The parts have no known signs, so that their sizes are added.
    return jnp.where(phi > 0, SAFETY * (weight + forcing + spring + bob + impacts), at_rest)
