"""Selection of the simplest model that solves a scene within a tolerance.

The models are, from simple to complete: the closed form of a block that never lifts (`uplift`), the exact
solution of the linear equations (25) (`exact`), and the nonlinear equations (4) (`nonlinear`). The first two
neglect terms of second order in the angles. Their error is estimated from their own solution, which cannot
show that the nonlinear model leads to another motion. The nonlinear model is therefore followed from
every initial state that is not near the settled motion.

Of the laws in closed form only the no-uplift condition is used. It is exact for a block at rest, so that its
error can be estimated. A balance of one harmonic and its fold have errors of up to 5 % that depend on the
scene, and do not show which of several motions an initial state reaches.
"""

from __future__ import annotations

from dataclasses import replace
from typing import Any

import equinox as eqx
import jax
import jax.numpy as jnp
import numpy as np

from tpd.answers.steady_state import Steady, steady_state
from tpd.compiled.rows import row_of
from tpd.compiled.simulate import HarmonicForcing, Run, follow
from tpd.core import checks
from tpd.models.base import scale_of, setting
from tpd.models.piecewise import Nonlinear, Piecewise
from tpd.scene.impacts import linear_ratio, velocity_ratio
from tpd.scene.parameters import Parameters, as_arrays
from tpd.scene.pytrees import Number, State
from tpd.scene.status import SETTLED, Status, is_one_of, status_name
from tpd.theory.equations import Linear, Terms
from tpd.theory.no_uplift import uplift

INTEGRATED = 1e-5
"""Relative error of the nonlinear model: its integration error, with a margin."""
SAFETY = 2.0
"""Factor on the estimated error of the linear model, because the estimate neglects how its parts add."""
_BASIN = 0.02
"""Distance of an initial state from an attracting motion, relative to the scale of the state, up to which the
initial state certainly reaches this motion."""
_GAP = 0.25
"""Largest relative difference between the amplitudes of (25) and (4) for the same motion. The amplitudes of
different motions differ more."""


class Auto(eqx.Module):
    """Automatic selection of the simplest model whose estimated error is within a tolerance.

    A block that never lifts is answered by the no-uplift condition, which also gives the lightest pendulum.
    No other law in closed form is used: their errors of up to 5 % have no certain bound.

    Use it as the model of `steady_state`. The fields `model`, `estimate` and `reason` of the result give the
    selected model, the estimated relative error of its amplitude, and the reason.

    Attributes:
        tolerance: largest allowed relative error of the amplitude, from 1e-5 to 1.

    Raises:
        ValueError: a tolerance that is not between 1e-5 and 1.

    Example:
        >>> import tpd
        >>> p = tpd.Parameters(nu=0.2, mu=0.05, lam=0.8, zeta=0.1, k=0.05, f=0.1, xi=3.0)
        >>> tpd.steady_state(p, model=tpd.Auto(tolerance=0.05)).model
        'uplift'
    """

    tolerance: checks.Real = setting("tolerance", checks.within, 0.05, INTEGRATED, 1.0)
    """Largest allowed relative error of the amplitude."""

    def steady(self, p: Parameters, y0: State) -> Steady:
        """Compute the settled motion from `y0` with the simplest model that is accurate enough.

        Raises:
            ValueError: traced or batched parameters, because the selection needs known numbers.
        """
        if not all(checks.is_concrete(x) and np.ndim(x) == 0 for x in jax.tree.leaves(p)):
            raise ValueError("`Auto` chooses by numbers: `p` must be plain numbers, but is traced or batched")
        fixed, limit = as_arrays(p), f"the tolerance {self.tolerance:g}"
        # The first model: the block never lifts. The reserve must exceed the share of the terms that the
        # closed form neglects.
        steady, reserve, share = _at_rest(fixed, y0)
        if float(share) <= min(self.tolerance, float(reserve)):
            spare = f"{100.0 * float(reserve):.1f} % of the moment that would lift the block"
            why = f"the block never lifts: {spare} remains in reserve at all times"
            return replace(steady, model="uplift", estimate=share, reason=why)
        # The second model: the exact solution of the linear model.
        steady, estimate = _exact(fixed, y0)
        name, error = status_name(steady.status), float(estimate)
        settles = bool(is_one_of(steady.status, *SETTLED))
        close = settles and error <= self.tolerance
        # The nonlinear model takes most of the time. It is not used if the initial state is already
        # next to the settled motion.
        near = close and bool(jnp.max(jnp.abs(y0 - steady.state) / scale_of(fixed)) < _BASIN)
        reached = None if near else follow(Terms.nonlinear, row_of(fixed), HarmonicForcing(), y0=y0)
        if close and (reached is None or _is_same_motion(steady, reached)):
            why = f"the estimated error of the linear model is within {limit}"
            return replace(steady, model="exact", estimate=estimate, reason=why)
        # The third model. The reason says why the linear model is not used.
        if not settles:
            why = f"with the linear model the outcome is {name}, so its error cannot be estimated"
        elif close and reached is not None:
            other = status_name(reached.status)
            why = f"the outcome is {name} with the linear and {other} with the nonlinear model"
        elif error < np.inf:
            why = f"the estimated error of the linear model is {error:.2g}, above {limit}"
        else:
            why = "the error of the linear model cannot be estimated here"
        complete = steady_state(fixed, model=Nonlinear(), y0=y0)
        integration_error = jnp.where(is_one_of(complete.status, *SETTLED), INTEGRATED, jnp.nan)
        return replace(complete, model="nonlinear", estimate=integration_error, reason=why)


@eqx.filter_jit
@jax.numpy_dtype_promotion("standard")
def _at_rest(p: Parameters, y0: State) -> tuple[Steady, Number, Number]:
    """Return the motion of the bob under a block that never lifts, and the reserve against uplift.

    The second result is the share of the lifting moment that remains in reserve at all times; it is -infinity
    if the block is not at rest at the beginning. The third result is the share of the moment that the closed
    form neglects.
    """
    linear, lift = Linear(p), uplift(p)
    # Under a block at rest the bob is a damped oscillator, lam rho psi'' + c_p psi' + psi = f sin(xi tau).
    # Its steady swing is psi = s sin(xi tau) + c cos(xi tau). The difference from it, `own_swing`, decays.
    response = linear.f / (1.0 - linear.m22 * p.xi**2 + 1j * linear.c2 * p.xi)
    s, c = jnp.real(response), jnp.imag(response)
    own_swing = jnp.hypot(y0[1] - c, jnp.sqrt(linear.m22) * (y0[3] - p.xi * s))
    # The block stays at rest if steady swing and own swing, both at their largest, cannot lift it.
    pull = (linear.tilt - 1.0 + jnp.abs(linear.bias) / jnp.sqrt(linear.m22)) * own_swing
    reserve = lift.margin - pull / (linear.weight + linear.friction)
    is_valid = (y0[0] == 0.0) & (y0[2] == 0.0)
    none, unknown, count = jnp.zeros(()), jnp.full((), jnp.nan), jnp.ones((), int)
    # The own swing of an undamped bob does not decay.
    decays = p.zeta > 0.0
    state = jnp.where(decays, jnp.stack([none, c, none, p.xi * s]), y0)
    swing = jnp.where(decays, lift.swing, lift.swing + own_swing)
    rest = none, swing, Status.rest, count, unknown, jnp.ones((), bool), unknown, state, 0 * count
    reach = (lift.swing + own_swing) * (p.mu > 0)
    return Steady(*rest), jnp.where(is_valid, reserve, -jnp.inf), _neglected_at_rest(p, reach)


@eqx.filter_jit
@jax.numpy_dtype_promotion("standard")
def _exact(p: Parameters, y0: State) -> tuple[Steady, Number]:
    """Return the exact solution of the linear model, and its estimated error."""

    def size(p: Parameters) -> tuple[Number, Steady]:
        steady = steady_state(p, model=Piecewise(lyapunov_periods=0), y0=y0)
        return steady.amplitude, steady

    # Housner's e is replaced by its number, so that there is a derivative with respect to e.
    p = replace(p, e=jnp.asarray(p.velocity_ratio))
    slope, steady = jax.jacrev(size, has_aux=True)(p)
    return steady, estimated_error(p, steady.amplitude, steady.swing, slope)


def _is_same_motion(steady: Steady, reached: Run) -> bool:
    """Whether the nonlinear model reaches the same motion as the linear one."""
    if bool(steady.status == Status.rest) or not is_one_of(reached.status, *SETTLED):
        return bool(reached.status == steady.status)
    alike = abs(float(reached.settled_tilt) - float(steady.amplitude)) <= _GAP * float(steady.amplitude)
    # A motion that was only followed until it repeated may have a multiple of its period.
    return alike and int(reached.periods) % int(steady.periods) == 0


def _neglected_at_rest(p: Parameters, reach: Number) -> Number:
    """Return the share of the moment on a block at rest that the terms neglected from (4) contribute.

    The bob swings up to `reach` (rad). The terms are nu/kappa psi, from S = kappa cos psi -+ nu sin psi, and
    terms of second order.
    """
    return p.nu / p.kappa * reach + reach**2


def estimated_error(p: Parameters, phi: Number, psi: Number, slope: Any) -> Number:
    """Estimate the relative change of the amplitude `phi` by the terms of (4) that (25) neglects.

    For a block at rest the result is the share of the moment that these terms contribute, or infinity if this
    share exceeds the uplift margin.

    The moment of the weight changes by the shares f phi (the parametric term) and phi^2/2, the forcing by
    (phi^2 + psi^2)/2, the restoring moment of the bob by psi^2/6, the coupling by nu (phi + psi)/kappa and
    (phi + psi)^2/2, and e by the impulse of a bob at +-psi.

    Args:
        p: dimensionless parameters with a number for `p.e`.
        phi: settled amplitude, rad.
        psi: settled swing, rad.
        slope: derivatives of the amplitude with respect to the parameters, as `jax.grad` returns them.
    """
    # The block does not feel a bob without mass.
    felt = psi * (p.mu > 0)
    angle = phi + felt
    coupling = p.nu / p.kappa * angle + 0.5 * angle**2
    law = p.velocity_ratio, p.nu, p.mu, p.lam, p.inertia_ratio, p.kappa
    ratios = [velocity_ratio(*law, side, jnp.sin(felt), jnp.cos(felt)) for side in (1.0, -1.0)]
    impacts = jnp.maximum(*[jnp.abs(e - linear_ratio(*law)) for e in ratios])
    # The signs of the parts are unknown, so their sizes are added.
    parts = (
        (slope.nu, p.nu * (p.f * phi + 0.5 * phi**2)),
        (slope.f, p.f * 0.5 * (phi**2 + felt**2)),
        (slope.lam, p.lam * (felt**2 / 6.0 + coupling)),
        (slope.mu, p.mu * coupling),
        (slope.e, impacts),
    )
    moving = SAFETY * sum(jnp.abs(by * change) for by, change in parts) / jnp.where(phi > 0, phi, 1.0)
    resting = _neglected_at_rest(p, felt)
    return jnp.where(phi > 0, moving, jnp.where(resting < uplift(p).margin, resting, jnp.inf))
