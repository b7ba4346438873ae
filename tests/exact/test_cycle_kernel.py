"""Arcs of a periodic orbit: each ends where the next begins, and meets what samples show."""

import numpy as np
import pytest

from tests.reference import along, parameters
from tpd.exact.multiple_shooting import polish, recorded, traverse
from tpd.exact.rows import row_of

SCENES = {
    "slips": ((0.25, 0.1, 0.15, 0.3, 0.05, 0.377, 2.67, 1.0), (0.02341, 0.37348, 0.18303, -1.33012)),
    "held and at rest": (
        (0.19, 0.09, 0.57, 0.3, 0.04, 0.25, 1.74, 0.0),
        (0.00103, -0.32788, -0.01066, -0.25904),
    ),
}


@pytest.fixture(params=SCENES.values(), ids=SCENES)
def orbit(request):
    x, y0 = request.param
    row = row_of(parameters(x))
    cycle = recorded(row, np.array(y0), 1, 32, 2e-7)
    return x, row, polish(row, cycle, 1, np.ones(4))


def test_every_arc_ends_where_the_next_one_begins_at_its_event(orbit):
    _, row, found = orbit
    ends, by, _ = traverse(row[None] + 0j, found.links, found.arcs[None] + 0j)
    onward = np.roll(found.arcs[:, :5], -1, axis=0)
    onward[-1, 4] += 2.0 * np.pi
    np.testing.assert_allclose(ends[:, :5], onward, rtol=0, atol=1e-12)
    np.testing.assert_allclose(ends[:, 5], 0.0, atol=1e-12)
    assert by.shape == (len(found.links), 6, 1)


def test_what_an_arc_meets_is_what_samples_show(orbit):
    x, _, found = orbit
    assert np.all(found.met["inside"] == 1.0)
    for link, arc, met in zip(found.links, found.arcs, found.met, strict=True):
        begin = arc[4] / x[6]
        start = np.where(np.abs(arc[:4]) < 1e-12, 0.0, arc[:4])
        ys = along(x, start, begin + np.linspace(0, 1, 361) * arc[5])[0]
        largest = np.abs(ys[:, 1]).max()
        assert largest * (1.0 - 1e-12) <= met["reach"] <= largest * (1.0 + 1e-3)
        assert 0.0 <= met["at"] <= arc[5] * (1.0 + 1e-12)
        np.testing.assert_allclose([met["v0"], met["v1"]], arc[2:4], rtol=0, atol=1e-12)
        if link["kind"] == 0.0 and link["ending"] == 0.0:
            assert 0.0 < met["sticking"] <= 1.0


def test_the_ends_have_the_derivatives_of_differences(orbit):
    _, row, found = orbit
    directions = 1j * np.eye(15)
    _, by, _ = traverse(row + directions[:, 6:], found.links, found.arcs + directions[:, None, :6])
    for j in range(15):
        step = 1e-6 * np.eye(15)[j]
        up, down = (
            traverse((row + d[6:])[None] + 0j, found.links, (found.arcs + d[:6])[None] + 0j)[0]
            for d in (step, -step)
        )
        reach = 1e-7 * (1.0 + np.abs(up - down).max() / 2e-6)
        np.testing.assert_allclose(by[:, :, j], (up - down) / 2e-6, rtol=1e-6, atol=reach)
