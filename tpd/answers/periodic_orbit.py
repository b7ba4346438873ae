"""Periodic orbits of the linear model near a state: of period n, asymmetric, sticking, resting, with impacts.

Newton's method on the map of the periods of the orbit finds both attracting and repelling orbits
(`tpd.compiled.period_map`). An orbit can therefore be continued where no simulation would stay near it. Its
derivatives follow from the implicit function theorem.
"""

from __future__ import annotations

import equinox as eqx
import jax
import jax.numpy as jnp
import numpy as np
from jax.lax import stop_gradient
from jaxtyping import Array, Bool, Complex, Float, Int

from tpd.compiled.calling import RUNS, parts, shape
from tpd.compiled.columns import NO_ORBIT, NOT_SETTLED, STEADY, WIDTH
from tpd.compiled.derivatives import unknown_in, with_slopes
from tpd.compiled.rows import packed, row_of
from tpd.compiled.simulate import EVENTS, REST_RATES, accuracy
from tpd.core import checks
from tpd.scene.parameters import Parameters, as_arrays, check_parameters
from tpd.scene.pytrees import single
from tpd.scene.status import Status, status_of
from tpd.theory.equations import Terms

REST_RATE = REST_RATES[Terms.linear]
"""Default of the rate (phi' in units of nu) below which an impact can end in rest."""
_MOST_PERIODS = 1000
_SIZES = 6
"""How many numbers of an orbit have derivatives: amplitude, swing and state, which come first."""


class PeriodicOrbit(eqx.Module):
    """Periodic orbit. Angles are in rad.

    `amplitude`, `swing` and `state` are differentiable in every parameter, also for unstable and neutral
    orbits. For other statuses their derivatives are NaN, as are the derivatives of `multipliers` and `fold`.
    All numbers are NaN if the status is no_orbit, event_bound or failed. If it is overturned, amplitude and
    swing are infinite and the others NaN.

    Attributes:
        status: outcome.
        amplitude: largest |phi|, rad.
        swing: largest |psi|, rad.
        state: (phi, psi, phi', psi') at tau = 0 modulo the period of the orbit.
        periods: number of forcing periods in one period of the orbit.
        symmetric: whether the orbit is its own mirror image half a period later.
        multipliers: Floquet multipliers over one period of the orbit.
        fold: det(I - M), where M is the derivative of the map of one period.
    """

    status: Status
    """Outcome: rocking or sticking (the orbit attracts), rest, held, unstable, neutral, near_fold, grazing or
    no_orbit. If the motion ends during its first period: overturned, event_bound, or failed (a number is not
    finite)."""
    amplitude: Float[Array, "*batch"]
    """Largest |phi|, rad."""
    swing: Float[Array, "*batch"]
    """Largest |psi|, rad."""
    state: Float[Array, "*batch 4"]
    """(phi, psi, phi', psi') at tau = 0 modulo the period of the orbit."""
    periods: Int[Array, "*batch"]
    """Smallest number of forcing periods after which the orbit closes."""
    symmetric: Bool[Array, "*batch"]
    """Whether the orbit is its own mirror image half a period later."""
    multipliers: Complex[Array, "*batch 4"]
    """Floquet multipliers over one period of the orbit. The orbit attracts if all moduli are below 1."""
    fold: Float[Array, "*batch"]
    """det(I - M), where M is the derivative of the map of one period of the orbit. It vanishes where two
    orbits merge, or where a symmetric orbit loses its symmetry."""


def periodic_orbit(
    p: Parameters,
    y0: checks.Vector,
    *,
    periods: checks.Whole = 1,
    max_events: checks.Whole = EVENTS,
    rest_rate: checks.Real = REST_RATE,
) -> PeriodicOrbit:
    """Solve for the periodic orbit near a state. The orbit need not attract.

    Newton's method starts from `y0`, and each of its steps follows `periods` forcing periods. The state and
    the periods of a `steady_state` are good initial guesses, and so are those of an orbit at parameters
    nearby: in small steps an orbit is followed through folds and grazings, also where it is unstable. The
    function works under `jit`, `vmap`, `grad` and `jacfwd`.

    Args:
        p: dimensionless parameters. Derivatives with respect to them are exact.
        y0: state (phi, psi, phi', psi') near the orbit at tau = 0, in rad and rad per unit tau.
        periods: number of forcing periods in one period of the orbit.
        max_events: largest number of events in one forcing period.
        rest_rate: rate (phi' in units of nu) below which an impact counts as rest if the block can remain at
            rest after it. This ends a rattling motion. The error is of the order of `rest_rate` squared.

    Raises:
        ValueError: `y0` does not have four components, or a limit is not positive.
        RuntimeError: JAX is in 32-bit mode.

    Example:
        >>> import tpd
        >>> p = tpd.Parameters(nu=0.2, mu=0.05, lam=0.8, zeta=0.1, k=0.05, f=0.3, xi=3.0)
        >>> orbit = tpd.periodic_orbit(p, tpd.steady_state(p).state)
        >>> tpd.status_name(orbit.status), round(float(orbit.amplitude), 4)
        ('rocking', 0.0552)
        >>> round(float(abs(orbit.multipliers).max()), 3)
        0.823
    """
    check_parameters(p)
    periods = checks.count("periods", periods, most=_MOST_PERIODS)
    max_events = checks.count("max_events", max_events, most=100_000)
    rest_rate = checks.tolerance("rest_rate", rest_rate)
    y0 = checks.state(y0)
    x = row_of(as_arrays(single(p)))
    inputs = [v if checks.is_concrete(v) else stop_gradient(v) for v in (x, y0, periods)]
    # Known numbers need no JAX program. Inside `jax.grad` outside of a program they are known, too.
    is_plain, slopes = all(map(checks.is_concrete, inputs)), 0.0 if checks.is_concrete(x) else float(WIDTH)
    limits = {"events": max_events, "rest_rate": rest_rate, "slopes": slopes, **accuracy(Terms.linear)}
    settings = RUNS.settings("ORBIT", periods=periods, **limits)
    call, row = (RUNS.on_host, settings) if is_plain else (RUNS, packed(map(stop_gradient, settings)))
    (record,) = call((shape(STEADY),), row, *inputs[:2])
    fields = parts(record, STEADY)
    # Complex numbers are divided into their two parts.
    numbers, both, fold = jnp.asarray(record[:_SIZES]), jnp.asarray(fields.multipliers), fields.fold
    # If the parameters are a NumPy array, JAX does not differentiate with respect to them.
    if not isinstance(x, np.ndarray):
        numbers, unknown = with_slopes(x, numbers, fields.by), unknown_in(x)
        both, fold = both + unknown, fold + unknown
    amplitude, swing, *state = numbers
    # A motion that does not repeat is no periodic orbit, and has not been followed until it settles.
    code = jnp.asarray(fields.status, dtype=jnp.int32)
    return PeriodicOrbit(
        status=status_of(jnp.where(code == NOT_SETTLED, NO_ORBIT, code)),
        amplitude=amplitude,
        swing=swing,
        state=jnp.stack(state),
        periods=jnp.asarray(fields.periods, dtype=int),
        symmetric=jnp.asarray(fields.symmetric != 0.0),
        multipliers=jax.lax.complex(both[..., 0], both[..., 1]),
        fold=jnp.asarray(fold),
    )
