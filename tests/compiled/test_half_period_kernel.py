"""The half period of a symmetric orbit: its conditions, their derivatives, and its way from turn to turn."""

import numpy as np
import pytest

from tests.compiled.orbit_cases import chosen
from tests.reference import along, parameters
from tpd.compiled import orbits
from tpd.compiled.columns import E
from tpd.compiled.rows import row_of


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
