"""Selection of a model: the least one that answers a scene within a tolerance.

First the closed form of a block that never lifts (`uplift`), then the exact solution of the linear equations
(25) (`exact`), at last the nonlinear equations (4) (`nonlinear`). The first two neglect terms of second order
in the angles. Their error is estimated from their own answer, which cannot show that the nonlinear equations
lead to another motion: so these are followed from every start that is not near the settled motion.
"""

from __future__ import annotations

from dataclasses import replace
from typing import Any

import equinox as eqx
import jax
import jax.numpy as jnp
import numpy as np

from tpd.answers.steady_state import Steady, steady_state
from tpd.core import checks
from tpd.exact.rows import row_of
from tpd.exact.runs import HarmonicForcing, Settled, follow
from tpd.models.base import AbstractChoice, setting
from tpd.models.compiled import Nonlinear, Piecewise
from tpd.models.settling import scale_of
from tpd.scene.impacts import linear_ratio, velocity_ratio
from tpd.scene.parameters import Parameters, as_arrays
from tpd.scene.pytrees import Number, State
from tpd.scene.status import SETTLED, Status, is_one_of, status_name
from tpd.theory.equations import Linear, Terms
from tpd.theory.no_uplift import uplift

INTEGRATED = 1e-5
"""Relative error of the nonlinear model: that of its integration, with some to spare."""
SAFETY = 2.0
"""Factor on the estimated error of the linear equations: its parts may add up less well than assumed."""
_NEAR = 0.02
"""Largest distance of a start from a motion that attracts it, in shares of the scales of the state."""
_ALIKE = 0.25
"""Largest relative difference of amplitudes of one motion by (25) and by (4): other motions are far apart."""


class Auto(AbstractChoice):
    """`steady_state(p, model=Auto(tolerance=...))` takes the least model whose estimated relative error of
    the amplitude is within the tolerance; `model`, `estimate` and `reason` of the result say which one
    answered.

    Raises:
        ValueError: a tolerance that is not between 1e-5 and 1.
    """

    tolerance: checks.Real = setting("tolerance", checks.within, 0.05, INTEGRATED, 1.0)

    def steady(self, p: Parameters, y0: State) -> Steady:
        """The settled motion from `y0` by the least model that is accurate enough.

        Raises:
            ValueError: traced or batched parameters, whose values are not known when a model is chosen.
        """
        if not all(checks.is_concrete(x) and np.ndim(x) == 0 for x in jax.tree.leaves(p)):
            raise ValueError(
                "`Auto` chooses by numbers: `p` must hold plain numbers, but is traced or batched"
            )
        fixed, limit = as_arrays(p), f"the tolerance {self.tolerance:g}"
        steady, reserve, share = _still(fixed, y0)
        if float(share) <= min(self.tolerance, float(reserve)):
            left = f"{float(reserve):.1%} of the moment that would lift the block is in reserve"
            why = f"the block never lifts: {left}, from the start on"
            return replace(steady, model="uplift", estimate=share, reason=why)
        steady, estimate = _exact(fixed, y0)
        name, off = status_name(steady.status), float(estimate)
        settles = bool(is_one_of(steady.status, *SETTLED))
        close = settles and off <= self.tolerance
        # Following the nonlinear equations costs most of the time, so that it is left out next to the motion.
        near = close and bool(jnp.max(jnp.abs(y0 - steady.state) / scale_of(fixed)) < _NEAR)
        run = (Terms.nonlinear, row_of(fixed), HarmonicForcing())
        reached = None if near else follow(*run, y0=y0)
        if close and (reached is None or _same_motion(steady, reached)):
            why = f"what the linear equations drop is estimated to be within {limit}"
            return replace(steady, model="exact", estimate=estimate, reason=why)
        if not settles:
            why = f"the linear equations end {name}, which says nothing about their error"
        elif close and reached is not None:
            other = status_name(reached.status)
            why = f"the linear equations end {name}, and the nonlinear ones another way: {other}"
        elif off < np.inf:
            why = f"the linear equations may be off by {off:.2g}, beyond {limit}"
        else:
            why = "the error of the linear equations cannot be estimated here"
        top = steady_state(fixed, model=Nonlinear(), y0=y0)
        sure = jnp.where(is_one_of(top.status, *SETTLED), INTEGRATED, jnp.nan)
        return replace(top, model="nonlinear", estimate=sure, reason=why)


@eqx.filter_jit
def _still(p: Parameters, y0: State) -> tuple[Steady, Number, Number]:
    """The bob under a block that never lifts; the share of the lifting moment that is in reserve from the
    start on, -infinity where this is no answer; and the share of it that is dropped."""
    linear, lift = Linear(p), uplift(p)
    # Under a block that does not move the bob is a damped oscillator, lam rho psi'' + c_p psi' + psi =
    # f sin(xi tau). Its steady swing is psi = s sin(xi tau) + c cos(xi tau), and the rest of it decays.
    response = linear.f / (1.0 - linear.m22 * p.xi**2 + 1j * linear.c2 * p.xi)
    s, c = jnp.real(response), jnp.imag(response)
    own = jnp.hypot(y0[1] - c, jnp.sqrt(linear.m22) * (y0[3] - p.xi * s))
    # The block stays down if both swings, at their largest, leave something of what holds it.
    pull = (linear.tilt - 1.0 + jnp.abs(linear.bias) / jnp.sqrt(linear.m22)) * own
    reserve = lift.margin - pull / (linear.weight + linear.friction)
    answers = (y0[0] == 0.0) & (y0[2] == 0.0)
    none, unknown, count = jnp.zeros(()), jnp.full((), jnp.nan), jnp.ones((), int)
    # An undamped bob keeps its own swing for ever.
    decays = p.zeta > 0.0
    state = jnp.where(decays, jnp.stack([none, c, none, p.xi * s]), y0)
    swing = jnp.where(decays, lift.swing, lift.swing + own)
    rest = none, swing, Status.rest, count, unknown, jnp.ones((), bool), unknown, state, 0 * count
    reach = (lift.swing + own) * (p.mu > 0)
    return Steady(*rest), jnp.where(answers, reserve, -jnp.inf), _dropped_at_rest(p, reach)


@eqx.filter_jit
def _exact(p: Parameters, y0: State) -> tuple[Steady, Number]:
    """The exact solution of the linear equations, and the estimated relative error of its amplitude."""

    def size(p: Parameters) -> tuple[Number, Steady]:
        steady = steady_state(p, model=Piecewise(lyapunov_periods=0), y0=y0)
        return steady.amplitude, steady

    # e as a number of its own, so that there is a derivative with respect to it.
    p = replace(p, e=jnp.asarray(p.velocity_ratio))
    slope, steady = jax.jacrev(size, has_aux=True)(p)
    return steady, dropped(p, steady.amplitude, steady.swing, slope)


def _same_motion(steady: Steady, reached: Settled) -> bool:
    """Whether the nonlinear equations reach the motion that the linear ones settle into."""
    if bool(steady.status == Status.rest) or not is_one_of(reached.status, *SETTLED):
        return bool(reached.status == steady.status)
    alike = abs(float(reached.amplitude) - float(steady.amplitude)) <= _ALIKE * float(steady.amplitude)
    # A motion that was followed until it repeated may be told with a multiple of its periods.
    return alike and int(reached.periods) % int(steady.periods) == 0


def _dropped_at_rest(p: Parameters, reach: Number) -> Number:
    """Share by which terms dropped from (4) change the moment on a resting block under a bob that swings to
    `reach`: nu/2 psi from S = 2 cos psi -+ nu sin psi, and what is of second order."""
    return 0.5 * p.nu * reach + reach**2


def dropped(p: Parameters, phi: Number, psi: Number, slope: Any) -> Number:
    """Estimated relative change of the amplitude `phi` by the terms of (4) that (25) drops; for a block at
    rest the share of the moment, infinite where it exceeds the uplift margin.

    The weight's moment changes by the shares f phi (the parametric term) and phi^2/2, the forcing by (phi^2 +
    psi^2)/2, the bob's spring by psi^2/6, the coupling by nu (phi + psi)/2 and (phi + psi)^2/2, and e by what
    the pull of a bob at +-psi, the settled stroke, changes. Their effect follows from `slope`, d phi/d p as
    `jax.grad` gives it where `p.e` is a number.
    """
    # A bob without mass swings, but the block does not feel it.
    felt = psi * (p.mu > 0)
    lean = phi + felt
    coupling = 0.5 * p.nu * lean + 0.5 * lean**2
    of = p.velocity_ratio, p.nu, p.mu, p.lam, p.inertia_ratio
    pulled = [velocity_ratio(*of, side, jnp.sin(felt), jnp.cos(felt)) for side in (1.0, -1.0)]
    impacts = jnp.maximum(*[jnp.abs(e - linear_ratio(*of)) for e in pulled])
    # The parts have no known signs, so that their sizes are added.
    parts = (
        (slope.nu, p.nu * (p.f * phi + 0.5 * phi**2)),
        (slope.f, p.f * 0.5 * (phi**2 + felt**2)),
        (slope.lam, p.lam * (felt**2 / 6.0 + coupling)),
        (slope.mu, p.mu * coupling),
        (slope.e, impacts),
    )
    moving = SAFETY * sum(jnp.abs(by * change) for by, change in parts) / jnp.where(phi > 0, phi, 1.0)
    resting = _dropped_at_rest(p, felt)
    return jnp.where(phi > 0, moving, jnp.where(resting < uplift(p).margin, resting, jnp.inf))
