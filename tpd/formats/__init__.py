"""Readers of files with ground motions. They use only NumPy, and return channels in m/s^2."""
