"""Geometry of block and bob under conditions."""

import dataclasses

import numpy as np

import tpd
from tpd.design.geometry import Geometry


def test_the_wall_distance_scales_with_cavity_width_and_slenderness():
    scene, slenderness = tpd.paper_scene(), np.array([1.0, 0.97])
    block = dataclasses.replace(scene.block, cavity_width=0.06)
    narrow = Geometry.of(
        dataclasses.replace(scene, block=block), tpd.Conditions({"slenderness": slenderness})
    )
    np.testing.assert_allclose(narrow.wall, 0.03 * slenderness)
