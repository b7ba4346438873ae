"""The section for whoever builds: sizes, loads, checks on site, and how much the benefit moves."""

import dataclasses

import numpy as np

import tpd
from tests import designs
from tpd.answers.statistics import Interval
from tpd.design.build import Loads, Moved
from tpd.design.study import build_of
from tpd.report import construction
from tpd.report.blocks import Listing, Table, Text

LOADS = Loads(tension=30.0, hinge=40.0, rate=2.0, friction=0.3, motions=7)


def build(**changes):
    return dataclasses.replace(build_of(designs.single()), loads=LOADS, **changes)


def rows(table: Table) -> dict:
    return {row[0]: row[1:] for row in table.rows}


def test_sizes_are_those_of_the_body_and_loads_those_of_the_motions():
    table, _ = construction.section(designs.single(), build())
    found = rows(table)
    body, rod = tpd.limits.Bob().built(1.6224, 0.12, 9.80665)
    assert found["mass of the bob"][0] == f"{body:.4g} kg"
    assert "acts as a point of 1.622 kg at 0.12 m" in found["mass of the bob"][1]
    assert found["rod, hinge to the bob's centre"][0] == f"{rod:.4g} m"
    wide = 2.0 * (3.0 * body / (4.0 * np.pi * 7850.0)) ** (1.0 / 3.0)
    assert found["bob, width by height"][0] == f"{wide:.4g} m × {wide:.4g} m"
    c = float(designs.HUNG.hinge_damping())
    assert found["largest moment of the damper"][0] == f"{2.0 * c:.4g} N m"
    assert found["largest power of the damper"][0] == f"{4.0 * c:.4g} W"
    assert found["friction that keeps the base from sliding"][0] == "0.3"
    assert "largest of 7 motions" in table.caption
    assert construction.section(designs.refused(), None) == []


def test_checks_on_site_have_the_readings_to_expect():
    _, checks = construction.section(designs.single(), build())
    assert isinstance(checks, Listing)
    ten, damped, pull = checks.items
    # 10 * 2 pi sqrt(0.12/9.80665)
    assert "ten swings take 6.95 s" in ten
    # exp(-pi 0.1/sqrt(1 - 0.01))
    assert "it swings to 73% of the angle on the other side" in damped
    # (nu + k)/2 times M g: 0.15 * 16.224 * 9.80665; a tenth of 0.25 rad over 0.4 m
    assert "23.9 N at the top lift it" in pull
    assert "has moved by 10 mm (0.025 rad" in pull
    slow = construction.section(designs.single(), build(rebound=0.004))[1].items[1]
    assert "it comes to rest without swinging back" in slow


def test_what_the_benefit_hangs_on_has_its_tolerance_and_what_is_lost_is_named():
    holds, lost = Interval(0.3, 0.2, 0.4), Interval(0.1, -0.05, 0.25)
    moved = (Moved("mass", 0.05, holds, holds), Moved("slenderness", 0.05, lost, holds))
    *_, table, said = construction.section(designs.single(), build(moved=moved))
    found = rows(table)
    assert found["mass of the bob"] == ("±2%", "±5%", "30% (20% to 40%)", "30% (20% to 40%)", "weigh it")
    assert found["slenderness ν"][2] == "10% (-5% to 25%)"
    assert said == Text("Moved as in the third column the benefit is not shown for: slenderness ν.")
    *_, said = construction.section(designs.single(), build(moved=moved[:1]))
    assert said == Text("In none of these is the benefit lost.")


def test_where_no_body_or_rod_acts_as_the_point_no_number_of_one_is_named():
    table, _ = construction.section(designs.single(), build(mass=float("nan"), rod=float("nan")))
    found = rows(table)
    assert found["rod, hinge to the bob's centre"][0] == "none swings as often"
    said = "no body, a solid ball of steel, acts as a point of 1.622 kg at 0.12 m"
    assert said in found["mass of the bob"][1]
    assert "nan" not in str(table)


def test_the_scatter_of_a_restitution_is_said_of_the_loss():
    """e = 0.95 within 2 % is a loss of 0.05 within 38 %."""
    design, holds = designs.single(), Interval(0.3, 0.2, 0.4)
    block = dataclasses.replace(design.scene.block, restitution=0.95, friction=0.0)
    scene = dataclasses.replace(design.scene, block=block)
    ensemble = dataclasses.replace(design.ensemble, restitution=0.02)
    design = dataclasses.replace(design, scene=scene, ensemble=ensemble)
    moved = (Moved("restitution", 0.5, holds, holds),)
    *_, table, _ = construction.section(design, build(moved=moved))
    assert rows(table)["loss at an impact, 1 - e"][0] == "±38%"
