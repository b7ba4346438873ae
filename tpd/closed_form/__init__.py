"""Closed forms: harmonic balance, uplift, free rocking, equivalent friction, the paper's own formulas."""

from tpd.closed_form.equivalent_friction import equivalent_friction as equivalent_friction
from tpd.closed_form.free_rocking import free_motion as free_motion
from tpd.closed_form.harmonic_balance import neglected_harmonics as neglected_harmonics
from tpd.closed_form.harmonic_balance import one_harmonic as one_harmonic
from tpd.closed_form.harmonic_balance import one_harmonic_branches as one_harmonic_branches
from tpd.closed_form.harmonic_balance import parametric_branches as parametric_branches
from tpd.closed_form.harmonic_balance import uplift as uplift
