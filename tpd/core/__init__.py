"""Foundations of all folders: checks of input, files, formatting, progress, batches and compiled code."""
