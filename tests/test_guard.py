"""The integrated models settle in no more solver steps and periods than were last counted: a measure of speed
that does not depend on the machine. Change the numbers where that is meant."""

import diffrax
import jax
import numpy as np
import pytest

from tests.reference import WITH, WITHOUT, parameters
from tests.segmented import Segmented
from tpd import Smoothed

COUNTS = {
    (Smoothed, WITH[0]): (4655, 40),
    (Smoothed, WITHOUT[1]): (2147, 20),
    (Segmented, WITH[0]): (611, 11),
    (Segmented, WITHOUT[1]): (1335, 25),
}
"""Steps of all solves, and periods. Half as many are rather work that is no longer counted."""


@pytest.mark.parametrize("kind", [Smoothed, Segmented])
def test_an_integrated_model_takes_no_more_steps_than_stated(kind, monkeypatch):
    steps, solve, model = [], diffrax.diffeqsolve, kind()

    def noted(*args, **options):
        solution = solve(*args, **options)
        jax.debug.callback(lambda n: steps.append(int(n)), solution.stats["num_steps"])
        return solution

    monkeypatch.setattr(diffrax, "diffeqsolve", noted)
    run = jax.jit(lambda x, y0: model.settle(parameters(x), y0).elapsed)
    for case in (WITH[0], WITHOUT[1]):
        steps.clear()
        periods = int(run(np.array(case.x), np.array(case.y0)))
        jax.effects_barrier()
        for found, known in zip((sum(steps), periods), COUNTS[kind, case], strict=True):
            assert 0.5 * known <= found <= 1.1 * known, case.name
