"""The class `Record`: its checks, sizes and scales, and JAX."""

from __future__ import annotations

import jax
import jax.numpy as jnp
import numpy as np
import pytest

from tpd import Record

TRIANGLE = [0.0, 1.0, 0.0, -2.0, 0.0]


def test_peaks_and_duration_of_a_record_equal_a_hand_calculation():
    record = Record(TRIANGLE, 0.1)
    assert record.pga == 2.0
    # From rest: 0.05, 0.1, 0.0, -0.1 m/s by trapezoids.
    assert record.pgv == pytest.approx(0.1, rel=1e-15)
    assert record.duration == pytest.approx(0.4, rel=1e-15)
    assert (record.scale, record.name, record.event, record.notes) == (1.0, "", "", ())


def test_a_scaled_record_has_the_scaled_peaks_and_its_name():
    record = Record(TRIANGLE, 0.1, name="a", event="b", notes=("c",))
    twice = record.scaled(2)
    assert twice.pga == 4.0
    assert twice.pgv == pytest.approx(0.2, rel=1e-15)
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
    assert Record(TRIANGLE, 0.1) == Record(np.array(TRIANGLE), 0.1)
    assert Record(TRIANGLE, 0.1) != Record(TRIANGLE, 0.2)
    assert Record(TRIANGLE, 0.1) != Record(TRIANGLE, 0.1, event="b")
    assert Record(TRIANGLE, 0.1) != Record(TRIANGLE[:-1], 0.1)
    assert Record(TRIANGLE, 0.1) != "a record"
    assert len({Record(TRIANGLE, 0.1), Record(TRIANGLE, 0.1)}) == 1


WRONG = {
    "one sample": (lambda: Record([1.0], 0.1), "an array of at least two accelerations"),
    "a table": (lambda: Record([[1.0, 2.0]], 0.1), "an array of at least two accelerations"),
    "nan": (lambda: Record([1.0, float("nan")], 0.1), "all finite"),
    "words": (lambda: Record(["a", "b"], 0.1), "all finite"),
    "negative step": (lambda: Record(TRIANGLE, -0.1), "`dt` must be between 1e-06 and 1000 s"),
    "a text for a step": (lambda: Record(TRIANGLE, "0.1"), "`dt` must be a number"),
    "cm/s^2": (lambda: Record([0.0, 312.0], 0.1), "at most 100 m/s.2 at its peak, but is 312 .* cm/s"),
    "a great scale": (lambda: Record(TRIANGLE, 0.1).scaled(100.0), "at most 100 m/s.2 at its peak"),
    "scale": (lambda: Record(TRIANGLE, 0.1, scale=float("inf")), "`scale` must be"),
    "name": (lambda: Record(TRIANGLE, 0.1, name=3), "name"),
    "notes": (lambda: Record(TRIANGLE, 0.1, notes=("a", 3)), "notes"),
    "no peak": (lambda: Record(TRIANGLE, 0.1).scaled_to(), "exactly one of `pga` and `pga_g`"),
    "negative peak": (lambda: Record(TRIANGLE, 0.1).scaled_to(pga=-1.0), "`pga` must be positive"),
}


@pytest.mark.parametrize("make", WRONG)
def test_invalid_samples_steps_and_scales_are_rejected(make):
    call, message = WRONG[make]
    # The checker of types of the tests may speak first where a word stands for a tuple or a number.
    with pytest.raises((ValueError, TypeError), match=message):
        call()


def test_a_record_is_a_pytree_of_its_numbers():
    record = Record(TRIANGLE, 0.1, name="a", event="b", notes=("c", "d"))
    assert len(jax.tree.leaves(record)) == 3
    again = jax.tree.map(lambda x: 2.0 * x, record)
    assert (again.name, again.event, again.notes) == ("a", "b", ("c", "d"))
    assert (again.dt, again.scale) == (0.2, 2.0)
    paths = [jax.tree_util.keystr(path) for path, _ in jax.tree_util.tree_leaves_with_path(record)]
    assert paths == [".acceleration", ".dt", ".scale"]


def test_a_record_supports_jit_grad_and_vmap():
    record = Record(TRIANGLE, 0.1)
    assert jax.jit(lambda r: r.pgv)(record) == pytest.approx(record.pgv, rel=1e-15)
    slopes = jax.grad(lambda r: r.scaled(3.0).pga)(record)
    np.testing.assert_allclose(slopes.acceleration, [0.0, 0.0, 0.0, -3.0, 0.0])
    assert slopes.scale == pytest.approx(6.0)
    scaled = jax.vmap(lambda pga: record.scaled_to(pga=pga).pga)(jnp.array([1.0, 3.0]))
    np.testing.assert_allclose(scaled, [1.0, 3.0], rtol=1e-15)
    made = jax.jit(lambda a: Record(a, 0.1).duration)(jnp.array(TRIANGLE))
    assert made == pytest.approx(0.4, rel=1e-15)


def test_a_tilde_in_the_path_of_a_record_is_the_home_folder(tmp_path, monkeypatch):
    monkeypatch.setenv("HOME", str(tmp_path))
    (tmp_path / "a.csv").write_text(
        "time (s),acc (m/s2)\n" + "".join(f"{0.01 * i:.2f},{i % 5}\n" for i in range(50))
    )
    assert Record.read("~/a.csv") == Record.read_all("~/a.csv")[0] == Record.read(tmp_path / "a.csv")


def test_the_peak_velocity_between_two_samples_has_a_gradient():
    record = Record([0.0, 1.2, -0.8, 0.0], 0.02)
    assert record.pgv == pytest.approx(0.0192, rel=1e-12)
    gradient = jax.grad(lambda r: r.pgv)(record)
    # Compare with differences.
    for i, slope in enumerate(gradient.acceleration):
        step = 1e-6 * np.eye(4)[i]
        high, low = (Record(record.acceleration + s, 0.02).pgv for s in (step, -step))
        assert slope == pytest.approx((high - low) / 2e-6, rel=1e-6, abs=1e-9)
