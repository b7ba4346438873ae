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
def test_the_table_is_exact_at_its_nodes(small):
    nodes = np.array(list(itertools.product(*(a.values for a in small.axes))))
    answers = look_up(small.encoded(), nodes)
    for (tilt, _), value in zip(answers, small.fields["tilt"].ravel(), strict=True):
        if np.isnan(value):
            assert (tilt["source"], tilt["value"]) == ("none", None)
        else:
            assert (tilt["source"], tilt["error"]) == ("exact", 0)
            assert tilt["value"] == pytest.approx(value, abs=2e-5)


@needs_node
def test_the_table_has_no_value_between_rocking_and_resting_nodes(small):
    values = small.fields["tilt"]
    assert 0.02 < np.isnan(values).mean() < 0.98, "the table has nodes of both kinds"
    i, j, k = next(
        index
        for index in itertools.product(*(range(n - 1) for n in values.shape))
        if np.isnan(values[index[0] : index[0] + 2, index[1] : index[1] + 2, index[2] : index[2] + 2]).sum()
        in range(1, 8)
    )
    middle = [float(np.mean(a.values[n : n + 2])) for a, n in zip(small.axes, (i, j, k), strict=True)]
    ((tilt, _),) = look_up(small.encoded(), np.array([middle]))
    assert (tilt["source"], tilt["value"]) == ("not interpolated", None)


@needs_node
def test_the_table_has_no_value_outside_its_range(small):
    inside = [float(np.sqrt(a.values[0] * a.values[-1])) for a in small.axes]
    for n, beyond in itertools.product(range(3), (0, -1)):
        point = [*inside]
        point[n] = float(small.axes[n].values[beyond]) * (0.99 if beyond == 0 else 1.01)
        ((tilt, swing),) = look_up(small.encoded(), np.array([point]))
        assert {tilt["source"], swing["source"]} == {"not interpolated"}


@needs_node
def test_interpolation_is_linear_along_each_axis():
    axes = axis("frequency", 1.0, 4.0, 3), axis("amplitude", 0.0, 2.0, 3, log=False)
    plane = np.log(axes[0].values)[:, None] + 3.0 * axes[1].values
    fields = dict.fromkeys(("tilt", "swing"), plane) | {f"{n}_error": 0.0 * plane for n in ("tilt", "swing")}
    ((tilt, _),) = look_up(Table(axes, fields).encoded(), np.array([[1.7, 0.3]]))
    assert tilt["value"] == pytest.approx(np.log(1.7) + 0.9, abs=2e-4)
