"""Fingerprints of inputs."""

import re
from enum import Enum
from typing import NamedTuple

import numpy as np
import pytest

import tpd
from tpd.core.fingerprints import fingerprint

SCENE = tpd.paper_scene()
HUNG = SCENE.pendulum(mass_ratio=0.1, length_ratio=0.4, damping_ratio=0.1)


def test_fingerprints_differ_where_inputs_do():
    values = [1, 1.0, True, "1", [1], [[1]], {"a": 1}, np.array(1.0), np.array([1.0]), None, b"1"]
    values += [
        *Enum("E", "A B"),
        SCENE,
        HUNG,
        [("a", 1)],
        NamedTuple("A", [("a", int)])(1),
        NamedTuple("B", [("a", int)])(1),
    ]
    assert len({fingerprint(v) for v in values}) == len(values)
    assert fingerprint({"a": 1, "b": 2}) == fingerprint({"b": 2, "a": 1})
    assert fingerprint("ab", "c") != fingerprint("a", "bc")
    assert fingerprint(SCENE) == fingerprint(tpd.paper_scene())


def test_what_no_words_tell_from_another_is_refused():
    with pytest.raises(TypeError, match=re.escape("no fingerprint of a object")):
        fingerprint([object()])
