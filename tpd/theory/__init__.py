"""Closed forms: quantities of block and pendulum that need no integration of the motion.

| equation of the paper | module | functions |
|---|---|---|
| Table 1, no-uplift condition | `no_uplift` | `uplift`, `lightest_pendulum` |
| (16) to (18), (25), motion between two events | `arc` | `arc`, `impact`, `holding_moment` |
| (11), free rocking | `free_rocking` | `free_motion` |
| losses at impacts as friction, free decay | `free_rocking` | `equivalent_friction`, `turning_tilts` |
| (23) and (27), one-harmonic balance | `harmonic_balance` | `one_harmonic`, `fold` and three more |
| not in the paper, a pendulum slower than the excitation | `relative_length` | `relative_length` |
"""

from tpd.theory.arc import arc, holding_moment, impact
from tpd.theory.free_rocking import equivalent_friction, free_motion, turning_tilts
from tpd.theory.harmonic_balance import (
    fold,
    neglected_harmonics,
    one_harmonic,
    one_harmonic_branches,
    parametric_branches,
)
from tpd.theory.no_uplift import lightest_pendulum, uplift
from tpd.theory.relative_length import relative_length

__all__ = [
    "arc",
    "equivalent_friction",
    "fold",
    "free_motion",
    "holding_moment",
    "impact",
    "lightest_pendulum",
    "neglected_harmonics",
    "one_harmonic",
    "one_harmonic_branches",
    "parametric_branches",
    "relative_length",
    "turning_tilts",
    "uplift",
]
