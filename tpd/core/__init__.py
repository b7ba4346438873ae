"""Foundations: scene in SI units, dimensionless parameters, conditions, equations (4) and (25), statuses."""
