"""Interpolation of the page: exact on nodes, within its bound between them, and no value between kinds."""

import itertools

import numpy as np
import pytest

import tpd
from tests.browser.node import needs_node, run
from tpd.compiled.orbits import solve_orbits
from tpd.compiled.rows import row_of
from tpd.explore.content import content
from tpd.explore.tables import Table, axis, solve
from tpd.scene.parameters import Parameters
from tpd.scene.scene import dimensionless

CHIMNEY = tpd.Scene(
    tpd.Block(width=1.3, height=10.0, mass=16280.0, radius_of_gyration=2.92, cavity_width=0.9),
    tpd.Harmonic(amplitude=0.081, frequency=0.85),
)
SCENES = {"chimney": CHIMNEY, "paper": tpd.paper_scene()}
HOLDS = 0.985
"""Least share of random points at which the bound of the error holds."""
LOOK_UP = """({ table, points }) => {
  const decoded = decode(table);
  return points.map((point) => ["tilt", "swing"].map((name) => lookUp(decoded, name, place(decoded, point))));
}"""


def look_up(table: dict, points: np.ndarray) -> list:
    """Tilt and bob angle of the page at points (n, axes)."""
    inputs = {"table": table, "points": np.asarray(points).tolist()}
    return run("orbits", "decode, place, lookUp", LOOK_UP, inputs)


def exact(scene: tpd.Scene, names: list[str], points: np.ndarray) -> np.ndarray:
    """Tilt over nu and bob angle of the attracting orbits at points, (n, 2), NaN without one."""
    start = tpd.Pendulum(mass=0.1 * float(scene.block.mass), length=0.1, damping_ratio=0.1)
    values = scene.quantities(start) | dict(zip(names, points.T, strict=True))
    orbits = solve_orbits(row_of(Parameters(**dimensionless(values))))
    out = np.full((len(points), 2), np.nan)
    for i, row in enumerate(orbits):
        first = next((o for o in row if o["status"] == 0), None)
        if first is not None:
            out[i] = first["sizes"][0] / float(scene.block.slenderness), first["sizes"][3]
    return out


@needs_node
@pytest.mark.parametrize("name", SCENES)
def test_the_interpolation_error_is_within_its_estimate(name):
    scene, rng = SCENES[name], np.random.default_rng(0)
    table = content(scene)["tables"]["grid"]
    axes = table["axes"]
    shares = rng.uniform(size=(len(axes), 1500))
    ends = [(a["values"][0], a["values"][-1], a["log"]) for a in axes]
    points = np.stack(
        [
            low * (high / low) ** x if log else low + (high - low) * x
            for x, (low, high, log) in zip(shares, ends, strict=True)
        ],
        axis=1,
    )
    truth = exact(scene, [a["name"] for a in axes], points)
    answers = look_up(table, points)
    kinds = np.array([tilt["source"] for tilt, _ in answers])
    assert set(kinds) <= {"interpolated", "none", "not interpolated"}
    assert np.mean(kinds == "interpolated") > 0.65
    # An interpolated orbit exists, apart from a narrow tongue between two nodes.
    assert np.mean(np.isnan(truth[kinds == "interpolated", 0])) < 0.005
    at = np.flatnonzero((kinds == "interpolated") & np.isfinite(truth[:, 0]))
    value, bound = (
        np.array([[quantity[key] for quantity in answers[i]] for i in at], dtype=float)
        for key in ("value", "error")
    )
    error, rounding = np.abs(value - truth[at]), 2e-5 * np.nanmax(truth, axis=0)
    assert np.isfinite(bound).all()
    assert (np.mean(error <= bound + rounding, axis=0) > HOLDS).all()
    # A large bound would hold always and say nothing.
    assert (np.median(bound, axis=0) < (0.005, 0.02)).all()
    assert (np.quantile(error[:, 0], [0.5, 0.99, 1.0]) < (1e-3, 0.01, 0.05)).all()


@pytest.fixture(scope="module")
def small() -> Table:
    """A table of the chimney in which some nodes have no attracting orbit."""
    axes = (
        axis("pendulum_length", 0.3, 2.0, 5),
        axis("frequency", 0.3, 1.2, 9),
        axis("amplitude", 0.02, 0.12, 4, log=False),
    )
    return solve(CHIMNEY, axes, tpd.Pendulum(mass=600.0, length=0.5, damping_ratio=0.3))


@needs_node
def test_the_table_is_exact_at_its_nodes_and_has_no_value_between_kinds_or_outside(small):
    nodes, values = np.array(list(itertools.product(*(a.values for a in small.axes)))), small.fields["tilt"]
    assert 0.02 < np.isnan(values).mean() < 0.98, "the table has nodes of both kinds"
    for (tilt, _), value in zip(look_up(small.encoded(), nodes), values.ravel(), strict=True):
        if np.isnan(value):
            assert (tilt["source"], tilt["value"]) == ("none", None)
        else:
            assert (tilt["source"], tilt["error"]) == ("exact", 0)
            assert tilt["value"] == pytest.approx(value, abs=2e-5)
    # The middle of a cell with nodes of both kinds, and places just outside of each end.
    cells = itertools.product(*(range(n - 1) for n in values.shape))
    kinds = {c: np.isnan(values[tuple(slice(n, n + 2) for n in c)]).sum() for c in cells}
    mixed = next(cell for cell, count in kinds.items() if 0 < count < 8)
    points = [[float(np.mean(a.values[n : n + 2])) for a, n in zip(small.axes, mixed, strict=True)]]
    inside = [float(np.sqrt(a.values[0] * a.values[-1])) for a in small.axes]
    for n, (end, factor) in itertools.product(range(3), ((0, 0.99), (-1, 1.01))):
        points.append([*inside[:n], float(small.axes[n].values[end]) * factor, *inside[n + 1 :]])
    for tilt, swing in look_up(small.encoded(), np.array(points)):
        assert {tilt["source"], swing["source"]} == {"not interpolated"}
        assert tilt["value"] is None


@needs_node
def test_interpolation_is_linear_along_each_axis():
    axes = axis("frequency", 1.0, 4.0, 3), axis("amplitude", 0.0, 2.0, 3, log=False)
    plane = np.log(axes[0].values)[:, None] + 3.0 * axes[1].values
    fields = dict.fromkeys(("tilt", "swing"), plane) | {f"{n}_error": 0.0 * plane for n in ("tilt", "swing")}
    ((tilt, _),) = look_up(Table(axes, fields).encoded(), np.array([[1.7, 0.3]]))
    assert tilt["value"] == pytest.approx(np.log(1.7) + 0.9, abs=2e-4)
