"""Geometry of block and bob under conditions."""

import numpy as np

import tpd
from tests.designs import with_block
from tpd.design.geometry import Geometry


def test_the_wall_distance_scales_with_cavity_width_and_slenderness():
    scene, slenderness = tpd.paper_scene(), np.array([1.0, 0.97])
    narrow = Geometry.of(with_block(scene, cavity_width=0.06), tpd.Conditions({"slenderness": slenderness}))
    np.testing.assert_allclose(narrow.wall, 0.03 * slenderness)
