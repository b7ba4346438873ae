"""Checkpoints: what is stored comes back, and another problem is refused."""

import re

import jax
import numpy as np
import pytest

from tests.damage import WAYS, damage
from tests.design.minimax import LIMITED, STARTS, WORST
from tpd.design.checkpoint import Checkpoint
from tpd.design.ends import BLANK
from tpd.design.methods import minimise


@pytest.fixture(scope="module")
def ends():
    return minimise(LIMITED, STARTS, 1.0, WORST, steps=3)


def test_ends_come_back_as_they_were(ends, tmp_path):
    path = tmp_path / "some.npz"
    store = Checkpoint.of(path, "a")
    assert store.get(0, BLANK) is None
    store.put(0, ends)
    store.put(12, ends._replace(x=ends.x + 1.0))
    again = Checkpoint.of(path, "a")
    assert again.get(1, BLANK) is None, "nor are numbers of two digits mixed up"
    np.testing.assert_array_equal(again.get(12, BLANK).x, ends.x + 1.0)
    found = again.get(0, BLANK)
    assert jax.tree.structure(found) == jax.tree.structure(ends)
    for a, b in zip(jax.tree.leaves(ends), jax.tree.leaves(found), strict=True):
        np.testing.assert_array_equal(a, b)
        assert a.dtype == b.dtype


def test_another_problem_is_refused(ends, tmp_path):
    path = tmp_path / "some.npz"
    Checkpoint.of(path, "a").put(0, ends)
    with pytest.raises(ValueError, match="holds searches of another problem"):
        Checkpoint.of(path, "b")
    # As an earlier version wrote it.
    np.savez(path, problem=np.array("a"))
    with pytest.raises(ValueError, match="or of another version of tpd"):
        Checkpoint.of(path, "a")
    with pytest.raises(ValueError, match="cannot read"):
        Checkpoint.of(tmp_path, "a")


@pytest.mark.mends("a damaged checkpoint was refused at every start, or raised errors of zip and zlib")
@pytest.mark.parametrize("way", WAYS)
def test_a_damaged_checkpoint_is_put_aside_and_its_searches_are_done_again(ends, tmp_path, way):
    path = tmp_path / "some.npz"
    Checkpoint.of(path, "a").put(0, ends)
    damage(path, way)
    content, aside = path.read_bytes(), tmp_path / "some.npz.damaged-1"
    words = f"finished searches (now in {aside}) in {path} were damaged, and are done again"
    with pytest.warns(UserWarning, match=re.escape(words)):
        store = Checkpoint.of(path, "a")
    assert store.get(0, BLANK) is None
    # It may be somebody's file, given by mistake.
    assert aside.read_bytes() == content
    store.put(0, ends)
    np.testing.assert_array_equal(Checkpoint.of(path, "a").get(0, BLANK).x, ends.x)


@pytest.mark.mends("flipped bits in a checkpoint raised errors of zip and zlib, or were not seen")
def test_a_flipped_bit_anywhere_is_seen(ends, tmp_path):
    path = tmp_path / "some.npz"
    Checkpoint.of(path, "a").put(0, ends)
    whole = path.read_bytes()
    for at in range(0, len(whole), max(1, len(whole) // 200)):
        content = bytearray(whole)
        content[at] ^= 1 << at % 8
        path.write_bytes(content)
        with pytest.warns(UserWarning, match="were damaged"):
            assert Checkpoint.of(path, "a").stored == {}
