"""Work shared among threads: every row once, in pieces within their bounds, and what fails is not lost."""

import numpy as np
import pytest

from tpd.models.rows import shared


@pytest.mark.parametrize("workers", [None, 1, 3])
@pytest.mark.parametrize("n", [1, 7, 1000])
def test_every_row_is_done_once_in_pieces_within_their_bounds(workers, n):
    done, pieces, calls = np.zeros(n, int), [], []

    def run(first, last):
        done[first:last] += 1
        pieces.append(last - first)
        return last - first

    shared(run, n, workers, lambda *counts: calls.append(counts), piece=(2, 50))
    assert np.all(done == 1)
    assert max(pieces) <= 50 or len(pieces) == 1
    assert sorted(pieces)[1:] == [] or min(sorted(pieces)[1:]) >= 2
    assert calls[-1] == (n, n)
    assert [c for c, _ in calls] == sorted(c for c, _ in calls)


def test_an_error_in_a_thread_is_raised():
    def run(first, last):
        if first > 20:
            raise OSError("no more")
        return last - first

    with pytest.raises(OSError, match="no more"):
        shared(run, 100, 2, None)
