"""Symmetric period-one orbits of a design, stable and unstable, without initial guesses.

Most rocking motions that attract are such orbits: one swing to either side in each forcing period, the second
swing being the mirror image of the first. The orbits are the roots of one scalar equation
(`tpd.compiled.half_period_kernel`), so no motion is simulated. Their derivatives follow from the
implicit function theorem.
"""

from __future__ import annotations

from collections.abc import Callable
from functools import partial
from typing import Any

import equinox as eqx
import jax
import jax.numpy as jnp
import numpy as np
from jaxtyping import Array, Bool, Complex, Float

from tpd.compiled.calling import ORBITS as ENGINE
from tpd.compiled.calling import parts
from tpd.compiled.columns import ASKED, SIZES, WIDTH
from tpd.compiled.derivatives import moved, once
from tpd.compiled.orbits import slopes, solve_orbits, solved
from tpd.compiled.rows import row_of
from tpd.core.batch import AT_ONCE
from tpd.scene.parameters import Parameters, check_parameters
from tpd.scene.pytrees import Number
from tpd.scene.status import Status, status_of

ORBITS = 3
"""Largest number of orbits of a design."""


class Margins(eqx.Module):
    """Distances of an orbit from the ways in which it can be lost. The leading axis is that of the orbits.

    Each margin is a function that vanishes where the orbit is lost or changes its kind. An attracting orbit
    continues to attract while none of the five margins vanishes. `fold`, `symmetry` and `torus` are
    differentiable wherever the amplitude is. The derivatives of `sticking` and `grazing` are NaN;
    `tpd.answers.bifurcations` computes the derivatives of the parameter values at which they vanish.
    """

    fold: Number
    """det(I - G), where G is the derivative of the mirrored half-period map. At zero two orbits merge and
    vanish."""
    symmetry: Number
    """det(I + G). At zero the orbit loses its symmetry, and two orbits that are mirror images of each other
    branch off."""
    torus: Number
    """Product of 1 - g_i g_j over all pairs of eigenvalues of G. At zero a pair of eigenvalues leaves the
    unit circle, and motions that never repeat branch off (Neimark-Sacker bifurcation)."""
    sticking: Number
    """-phi'' just after the turn, divided by its size just before. At zero the block sticks at the turn."""
    grazing: Number
    """Smallest downward rate between the turns, divided by xi times the amplitude; infinite if the rate has
    no local minimum. At zero the block turns back once more. Without friction a turn is not an event. Then
    the margin is the smallest tilt at a turn between the largest ones, divided by the amplitude, and at zero
    the block has one more impact."""


class Orbits(eqx.Module):
    """Symmetric period-one orbits of one design, the largest first. Angles are in rad.

    The leading axis has the length `ORBITS` (3). Where fewer orbits exist, the status is `no_orbit` and the
    numbers are NaN. `amplitude`, `swing`, `state`, `phase`, `crossing` and `remaining` are differentiable in
    every parameter, also for unstable orbits. Their derivatives are NaN if the status is near_fold, grazing
    or no_orbit. The derivative of `multipliers` is always NaN.

    Attributes:
        status: outcome of each orbit.
        amplitude: largest |phi|, rad.
        swing: largest |psi|, rad.
        state: (phi, psi, phi', psi') at tau = 0 modulo the forcing period.
        phase: phase xi tau of the forcing at the upper turn, rad.
        crossing: dimensionless time from the upper turn to the crossing of phi = 0.
        multipliers: Floquet multipliers over one forcing period.
        remaining: factor per forcing period by which a small disturbance of the block falls.
        margins: distances from the loss of the orbit.
        overflow: whether the design may have more orbits.
    """

    status: Status
    """Outcome: rocking (the orbit attracts), unstable, neutral, near_fold, grazing or no_orbit."""
    amplitude: Float[Array | np.ndarray, "*orbits"]
    """Largest |phi|, rad."""
    swing: Float[Array | np.ndarray, "*orbits"]
    """Largest |psi|, rad."""
    state: Float[Array | np.ndarray, "*orbits 4"]
    """(phi, psi, phi', psi') at tau = 0 modulo the forcing period."""
    phase: Float[Array | np.ndarray, "*orbits"]
    """Phase xi tau of the forcing at the upper turn, rad, in (-pi, pi]."""
    crossing: Float[Array | np.ndarray, "*orbits"]
    """Dimensionless time from the upper turn to the crossing of phi = 0."""
    multipliers: Complex[Array | np.ndarray, "*orbits 4"]
    """Floquet multipliers over one forcing period. The orbit attracts if all moduli are below 1."""
    remaining: Float[Array | np.ndarray, "*orbits"]
    """Factor per forcing period by which a small disturbance of the block falls, see `limits.Settling`."""
    margins: Margins
    """Distances from the loss of the orbit."""
    overflow: Bool[Array | np.ndarray, "..."] | np.bool_
    """Whether the design may have more orbits. This is the case if the equation has more roots than were
    examined, or if the bob swings freely more than 300 times during one of the two arcs of a half period; the
    path of such a bob is not followed."""


def symmetric_orbits(p: Parameters) -> Orbits:
    """Solve for the symmetric period-one orbits of (25), in closed form between the events.

    With friction (k > 0) the orbits are those that cross phi = 0 once in half a period and move from the
    upper to the lower turn without turning back. Without friction (k = 0) the block may turn back any number
    of times. The function does not find orbits that stick, that cross more often, that turn more often under
    friction, or that have a longer period. `steady_state` follows such motions from an initial state. Hence
    `no_orbit` does not prove that there is no periodic motion, not even that there is no symmetric one.

    The function works under `jit`, `vmap`, `grad` and `jacfwd` as one call of compiled code. Known numbers
    are evaluated on the host without a JAX program. For a large batch the fastest way is
    `tpd.in_chunks(tpd.symmetric_orbits, p)`, which calls compiled code on all cores, without derivatives.

    Args:
        p: dimensionless parameters, single numbers.

    Raises:
        ValueError: bad input.
        RuntimeError: JAX is in 32-bit mode.

    Example:
        >>> import tpd
        >>> p = tpd.Parameters(nu=0.2, mu=0.0, lam=0.5, zeta=0.1, k=0.05, f=0.1, xi=2.0)
        >>> orbits = tpd.symmetric_orbits(p)
        >>> [round(float(amplitude), 4) for amplitude in orbits.amplitude]
        [0.0637, 0.0301, nan]
        >>> [round(float(abs(multipliers).max()), 2) for multipliers in orbits.multipliers[:2]]
        [0.62, 5.82]
    """
    check_parameters(p)
    x = row_of(p)
    if x.size > WIDTH:
        # A batch is an error here, because its orbits need the loop over several cores below.
        call = "`jax.vmap(tpd.symmetric_orbits)(p)` or `tpd.in_chunks(tpd.symmetric_orbits, p)`"
        raise ValueError(f"`p` must be single numbers, but is a batch: call {call}")
    x = x.reshape(WIDTH)
    # Known numbers have no derivatives. JAX would take longer to prepare derivatives than the solution takes.
    return _orbits(_fields(solved(x)) if isinstance(x, np.ndarray) else _numbers_and_fields(x)[1])


def all_symmetric_orbits(
    p: Parameters, *, workers: int | None = None, progress: Callable[[int, int], None] | None = None
) -> Orbits:
    """Solve for the `symmetric_orbits` of every element of a batch, on all cores and without derivatives.

    Args:
        p: known parameters. At least one field has the shape (n,); single numbers apply to all elements.
        workers: number of threads; all cores by default.
        progress: function that is called with (number of solved designs, number of all designs).

    Returns:
        Orbits as NumPy arrays with leading axes (n, 3).

    Raises:
        RuntimeError: JAX is in 32-bit mode.
        ValueError: bad input, or `workers` is below one.
    """
    check_parameters(p)
    orbits = solve_orbits(row_of(p), workers=workers, progress=progress)
    # The compiled code returns a structured array. As plain numbers it has one more axis.
    return _orbits(_fields(orbits.view(float).reshape(*orbits.shape, -1)))


AT_ONCE[symmetric_orbits] = all_symmetric_orbits
_UNKNOWN = ("multipliers", "sticking", "grazing")
"""Names of the fields whose derivatives are not computed."""


def _fields(numbers: Any) -> dict[str, Any]:
    """Return the fields of `Orbits` and `Margins` by name, from the numbers of orbits (..., 3, numbers)."""
    orbits = parts(numbers, ENGINE.entry().ORBIT)
    # With strict types JAX adds no real number to a complex one.
    pairs = orbits.multipliers.astype(complex)
    return {name: orbits.sizes[..., place] for name, place in SIZES.items()} | {
        "multipliers": pairs[..., 0] + 1j * pairs[..., 1],
        "sticking": orbits.sticking,
        "grazing": orbits.grazing,
        "status": orbits.status.astype(np.int32),
        "overflow": orbits.overflow[..., 0] > 0.0,
    }


@jax.custom_jvp
def _numbers_and_fields(x: Float[Array | np.ndarray, "10"]) -> tuple[Any, dict[str, Any]]:
    """Return the orbits of a design as numbers, and their fields. Only the fields have derivatives."""
    numbers = solved(x)
    return numbers, _fields(numbers)


@_numbers_and_fields.defjvp
def _numbers_and_fields_jvp(primals: tuple, tangents: tuple) -> tuple[Any, Any]:
    (x,), (direction,) = primals, tangents
    numbers, fields = _numbers_and_fields(x)
    moves = {}
    # The slopes are divided into groups, because XLA omits the groups that a program does not use.
    for group, names in ASKED.items():
        # The tangent of each size is the product of its slopes with the direction.
        change = moved(_SLOPES[group](x, numbers).swapaxes(-1, -2), direction, x)
        moves |= {name: change[:, SIZES[name]] for name in names}
    # Fields without known derivatives get NaN, unless the direction is zero.
    unknown = moved(np.full(len(x), np.nan), direction, x)
    for name in _UNKNOWN:
        moves[name] = jnp.broadcast_to(unknown, fields[name].shape)
    # A complex number has two unknown parts.
    moves["multipliers"] = jax.lax.complex(moves["multipliers"], moves["multipliers"])
    for name in ("status", "overflow"):
        # JAX requires tangents of this type for integers and booleans.
        moves[name] = np.zeros(fields[name].shape, jax.dtypes.float0)
    # The numbers themselves are not differentiated, see `_numbers_and_fields`.
    return (numbers, fields), (jnp.zeros_like(numbers), {name: moves[name] for name in fields})


# The derivatives of the slopes are NaN, because second derivatives are not computed.
_SLOPES = {group: once(partial(slopes, group=group)) for group in ASKED}


def _orbits(fields: dict[str, Any]) -> Orbits:
    margins = {name: fields.pop(name) for name in ("fold", "symmetry", "torus", "sticking", "grazing")}
    fields["status"] = status_of(fields["status"])
    return Orbits(margins=Margins(**margins), **fields)
