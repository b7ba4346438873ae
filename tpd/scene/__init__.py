"""Block, pendulum, ground motion and materials, in SI units and as dimensionless numbers."""
