"""The table of trials."""

import numpy as np

from tpd.design.trials import Trials


def test_the_best_trial_without_a_limit_keeps_the_others():
    sizes = np.array([[0.9, 1.2], [0.8, 1.1], [1.3, 0.5], [0.7, np.nan]])
    value = np.array([0.3, 0.2, 0.1, 0.05])
    none = np.zeros(4, int)
    trials = Trials(
        designs=np.ones((4, 3)),
        value=value,
        trend=value,
        names=("stroke", "clearance"),
        sizes=sizes,
        overturned=0.0 * value,
        undecided=none,
        feasible=none > 0,
        without_pendulum=0.4,
        risk=None,
    )
    assert trials.best_without() is None
    assert trials.best_without("clearance") == 3
    assert trials.best_without("stroke") == 2
