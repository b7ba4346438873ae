"""Periodic orbits of any sequence of events, against simulation, known answers and differences."""

from __future__ import annotations

import functools
from typing import Any, NamedTuple

import equinox as eqx
import jax
import jax.numpy as jnp
import numpy as np
import pytest

from tests.compiled.orbit_cases import chosen, felt
from tests.reference import UNSTABLE, WITHOUT, along, differences, parameters
from tpd import status_name
from tpd.answers.periodic_orbit import PeriodicOrbit, periodic_orbit


class Scene(NamedTuple):
    """Parameters, a state near a periodic orbit, and what is to be found there."""

    name: str
    x: tuple[float, ...]
    near: tuple[float, ...]
    periods: int
    symmetric: bool
    status: str


def scene(name: str, numbers: str, kind: str) -> Scene:
    x, start = (tuple(map(float, part.split())) for part in numbers.split("|"))
    periods, mirrored, status = kind.split()
    return Scene(name, x, start, int(periods), mirrored == "mirrored", status)


TABLE = """
mirrored, period one
0.25 0.1 0.15 0.3 0.05 0.377 2.67 1.0 | 0.02341 0.37348 0.18303 -1.33012
1 mirrored rocking
period three with turns in the air
0.27 0.24 0.34 0.25 0.06 0.35 3.08 1.0 | -0.09945 0.34152 0.08349 -0.10177
3 mirrored rocking
period three, lopsided, bare
0.3 0.0 0.89 0.1 0.05 0.41 3.18 0.98 | -0.14769 0.55543 0.10184 0.66326
3 lopsided rocking
plastic, period two
0.23 0.28 0.11 0.24 0.05 0.44 2.4 0.0 | 0.06651 -0.34954 0.15438 1.07358
2 lopsided sticking
plastic, stuck in the air
0.19 0.09 0.57 0.3 0.04 0.25 1.74 0.0 | 0.00103 -0.32788 -0.01066 -0.25904
1 mirrored sticking
stuck between hops
0.18 0.0 0.55 0.05 0.03 0.23 2.33 0.77 | -0.0003 0.02051 -0.00683 -0.25332
1 mirrored sticking
rattling to rest
0.24 0.11 0.18 0.06 0.05 0.17 2.84 0.56 | 0.00012 -1.31521 0.00034 -0.92075
1 mirrored sticking
""".strip().splitlines()
"""Parameters by random search; the states are simulated ones after the transient, five digits."""
*SCENES, RATTLING = (scene(*TABLE[i : i + 3]) for i in range(0, len(TABLE), 3))
ALL = (*SCENES, RATTLING)


class Answer(NamedTuple):
    """An orbit, and the derivatives of (amplitude, swing, state) in all parameters."""

    orbit: PeriodicOrbit
    slopes: np.ndarray


def at(x: Any) -> Any:
    """Parameters as arrays, so that e may be varied about 1."""
    return eqx.tree_at(lambda p: p.e, parameters((*x[:7], 1.0)), float(x[7]))


def near(x: Any, y0: Any, periods: int = 1, max_events: int = 2000) -> PeriodicOrbit:
    return periodic_orbit(at(x), np.asarray(y0, dtype=float), periods=periods, max_events=max_events)


def sizes(o: PeriodicOrbit) -> jax.Array:
    return jnp.concatenate([jnp.stack([o.amplitude, o.swing]), o.state])


@functools.partial(jax.jit, static_argnums=2)
def _carried(x: jax.Array, state: jax.Array, periods: int) -> tuple[jax.Array, PeriodicOrbit]:
    def here(x: jax.Array) -> tuple[jax.Array, PeriodicOrbit]:
        o = periodic_orbit(parameters(x), state, periods=periods)
        return sizes(o), o

    return jax.jacfwd(here, has_aux=True)(x)


def carried(x: Any, orbit: PeriodicOrbit) -> Answer:
    slopes, o = _carried(jnp.asarray(x), orbit.state, int(orbit.periods))
    return Answer(o, np.asarray(slopes))


@functools.cache
def found(scene: Scene) -> Answer:
    """The orbit of a scene from its rough state, and derivatives."""
    return carried(scene.x, near(scene.x, scene.near, scene.periods))


def spectrum(multipliers: Any) -> np.ndarray:
    """In an order in which two of them can be compared, small ones left out."""
    m = np.asarray(multipliers)
    return np.sort_complex(np.where(np.abs(m) < 1e-4, 0.0, np.round(m.real, 12) + 1j * np.abs(m.imag)))


@pytest.mark.parametrize("scene", ALL, ids=lambda s: s.name)
def test_an_orbit_has_its_known_status_period_and_symmetry(scene: Scene) -> None:
    orbit = found(scene).orbit
    assert status_name(orbit.status) == scene.status
    assert bool(orbit.symmetric) == scene.symmetric
    assert int(orbit.periods) == scene.periods
    # Over twice its periods the same orbit closes as well, and is said to have the fewest.
    twice = near(scene.x, scene.near, 2 * scene.periods)
    assert int(twice.periods) == scene.periods
    np.testing.assert_allclose(twice.state, orbit.state, rtol=0.0, atol=1e-12)


@pytest.mark.parametrize("scene", ALL, ids=lambda s: s.name)
def test_a_simulation_from_the_orbit_closes_with_its_multipliers(scene: Scene) -> None:
    orbit, period = found(scene).orbit, np.linspace(0.0, 1.0, 361) * scene.periods * 2.0 * np.pi / scene.x[6]
    ys, slopes, _ = along(scene.x, orbit.state, period)
    np.testing.assert_allclose(ys[-1], orbit.state, rtol=0.0, atol=2e-12)
    largest = np.max(np.abs(ys), axis=0)
    for size, seen in ((orbit.amplitude, largest[0]), (orbit.swing, largest[1])):
        assert (1.0 - 2e-3) * float(size) < seen < (1.0 + 1e-9) * float(size)
    _, other, _ = along(scene.x, ys[137], period[137] + period)
    # Rounding of the tilt moves hops of 1e-6 by 1e-10, and the multipliers of the rattle with them.
    atol = 1e-7 if scene is RATTLING else 1e-8
    for by in (slopes[-1], other[-1]):
        expected = spectrum(np.linalg.eigvals(felt(np.array(scene.x), by)))
        np.testing.assert_allclose(spectrum(orbit.multipliers), expected, rtol=0, atol=atol)


@pytest.mark.parametrize("scene", SCENES, ids=lambda s: s.name)
def test_derivatives_of_an_orbit_equal_finite_differences(scene: Scene) -> None:
    answer = found(scene)
    assert np.all(np.isfinite(answer.slopes))

    def size(x: np.ndarray) -> np.ndarray:
        o = periodic_orbit(at(x), answer.orbit.state, periods=int(answer.orbit.periods))
        assert status_name(o.status) == status_name(answer.orbit.status)
        return np.asarray(sizes(o))

    # One design parameter and one of the shaking of each; all of the first scene.
    every = np.flatnonzero(np.array(scene.x) > 0.0)
    for i in every if scene is SCENES[0] else every[[1, -2]]:
        slope = differences(size, scene.x, int(i), share=1e-4)
        scale = 1e-7 * max(1.0, float(np.max(np.abs(slope))))
        np.testing.assert_allclose(answer.slopes[:, i], slope, rtol=1e-6, atol=scale)


@functools.cache
def without() -> PeriodicOrbit:
    """The attracting orbit of the bare block at xi = 1.5, whose branch loses symmetry near 1.0443."""
    return near((*WITHOUT[0].x, 1.0), (0.06571, 0.00324, 0.1113, -0.85042))


def moved(orbit: PeriodicOrbit, x: Any, i: int, stops: Any) -> PeriodicOrbit:
    x = np.array(x, dtype=float)
    for x[i] in stops:
        orbit = periodic_orbit(at(x), orbit.state, periods=int(orbit.periods))
    return orbit


def test_continuation_follows_an_orbit_after_it_becomes_unstable() -> None:
    x, amplitude, half = (*UNSTABLE[0], 1.0), *UNSTABLE[1:]
    before = moved(without(), x, 6, np.linspace(1.5, 1.05, 10))
    assert status_name(before.status) == "rocking"
    after = moved(before, x, 6, (1.04,))
    assert status_name(after.status) == "unstable"
    assert float(before.fold) * float(after.fold) < 0.0
    end = moved(after, x, 6, (1.02, 1.0))
    assert status_name(end.status) == "unstable"
    assert bool(end.symmetric)
    assert float(end.amplitude) == pytest.approx(amplitude, abs=5e-7)
    assert np.max(np.abs(end.multipliers)) == pytest.approx(half**2, rel=1e-3)
    answer = carried(x, end)
    slope = differences(
        lambda x: np.asarray(sizes(periodic_orbit(at(x), end.state, periods=int(end.periods)))),
        x,
        6,
        share=1e-3,
    )
    np.testing.assert_allclose(answer.slopes[:, 6], slope, rtol=1e-7, atol=1e-7)
    back = moved(end, x, 6, np.linspace(1.0, 1.5, 12))
    np.testing.assert_allclose(back.state, without().state, rtol=0.0, atol=1e-13)


def test_a_fold_has_a_status_and_no_derivative() -> None:
    """Followed down in f until the orbit is gone: next to its end the status says so, the fold's margin
    vanishes, and there are no derivatives."""
    x, orbit, step = np.array((*WITHOUT[0].x, 1.0)), without(), 0.01
    while step > 1e-15:
        onward = moved(orbit, x, 5, (x[5] - step,))
        near_by = abs(float(onward.amplitude) - float(orbit.amplitude)) < 0.01
        orbit, x[5], step = (onward, x[5] - step, step) if near_by else (orbit, x[5], 0.25 * step)
    # In the last digits before the fold rounding decides on which side, and whether, Newton's method ends.
    ends = [np.array((*x[:5], x[5] + more, *x[6:])) for more in np.linspace(0.0, 4e-14, 41)]
    answers = [carried(end, moved(orbit, end, 5, (end[5],))) for end in ends]
    answer = next(a for a in answers if status_name(a.orbit.status) == "near_fold")
    assert abs(float(answer.orbit.fold)) < 1e-5
    assert np.isfinite(float(answer.orbit.amplitude))
    assert np.all(np.isnan(answer.slopes))


NOT_THERE = {
    "rest": ((0.2, 0.1, 0.4, 0.2, 0.03, 0.05, 4.0, 1.0), (0.0, 0.0, 0.0, 0.0)),
    "overturned": ((0.2, 0.1, 0.4, 0.2, 0.03, 0.25, 4.0, 1.0), (5.0, 0.0, 0.0, 0.0)),
    "event_bound": ((0.2, 0.0, 0.4, 0.2, 0.0, 0.05, 4.0, 1.0), (1e-5, 0.0, 0.0, 0.0)),
    "no_orbit": (SCENES[2].x, SCENES[2].near),
}


@pytest.mark.parametrize("status", NOT_THERE)
def test_a_missing_orbit_has_a_status_with_the_reason(status: str) -> None:
    x, y0 = NOT_THERE[status]
    orbit = near(x, y0, max_events=32)
    assert status_name(orbit.status) == status
    size = {"rest": 0.0, "overturned": np.inf}.get(status, np.nan)
    np.testing.assert_equal(float(orbit.amplitude), size)
    assert np.all(np.isfinite(orbit.state)) == (status == "rest")


@pytest.mark.parametrize(
    ("name", "value", "said"),
    [
        ("periods", 0, "must be a whole number, 1 or more, but is 0"),
        ("max_events", 0, "must be a whole number, 1 or more, but is 0"),
        ("rest_rate", 0.0, "must be positive"),
    ],
)
def test_arguments_out_of_range_are_rejected(name: str, value: float, said: str) -> None:
    with pytest.raises(ValueError, match=f"`{name}` {said}"):
        periodic_orbit(parameters(SCENES[0].x), np.zeros(4), **{name: value})


def test_an_orbit_under_jit_equals_the_orbit_of_plain_numbers() -> None:
    scene = SCENES[3]
    x, y0 = jnp.array(scene.x), np.array(scene.near)

    def answer(x: jax.Array) -> PeriodicOrbit:
        return periodic_orbit(parameters(x), y0, periods=scene.periods)

    on_host = periodic_orbit(at(scene.x), y0, periods=scene.periods)
    for one, other in zip(jax.tree.leaves(on_host), jax.tree.leaves(jax.jit(answer)(x)), strict=True):
        assert one.dtype == other.dtype
        np.testing.assert_allclose(one, other, rtol=1e-12, atol=1e-13)
    batch = jax.jit(jax.vmap(jax.value_and_grad(lambda x: answer(x).swing)))
    for value, slopes in zip(*batch(jnp.stack([x, x])), strict=True):
        assert float(value) == pytest.approx(float(on_host.swing), rel=1e-12)
        np.testing.assert_allclose(slopes, found(scene).slopes[1], rtol=1e-9)


@pytest.mark.parametrize("kind", ["rocking", "unstable"])
def test_symmetric_orbits_are_periodic_orbits(kind: str) -> None:
    same = np.array([0, 2, 3, 4, 5])
    for x, one in chosen(3, kind):
        answer = carried(x, near(x, one.state))
        assert status_name(answer.orbit.status) == kind
        np.testing.assert_allclose(answer.orbit.amplitude, one.amplitude, rtol=1e-11)
        expected = spectrum(one.multipliers)
        np.testing.assert_allclose(spectrum(answer.orbit.multipliers), expected, rtol=1e-8, atol=1e-8)
        scale = 1e-8 * np.max(np.abs(one.slopes))
        np.testing.assert_allclose(answer.slopes[same], one.slopes[same], rtol=1e-8, atol=scale)
