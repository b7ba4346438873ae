"""Names and bounds of the symmetric orbits: their statuses, their sizes with derivatives, and where one is
about to be lost, or is held to be neither attracting nor repelling. Compiled code needs them without JAX."""

STATUSES = ("rocking", "unstable", "neutral", "near_fold", "grazing", "no_orbit")
"""Names of the statuses in compiled code, by their numbers there."""
SIZES = ("amplitude", "phase", "crossing", "stroke", "fold", "symmetry", "torus")
"""Sizes with derivatives in compiled code, in this order; the four numbers of the state at tau = 0 follow."""

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
SYMMETRIC = 1e-6
"""Largest difference between the tilts to either side, over the amplitude, of a symmetric motion."""
APERIODIC = 5e-3
"""Lyapunov exponent, per unit tau, above which a motion that did not repeat is called aperiodic."""
