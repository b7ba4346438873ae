"""The half period of a symmetric orbit: its conditions, their derivatives, and its way from turn to turn."""

import numpy as np
import pytest
from scipy.linalg import expm

from tests.compiled.orbit_cases import chosen
from tests.compiled.plants import entry
from tests.reference import along, parameters
from tpd.compiled import half_period_kernel, orbits
from tpd.compiled.columns import E
from tpd.compiled.plant import STEP
from tpd.compiled.rows import row_of

PAIRS = [(0.0, 4.0), (0.3, 4.0), (40.0, 5.0), *((2.0, 1.0 + d) for d in (-1e-3, -1e-6, 0.0, 1e-6, 1e-3))]


@pytest.mark.parametrize(("p", "q"), PAIRS)
def test_the_flow_of_a_pair_of_modes_is_an_exponential_at_any_damping(p, q):
    pair = entry(half_period_kernel.pair)
    for t in (0.0, 1e-6, 0.03, 1.0, 8.0):
        expected = expm(np.array([[0.0, 1.0], [-q, -p]]) * t)[0]
        np.testing.assert_allclose(pair(p, q, t), expected, rtol=1e-11, atol=1e-14)


def test_exponential_and_sine_have_complex_step_derivatives():
    exponential, sincos = entry(half_period_kernel.exponential), entry(half_period_kernel.sincos)
    for x in (-300.0, -0.3, 0.0, 1e-20, 2.0, 600.0):
        z = complex(x, 3.0 * STEP)
        found, expected = np.array([exponential(z), *sincos(z)]), np.array([np.exp(x), np.sin(x), np.cos(x)])
        np.testing.assert_allclose(found.real, expected, rtol=1e-15)
        slopes = expected[[0, 2, 1]] * [1.0, 1.0, -1.0]
        np.testing.assert_allclose(found.imag / (3.0 * STEP), slopes, rtol=1e-15)


@pytest.mark.parametrize("kind", ["rocking", "unstable"])
def test_an_orbit_closes_and_its_path_equals_a_simulation(kind):
    for x, o in chosen(3, kind):
        u = np.array([float(o.crossing), float(o.phase)])
        found = orbits.vanishing(np.append(u, 0.0), row_of(parameters(x)))
        np.testing.assert_allclose(found.values[:2], 0.0, atol=1e-12)
        way = orbits.sample_path(u, row_of(parameters(x)))
        assert way.height == pytest.approx(float(o.amplitude), rel=1e-12)
        assert way.leaving < 0.0 > way.arriving
        half = np.pi / x[6]
        ys = along(x, o.state, np.linspace(0.0, 2.0 * half, 361))[0]
        assert np.abs(ys[:, 2]).max() == pytest.approx(-way.rates.min(), rel=1e-2)
        assert np.abs(ys[:, 0]).max() == pytest.approx(way.height, rel=1e-3)


def test_derivatives_of_the_end_conditions_of_orbits_equal_differences():
    for x, o in chosen(2, "rocking"):
        u, x = np.array([float(o.crossing), float(o.phase), 0.4 * float(o.crossing)]), row_of(parameters(x))
        found = orbits.vanishing(u, x)
        point = np.concatenate([u, x])
        for i, step in enumerate(1e-4 * np.maximum(np.abs(point), 0.1)):
            if i == 3 + E and x[E] > 1.0 - 3e-4:
                continue
            at = [point + n * step * (np.arange(len(point)) == i) for n in (-2, -1, 1, 2)]
            at = [orbits.vanishing(z[:3], z[3:]).values for z in at]
            expected = (8.0 * (at[2] - at[1]) - (at[3] - at[0])) / (12.0 * step)
            by = np.hstack([found.by_u, found.by_x])[:, i]
            np.testing.assert_allclose(by, expected, rtol=1e-6, atol=1e-7 * (1.0 + np.abs(expected).max()))
