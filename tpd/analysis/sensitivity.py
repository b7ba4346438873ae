"""Sensitivity of a design: elasticities of its amplitude, from the exact gradient."""

from __future__ import annotations

from dataclasses import dataclass

import jax
import numpy as np

from tpd.analysis.steady_state import steady_state
from tpd.closed_form.no_uplift import uplift
from tpd.core.parameters import Parameters, as_arrays
from tpd.core.quantities import parameters_of
from tpd.core.scene import Pendulum, Scene
from tpd.core.status import SETTLED, Status, status_name

_OWN = ("nu", "k", "f", "xi")
"""Parameters of the block and its shaking."""
_HUNG = ("mu", "lam", "zeta")
"""Parameters of the pendulum."""


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
    """The sensitivities, by the names in `at`; empty where there is no derivative."""
    refused: str = ""
    """Sentence that says why there is no derivative."""


def elasticities(subject: Parameters | Scene, pendulum: Pendulum | None = None) -> Elasticities:
    """Elasticities of the motion from rest by the exact solution, in mu, lam, zeta, k, f, xi and nu.

    rho stays tied to nu where the subject leaves it so. Without a pendulum (mu = 0) its own are left out.

    Args:
        subject: dimensionless parameters, or a scene; plain numbers.
        pendulum: in the scene; default none.

    Raises:
        ValueError: traced or batched parameters, or a pendulum beside parameters.
        RuntimeError: JAX is in 32-bit mode.
    """
    p = as_arrays(parameters_of(subject, pendulum))
    names = _OWN if float(p.mu) == 0.0 else (*_HUNG, *_OWN)
    at = {name: float(getattr(p, name)) for name in names}
    steady = steady_state(p)
    status, amplitude = status_name(steady.status), float(steady.amplitude)
    if status == "rest":
        # The amplitude is zero on all sides: only the margin shows how close the block is to lifting.
        margin, slope = jax.value_and_grad(lambda q: uplift(q).margin)(p)
        slopes = {name: 0.01 * at[name] * float(getattr(slope, name)) for name in names}
        return Elasticities(of="margin", value=float(margin), at=at, slopes=slopes)
    slopes, refused = {}, ""
    if status not in SETTLED:
        refused = f"{status}: {Status[steady.status]}"
    else:
        slope = jax.grad(lambda q: steady_state(q).amplitude)(p)
        slopes = {name: at[name] * float(getattr(slope, name)) / amplitude for name in names}
        if not np.isfinite(list(slopes.values())).all():
            slopes, refused = {}, "the exact solution has no derivative here"
    return Elasticities(of="amplitude", value=amplitude, at=at, slopes=slopes, refused=refused)
