"""Design of a pendulum on ground motions: pulses and records."""
