"""The class `Record`: its checks, sizes and scales, and JAX."""

from __future__ import annotations

import math

import jax
import jax.numpy as jnp
import numpy as np
import pytest

import tpd
from tpd import Record

TRIANGLE = [0.0, 1.0, 0.0, -2.0, 0.0]


def test_a_scaled_record_has_the_scaled_peaks_and_its_name():
    record = Record(TRIANGLE, 0.1, name="a", event="b", notes=("c",))
    twice = record.scaled(2)
    # From rest: 0.05, 0.1, 0.0, -0.1 m/s by trapezoids.
    assert (record.pga, record.pgv, record.duration) == pytest.approx((2.0, 0.1, 0.4), rel=1e-15)
    assert (twice.pga, twice.pgv, twice.duration) == pytest.approx((4.0, 0.2, 0.4), rel=1e-15)
    assert (twice.name, twice.event, twice.notes) == ("a", "b", ("c",))
    assert record.scaled(-0.5).pga == 1.0
    assert record.scaled_to(pga=3.0).pga == pytest.approx(3.0, rel=1e-15)
    assert twice.scaled_to(pga_g=0.4).pga == pytest.approx(0.4 * 9.80665, rel=1e-15)
    assert Record([0, 0], 1).pga == 0.0


def test_the_pieces_of_a_record_are_straight_lines_divided_by_the_peak():
    lines = [[0.0, 0.5, 0, 0], [0.5, -0.5, 0, 0], [0.0, -1.0, 0, 0], [-1.0, 1.0, 0, 0]]
    np.testing.assert_allclose(Record(TRIANGLE, 0.1, scale=3.0).pieces(), lines)
    np.testing.assert_allclose(Record(TRIANGLE, 0.1, scale=-0.5).pieces(), -np.array(lines))
    assert not np.any(Record([0.0, 0.0], 0.1).pieces())


def test_the_samples_of_a_record_are_a_read_only_copy():
    given = np.array(TRIANGLE)
    record = Record(given, 0.1)
    given[0] = 7.0
    assert record.acceleration[0] == 0.0
    with pytest.raises(ValueError, match="read-only"):
        record.acceleration[0] = 1.0


def test_records_are_equal_if_all_fields_are_equal():
    assert Record(TRIANGLE, 0.1).notes == ()
    assert Record(TRIANGLE, 0.1) == Record(np.array(TRIANGLE), 0.1)
    assert Record(TRIANGLE, 0.1) != Record(TRIANGLE, 0.2)
    assert Record(TRIANGLE, 0.1) != Record(TRIANGLE, 0.1, event="b")
    assert Record(TRIANGLE, 0.1) != Record(TRIANGLE[:-1], 0.1)
    assert Record(TRIANGLE, 0.1) != "a record"
    assert len({Record(TRIANGLE, 0.1), Record(TRIANGLE, 0.1)}) == 1


def test_invalid_samples_steps_and_scales_are_rejected():
    for call, message in (
        (lambda: Record([1.0], 0.1), "an array of at least two accelerations"),
        (lambda: Record([[1.0, 2.0]], 0.1), "an array of at least two accelerations"),
        (lambda: Record(["a", "b"], 0.1), "all finite"),
        (lambda: Record(TRIANGLE, -0.1), "`dt` must be between 1e-06 and 1000 s"),
        (lambda: Record(TRIANGLE, "0.1"), "`dt` must be a number"),
        (lambda: Record([0.0, 312.0], 0.1), "at most 100, the largest plausible .* is 312"),
        (lambda: Record(TRIANGLE, 0.1).scaled(100.0), "at most 100, the largest plausible peak"),
        (lambda: Record(TRIANGLE, 0.1, scale=float("inf")), "`scale` must be"),
        (lambda: Record(TRIANGLE, 0.1, notes=("a", 3)), "notes"),
        (lambda: Record(TRIANGLE, 0.1).scaled_to(), "exactly one of `pga` and `pga_g`"),
        (lambda: Record(TRIANGLE, 0.1).scaled_to(pga=-1.0), "`pga` must be positive"),
    ):
        # The checker of types of the tests may speak first where a word stands for a tuple or a number.
        with pytest.raises((ValueError, TypeError), match=message):
            call()


def test_a_record_supports_jit_grad_and_vmap():
    record = Record(TRIANGLE, 0.1, name="a", event="b", notes=("c", "d"))
    again = jax.tree.map(lambda x: 2.0 * x, record)
    assert (again.name, again.event, again.notes, again.dt, again.scale) == ("a", "b", ("c", "d"), 0.2, 2.0)
    assert jax.jit(lambda r: r.pgv)(record) == pytest.approx(record.pgv, rel=1e-15)
    slopes = jax.grad(lambda r: r.scaled(3.0).pga)(record)
    np.testing.assert_allclose(slopes.acceleration, [0.0, 0.0, 0.0, -3.0, 0.0])
    assert slopes.scale == pytest.approx(6.0)
    scaled = jax.vmap(lambda pga: record.scaled_to(pga=pga).pga)(jnp.array([1.0, 3.0]))
    np.testing.assert_allclose(scaled, [1.0, 3.0], rtol=1e-15)
    made = jax.jit(lambda a: Record(a, 0.1).duration)(jnp.array(TRIANGLE))
    assert made == pytest.approx(0.4, rel=1e-15)


def test_the_peak_velocity_between_two_samples_has_a_gradient():
    record = Record([0.0, 1.2, -0.8, 0.0], 0.02)
    assert record.pgv == pytest.approx(0.0192, rel=1e-12)
    gradient = jax.grad(lambda r: r.pgv)(record)
    # Compare with differences.
    for i, slope in enumerate(gradient.acceleration):
        step = 1e-6 * np.eye(4)[i]
        high, low = (Record(record.acceleration + s, 0.02).pgv for s in (step, -step))
        assert slope == pytest.approx((high - low) / 2e-6, rel=1e-6, abs=1e-9)


@pytest.mark.parametrize(("period", "damping"), [(0.5, 0.05), (2.0, 0.2)])
def test_a_building_amplifies_a_long_sine_as_an_oscillator_does(period, damping):
    times = np.arange(20_000) * 0.002
    ground = tpd.Record(np.sin(2.0 * np.pi * times), 0.002).scaled(3.0)
    roof = ground.on_building(period, damping)
    # Transmissibility of an oscillator; the last seconds are a steady state.
    r = period
    expected = math.sqrt((1.0 + (2.0 * damping * r) ** 2) / ((1.0 - r**2) ** 2 + (2.0 * damping * r) ** 2))
    steady = roof.acceleration_at(times[15_000:])
    assert np.abs(steady).max() == pytest.approx(3.0 * expected, rel=2e-4)
    # The record ends at rest, and intensities are those of the ground.
    assert np.abs(roof.acceleration[-5:]).max() < 0.02 * np.abs(roof.acceleration).max()
    assert float(roof.at_ground.pga) == float(ground.pga)
    assert float(roof.scaled_to(pga=1.0).at_ground.pga) == pytest.approx(1.0)
    with pytest.raises(ValueError, match="must be one of the ground"):
        roof.on_building(1.0)


def test_a_stiff_building_gives_the_motion_of_the_ground():
    ground = tpd.records.el_centro()
    roof = ground.on_building(0.01, 0.05)
    times = np.arange(2000) * 0.01
    error = roof.acceleration_at(times) - ground.acceleration_at(times)
    assert np.abs(error).max() < 0.02 * float(ground.pga)
