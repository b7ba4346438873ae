"""Scene in words: whose block it is, and its numbers."""

import dataclasses

import numpy as np

import tpd
from tests import designs
from tests.report.conftest import harmonic
from tpd.limits import Clearance, Mass
from tpd.report import words
from tpd.report.words import point, rule_and_search
from tpd.scene.bob import Bob

PAPER = tpd.paper_scene()
MARBLE = tpd.Block(width=1.0, height=6.0, mass=9000.0, radius_of_gyration=1.75, restitution=0.9)
COLUMN = tpd.Scene(MARBLE, tpd.Harmonic(amplitude=0.05, frequency=0.5))


def changed(**block) -> tpd.Scene:
    """The paper's scene with another value of its block."""
    return dataclasses.replace(PAPER, block=dataclasses.replace(PAPER.block, **block))


def test_the_description_states_which_values_differ_from_the_paper():
    for scene, said in (
        (PAPER, "with the paper's excitation and losses"),
        (changed(restitution=0.9), "with other losses than the paper's"),
        (tpd.Scene(PAPER.block, PAPER.excitation, 3.7), "with other gravity than the paper's"),
        (tpd.Scene(changed(friction=0.1).block, COLUMN.excitation), "with other excitation and losses than"),
    ):
        assert words.origin(scene).startswith(f"the paper's block (Collini et al. 2016) {said}")
    for size in ("height", "mass", "radius_of_gyration", "effective_width", "centroid_height"):
        assert words.origin(changed(**{size: 0.2})) == ""


def test_scene_lines_describe_block_excitation_and_losses_in_si_units():
    block, motion, losses = words.scene_lines(COLUMN)
    assert "6 m high, 9000 kg, radius of gyration 1.75 m, centroid at 3 m, no cavity stated; slender" in block
    assert "topples at 0.1651 rad (9.46°)" in block
    # 0.05 m (2 pi 0.5 Hz)^2 is 0.4935 m/s^2.
    assert motion == "  excitation  0.05 m at 0.5 Hz, 0.05032 g"
    assert losses == "  losses      impacts e = 0.9"


def test_scene_lines_state_the_effective_width_of_the_base():
    block = words.scene_lines(changed(effective_width=0.9))[0]
    assert "16.22 kg, centroid at 0.2 m, rocks on 90 % of its width, cavity 0.08 m wide" in block
    assert "slenderness 0.225; topples at 0.2213 rad" in block


def test_energy_losses_are_described_by_friction_and_restitution():
    for losses, said in (
        ({"restitution": 1.0, "friction": 0.05}, "friction k = 0.05"),
        ({}, "impacts e = 0.9118 (Housner, without a pendulum)"),
        ({"restitution": 0.9, "friction": 0.02}, "impacts e = 0.9; friction k = 0.02"),
    ):
        assert words.losses(tpd.Block(width=0.1, height=0.4, mass=16.0, **losses)) == said


def test_the_settled_tilt_is_described_as_an_angle_or_as_an_uplift_margin():
    motions = harmonic().exact_motions[0]
    for changes, margin, said in (
        ({"tilt": 0.3}, -0.5, "0.07500 rad (30.0 % of ν)"),
        (
            {"tilt": 0.0, "kind": 2},
            0.1,
            "none: the block stays at rest with 10.0 % of the lifting moment in reserve",
        ),
        ({"tilt": 1.2, "kind": 3}, -0.5, "no settled motion under some condition: the block may overturn"),
    ):
        full = {name: np.full_like(getattr(motions.orbits, name), x) for name, x in changes.items()}
        orbits = motions.orbits._replace(kind=np.zeros_like(motions.orbits.kind))._replace(**full)
        of = dataclasses.replace(motions, orbits=orbits, margin=np.full_like(motions.margin, margin))
        assert words.settled_tilt(harmonic(), of).startswith(said)


def test_an_infinite_angle_reads_overturns_and_nan_reads_unknown():
    assert words.angle(0.1) == "0.1 rad (5.73°)"
    assert words.angle(np.inf) == "overturns"
    assert words.angle(np.nan) == "unknown"


def test_each_limit_is_described_in_words():
    assert words.limit(Mass(2.0)) == "at most 2 kg"
    assert words.limit(Clearance()) == "the bob, a solid ball of steel, does not touch the walls"
    wood = Clearance(Bob(shape="cylinder", density=700.0))
    assert "a solid cylinder of 700 kg/m³, 2 times as high as wide" in words.limit(wood)
    said = [words.limit(limit) for limit in harmonic().problem.limits]
    assert said == ["at most 0.5 rad", "at least 0.05"]


def test_the_rows_of_rule_and_search_state_reduction_reasons_and_groups():
    design = designs.ground_design()
    rows = dict(rule_and_search(design))
    assert list(rows) == ["rule", "search"]
    for name, of in (("rule", design.rule), ("search", design.searched)):
        less, by, around = of.runs.reduction(of.measure)[0].fall_in_words()
        assert rows[name].startswith(f"{point(of.pendulum, 3, 3)}: {by} {'lower' if less else 'higher'} ")
        assert around in rows[name]
        assert ("; not recommended, because " in rows[name]) == bool(of.refusals)
    masses = [float(x[0] * design.scene.block.mass) for x in design.searched.crossed]
    ends = f"; without each group of earthquakes: {min(masses):.3g} to {max(masses):.3g} kg"
    assert rows["search"].endswith(ends)
    assert "group" not in rows["rule"]
    assert not dict(rule_and_search(harmonic())).keys() & {"rule"}
