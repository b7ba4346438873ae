"""The section for whoever builds: sizes, loads, checks on site, and how much the benefit depends on each."""

import dataclasses

import numpy as np

import tpd
from tests.report.conftest import details, harmonic, rejected
from tpd.design.as_built import Parts
from tpd.report import construction
from tpd.report.blocks import Listing, Table


def section(**changes):
    """Blocks of the recommended design, with another build."""
    build = dataclasses.replace(details().build, **changes)
    return construction.section(harmonic(), dataclasses.replace(details(), build=build))


def rows(table: Table) -> dict:
    return {row[0]: row[1:] for row in table.rows}


def test_sizes_describe_the_bob_as_built_and_loads_the_simulated_motions():
    table, with_it, loads = section()[0], harmonic().pendulum, details().build.loads
    found = rows(table)
    body, rod = tpd.limits.Bob().built(with_it.mass, with_it.length, 9.80665)
    assert found["mass of the bob"][0] == f"{body:.4g} kg"
    assert (
        f"equivalent to a point mass of {with_it.mass:.4g} kg on a rod of {with_it.length:.4g} m"
        in found["mass of the bob"][1]
    )
    assert found["rod, hinge to the bob's centre"][0] == f"{rod:.4g} m"
    wide = 2.0 * (3.0 * body / (4.0 * np.pi * 7850.0)) ** (1.0 / 3.0)
    assert found["bob, width by height"][0] == f"{wide:.4g} m × {wide:.4g} m"
    c = float(with_it.hinge_damping())
    assert found["largest moment of the damper"][0] == f"{loads.rate * c:.4g} N m"
    assert found["largest power of the damper"][0] == f"{loads.rate**2 * c:.4g} W"
    assert f"largest of {loads.motions} motions" in table.caption
    assert found["coefficient of friction needed at the base"][0] == loads.friction
    swing = section(loads=loads._replace(friction=np.nan, motions=0))[0]
    assert swing.caption.startswith("The block overturns in all motions.")
    assert rows(swing)["coefficient of friction needed at the base"][0] == "–"
    assert construction.section(rejected(), details("rejected")) == []


def test_parts_state_size_unit_steel_and_factor_of_safety():
    parts = Parts(0.042, 13.1, 0.014, 0.3, 2778.0, 1667.0, 0.24, 0.6, 0.45, 0.03, 66667.0)
    table, second = section(parts=parts, rod=1.2, rod_share=0.1, mass=200.0)[1:3]
    found = rows(table)
    assert found["rod, diameter"] == ("42 mm", "steel bar of 13.1 kg; the table above assumes 20 kg")
    heavy = rows(section(parts=parts, rod=1.2, rod_share=0.05, mass=200.0)[1])["rod, diameter"][1]
    assert heavy.startswith("steel bar of 13.1 kg; the table above assumes 10 kg. To keep the frequency")
    # One total of both forces for the hinge.
    total = 1e-3 * (details().build.loads.hinge + 1667.0)
    assert found["hinge, largest force with the linear damper"][0] == f"{total:.3g} kN"
    assert found["pin of the hinge, diameter"][0] == "14 mm"
    assert found["linear damper, arm"][1] == "distance from the hinge along the rod: a quarter of the rod"
    values = ["2780 N s/m", "1.67 kN", "240 mm", "0.6 m/s"]
    for name, value in zip(("coefficient", "largest force", "stroke", "largest speed"), values, strict=True):
        assert found[f"linear damper, {name}"][0] == value
    assert found["stop, distance from the axis"][0] == "0.45 m"
    assert found["stop, largest force"][0] == "66.7 kN"
    assert "stops the bob within 30 mm from its largest rate" in found["stop, largest force"][1]
    assert "S235 (yield stress 235 MPa, EN 10025-2)" in table.caption
    assert "factor of safety of 3" in table.caption
    assert second.text.startswith("A pin lets the pendulum swing in one direction only.")
    table = section(parts=parts._replace(arm=0.2, stop_way=np.nan), rod=1.2)[1]
    assert "the largest arm that fits the cavity" in rows(table)["linear damper, arm"][1]
    assert "stop, largest force" not in rows(table)


def test_checks_on_site_state_the_expected_readings():
    checks, with_it = section()[3], harmonic().pendulum
    assert isinstance(checks, Listing)
    ten, damped, pull = checks.items
    seconds = 20 * np.pi * np.sqrt(with_it.length / 9.80665)
    assert f"Ten complete oscillations (there and back) must take {seconds:.3g} s" in ten
    # exp(-pi 0.1/sqrt(1 - 0.01))
    assert "It should swing to about 73 % of this angle on the other side" in damped
    # (nu + k)/2 times M g: 0.15 * 16.224 * 9.80665; a tenth of 0.25 rad over 0.4 m
    assert "A horizontal pull of 23.9 N at the top starts uplift" in pull
    assert "has moved by 10 mm (0.025 rad" in pull
    assert "It should come to rest without a swing to the other side" in section(rebound=0.004)[3].items[1]


def test_a_pendulum_without_an_equivalent_body_has_no_size():
    table, *others = section(mass=float("nan"), rod=float("nan"), parts=None)
    assert isinstance(others[0], Listing)
    assert rows(table)["rod, hinge to the bob's centre"][0] == "–"
    assert "no ball is equivalent to the point mass of" in rows(table)["mass of the bob"][1]
    assert "nan " not in str(table)
