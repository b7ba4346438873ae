"""Closed forms: harmonic balance, uplift, free rocking, equivalent friction, the paper's own formulas."""
