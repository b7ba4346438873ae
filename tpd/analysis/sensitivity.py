"""What a design is sensitive to: elasticities of its amplitude, from the exact gradient."""

from __future__ import annotations

from dataclasses import dataclass

import jax
import numpy as np

from tpd.analysis.steady_state import steady_state
from tpd.closed_form.no_uplift import uplift
from tpd.core.parameters import Parameters, as_arrays
from tpd.core.status import SETTLED, Status, status_name

_OWN = ("nu", "k", "f", "xi")
"""Of the block and its shaking."""
_HUNG = ("mu", "lam", "zeta")
"""Of the pendulum."""


@dataclass(frozen=True, kw_only=True)
class Elasticities:
    """Relative sensitivities of one settled motion from rest, by the symbols of the parameters."""

    of: str
    """"amplitude": d ln(amplitude)/d ln x, the change in per cent for one per cent of x. "margin", where
    the block rests and the amplitude is flat: x d(uplift margin)/dx / 100, the change of the margin for one
    per cent of x."""
    value: float
    """The amplitude in rad, or the margin."""
    at: dict[str, float]
    """The parameters x."""
    slopes: dict[str, float]
    """Empty where they are refused."""
    refused: str = ""
    """Why, in words."""


def elasticities(p: Parameters) -> Elasticities:
    """Those of the motion from rest by the exact solution in mu, lam, zeta, k, f, xi and nu.

    rho stays tied to nu where `p.rho` is None. Without a pendulum (mu = 0) its own are left out.

    Raises:
        RuntimeError: JAX is in 32-bit mode.
    """
    p = as_arrays(p)
    names = _OWN if float(p.mu) == 0.0 else (*_HUNG, *_OWN)
    at = {name: float(getattr(p, name)) for name in names}
    steady = steady_state(p)
    status, amplitude = status_name(steady.status), float(steady.amplitude)
    if status == "rest":
        margin, slope = jax.value_and_grad(lambda q: uplift(q).margin)(p)
        slopes = {name: 0.01 * at[name] * float(getattr(slope, name)) for name in names}
        return Elasticities(of="margin", value=float(margin), at=at, slopes=slopes)
    if status not in SETTLED:
        return Elasticities(
            of="amplitude", value=amplitude, at=at, slopes={}, refused=f"{status}: {Status[steady.status]}"
        )
    slope = jax.grad(lambda q: steady_state(q).amplitude)(p)
    slopes = {name: at[name] * float(getattr(slope, name)) / amplitude for name in names}
    if not np.isfinite(list(slopes.values())).all():
        return Elasticities(
            of="amplitude",
            value=amplitude,
            at=at,
            slopes={},
            refused="the exact solution has no derivative here",
        )
    return Elasticities(of="amplitude", value=amplitude, at=at, slopes=slopes)
