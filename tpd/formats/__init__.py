"""Readers of files of ground motion. They know NumPy only, and give channels in m/s^2."""
