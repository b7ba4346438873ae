"""Every symmetric period-one orbit of a design, stable and unstable, without start values.

Most rocking attractors are such orbits: one swing to either side per forcing period, the second the
mirror image of the first. They are the roots of one scalar equation (`tpd.exact.orbit_equation`), so that
nothing is simulated; their derivatives follow from the implicit function theorem.
"""

from __future__ import annotations

from functools import partial
from typing import NamedTuple

import equinox as eqx
import jax
import jax.numpy as jnp
from jax.lax import stop_gradient
from jaxtyping import Array, Bool, Complex, Float

from tpd.core import checks
from tpd.core.eigenvalues import (
    GRAZING,
    NEAR_FOLD,
    characteristic,
    determinants,
    felt_by_block,
    is_neutral,
    quartic_roots,
)
from tpd.core.parameters import Number, Parameters, State, as_arrays, check_parameters
from tpd.core.status import Status
from tpd.exact.batch_branches import computed_once, where_needed
from tpd.exact.derivatives import refused, refused_in
from tpd.exact.modes import Plant
from tpd.exact.orbit_candidates import candidates
from tpd.exact.orbit_equation import Half
from tpd.exact.orbit_path import Path
from tpd.exact.orbit_roots import Root, differentiable
from tpd.exact.symmetric_orbit import Orbit, half_map, instant, orbit_of, state_at


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
    no dent): at zero the block turns back once more."""


class Orbits(eqx.Module):
    """The symmetric period-one orbits of one design, the largest first; leading axis `ORBITS` (3),
    status `no_orbit` where there are fewer, and NaN beside it. Angles in rad.

    `amplitude`, `stroke`, `state`, `phase` and `crossing` are differentiable in every parameter, also on
    unstable orbits; their derivative is NaN where the status is near_fold, grazing or no_orbit. That of
    `multipliers` is NaN everywhere.
    """

    status: Status
    """rocking (attracting), unstable, neutral, near_fold, grazing or no_orbit."""
    amplitude: Float[Array, "*orbits"]
    """Largest |phi|."""
    stroke: Float[Array, "*orbits"]
    """Largest |psi|."""
    state: Float[Array, "*orbits 4"]
    """(phi, psi, phi', psi') at tau = 0 modulo the forcing period."""
    phase: Float[Array, "*orbits"]
    """Phase xi tau of the forcing at the upper turn, in (-pi, pi]."""
    crossing: Float[Array, "*orbits"]
    """Dimensionless time from the upper turn to the crossing of phi = 0."""
    multipliers: Complex[Array, "*orbits 4"]
    """Floquet multipliers over one forcing period; attracting if all are below 1 in size."""
    margins: Margins
    overflow: Bool[Array, ""]
    """Whether there may be more: more roots than could be followed up, or a bob that swings freely more than
    300 times on one of the two arcs of a half period, whose path is not followed."""


def symmetric_orbits(p: Parameters) -> Orbits:
    """All symmetric period-one orbits of (25) with true signs, section by section in closed form.

    Works under `jit`, `vmap`, `grad` and `jacfwd`; see `in_chunks` for large batches. An orbit with
    a stick phase, with more crossings, or that repeats later is not among them: `steady_state`
    follows those.

    Raises:
        RuntimeError: JAX is in 32-bit mode.
    """
    checks.require_x64()
    check_parameters(p)
    return _symmetric_orbits(as_arrays(p))


@eqx.filter_jit
def _symmetric_orbits(p: Parameters) -> Orbits:
    half = Half(Plant(p))
    found = candidates(jax.tree.map(stop_gradient, half))
    found = jax.tree.map(stop_gradient, found)
    # Where there is no orbit the arithmetic is done on a harmless root and thrown away.
    safe = Root(
        jnp.where(found.exists, found.root.t, 0.5 * stop_gradient(half.span)),
        jnp.where(found.exists, found.root.gamma, 0.3),
    )

    def step(_: None, slot: tuple[Root, Path, Array]) -> tuple[None, _Described]:
        root, path, there = slot
        return None, where_needed(there, _describe, p, half, root, path)

    # One after the other: in a batch the designs, not the few orbits, are next to each other in memory.
    _, described = jax.lax.scan(step, None, (safe, found.path, found.exists))
    answers = jax.vmap(partial(_answered, p))(described, found.exists)
    status, (amplitude, stroke, state, phase, crossing), multipliers, margins = answers
    multipliers = refused_in(p, jnp.real(multipliers)) + 1j * refused_in(p, jnp.imag(multipliers))
    sticking, grazing = refused_in(p, margins.sticking), refused_in(p, margins.grazing)
    margins = Margins(margins.fold, margins.symmetry, margins.torus, sticking, grazing)
    return Orbits(status, amplitude, stroke, state, phase, crossing, multipliers, margins, found.overflow)


class _Margins(NamedTuple):
    """See `Margins`."""

    fold: Number
    symmetry: Number
    torus: Number
    sticking: Number
    grazing: Number


class _Described(NamedTuple):
    """Description of an orbit, before its status is known."""

    amplitude: Number
    stroke: Number
    state: State
    phase: Number
    crossing: Number
    halves: Array
    """Multipliers over half a period."""
    margins: _Margins


def _describe(p: Parameters, half: Half, root: Root, path: Path) -> _Described:
    polished, height = computed_once(*differentiable(half, root))
    orbit = orbit_of(half, polished)
    multipliers, determinants = _stability(p, half, orbit)
    sticking = path.leaving / (path.leaving - 2.0 * _friction_pull(half))
    fall = path.least_fall / (half.plant.linear.xi * stop_gradient(height))
    begun = jnp.mod(-polished.gamma, 2.0 * jnp.pi) / half.plant.linear.xi
    late = path.bob.late
    lasts = jnp.where(late, half.span - polished.t, polished.t)
    bob = instant(half, orbit, path.bob.share * lasts, late)
    arc = jax.tree.map(lambda a, b: jnp.where(late, b, a), orbit.first[1], orbit.second[1])
    return _Described(
        height,
        jnp.abs(arc.at(bob)),
        state_at(half, orbit, begun),
        polished.gamma,
        polished.t,
        multipliers,
        _Margins(*determinants, sticking, fall),
    )


def _answered(p: Parameters, of: _Described, there: Bool[Array, ""]) -> tuple:
    """The fields of `Orbits`: nothing where there is no orbit, and no derivative where it has none."""
    near = jnp.min(jnp.abs(1.0 - of.halves)) < NEAR_FOLD
    grazes = of.margins.grazing < GRAZING
    largest = jnp.max(jnp.abs(of.halves))
    status = Status.where(largest < 1.0, Status.rocking, Status.unstable)
    status = Status.where(is_neutral(p, largest), Status.neutral, status)
    status = Status.where(grazes, Status.grazing, status)
    status = Status.where(there, Status.where(near, Status.near_fold, status), Status.no_orbit)
    usable = there & ~near & ~grazes
    of = jax.tree.map(lambda x: jnp.where(there, x, jnp.nan), of)
    numbers = tuple(refused(x, usable) for x in (of.amplitude, of.stroke, of.state, of.phase, of.crossing))
    margins = {name: refused(getattr(of.margins, name), usable) for name in ("fold", "symmetry", "torus")}
    return status, numbers, of.halves**2, of.margins._replace(**margins)


def _stability(p: Parameters, half: Half, orbit: Orbit) -> tuple[Array, tuple[Number, Number, Number]]:
    """Eigenvalues of the mirrored half-period map, and its determinants (fold, symmetry, torus). A bob
    without mass (mu = 0) cannot be felt and is left out: two eigenvalues are zero then."""
    m = felt_by_block(p, half_map(half, orbit))
    coefficients = computed_once(*characteristic(*computed_once(m)))
    real, imag = quartic_roots(coefficients)
    return real + 1j * imag, determinants(coefficients)


def _friction_pull(half: Half) -> Number:
    """Contribution of friction to phi'' while the tilt falls."""
    linear = half.plant.linear
    return linear.friction * linear.m22 / linear.determinant
