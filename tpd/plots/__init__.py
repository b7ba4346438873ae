"""Pictures of designs, motions, responses and maps.

Plot functions take a result and optional axes, and return the axes. They neither show nor save a figure.
"""
