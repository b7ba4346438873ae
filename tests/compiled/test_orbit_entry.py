"""Tasks of the entrance to symmetric orbits: every row of a call for itself, and only those asked for."""

import numpy as np

from tests.compiled.orbit_cases import ROWS
from tests.reference import parameters
from tpd.compiled import orbit_entry as entry
from tpd.compiled.rows import row_of

X = np.array([row_of(parameters(row["parameters"])) for row in ROWS[:12]])
SETTINGS = np.tile([float(entry.SOLVE), 0.0, 0.0, 0.0], (12, 1))


def test_only_the_requested_rows_of_orbits_are_written():
    every = np.zeros((12, entry.ORBITS), entry.ORBIT)
    entry.run(0, 12, SETTINGS, X, every)
    part = np.zeros((12, entry.ORBITS), entry.ORBIT)
    entry.run(4, 9, SETTINGS, X, part)
    assert part[4:9].tobytes() == every[4:9].tobytes()
    assert not any(part[:4].tobytes())
    assert not any(part[9:].tobytes())
    # The largest first, and none after the last.
    for row, orbits in zip(ROWS, every, strict=False):
        sizes = orbits["sizes"][:, 0]
        assert np.sum(np.isfinite(sizes)) == len(row["states"])
        np.testing.assert_allclose(sizes[: len(row["states"])], row["amplitudes"], rtol=1e-11)
