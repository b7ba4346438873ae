"""Tally of a motion under a ground motion: the largest angles, and what is counted on the way."""

from __future__ import annotations

from tpd.exact.arc_kernel import compiled

BEST, WHERE, WHEN = 0, 6, 12
"""Places in the tally of a motion: largest phi, psi and psi - phi to either side, the legs at whose ends they
were met (-1 is the beginning), and the times."""
IMPACTS, LIFTED, FELL, LEGS, EVENTS, LOOKS_LEFT, CROSSING = range(18, 25)
"""Further places: impacts, times of first uplift and of overturning, legs, events and looks that are left,
and the least transversality."""
TALLY = 25


@compiled
def note(tally, phi, psi, tau, leg):
    """Take account of the angles at the end of a leg."""
    for k in range(6):
        angle = phi if k < 2 else (psi if k < 4 else psi - phi)
        angle = angle if k % 2 == 0 else -angle
        # The first leg of several with the same angle counts: a block that rests adds none.
        if angle > tally[BEST + k]:
            tally[BEST + k], tally[WHERE + k], tally[WHEN + k] = angle, leg, tau
