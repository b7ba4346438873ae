"""Whether a pendulum can be hung: each reason against it alone, and a design that has none."""

import dataclasses
import math

import numpy as np
import pytest

import tpd
from tests import designs
from tpd.analysis.compare_models import nonlinear
from tpd.core.bob import Bob
from tpd.core.conditions import Conditions
from tpd.design.suitability import (
    Motions,
    Suitability,
    misfits,
    motions,
    neighbours,
    suitability,
)

TOWER = tpd.Scene(
    tpd.Block(width=2.0, height=9.0, mass=41500.0, radius_of_gyration=2.7, friction=0.02),
    tpd.Harmonic(amplitude=0.1, frequency=0.8),
)
HUNG = TOWER.pendulum(mass_ratio=0.08, length_ratio=0.22, damping_ratio=0.2)


def some(*amplitudes, angle=0.1) -> Motions:
    """Motions of these amplitudes."""
    sizes = np.array(amplitudes)
    over = np.isinf(sizes)
    status = np.where(over, "overturned", np.where(sizes == 0.0, "rest", "rocking"))
    far = np.where(over, np.inf, angle)
    return Motions(status=status, amplitude=sizes, settled=far, way=far)


def case(hung: Motions, bare: Motions, several: bool = False, top: float | None = None) -> Suitability:
    """A pendulum in the tower with motions under its own shaking and under two others."""
    size = float(hung.amplitude[0]) if top is None else top
    models = tuple(dataclasses.replace(m, amplitude=size, status=str(hung.status[0])) for m in CHECK.models)
    check = dataclasses.replace(CHECK, models=models, bare=float(bare.amplitude[0]), limit=0.5)
    shakings = Conditions({"frequency": np.array([1.0, 0.99, 1.01])})
    return Suitability(
        scene=TOWER,
        pendulum=HUNG,
        bob=Bob(),
        check=check,
        shakings=shakings,
        several=several,
        hung=hung,
        bare=bare,
    )


CHECK = designs.study().comparison
INF = math.inf


@pytest.mark.parametrize(
    ("hung", "bare", "several", "said"),
    [
        ((0.0, 0.0, 0.0), (0.1, 0.1, 0.1), False, ()),
        ((0.05, 0.05, 0.2), (0.1, 0.1, 0.1), False, ()),
        ((0.1, 0.05, 0.05), (0.1, 0.1, 0.1), False, ("does not help: by the nonlinear",)),
        ((0.05, 0.2, 0.2), (0.1, 0.1, 0.1), False, ("does not help: under 2 of 2 shakings within 1 %",)),
        (
            (0.05, 0.05, INF),
            (0.1, 0.1, INF),
            False,
            ("DO NOT USE: by the nonlinear equations, under 1 of 2",),
        ),
        (
            (INF, 0.05, INF),
            (INF, INF, INF),
            False,
            ("DO NOT USE: by the nonlinear equations the motion ends",),
        ),
        # Under many conditions the number of them decides.
        ((0.05, 0.05, INF), (0.1, 0.1, INF), True, ()),
        ((INF, 0.05, 0.05), (INF, 0.1, 0.1), True, ()),
        ((0.2, 0.05, 0.05), (0.1, 0.1, 0.1), True, ()),
        (
            (0.05, 0.05, INF),
            (0.1, 0.1, 0.1),
            True,
            ("DO NOT USE: by the nonlinear equations, under 1 of 2 cond",),
        ),
    ],
)
def test_a_refusal_has_its_reason(hung, bare, several, said):
    refusals = case(some(*hung), some(*bare), several).refusals
    assert len(refusals) == len(said)
    for refusal, start in zip(refusals, said, strict=True):
        assert refusal.startswith(start)


def test_an_overturning_is_told_with_its_share():
    (refusal,) = case(some(INF, 0.05, INF), some(INF, INF, INF)).refusals
    assert "(under 1 of 2 shakings within 1 % in amplitude or frequency the block overturns" in refusal
    assert refusal.endswith("and under 2 without the pendulum)")


def test_the_gravest_reason_is_the_last():
    found = case(some(INF, 0.2, INF, angle=1.5), some(0.1, 0.1, 0.1))
    assert [x.split(":")[0] for x in found.refusals] == ["does not help", "DO NOT USE"]
    found = case(some(0.2, 0.2, INF, angle=1.5), some(0.1, 0.1, 0.1))
    kinds = ["does not help", "does not help", "does not fit", "does not fit", "DO NOT USE"]
    assert [x.split(":")[0] for x in found.refusals] == kinds


def test_the_reach_is_that_of_the_motions_that_stand():
    at = HUNG.length * math.sin(0.1) + Bob().radius(HUNG.mass)
    assert case(some(0.05, INF, INF), some(0.1, 0.1, 0.1)).reach == pytest.approx((at, at), rel=1e-12)
    assert case(some(INF, 0.05, 0.05), some(0.1, 0.1, 0.1), True).reach == pytest.approx((at, at), rel=1e-12)
    assert all(map(math.isnan, case(some(INF, 0.05, 0.05), some(0.1, 0.1, 0.1)).reach))


@pytest.mark.parametrize(
    ("ratios", "reach", "said"),
    [
        ((0.08, 0.22), (0.9, 1.0), ()),
        (
            (0.08, 0.22),
            (1.01, 0.5),
            ("once settled the bob reaches 1.01 m to the side, and there are 1 m",),
        ),
        ((0.08, 0.22), (0.5, 1.2), ("on the way from rest the bob reaches 1.2 m",)),
        ((0.08, 0.1), (0.5, 0.5), ("more than half of its rod",)),
        ((0.05, 1.95), (0.5, 0.5), ("rod and bob are 9.17 m long, and the block is 9 m high",)),
        (
            (0.8, 1.0),
            (0.5, 0.5),
            ("the bob as a solid ball of steel has a radius of 1 m, and there are 1 m to either side",),
        ),
        ((0.08, 0.22), (math.nan, math.nan), ()),
    ],
)
def test_a_bob_that_does_not_fit_is_refused(ratios, reach, said):
    hung = TOWER.pendulum(mass_ratio=ratios[0], length_ratio=ratios[1], damping_ratio=0.2)
    found = list(misfits(TOWER.block, hung, Bob(), reach))
    assert len(found) == len(said)
    for sentence, part in zip(found, said, strict=True):
        assert part in sentence


def test_the_bob_must_fit_into_the_cavity():
    """It is as wide as the block unless it is given."""
    assert TOWER.block.room == 2.0
    narrow = dataclasses.replace(TOWER.block, cavity_width=1.5)
    assert narrow.room == 1.5
    assert list(misfits(TOWER.block, HUNG, Bob(), (0.8, 0.9))) == []
    found = list(misfits(narrow, HUNG, Bob(), (0.7, 0.9)))
    assert found == ["on the way from rest the bob reaches 0.9 m to the side, and there are 0.75 m"]


def test_a_slim_bob_is_measured_along_the_rod_as_well():
    slim = Bob(shape="cylinder", aspect=8.0)
    (sentence,) = misfits(TOWER.block, HUNG, slim, (0.5, 0.5))
    assert sentence.startswith(
        "the bob as a solid cylinder of steel, 8 times as high as wide has a radius of"
    )
    assert sentence.endswith("its half height is more than half of its rod of 0.99 m")


def test_motions_are_those_of_the_nonlinear_equations():
    found = motions(TOWER, None, neighbours())
    assert len(found.status) == 8
    scene = dataclasses.replace(TOWER, motion=tpd.Harmonic(amplitude=0.1, frequency=0.8 * 1.01))
    amplitude, _, status = nonlinear(scene.parameters())
    assert found.status[7] == status == "rocking"
    # Followed until it repeats itself, not polished: the last periods still change by that much.
    assert found.amplitude[7] == pytest.approx(amplitude, abs=1e-5)
    assert found.way[7] >= found.settled[7] > 0.0


def test_a_design_that_helps_and_fits_has_nothing_against_it():
    found = suitability(TOWER, HUNG, stroke=0.5, models=("uplift",))
    assert found.refusals == ()
    assert found.check.top.status == "rest"
    assert found.check.bare > 0.02
    assert (found.tried, found.lost, found.worse) == (8, (0, 0), 0)
    strict = suitability(TOWER, HUNG, stroke=0.1, models=("uplift",))
    assert [x[:45] for x in strict.refusals] == ["DO NOT USE: by the nonlinear equations the str"[:45]]


def test_conditions_of_a_job_take_the_place_of_the_neighbours():
    many = Conditions.band(TOWER, 0.75, 0.85, 3)
    found = suitability(TOWER, HUNG, conditions=many, stroke=0.5, models=("uplift",))
    assert found.several
    assert found.around == "3 conditions of the job"
    np.testing.assert_array_equal(found.shakings.column("frequency")[1:], many.column("frequency"))
    assert not suitability(TOWER, HUNG, conditions=Conditions(), models=("uplift",)).several
