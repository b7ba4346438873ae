"""Tasks of the entrance to the linear model: the same motion by each of them."""

import numpy as np
import pytest

from tests.reference import WITH, exact, parameters, settled
from tpd.compiled import linear_entry as entry
from tpd.compiled.calling import LINEAR
from tpd.compiled.columns import STEADY
from tpd.compiled.rows import row_of
from tpd.scene.parameters import as_arrays
from tpd.theory.equations import Terms


def test_the_steady_state_entry_agrees_with_a_settled_simulation():
    p, steady, limits = as_arrays(parameters(WITH[0].x)), np.zeros(1, STEADY), {"periods": 500}
    limits |= {"events": 500, "rest_rate": 2e-7, "tolerance": 1e-8, "lyapunov_periods": 100}
    row = row_of(p)[None].copy()
    entry.run(0, 1, np.array([LINEAR.settings("STEADY_STATE", **limits)]), row, np.zeros((1, 4)), steady)
    known, found = exact(WITH[0].x), settled(Terms.linear, p, np.zeros((1, 4)))
    assert float(steady["amplitude"][0]) == known.amplitude
    assert int(steady["elapsed"][0]) == int(found.elapsed[0]) == int(known.steady.elapsed)
    assert float(found.settled_tilt[0]) == pytest.approx(known.amplitude, rel=1e-7)
