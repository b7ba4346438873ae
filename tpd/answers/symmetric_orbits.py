"""The symmetric period-one orbits of a design, stable and unstable, without start values.

Most rocking attractors are such orbits: one swing to either side per forcing period, the second the
mirror image of the first. They are the roots of one scalar equation (`tpd.exact.half_period_kernel`), so that
nothing is simulated; their derivatives follow from the implicit function theorem.
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

from tpd.core import checks
from tpd.exact.calling import ORBITS as ENGINE
from tpd.exact.calling import parts
from tpd.exact.derivatives import moved, once
from tpd.exact.orbits import slopes, solve_orbits, solved
from tpd.exact.rows import row_of
from tpd.exact.terms import ASKED, SIZES, STATUSES
from tpd.scene.parameters import Parameters, check_parameters
from tpd.scene.pytrees import Number
from tpd.scene.status import Status, codes_of, status_of

ORBITS = 3
"""Most orbits of a design."""


class Margins(eqx.Module):
    """Distances from the loss of an orbit, as functions that vanish where it happens; leading axis the
    orbits. `fold`, `symmetry` and `torus` are differentiable as the amplitude is; the derivatives of the
    other two are NaN (`tpd.bifurcations` has those of the place where they vanish). An attracting orbit
    keeps attracting for as long as none of the five vanishes."""

    fold: Number
    """det(I - G), G the derivative of the mirrored half-period map: two orbits merge and vanish."""
    symmetry: Number
    """det(I + G): the orbit loses its symmetry, and two mirror images branch off."""
    torus: Number
    """The product of 1 - g_i g_j over all pairs of G's eigenvalues: a pair of them leaves the unit circle
    together, and motions that never repeat branch off (Neimark-Sacker)."""
    sticking: Number
    """-phi'' just after the turn, over its size just before: at zero the block sticks there."""
    grazing: Number
    """The least falling rate between the turns, over xi times the amplitude (infinite if the rate has
    no dent): at zero the block turns back once more. Without friction a turn is no event, and this is the
    least tilt at a turn between the largest ones, over the amplitude: at zero the block strikes its base."""


class Orbits(eqx.Module):
    """The symmetric period-one orbits of one design, the largest first; leading axis `ORBITS` (3),
    status `no_orbit` where no more were found, and NaN beside it. Angles in rad.

    `amplitude`, `swing`, `state`, `phase` and `crossing` are differentiable in every parameter, also on
    unstable orbits; their derivative is NaN where the status is near_fold, grazing or no_orbit. That of
    `multipliers` is NaN everywhere.
    """

    status: Status
    """rocking (attracting), unstable, neutral, near_fold, grazing or no_orbit."""
    amplitude: Float[Array | np.ndarray, "*orbits"]
    """Largest |phi|."""
    swing: Float[Array | np.ndarray, "*orbits"]
    """Largest |psi|."""
    state: Float[Array | np.ndarray, "*orbits 4"]
    """(phi, psi, phi', psi') at tau = 0 modulo the forcing period."""
    phase: Float[Array | np.ndarray, "*orbits"]
    """Phase xi tau of the forcing at the upper turn, in (-pi, pi]."""
    crossing: Float[Array | np.ndarray, "*orbits"]
    """Dimensionless time from the upper turn to the crossing of phi = 0."""
    multipliers: Complex[Array | np.ndarray, "*orbits 4"]
    """Floquet multipliers over one forcing period; attracting if all are below 1 in size."""
    margins: Margins
    overflow: Bool[Array | np.ndarray, "..."] | np.bool_
    """Whether there may be more: more roots than could be followed up, or a bob that swings freely more than
    300 times on one of the two arcs of a half period, whose path is not followed."""


def symmetric_orbits(p: Parameters) -> Orbits:
    """The symmetric period-one orbits of (25) with true signs, section by section in closed form.

    With friction (k > 0) they are all orbits that cross phi = 0 once in half a period and fall from the upper
    turn to the lower one without turning back; without friction (k = 0) the block may turn back as often as
    it likes. Not found are orbits with a stick phase, with more crossings, with more turns under friction, or
    that repeat later. `steady_state` follows those from a start. So `no_orbit` does not prove that there is
    no periodic motion, not even a symmetric one.

    Works under `jit`, `vmap`, `grad` and `jacfwd` as one call of compiled code; what is known is answered on
    the host, and nothing is compiled. See `all_symmetric_orbits` and `in_chunks` for large batches.

    Raises:
        ValueError: bad input.
        RuntimeError: JAX is in 32-bit mode.
    """
    check_parameters(p)
    x = row_of(p)
    if x.size > 9:
        raise ValueError("`p` must be single numbers: `jax.vmap` and `all_symmetric_orbits` take batches")
    x = x.reshape(9)
    # What is known has no derivatives, which JAX would prepare for longer than the orbits take.
    return _orbits(_leaves(solved(x)) if isinstance(x, np.ndarray) else _described(x)[1])


def all_symmetric_orbits(
    p: Parameters, *, workers: int | None = None, progress: Callable[[int, int], None] | None = None
) -> Orbits:
    """`symmetric_orbits` of every element of a batch, on all cores: NumPy arrays with leading axes (n, 3),
    without derivatives.

    Args:
        p: known parameters, at least one of shape (n,), single numbers for all.
        workers: threads; default the number of cores.
        progress: called with (designs done, of how many) now and then.

    Raises:
        RuntimeError: JAX is in 32-bit mode.
        ValueError: workers below one.
    """
    checks.require_x64()
    orbits = solve_orbits(row_of(p), workers=workers, progress=progress)
    return _orbits(_leaves(orbits.view(float).reshape(*orbits.shape, -1)))


_UNKNOWN = ("multipliers", "sticking", "grazing")
"""Names of numbers whose derivative is not known."""


def _leaves(numbers: Any) -> dict[str, Any]:
    """Fields of `Orbits` and `Margins` by name, of orbits as numbers (..., 3, numbers of an orbit)."""
    of = parts(numbers, ENGINE.entry().ORBIT)
    index, codes = codes_of(STATUSES), of.status.astype(int)
    return {name: of.sizes[..., place] for name, place in SIZES.items()} | {
        "multipliers": of.multipliers[..., 0] + 1j * of.multipliers[..., 1],
        "sticking": of.sticking,
        "grazing": of.grazing,
        "status": index[codes] if isinstance(codes, np.ndarray) else jnp.asarray(index)[codes],
        "overflow": of.overflow[..., 0] > 0.0,
    }


@jax.custom_jvp
def _described(x: Float[Array | np.ndarray, "9"]) -> tuple[Any, dict[str, Any]]:
    """Orbits of a design as numbers, and their fields. Only the fields have derivatives."""
    numbers = solved(x)
    return numbers, _leaves(numbers)


@_described.defjvp
def _described_jvp(primals: tuple, tangents: tuple) -> tuple[Any, Any]:
    (x,), (direction,) = primals, tangents
    numbers, leaves = _described(x)
    moves = {}
    # A program computes those that it needs.
    for asked, names in ASKED.items():
        change = moved(_SLOPES[asked](x, numbers).swapaxes(-1, -2), direction, x)
        moves |= {name: change[:, SIZES[name]] for name in names}
    unknown = moved(np.full(len(x), np.nan), direction, x)
    for name in _UNKNOWN:
        moves[name] = jnp.broadcast_to(unknown, leaves[name].shape)
    moves["multipliers"] = (1.0 + 1.0j) * moves["multipliers"]
    for name in ("status", "overflow"):
        moves[name] = np.zeros(leaves[name].shape, jax.dtypes.float0)
    return (numbers, leaves), (jnp.zeros_like(numbers), {name: moves[name] for name in leaves})


_SLOPES = {asked: once(partial(slopes, asked=asked)) for asked in ASKED}


def _orbits(of: dict[str, Any]) -> Orbits:
    margins = Margins(**{name: of[name] for name in ("fold", "symmetry", "torus", "sticking", "grazing")})
    status = status_of(of["status"])
    names = ("amplitude", "swing", "state", "phase", "crossing", "multipliers", "overflow")
    return Orbits(status=status, margins=margins, **{name: of[name] for name in names})
