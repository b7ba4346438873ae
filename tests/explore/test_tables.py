"""Tables of orbits: nodes, fields, bounds of the interpolation error, and their encoding."""

import base64

import numpy as np
import pytest

import tpd
from tpd.explore.tables import NONE, SAFETY, Table, axis, interpolation_error, solve

SCENE = tpd.paper_scene()
PENDULUM = tpd.Pendulum(mass=1.6, length=0.12, damping_ratio=0.1)


def test_stated_values_in_range_are_nodes_of_the_axis_and_replace_nearby_ones():
    own = axis("frequency", 1.0, 100.0, 5, [3.0, 30.0, 300.0])
    assert {1.0, 3.0, 30.0, 100.0} <= set(own.values)
    assert 300.0 not in own.values, "it is out of range"
    assert (np.diff(own.values) > 0.0).all()
    # 9.0 is next to the node 10 of 1, 10, 100.
    np.testing.assert_allclose(axis("frequency", 1.0, 100.0, 3, [9.0]).values, [1.0, 9.0, 100.0])
    assert axis("damping", 0.0, 1.0, 5, [0.3], log=False).values.tolist() == [0.0, 0.3, 0.5, 0.75, 1.0]


def test_fields_of_the_table_equal_the_symmetric_orbits():
    table = solve(SCENE, [axis("frequency", 2.0, 4.0, 4), axis("pendulum_mass", 0.2, 3.0, 3)], PENDULUM)
    nu, rocking = float(SCENE.block.slenderness), 0
    for i, frequency in enumerate(table.axes[0].values):
        for j, mass in enumerate(table.axes[1].values):
            scene = tpd.Scene(SCENE.block, tpd.Harmonic(amplitude=0.015, frequency=float(frequency)))
            own = tpd.Pendulum(mass=float(mass), length=0.12, damping_ratio=0.1)
            orbits = tpd.symmetric_orbits(scene.parameters(own))
            at = np.flatnonzero(np.asarray(orbits.status == tpd.Status.rocking))
            tilt = float(orbits.amplitude[at[0]]) / nu if at.size else np.nan
            swing = float(orbits.swing[at[0]]) if at.size else np.nan
            np.testing.assert_allclose(table.fields["tilt"][i, j], tilt, rtol=1e-12)
            np.testing.assert_allclose(table.fields["swing"][i, j], swing, rtol=1e-12)
            unstable = np.flatnonzero(np.asarray(orbits.status == tpd.Status.unstable))
            other = float(orbits.amplitude[unstable[0]]) / nu if unstable.size else np.nan
            np.testing.assert_allclose(table.fields["unstable"][i, j], other, rtol=1e-12)
            rocking += at.size > 0
    assert rocking > 3


def test_the_table_uses_housners_restitution_of_each_bob():
    block = tpd.Block(width=1.0, height=6.0, mass=9000.0)
    scene = tpd.Scene(block, tpd.Harmonic(amplitude=0.08, frequency=1.0))
    own = tpd.Pendulum(mass=900.0, length=0.5, damping_ratio=0.3)
    table = solve(scene, [axis("pendulum_mass", 100.0, 900.0, 3)], own)
    orbits = tpd.symmetric_orbits(scene.parameters(own))
    assert table.fields["tilt"][-1] == pytest.approx(float(orbits.amplitude[0]) * 6.0, rel=1e-12)


def test_the_error_is_the_sum_of_all_axes_and_next_to_a_missing_orbit_a_share_of_the_step():
    x = axis("damping", 0.0, 4.0, 5, log=False)
    y = axis("amplitude", 0.0, 2.0, 3, log=False)
    values = x.values[:, None] ** 2 + 3.0 * y.values**2
    np.testing.assert_allclose(interpolation_error(values, [x, y]), SAFETY * (0.25 + 0.75))
    x = axis("damping", 0.0, 3.0, 4, log=False)
    error = interpolation_error(np.array([1.0, 5.0, np.nan, 7.0]), [x])
    # Nothing is interpolated along this axis from the last node.
    np.testing.assert_allclose(error, [SAFETY * 1.0, SAFETY * 1.0, np.nan, 0.0])


def test_numbers_of_a_table_are_encoded_in_two_bytes():
    table = solve(SCENE, [axis("frequency", 2.0, 4.0, 6)], PENDULUM)
    out = table.encoded("tilt")
    assert out["axes"][0] == {"name": "frequency", "values": table.axes[0].values.tolist(), "log": True}
    assert out["fields"].keys() == {"tilt"}
    field, values = out["fields"]["tilt"], table.fields["tilt"]
    codes = np.frombuffer(base64.b64decode(field["data"]), "<u2")
    assert ((codes == NONE) == np.isnan(values)).all()
    known = codes != NONE
    assert known.any()
    np.testing.assert_allclose(codes[known] / (NONE - 1) * field["scale"], values[known], atol=1e-5)
    assert table.encoded()["fields"].keys() == table.fields.keys()


def table_of(width: float, height: float, amplitude: float, frequency: float) -> Table:
    """Orbits of a block over mass and length of its pendulum."""
    scene = tpd.Scene(
        tpd.Block(width=width, height=height, mass=5000.0),
        tpd.Harmonic(amplitude=amplitude, frequency=frequency),
    )
    half = 0.5 * height
    axes = axis("pendulum_mass", 50.0, 1000.0, 4), axis("pendulum_length", 0.1 * half, 1.5 * half, 8)
    return solve(scene, axes, tpd.Pendulum(mass=600.0, length=0.5, damping_ratio=0.3))


# The motion of this failure is unusually strong.
@pytest.mark.filterwarnings("ignore:.*is usually at most 2 g")
def test_no_orbit_lies_beyond_the_toppling_tilt():
    table = table_of(0.92, 3.64, 0.656, 0.88)
    assert not any((table.fields[name] >= 1.0).any() for name in ("tilt", "unstable"))


def test_every_value_of_a_table_has_an_error_estimate():
    table = table_of(1.07, 10.83, 0.291, 0.22)
    for name in ("tilt", "swing"):
        known = np.isfinite(table.fields[name])
        assert 0 < known.sum() < known.size
        assert (np.isfinite(table.fields[f"{name}_error"]) == known).all()
