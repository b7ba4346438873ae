"""Derivatives that are computed from the legs of a run: those of every result, for both equations."""

import jax
import jax.numpy as jnp
import numpy as np
import pytest

import tpd
from tests.compiled.shaken import Case, operands, record
from tests.reference import differences
from tpd.compiled.columns import KAPPA, MU, NU, WIDTH, XI, K
from tpd.compiled.rows import row_of
from tpd.compiled.simulate import GroundForcing, follow

COLUMN = tpd.Block(width=1.0, height=6.0, mass=9000.0, friction=0.01, restitution=0.9595)
PENDULUM = tpd.Pendulum(mass=450.0, length=0.9, damping_ratio=0.1)
SINE = tpd.Pulse.one_sine(acceleration=2.0 * 9.80665 / 6.0, frequency=1.2375)
NOISE = record(np.append(0.0, 4.0 * np.random.default_rng(4).standard_normal(40)), 0.05)


TERMS = [tpd.Terms.linear, tpd.Terms.nonlinear]


def results(z, pieces, terms, free=1.5):
    """Numbers of a run as a function of its row and its start."""
    accuracy = {} if terms is tpd.Terms.linear else {"rtol": 1e-12, "rest_rate": 1e-7}
    found = follow(terms, z[:WIDTH], GroundForcing([pieces], free), y0=z[WIDTH:], **accuracy)
    sizes = found.tilt, found.swing, found.rod_angle
    return jnp.stack([*sizes, *found.state, found.growing, *found.times, found.uplift_time])


@pytest.mark.parametrize("terms", TERMS)
@pytest.mark.parametrize("motion", [SINE, NOISE], ids=["sine", "record"])
def test_derivatives_of_every_result_equal_finite_differences(motion, terms):
    rows, (pieces,), _ = operands([Case(COLUMN, PENDULUM, motion)])
    point = np.append(rows[0], [0.01, 0.02, -0.01, 0.05])
    values, by = (np.asarray(f(point, pieces, terms)) for f in (results, jax.jacfwd(results)))
    # A block that begins tilted has no uplift. The slope of the growing coordinate is right where that
    # vanishes, see `critical_scale`.
    sure = np.isfinite(by).all(axis=1) & (np.arange(12) != 7)
    assert np.sum(sure) >= 8
    for j in range(WIDTH + 4):
        expected = differences(lambda z: np.asarray(results(z, pieces, terms)), point, j, share=2e-5)
        # Derivatives pass through tens of impacts, and those of the end through all of them.
        for i in np.flatnonzero(sure & np.isfinite(values)):
            assert by[i, j] == pytest.approx(expected[i], rel=2e-4, abs=2e-5 * (1.0 + np.abs(by[i]).max())), (
                i,
                j,
            )


@pytest.mark.parametrize("terms", TERMS)
def test_derivatives_over_pieces_of_many_legs_equal_differences(terms):
    # Under a block that stays at rest the bob swings through pieces that take many legs each.
    p = tpd.Parameters(nu=0.3, mu=0.1, lam=0.4, zeta=0.05, k=0.1, f=0.1, xi=25.0, rho=0.7, e=0.9)
    x = np.append(row_of(p), np.zeros(4))
    pieces = np.array([[0.0, 0.5, 0.0, 0.0], [0.5, -1.0, 0.0, 0.0]])
    by = jax.jacfwd(results)(x, pieces, terms, free=0.0)
    expected = differences(lambda z: float(results(z, pieces, terms, free=0.0)[4]), x, XI, share=1e-5)
    assert abs(expected) > 1e-5
    assert by[4, XI] == pytest.approx(expected, rel=1e-6)


@pytest.mark.parametrize("terms", TERMS)
def test_the_growing_coordinate_is_zero_at_the_unstable_tilt_of_all_parameters(terms):
    # A free block that starts at its unstable tilt, with the bob almost at rest.
    p = tpd.Parameters(nu=0.3, mu=0.1, lam=0.4, zeta=0.05, k=0.02, f=0.1, xi=0.01, rho=0.7, e=0.9, kappa=1.3)

    def tilt(row):
        weight, up, k = row[NU] * (1.0 + row[MU]), 1.0 + row[MU] * row[KAPPA], row[K]
        if terms is tpd.Terms.linear:
            return (weight + k) / up
        return np.arctan(weight / up) + np.arcsin(k / np.hypot(weight, up))

    row = row_of(p)
    by = jax.jacfwd(results)(np.append(row, [tilt(row), 0.0, 0.0, -1e-9]), np.zeros((1, 4)), terms)[7]
    by_row = [-by[WIDTH] * float(differences(tilt, row, j, share=1e-5)) for j in range(WIDTH)]
    np.testing.assert_allclose(by[:WIDTH], by_row, atol=1e-8)
