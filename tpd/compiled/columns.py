"""Constants that compiled code and JAX code share. This module loads neither of them.

These are the kinds of modes, the columns of states, and the statuses, sizes and bounds of orbits. The bounds
define near which points an orbit loses its derivatives, and which orbits neither attract nor repel.
"""

from __future__ import annotations

import math
from typing import Any

import numpy as np

from tpd.scene.impacts import select
from tpd.scene.parameters import NAMES

SLIP, STICK, REST = range(3)
"""Kinds of the modes of the contact, see `tpd.compiled.contact`: the block moves; it is held at a
tilt; it is held on its base."""
TILT, SWING, TILT_RATE, SWING_RATE, TILT_PULL, SWING_PULL = range(6)
"""Columns of a state: phi, psi, phi', psi', and where they follow, the accelerations phi'' and psi''."""
APART = 2
"""Index of the third angle psi - phi, after TILT and SWING."""
NU, MU, LAM, ZETA = map(NAMES.index, ("nu", "mu", "lam", "zeta"))
K, F, XI, RHO, E, KAPPA = map(NAMES.index, ("k", "f", "xi", "rho", "e", "kappa"))
"""Columns of the parameters in a row."""
WIDTH = len(NAMES)
"""Number of parameters."""
ROCKING, STICKING, AT_REST, HELD, OVERTURNED, APERIODIC_STATUS, NOT_SETTLED, UNSTABLE = range(8)
NEUTRAL, NEAR_FOLD_STATUS, GRAZING_STATUS, EVENT_BOUND, FAILED, NO_ORBIT, STOOD, ROCKED = range(8, 16)
"""Numbers of the statuses in compiled code, which are those of `tpd.scene.status`."""
RUN = np.dtype(
    [
        *((name, np.float64) for name in ("tilt", "settled_tilt", "swing", "settled_swing", "rod_angle")),
        ("settled_rod_angle", np.float64),
        ("times", np.float64, (3,)),
        ("state", np.float64, (6,)),
        *((name, np.float64) for name in ("status", "periods", "elapsed", "growing", "impacts")),
        *((name, np.float64) for name in ("uplift_time", "overturning_time", "transversality")),
    ]
)
"""Results of a run, see `tpd.compiled.simulate.Run`. The accelerations follow in `state`."""
STEADY = np.dtype(
    [
        *((name, np.float64) for name in ("amplitude", "swing")),
        ("state", np.float64, (4,)),
        *((name, np.float64) for name in ("multiplier", "lyapunov", "fold")),
        *((name, np.float64) for name in ("status", "periods", "symmetric", "elapsed")),
        ("multipliers", np.complex128, (4,)),
        ("by", np.float64, (6, WIDTH)),
    ],
    align=True,
)
"""A steady state, see `tpd.answers.steady_state.Steady`; all multipliers and the margin to the fold, see
`tpd.answers.periodic_orbit.PeriodicOrbit`; and `by`, the derivatives of the first six numbers in the
parameters. A derivative that does not exist is NaN."""
TURNING, CROSSED, MERGED, BROKEN, STUCK, TOUCHED, FLAT = range(7)
"""Indices of the functions that vanish at an orbit (its two conditions) and where orbits are lost, see
`tpd.compiled.symmetric_orbit_kernel.vanishing`."""
SIZES = {
    **{"amplitude": 0, "phase": 1, "crossing": 2, "swing": 3, "fold": 4, "symmetry": 5, "torus": 6},
    **{"remaining": 7, "state": slice(8, 12)},
}
"""Indices of the sizes of a symmetric orbit, all of which have derivatives."""
ASKED = {
    **{(0, 3): ("amplitude", "phase", "crossing"), (3, 4): ("swing",)},
    **{(4, 8): ("fold", "symmetry", "torus", "remaining"), (8, 12): ("state",)},
}
"""Ranges of these indices that are computed together, with the names of the sizes. The groups belong to the
solution, to its path, to the map along the path (three margins and what remains of a disturbance), and to
the state at tau = 0."""

NEAR_FOLD = 1e-6
"""Smallest distance of a multiplier from 1 at which an orbit has derivatives, over half a period. Over a
whole period it is twice as large."""
GRAZING = 1e-7
"""Smallest rate at an event at which an orbit has derivatives, as a share of its usual value."""
CONSERVED = 1e-6
"""Largest excess over 1 of the largest multiplier of an orbit that counts as neutral, if the equations
conserve energy. Rounding limits a double multiplier to half of the digits."""
UNDECIDED = 1e-11
"""Distance of the largest multiplier from 1 below which rounding decides whether an orbit attracts."""
RESIDUAL = 1e-8
"""Largest residual of the period map at which a motion counts as an orbit, in shares of the scales."""
NEWTON_STEPS = 24
"""Bound on the Newton steps on the period map. Usually three or four are enough. Near a fold each step only
halves the error."""
LAST_STEP = 1e-6
"""Largest Newton step, in shares of the scales, of a converged orbit. Just beyond a fold the residual is
small, but the step is not."""
SYMMETRIC = 1e-6
"""Largest difference between the tilts to either side of a symmetric motion, as a share of the amplitude."""
APERIODIC = 5e-3
"""Lyapunov exponent (per unit of tau) above which a motion that did not repeat counts as aperiodic."""


def is_neutral(k: Any, e: Any, mu: Any, zeta: Any, largest: Any) -> Any:
    """Whether an orbit neither attracts nor repels. `largest` is the modulus of its largest multiplier."""
    # The block loses no energy: there is no friction, no impact loss, and no hinge damping that acts on the
    # block.
    conserves = (k == 0.0) & (e == 1.0) & ((mu == 0.0) | (zeta == 0.0))
    return (conserves & (largest < 1.0 + CONSERVED)) | (abs(largest - 1.0) < UNDECIDED)


def verdict(
    outcome: Any,
    residual: Any,
    multiplier: Any,
    to_fold: Any,
    transversality: Any,
    neutral: Any,
    small: Any,
    damped: Any,
    finite: Any,
) -> Any:
    """Return the number of the status of a steady state, from the run and from Newton's method.

    Compiled code and JAX have the same rules.

    Args:
        outcome: status at the end of the run.
        residual: residual of the orbit.
        multiplier: modulus of the largest multiplier.
        to_fold: distance of the nearest multiplier from 1.
        transversality: smallest transversality of all events.
        neutral: whether the orbit neither attracts nor repels.
        small: whether the model cannot distinguish the motion from rest.
        damped: whether the hinge has damping.
        finite: whether the state is finite.
    """
    # The statements are in increasing order of priority: each one overrules those above it. Stability comes
    # first, because it means nothing if an event grazes, next to a fold, or away from an orbit.
    moving = (outcome == ROCKING) | (outcome == STICKING)
    status = select(moving & (multiplier > 1.0), UNSTABLE, outcome)
    status = select(moving & neutral, NEUTRAL, status)
    status = select(moving & (transversality < GRAZING), GRAZING_STATUS, status)
    status = select(moving & (to_fold < 2.0 * NEAR_FOLD), NEAR_FOLD_STATUS, status)
    status = select(residual < RESIDUAL, status, select(moving, NOT_SETTLED, status))
    status = select(moving & small, AT_REST, status)
    # An undamped bob that keeps swinging under a resting block has no orbit. With damping one period was
    # simulated, unless it has more events or solver steps than allowed.
    stopped = select((outcome == AT_REST) & damped, EVENT_BOUND, status)
    status = select(residual < math.inf, status, stopped)
    # Without a finite derivative of the period map the stability is unknown.
    status = select(multiplier < math.inf, status, select(status == UNSTABLE, FAILED, status))
    return select(finite | (status == OVERTURNED), status, FAILED)
