"""Block, pendulum, motion of the ground and materials, in SI units and as dimensionless numbers."""
