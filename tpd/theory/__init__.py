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

from tpd.theory.arc import arc as arc
from tpd.theory.arc import holding_moment as holding_moment
from tpd.theory.arc import impact as impact
from tpd.theory.free_rocking import equivalent_friction as equivalent_friction
from tpd.theory.free_rocking import free_motion as free_motion
from tpd.theory.free_rocking import turning_tilts as turning_tilts
from tpd.theory.harmonic_balance import fold as fold
from tpd.theory.harmonic_balance import neglected_harmonics as neglected_harmonics
from tpd.theory.harmonic_balance import one_harmonic as one_harmonic
from tpd.theory.harmonic_balance import one_harmonic_branches as one_harmonic_branches
from tpd.theory.harmonic_balance import parametric_branches as parametric_branches
from tpd.theory.no_uplift import lightest_pendulum as lightest_pendulum
from tpd.theory.no_uplift import uplift as uplift
from tpd.theory.relative_length import relative_length as relative_length
