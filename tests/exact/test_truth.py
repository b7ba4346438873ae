"""The exact engine against a 50-digit evaluation of the same hybrid system (`tests.truth`)."""

import jax
import jax.numpy as jnp
import numpy as np
import pytest

from tests.reference import orbits_of, parameters
from tests.truth import load
from tpd import Piecewise, simulate, status_name, steady_state
from tpd.theory.equations import Linear

ROWS = load()
TRANSIENT = [r for r in ROWS if r["what"] == "transient"]
SETTLED = [r for r in ROWS if r["what"] == "settled"]
REACH = 1e-11

MODEL = Piecewise(max_events=4000)
FOLLOW = jax.jit(lambda x, y0, times: simulate(parameters(x), y0, times, model=MODEL))
SETTLE = jax.jit(lambda x, y0: steady_state(parameters(x), y0=y0, model=MODEL))


def named(row):
    return row["name"].replace(" ", "-")


def scales(x):
    rate = max(1.0, x[6])
    return x[0] * np.array([1.0, 1.0, rate, rate])


def test_the_table_covers_every_mode_and_kind_of_scene():
    assert len(ROWS) >= 30
    assert {m for r in ROWS for m in r["modes"]} == {"slip", "stick", "rest"}
    assert {r["parameters"][7] for r in ROWS} >= {0.0, 0.5, 0.8, 1.0}


@pytest.mark.parametrize("row", TRANSIENT, ids=named)
def test_a_transient_ends_where_fifty_digits_end(row):
    x, y0 = np.array(row["parameters"]), np.array(row["y0"])
    times = np.linspace(0.0, row["periods"] * 2.0 * np.pi / x[6], 3)
    motion = FOLLOW(x, y0, times)
    end = np.array([float(v) for v in row["end"]])
    felt = [0, 2] if x[1] == 0 else [0, 1, 2, 3]
    error = np.abs(np.asarray(motion.ys[-1]) - end) / scales(x)
    assert error[felt].max() < REACH


@pytest.mark.parametrize("row", SETTLED, ids=named)
def test_a_settled_motion_has_the_sizes_and_state_of_fifty_digits(row):
    x = np.array(row["parameters"])
    s = SETTLE(x, np.array(row["y0"]))
    assert status_name(s.status) in ("rocking", "sticking", "rest")
    assert float(s.amplitude) == pytest.approx(float(row["amplitude"]), rel=REACH)
    assert float(s.stroke) == pytest.approx(float(row["stroke"]), rel=REACH)
    end = np.array([float(v) for v in row["end"]])
    # On any of the forcing periods of its motion: on which one it is depends on how long it was followed.
    begins = np.array([0.0, *2.0 * np.pi / x[6] * np.arange(1, int(s.periods) + 1)])
    visited = simulate(parameters(x), s.state, begins).ys
    assert (np.abs(np.asarray(visited) - end) / scales(x)).max(axis=1).min() < REACH


def test_energy_stays_through_ten_thousand_crossings():
    # f = k = zeta = 0, e = 1: the linear model conserves it.
    x = (0.2, 0.3, 0.4, 0.0, 0.0, 0.0, 2.0, 1.0)
    p = parameters(x)

    @jax.jit
    def many(y0):
        def leg(y, _):
            ys = simulate(p, y, jnp.array([0.0, 5.0 * np.pi])).ys
            return ys[-1], Linear(p).energy(ys[-1], p.mu, p.lam)

        return jax.lax.scan(leg, y0, None, length=2600)[1]

    y0 = jnp.array([0.05, 0.1, 0.0, 0.0])
    energy = np.asarray(many(y0)) / float(Linear(p).energy(y0, p.mu, p.lam)) - 1.0
    signs = np.sign(np.asarray(simulate(p, y0, jnp.linspace(0.0, 100.0, 4001)).ys[:, 0]))
    crossings = np.sum(np.diff(signs) != 0) * 2600 * 5.0 * np.pi / 100.0
    assert crossings > 1e4
    assert np.abs(energy).max() < 1e-11
    trend = np.polyfit(np.arange(energy.size), energy, 1)[0] * energy.size
    assert abs(trend) < 1e-11


def test_orbits_of_the_scalar_equation_are_those_of_fifty_digits():
    checked = 0
    for row in SETTLED:
        orbits = orbits_of(parameters(row["parameters"]))
        if status_name(jax.tree.map(lambda v: v[0], orbits.status)) != "rocking":
            continue
        error = abs(float(orbits.amplitude[0]) / max(float(row["amplitude"]), 1e-300) - 1.0)
        if row["periods"] == 1 and error < 1e-3:
            checked += 1
            assert error < REACH
            stroke = float(row["stroke"])
            assert float(orbits.stroke[0]) == pytest.approx(stroke, rel=REACH)
    assert checked >= 8
