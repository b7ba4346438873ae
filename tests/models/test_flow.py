"""Comparison of a smoothed steady state with the exact one."""

import jax
import jax.numpy as jnp
import numpy as np
import pytest

from tpd import Status
from tpd.compiled.simulate import Run, SteadyNumbers
from tpd.models.flow import _compare
from tpd.scene.status import index_of, names_of


def compared(answer, exact):
    """Name of the status, and relative error, of two motions (status, amplitude): smoothed and exact."""
    of, other = ((index_of(name), jnp.asarray(amplitude)) for name, amplitude in (answer, exact))
    none = jnp.zeros(())
    judged = SteadyNumbers(of[1], none, of[0], 1, none, False, none, jnp.zeros(4), 0)
    status = jax.tree.unflatten(jax.tree.structure(Status.failed), [jnp.asarray(other[0])])
    angles, one = (none, other[1], *4 * (none,)), jnp.asarray(1)
    settled = Run(*angles, jnp.zeros(4), status, one, one)
    found = _compare(judged, settled)
    return str(names_of(found.status)), float(found.estimate)


@pytest.mark.parametrize(
    ("answer", "exact", "expected", "error"),
    [
        (("rocking", 0.104), ("rocking", 0.1), "rocking", 0.04),
        (("rocking", 0.106), ("rocking", 0.1), "inexact", 0.06),
        (("rocking", 0.1), ("sticking", 0.05), "inexact", 1.0),
        (("rocking", 0.1), ("rest", 0.0), "inexact", np.inf),
        (("rocking", 0.1), ("overturned", 0.7), "inexact", 1.0),
        (("rest", 0.0), ("rest", 0.0), "rest", 0.0),
        (("rest", 0.0), ("sticking", 0.01), "inexact", 1.0),
        (("overturned", np.inf), ("overturned", 0.7), "overturned", 0.0),
        (("overturned", np.inf), ("rocking", 0.1), "inexact", np.inf),
        # Of a motion that has not settled, the amplitude says nothing.
        (("rocking", 0.1), ("not_settled", 0.2), "rocking", np.nan),
        (("rocking", 0.1), ("event_bound", 0.2), "rocking", np.nan),
        # What the smoothed model does not claim to be an answer keeps its name.
        (("not_settled", 0.1), ("rocking", 0.2), "not_settled", 0.5),
        (("unstable", 0.1), ("rocking", 0.2), "unstable", 0.5),
    ],
)
def test_a_smoothed_result_far_from_the_linear_model_is_inexact(answer, exact, expected, error):
    status, found = compared(answer, exact)
    assert status == expected
    assert found == pytest.approx(error, rel=1e-12, nan_ok=True)
