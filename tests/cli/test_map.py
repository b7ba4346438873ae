"""`tpd map`: the table agrees with the library, and names are checked."""

import numpy as np

import tpd
from tpd.answers.design_map import design_map
from tpd.cli.map import _with_folds

AXES = "--x frequency 1 5 --y pendulum-length 0.05 0.2 --pendulum-mass 0.8 --points 4"


def test_map_writes_the_statuses_and_amplitudes_of_the_library(run):
    done = run("map", AXES)
    assert done.status == 0
    assert all(line.startswith("tpd: ") for line in done.err.splitlines())
    assert done.files.keys() == {"map.csv", "map.json", "amplitude.png", "swing.png", "margin.png"}
    x, y = ("frequency", np.linspace(1, 5, 4)), ("pendulum_length", np.linspace(0.05, 0.2, 4))
    pendulum = tpd.Pendulum(mass=0.8, length=0.1, damping_ratio=0.1)
    m = design_map(tpd.paper_scene(), x, y, pendulum=pendulum)
    rows = done.rows("map.csv")
    assert [row["status"] for row in rows] == list(m.status.ravel())
    np.testing.assert_array_equal([float(row["amplitude_rad"]) for row in rows], m.amplitude.ravel())
    content = done.json("map.json")
    assert content["statuses"] == m.counts
    assert content["varied"] == {"x": ["frequency", 1.0, 5.0], "y": ["pendulum_length", 0.05, 0.2]}
    assert (content["pendulum"]["mass"], content["pendulum"]["damping_ratio"]) == (0.8, 0.1)
    assert all(f"{count} {status}" in done.out for status, count in m.counts.items())
    assert "Run the command with --simulate to find out" in done.out
    assert "already contains files" in run("map", AXES).err
    again = run("map", AXES, "--overwrite", "--simulate")
    assert again.status == 0
    assert again.json("map.json")["start"] == [0.0] * 4
    assert "--simulate" not in again.out


def test_the_amplitude_map_shows_the_fold_curve():
    scene, pendulum = tpd.paper_scene(), tpd.Pendulum(mass=0.8, length=0.1, damping_ratio=0.1)
    axes = ("frequency", np.linspace(1, 5, 5)), ("amplitude", np.linspace(0.001, 0.02, 5))
    ax = _with_folds(design_map(scene, *axes, pendulum=pendulum), scene, pendulum)
    ranges = {"x_range": (1.0, 5.0), "y_range": (0.001, 0.02)}
    folds = tpd.fold_curve(scene, "frequency", "amplitude", **ranges, pendulum=pendulum)
    assert len(folds.points) > 20
    np.testing.assert_array_equal(ax.lines[-1].get_xydata(), folds.points)
    assert ax.get_ylabel().startswith("amplitude of the excitation")
