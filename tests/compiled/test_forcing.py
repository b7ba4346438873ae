"""The forcing of a run, from any time of its pieces on."""

import numba
import numpy as np
import pytest

from tests.compiled.plants import plants_of
from tpd.compiled import forcing
from tpd.compiled.forcing import NO, YES, Forcing


@numba.njit
def eta(plants, f, i, s, t):
    """The forcing of piece i at the time s + t, from its numbers at the time s; and the forcing at s."""
    e = forcing.load_at(plants[0], f, i, s)
    size = e.e0 + t * (e.e1 + t * (e.e2 + t * e.e3))
    return size * np.sin(e.phase + e.xi * t) if e.xi != 0.0 else size, forcing.forcing_now(plants[0], f, i, s)


def test_a_forcing_can_continue_from_any_time_of_its_piece():
    plants = plants_of([(0.25, 0.1, 0.7, 0.1, 0.05, 0.3, 2.5)])
    c = np.array([[0.4, -0.9, 0.5, 0.3], [0.3, 1.0, 0.0, -0.2], [0.0, 0.0, 0.0, 0.0]])
    sampled, growing = Forcing(NO, 0.0, 0.0, 2, c[:2]), Forcing(YES, 0.3, 0.2, 0, c[:2])
    for s, t in ((0.0, 0.7), (0.4, 0.3), (1.1, 0.0)):
        for i, p in enumerate(map(np.polynomial.Polynomial, c)):
            assert eta(plants, sampled, i, s, t) == pytest.approx((p((s + t) / 2.5), p(s / 2.5)), rel=1e-14)
        known = [(0.3 + 0.2 * late) * np.sin(2.5 * late) for late in (s + t, s)]
        assert eta(plants, growing, 0, s, t) == pytest.approx(known, rel=1e-14)
