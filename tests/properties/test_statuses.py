"""Every status of a motion is reached by a scene, and its sentence says what to do."""

from collections.abc import Callable
from typing import Any

import numpy as np
import pytest

from tests.reference import LEANING, OVERTURNING, UNSTABLE, parameters
from tpd import Block, Piecewise, Record, Scene, Smoothed, Status, design_map, steady_state, symmetric_orbits
from tpd import transient as follow
from tpd.scene.status import SETTLED, names_of

PENDULUM = (0.25, 0.05, 0.2, 0.1, 0.05, 0.377, 2.67)
FOLD = 0.060961548685057224
"""f at which the two orbits of the bare block (nu .2, k .05, xi 2) merge, by `tpd.answers.bifurcations`."""
TOUCH = 0.30475055580416444
"""f at which the fall of a repelling orbit halts for a moment."""


def settled(*x: float, y0: Any = (0.0, 0.0, 0.0, 0.0), model: Any = None) -> Callable[[], Any]:
    return lambda: steady_state(parameters(x), y0=np.array(y0), model=model).status


def shaken(share: float) -> Callable[[], Any]:
    """Status of a bare block under a triangle of acceleration, in shares of what lifts it."""
    block = Block(width=0.6, height=3.0, mass=2000.0, friction=0.05, restitution=1.0)
    top = share * (block.slenderness + 0.05) * 9.80665
    return lambda: follow(Scene(block, Record(acceleration=np.array([0.0, top, 0.0]), dt=0.1))).status


def orbits(*x: float) -> Callable[[], Any]:
    return lambda: symmetric_orbits(parameters(x)).status


def mapped(*x: float) -> Callable[[], Any]:
    """Statuses in a map about the parameters."""
    axes = ("zeta", [x[3], 1.001 * x[3]]), ("f", [x[5], 1.0001 * x[5]])
    return lambda: design_map(parameters(x), *axes).status.ravel()


def just_beside(fold: float) -> Any:
    """Statuses of the orbits within rounding of their fold."""
    values = fold * (1.0 + np.array([0.5e-14, 1e-14, 2e-14, 4e-14, 8e-14]))
    rows = [names_of(orbits(0.2, 0.0, 0.4, 0.2, 0.05, float(f), 2.0, 1.0)()) for f in values]
    return next((row for row in rows if "near_fold" in row), rows[0])


REACHED: dict[str, Callable[[], Any]] = {
    "rocking": settled(*PENDULUM),
    "sticking": settled(0.278, 0.227, 1.56, 0.17, 0.173, 0.536, 8.161, 0.76),
    "rest": settled(0.2, 0.1, 0.4, 0.2, 0.03, 0.25, 4.0),
    "held": settled(*LEANING[0], y0=LEANING[1]),
    "overturned": settled(*OVERTURNING),
    "aperiodic": settled(0.088, 0.593, 1.995, 0.94, 0.024, 0.594, 5.87, 0.051),
    "not_settled": settled(*PENDULUM, model=Piecewise(max_periods=3)),
    "unstable": orbits(*UNSTABLE[0]),
    "neutral": orbits(0.2, 0.1, 0.4, 0.0, 0.0, 0.2, 3.0, 1.0),
    "near_fold": lambda: just_beside(FOLD),
    "grazing": orbits(0.155, 0.4563, 1.0546, 0.3645, 0.02616, TOUCH * (1.0 - 1e-10), 2.632, 0.8115),
    "event_bound": settled(0.2, 0.1, 0.4, 0.2, 0.03, 0.25, 4.0, model=Piecewise(max_events=3)),
    "failed": settled(0.5, 0.0, 1.0 / 0.6, 0.0, 0.05, 0.1, 1.0),
    "no_orbit": orbits(0.2, 0.1, 0.4, 0.2, 0.03, 0.02, 4.0),
    "stood": shaken(0.9),
    "rocked": shaken(1.3),
    "inexact": settled(0.2082, 0.0, 0.4, 0.4166, 0.0449, 0.2894, 2.4994, 0.3954, model=Smoothed()),
    "not_known": mapped(0.155, 0.3546, 0.608, 0.0891, 0.0442, 0.122, 1.5464, 0.8054),
}


def test_the_scenes_of_this_module_cover_all_statuses():
    assert set(REACHED) == set(names_of(np.arange(len(REACHED))))
    with pytest.raises(IndexError):
        names_of(np.array([len(REACHED)]))


@pytest.mark.parametrize("name", REACHED)
def test_every_status_is_reached_by_a_scene(name):
    found = REACHED[name]()
    names = found if isinstance(found, np.ndarray) else np.atleast_1d(names_of(found))
    assert name in names


def test_every_status_without_a_result_has_a_remedy():
    remedies = ("Start", "Change", "Evaluate", "Increase", "Move", "Add", "Run", "reduce")
    for name in REACHED:
        sentence = Status[getattr(Status, name)]
        assert sentence.endswith("."), name
        has_result = name in (*names_of(SETTLED), "stood", "rocked")
        assert has_result != any(word in sentence for word in remedies), name
