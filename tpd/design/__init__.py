"""Search for the pendulum and verification of the answer."""
