"""Statuses: names and numbers that stand for them, and a remedy in every message of a solve that failed."""

import numpy as np
import pytest

from tpd.scene.status import (
    MOVING,
    SETTLED,
    UNANSWERED,
    Outcome,
    Status,
    codes_of,
    index_of,
    is_moving,
    is_settled,
    names_by_code,
    names_of,
    status_name,
)


@pytest.mark.parametrize("name", list(Outcome))
def test_names_numbers_and_statuses_belong_together(name):
    status = getattr(Status, name)
    assert status_name(status) == name == str(name)
    assert names_of(status).shape == ()
    assert index_of(name) == codes_of(np.array([name]))[0] == list(Outcome).index(name)
    assert bool(is_moving(status)) == (name in MOVING)
    assert bool(is_settled(status)) == (name in SETTLED)
    # What is no answer of its own says what to do.
    remedy = {"held", "overturned", "aperiodic", "not_settled", "unstable", "neutral", "near_fold", "grazing"}
    if name in remedy | set(UNANSWERED) | {"no_orbit", "inexact", "not_known"}:
        assert Status[status].count(".") >= 2


def test_numbers_in_files_keep_their_names():
    codes = codes_of(np.array([["rest", "overturned"], ["rocked", "rocking"]]))
    assert codes.tolist() == [[2, 4], [15, 0]]
    assert codes.dtype == np.int8
    assert names_by_code(codes).tolist() == [["rest", "overturned"], ["rocked", "rocking"]]
    with pytest.raises(ValueError, match=r"names of statuses must be among rocking, .*, but are \['lost'\]"):
        codes_of(np.array(["lost"]))
