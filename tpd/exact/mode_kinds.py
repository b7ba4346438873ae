"""Kinds of the modes of the contact; see `tpd.exact.contact`. Compiled code needs them without JAX."""

SLIP, STICK, REST = 0, 1, 2
