"""Names that compiled code and JAX share, known without loading either.

Kinds of modes, columns of states, and the statuses, sizes and bounds of orbits: where one is
about to be lost, or is held to be neither attracting nor repelling.
"""

from __future__ import annotations

from typing import Any

from tpd.scene.parameters import NAMES

SLIP, STICK, REST = range(3)
"""Kinds of the modes of the contact, see `tpd.exact.contact_kernel`."""
TILT, SWING, TILT_RATE, SWING_RATE, TILT_PULL, SWING_PULL = range(6)
"""Columns of a state: phi, psi, phi', psi'; and of its accelerations, phi'' and psi'', where they follow."""
APART = 2
"""After the angles TILT and SWING the third that is counted: psi - phi."""
NU, MU, LAM, ZETA = map(NAMES.index, ("nu", "mu", "lam", "zeta"))
K, F, XI, RHO, E = map(NAMES.index, ("k", "f", "xi", "rho", "e"))
"""Columns of the parameters in a row."""
MANY = len(NAMES)
"""Number of parameters."""
STATUSES = ("rocking", "unstable", "neutral", "near_fold", "grazing", "no_orbit")
"""Names of the statuses of symmetric orbits in compiled code, by their numbers there."""
ENDS = ("rocking", "sticking", "rest", "held", "overturned", "not_settled", "event_bound", "failed")
"""Names of the statuses with which following a motion under a harmonic ends, by their numbers there."""
STEADY_STATUSES = (*ENDS, "aperiodic", "unstable", "neutral", "near_fold", "grazing")
"""Names of the statuses of a steady state, by their numbers in compiled code."""
SHAKEN = ("stood", "rocked", "overturned", "event_bound", "failed")
"""Names of the statuses of a motion through a pulse or a record, by their numbers:"""
STOOD, ROCKED, OVERTURNED, EVENT_BOUND, FAILED = range(5)
TURNING, CROSSED, MERGED, BROKEN, STUCK, TOUCHED, FLAT = range(7)
"""Places of the numbers that vanish at an orbit (its two conditions) and where orbits are lost, see
`tpd.exact.symmetric_orbit_kernel.vanishing`."""
SIZES = {
    **{"amplitude": 0, "phase": 1, "crossing": 2, "swing": 3, "fold": 4, "symmetry": 5, "torus": 6},
    "state": slice(7, 11),
}
"""Places of their sizes with derivatives in compiled code."""
ASKED = {
    **{(0, 3): ("amplitude", "phase", "crossing"), (3, 4): ("swing",)},
    **{(4, 7): ("fold", "symmetry", "torus"), (7, 11): ("state",)},
}
"""Ranges of places that are computed together: those of a solution, of its path, of the map along it, and the
state at tau = 0; with their names."""

NEAR_FOLD = 1e-6
"""Smallest distance of a multiplier over half a period from 1 (over a whole period: twice that) at which the
derivative of an orbit is given."""
GRAZING = 1e-7
"""Smallest rate at an event, as a share of its usual size, at which the derivative of an orbit is given."""
CONSERVED = 1e-6
"""Largest excess over 1 of the largest multiplier of an orbit that neither attracts nor repels where the
equations conserve energy: a double multiplier is known to the root of rounding."""
UNDECIDED = 1e-11
"""Distance from 1 of the largest multiplier below which rounding decides whether an orbit attracts."""
RESIDUAL = 1e-8
"""Largest residual of the period map, in shares of the scales, of what is called an orbit."""
NEWTON_STEPS = 24
"""Bound on the steps of Newton's method on the period map. Three or four usually do; next to a fold each only
halves the error."""
LAST_STEP = 1e-6
"""Largest step of this method, in shares of the scales, after which a step that leads away is the last one.
Just beyond a fold the residual is small, and the step is not."""
SYMMETRIC = 1e-6
"""Largest difference between the tilts to either side, over the amplitude, of a symmetric motion."""
APERIODIC = 5e-3
"""Lyapunov exponent, per unit tau, above which a motion that did not repeat is called aperiodic."""


def is_neutral(k: Any, e: Any, mu: Any, zeta: Any, largest: Any) -> Any:
    """Whether an orbit whose multiplier is `largest` in size neither attracts nor repels."""
    # Nothing takes energy from the block: no friction, no impact loss, no hinge damping that it can feel.
    conserves = (k == 0.0) & (e == 1.0) & ((mu == 0.0) | (zeta == 0.0))
    return (conserves & (largest < 1.0 + CONSERVED)) | (abs(largest - 1.0) < UNDECIDED)
