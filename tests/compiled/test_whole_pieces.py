"""Whole pieces of a record without an event: their map, and that taking them in one step changes nothing."""

import numba
import numpy as np
import pytest
from scipy.linalg import expm
from tpd.compiled.arcs import accelerations

import tpd
from tests.compiled.plants import plants_of
from tests.compiled.shaken import Case, changed, motions, operands, random_scenes
from tpd.compiled import whole_pieces
from tpd.compiled.columns import REST, SLIP
from tpd.compiled.simulate import GroundForcing, follow
from tpd.scene.status import Status, code_of, is_one_of

SCENES = random_scenes(60)
COLUMN = tpd.Block(width=1.0, height=6.0, mass=9000.0, friction=0.0, restitution=0.9595)
PENDULUM = tpd.Pendulum(mass=450.0, length=0.9, damping_ratio=0.1)


@numba.njit
def store_map(plants, kind, h, out, matrix):
    """Put the map of a piece, and the matrix of its equations over state, forcing and slopes, into both."""
    q, x = plants[0], np.zeros(5)
    whole_pieces.store_map(q, kind, h, out)
    for j in range(5):
        x[j] = 1.0
        matrix[2, j], matrix[3, j] = accelerations(q, kind, 0.0, x[0], x[1], x[2], x[3], x[4])
        x[j] = 0.0


@pytest.mark.parametrize("kind", [SLIP, REST])
@pytest.mark.parametrize("h", [1e-3, 0.1, 3.0])
def test_the_map_of_a_piece_equals_the_matrix_exponential(kind, h):
    for x in ([0.25, 0.0, 0.7, 0.1, 0.05, 0.3, 2.5], [0.2, 0.3, 0.1, 1.4, 0.0, 0.4, 1.0]):
        out, matrix = np.empty((4, 8)), np.zeros((8, 8))
        store_map(plants_of([x]), float(kind), h, out, matrix)
        matrix[0, 2], matrix[1, 3] = float(kind == SLIP), 1.0
        # Derivatives of the forcing in the share of a piece.
        matrix[4, 5] = matrix[5, 6] = matrix[6, 7] = 1.0 / h
        expected = (expm(h * matrix) - np.eye(8))[:4] * [1, 1, 1, 1, 1, 1, 2, 6]
        np.testing.assert_allclose(out, expected, rtol=1e-10, atol=1e-12 * np.abs(expected).max())


def test_interpolated_samples_do_not_change_the_motion():
    def doubled(a, dt):
        out = np.empty(2 * len(a) - 1)
        out[::2], out[1::2] = a, 0.5 * (a[1:] + a[:-1])
        return out, 0.5 * dt

    known, finer = motions([case for case, _, _ in SCENES]), motions(changed(SCENES, doubled))
    assert np.array_equal(code_of(finer.status), code_of(known.status))
    rocked = is_one_of(known.status, Status.rocked)
    with_it = rocked & np.array([case.pendulum is not None for case, _, _ in SCENES])
    for name, sure in zip(("tilt", "swing", "rod_angle"), (rocked, with_it, with_it), strict=True):
        error = np.abs(getattr(finer, name)[sure] / getattr(known, name)[sure] - 1.0)
        # A long rattle doubles a rounding at every few impacts.
        assert np.median(error) < 1e-14
        assert np.quantile(error, 0.95) < 1e-10


def test_a_brief_simulation_gives_the_statuses_of_a_full_one():
    sizes = np.linspace(0.9, 4.0, 40) * 9.80665 / 6.0
    cases = [Case(COLUMN, PENDULUM, tpd.Pulse.one_sine(acceleration=a, frequency=1.2375)) for a in sizes]
    rows, pieces, _ = operands(cases)
    forcing = GroundForcing(pieces, 30.0, np.arange(40))
    full, brief = (follow(tpd.Terms.linear, rows, forcing, brief=b) for b in (False, True))
    assert np.array_equal(code_of(full.status), code_of(brief.status))
    # Turns of the bob are not looked for: other pieces are taken in one step, and rounding is another.
    np.testing.assert_allclose(brief.tilt, full.tilt, rtol=1e-13)
