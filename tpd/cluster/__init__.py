"""Computation of long batches on several processes or machines."""
