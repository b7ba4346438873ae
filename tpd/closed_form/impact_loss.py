"""The friction that loses as much as impacts do."""

from __future__ import annotations

from typing import Any

import jax.numpy as jnp
import numpy as np
from jaxtyping import Array, Float

from tpd.core import checks
from tpd.core.equations import Linear
from tpd.core.parameters import Parameters


def equivalent_friction(p: Parameters, amplitude: Any) -> Float[Array, "*batch"]:
    """The dry friction k that loses as much per cycle of amplitude Phi as the impacts of ratio `p.e`.

    Friction takes 4 k Phi from a cycle: the way is four times Phi. Each of the two impacts takes
    (1 - e^2) phi'^2/2, where phi'^2/2 is what the weight gave on the way down from Phi: w Phi - K Phi^2/2,
    with w = (1 + mu) nu and K = 1 + 2 mu. Both are equal for

        k = (1 - e^2)(2 w - K Phi)/4,   of the bare block (1 - e^2)(2 nu - Phi)/4.

    Assumed is that all losses of a cycle are small against its energy: then the friction `p.k` that is
    there already and the impacts do not feel each other, so that k adds to `p.k`, and the shaking,
    which gives back what is lost, leaves the block as fast at its base as free rocking would. A pendulum
    is assumed to add its weight and to take no energy on the way.

    How good that is, by `python -m tests.benchmarks.restitution`: of 400 random scenes, half of them with a
    pendulum, 193 move for good with their impacts. On the way from rest, with k at the amplitude that it
    leads to, 116 of these end in the same status, with a median error of the amplitude of 0.6 % (90 %: below
    4.9 %); 25 of those that rock overturn instead, and 28 come to rest. Started on the motion itself 175 keep
    their status (0.6 %, 4.8 %), and 16 of the others stick before and rest then. So k serves for the motion
    that is settled into, and not for the way there.

    Args:
        p: dimensionless parameters; fields may be arrays. f, xi, lam, zeta and k are not used.
        amplitude: Phi, rad, a number or an array: from 0 to 2 w/K, twice the tilt at which it topples.

    Returns:
        k, to be added to `p.k` with e = 1; differentiable in both arguments.

    Raises:
        ValueError: an amplitude out of range.
        RuntimeError: JAX is in 32-bit mode.
    """
    checks.require_x64()
    checks.not_negative("amplitude", amplitude)
    linear = Linear(p)
    twice, tilt = 2.0 * linear.weight, linear.tilt
    if all(map(checks.is_concrete, (amplitude, twice, tilt))):
        _check_range(amplitude, np.asarray(twice) / np.asarray(tilt))
    return (1.0 - jnp.asarray(p.e) ** 2) * (twice - tilt * jnp.asarray(amplitude)) / 4.0


def _check_range(amplitude: Any, most: Any) -> None:
    phi, most = np.broadcast_arrays(amplitude, most)
    if np.any(phi > most):
        i = np.unravel_index(np.argmax(phi - most), phi.shape)
        raise ValueError(
            f"`amplitude` must be at most {most[i]:g}, twice the tilt at which the block topples of itself, "
            f"but is {phi[i]:g}"
        )
