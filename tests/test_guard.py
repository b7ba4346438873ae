"""The smoothed model settles within the solver steps and periods that were last counted.

This measure of speed does not depend on the machine. Change the numbers if a change of speed is intended."""

import diffrax
import jax
import numpy as np

from tests.reference import WITH, WITHOUT, parameters
from tpd import Smoothed

COUNTS = {
    WITH[0]: (4655, 40),
    WITHOUT[1]: (2147, 20),
}
"""Steps of all solves, and periods. Half as many are rather work that is no longer counted."""


def test_a_smoothed_model_takes_no_more_steps_than_stated(monkeypatch):
    steps, solve, model = [], diffrax.diffeqsolve, Smoothed()

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
        for found, known in zip((sum(steps), periods), COUNTS[case], strict=True):
            assert 0.5 * known <= found <= 1.1 * known, case.name
