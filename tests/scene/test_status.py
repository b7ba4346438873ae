"""Named outcomes: names, numbers in files, messages."""

import jax
import jax.numpy as jnp
import numpy as np
import pytest

from tpd import Status, status_name
from tpd.scene import status
from tpd.scene.status import codes_of, index_of, is_moving, is_settled, names_by_code, names_of

NAMES = status._NAMES


def test_every_status_has_a_name_and_a_message():
    assert len({index_of(name) for name in NAMES}) == len(NAMES) == len(Status)
    for name in NAMES:
        one = getattr(Status, name)
        assert status_name(one) == name
        assert len(Status[one]) > 30
        assert Status[one].endswith(".")


def test_statuses_in_files_are_places_in_a_list_that_only_grows():
    # The order of stored files.
    first = "rocking sticking rest held overturned aperiodic not_settled unstable neutral near_fold grazing"
    assert NAMES[:14] == (*first.split(), "event_bound", "failed", "no_orbit")
    names = np.array([["rest", "failed"], ["rocking", "stood"]])
    np.testing.assert_array_equal(names_by_code(codes_of(names)), names)
    with pytest.raises(ValueError, match=r"names of statuses must be among rocking, .*, but are \['no'\]"):
        codes_of(np.array(["no"]))


def test_batches_of_statuses():
    batch = jax.vmap(lambda x: Status.where(x, Status.rocking, Status.held))(jnp.array([True, False, True]))
    np.testing.assert_array_equal(names_of(batch), ["rocking", "held", "rocking"])
    settled = {name for name in NAMES if is_settled(getattr(Status, name))}
    assert settled == set(status.SETTLED) == {"rocking", "sticking", "rest"}
    assert {name for name in NAMES if is_moving(getattr(Status, name))} == settled - {"rest"}
