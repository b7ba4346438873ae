"""Kinds of the modes of the contact, see `tpd.exact.contact`, and of the events that end an arc of a periodic
orbit. Compiled code needs them without JAX."""

SLIP, STICK, REST = 0, 1, 2
TURN, LANDING, RELEASE = 0, 1, 2
