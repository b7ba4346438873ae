"""Statuses: names and numbers that stand for them, and a remedy in every message of a solve that failed."""

import jax
import jax.numpy as jnp
import numpy as np
import pytest

from tpd.scene.status import (
    MOVING,
    NOT_ATTRACTING,
    SETTLED,
    STANDING,
    UNANSWERED,
    Status,
    code_of,
    is_one_of,
    names_of,
    status_name,
)


@pytest.mark.parametrize("name", Status.__names__)
def test_names_and_codes_of_a_status_agree(name):
    status = getattr(Status, name)
    assert status_name(status) == name
    assert names_of(status).shape == ()
    assert code_of(status) == Status.__names__.index(name)
    assert is_one_of(status, status)
    assert is_one_of(status, *SETTLED) == (name in names_of(SETTLED))
    # What is no answer of its own says what to do.
    remedy = {*names_of(NOT_ATTRACTING), "held", "overturned", "aperiodic", "not_settled"}
    if name in remedy | {*names_of(UNANSWERED), "no_orbit", "inexact", "not_known"}:
        assert Status[status].count(".") >= 2


def test_stored_status_codes_keep_their_names():
    codes = np.array([[2, 4], [15, 0]], dtype=np.int8)
    assert names_of(codes).tolist() == [["rest", "overturned"], ["rocked", "rocking"]]
    assert len(Status.__names__) == len(Status) == 18
    with pytest.raises(IndexError):
        names_of(np.array([18]))


def test_membership_in_a_group_of_statuses_holds_in_arrays_and_under_jit():
    codes = np.array([0, 2, 14, 11], dtype=np.int8)
    batch = jax.vmap(lambda x: Status.where(x, Status.rocking, Status.stood))(jnp.array([True, False]))
    for members, in_codes, in_batch in (
        (MOVING, [True, False, False, False], [True, False]),
        (SETTLED, [True, True, False, False], [True, False]),
        (STANDING, [False, False, True, False], [False, True]),
        (UNANSWERED, [False, False, False, True], [False, False]),
        ((Status.rest,), [False, True, False, False], [False, False]),
    ):
        assert is_one_of(codes, *members).tolist() == in_codes
        assert is_one_of(batch, *members).tolist() == in_batch
        assert jax.jit(lambda x, m=members: is_one_of(x, *m))(batch).tolist() == in_batch
