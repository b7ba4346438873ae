"""Rows of parameters: read by name, in whatever order these are defined."""

import json
import subprocess
import sys

import jax.numpy as jnp
import numpy as np

from tests import interpreted
from tests.reference import WITH, parameters
from tpd.compiled.columns import XI, F
from tpd.compiled.rows import ground_row_of, packed, row_of
from tpd.scene.parameters import NAMES, from_row


def test_parameters_survive_packing_into_a_row():
    p = parameters((*WITH[0].x, 0.8))
    q = from_row(packed(p.numbers))
    assert float(q.rho) == float(p.inertia_ratio)
    np.testing.assert_array_equal(row_of(q), row_of(p))
    assert isinstance(row_of(parameters(jnp.asarray(WITH[0].x))), np.ndarray)


def test_a_row_under_a_record_has_the_piece_duration_instead_of_the_frequency():
    p = parameters((*WITH[0].x[:6], np.array([2.0, 3.0])))
    row = row_of(p)
    row[:, XI] = 2.0 * np.pi / p.xi
    np.testing.assert_array_equal(ground_row_of(p), row)
    # A factor multiplies the amplitude, and the duration of a piece can be that of another motion.
    row[:, F] *= 3.0
    row[:, XI] = [0.1, 0.2]
    np.testing.assert_array_equal(ground_row_of(p, size=3.0, piece=np.array([0.1, 0.2])), row)


def test_no_result_depends_on_the_order_of_the_parameters():
    # The interpreted kernels also check the compiled ones.
    command = [sys.executable, "-m", "tests.interpreted", *sorted(NAMES)]
    done = subprocess.run(command, check=True, capture_output=True, text=True)
    other, ours = json.loads(done.stdout), interpreted.results()
    assert sorted(NAMES) != list(NAMES)
    assert other.keys() == ours.keys()
    for name in ours:
        one, two = interpreted.flat(ours[name]), interpreted.flat(other[name])
        np.testing.assert_allclose(one, two, rtol=1e-8, atol=1e-11, err_msg=name)
