"""Notes: dangers first, each said once and only where it holds."""

import dataclasses

import numpy as np
import pytest

import tpd
from tests import designs
from tpd.analysis.attractors import Starts
from tpd.analysis.paired import Verdict
from tpd.design.criteria import DEFAULT_LIMITS
from tpd.design.result import DesignStatus
from tpd.design.study import Study
from tpd.design.verified import Neighbours
from tpd.report.blocks import Severity
from tpd.report.notes import disagree, notes, strikes, thick

LIGHT = dataclasses.replace(designs.HUNG, mass=0.5)
NONE = Study()


def texts(design, study=NONE, severity=None) -> list[str]:
    return [n.text for n in notes(design, study) if severity in (None, n.severity)]


def only(design, study=NONE, *, about: str):
    """The one note that holds these words."""
    (found,) = (n for n in notes(design, study) if about in n.text)
    return found


def with_winner(base=designs.single, **changes):
    design = base()
    winner = dataclasses.replace(design.winner, **changes)
    return dataclasses.replace(design, verified=(*design.verified[:-1], winner))


def test_dangers_come_before_warnings_and_these_before_information():
    order = [n.severity.value for n in notes(designs.band(), designs.study())]
    assert order == sorted(order)
    assert set(order) == {s.value for s in Severity}


def strike_notes(pendulum=LIGHT, **changes):
    exact = designs.motions("piecewise", 0.04, changes.pop("stroke"), **changes)
    design = with_winner(exact=exact, verdict=None)
    return [t for t in texts(dataclasses.replace(design, pendulum=pendulum)) if "STRIKE" in t]


def test_a_bob_that_would_strike_the_walls_is_a_danger_with_a_remedy():
    """Half width 0.05 m, length 0.12 m; a ball of 0.5 kg has a radius of 0.0248 m: 0.2118 rad are left."""
    ball = (0.5 / 7850.0 * 3.0 / (4.0 * np.pi)) ** (1.0 / 3.0)
    most = np.arcsin((0.05 - ball) / 0.12)

    def peaks(swing):
        return {"peak": np.array([0.06]), "peak_stroke": np.array([swing])}

    # The bob's angle and the block's tilt together: 0.04 rad settled, 0.06 rad on the way.
    assert strike_notes(stroke=most - 0.04 - 1e-6, **peaks(most - 0.06 - 1e-6)) == []
    (text,) = strike_notes(stroke=0.1, **peaks(most - 0.06 + 1e-6))
    assert text.startswith("On the way from rest the bob may swing 0.0252 m out of the block's axis")
    assert f"up to {np.floor(1e3 * most) / 1e3:g} rad between rod and block, a point up to 0.429 rad" in text
    (text,) = strike_notes(stroke=0.46, **peaks(0.6))
    assert text.startswith("Once settled the bob may swing 0.0575 m")


def test_a_ball_wider_than_the_block_fits_at_no_angle():
    heavy = dataclasses.replace(designs.HUNG, mass=16.0)
    (note,) = strikes(designs.SCENE.block, heavy, {"settled": 0.0}, False)
    assert note.severity is Severity.danger
    assert "stays off them at no angle" in note.text


def test_the_remedy_against_walls_is_another_one_where_they_are_limited():
    design = designs.single(limits=(*DEFAULT_LIMITS, Walls()))
    assert "`--walls`" in only(designs.single(), about="STRIKE").text
    assert "the limit on walls holds for the settled motion only" in only(design, about="STRIKE").text


def test_walls_are_watched_in_the_ensemble_too():
    """Half of the runs reach 0.1 rad of bob and block each, 0.2 rad together: 0.0238 m."""
    quiet = designs.motions("piecewise", 0.01, 0.01)
    design = dataclasses.replace(with_winner(exact=quiet), pendulum=dataclasses.replace(LIGHT, mass=0.6))
    assert only(design, about="STRIKE").text.startswith(
        "In half of the ensemble's runs the bob may swing 0.0238 m"
    )
    lost = Verdict(hung=designs.outcomes(30), bare=designs.outcomes(30))
    design = dataclasses.replace(with_winner(exact=quiet, verdict=lost), pendulum=design.pendulum)
    assert not any("STRIKE" in t for t in texts(design))


def test_over_conditions_the_search_may_know_larger_angles_than_the_start_from_rest():
    quiet = designs.motions("piecewise", np.full(8, 0.01), 0.01)
    design = dataclasses.replace(with_winner(designs.band, exact=quiet, verdict=None), pendulum=LIGHT)
    assert "Once settled the bob may swing 0.0601 m" in only(design, about="STRIKE").text
    # Of a search over starts at rest the exact solution has the last word.
    assert not any("STRIKE" in t for t in texts(dataclasses.replace(design, starts=Starts.rest())))


def test_a_ball_that_is_no_point_is_said():
    assert thick(designs.HUNG) == []
    (note,) = thick(tpd.Pendulum(mass=1.6224, length=0.03, damping_ratio=0.1))
    assert note.text.endswith("and it is thicker than the rod is long.")


def test_a_pendulum_that_saves_by_luck_is_a_danger():
    near = Neighbours(condition=0, tried=8, overturned=2, overturned_bare=1)
    text = "Of 8 shakings within 1 % in amplitude or frequency, 2 overturn the block with this pendulum (1 "
    note = only(with_winner(neighbours=near), about="shakings within")
    assert note.severity is Severity.danger
    assert note.text.startswith(text)
    assert not any("shakings within" in t for t in texts(designs.single()))


def test_overturning_from_rest_is_counted_and_a_danger_where_the_bare_block_stands():
    status = np.array(["overturned", "overturned", *["rocking"] * 6])
    exact = designs.motions("piecewise", np.full(8, 0.05), 0.3, status)
    design = with_winner(designs.band, exact=exact)
    note = only(design, about="OVERTURNS")
    assert note.severity is Severity.danger
    assert (
        f"under 1 of 8 conditions that it stands without, the first at {design.conditions.label(1)}"
        in note.text
    )
    assert (
        "under 2 of 8 conditions with the pendulum and 1 without" in only(design, about="From rest the").text
    )


@pytest.mark.parametrize(("peak", "near"), [(0.17, False), (0.18, True), (np.nan, False)])
def test_coming_near_toppling_on_the_way_is_a_danger(peak, near):
    exact = designs.motions("piecewise", 0.04, peak=np.array([peak]))
    said = texts(with_winner(exact=exact), severity=Severity.danger)
    assert any("near the tilt at which it topples" in t for t in said) is near


@pytest.mark.parametrize(("worse", "better", "fewer"), [(0, 0, False), (3, 5, False), (0, 19, True)])
def test_that_it_overturns_less_is_shown_by_significantly_fewer_runs(worse, better, fewer):
    size, order = 40, np.arange(40)
    hung, bare = designs.outcomes(worse), designs.outcomes(0)
    late = np.where(order >= size - better, "overturned", "rocking")
    verdict = Verdict(hung=hung, bare=dataclasses.replace(bare, status=late))
    assert (verdict.worse, verdict.better) == (worse, better)
    said = any(
        "Nothing shows that the block overturns less" in t for t in texts(with_winner(verdict=verdict))
    )
    assert said is not fewer


def test_an_ensemble_in_which_the_pendulum_harms_is_a_danger():
    worse = Verdict(hung=designs.outcomes(20), bare=designs.outcomes(2))
    note = only(with_winner(verdict=worse), about="In the ensemble")
    assert note.severity is Severity.danger
    assert note.text == "In the ensemble 18 runs overturn with the pendulum only, and 0 without it only."
    assert not any("In the ensemble 0" in t for t in texts(designs.single()))


def test_an_overturning_that_the_bare_block_withstands_is_a_danger():
    asked = (designs.nonlinear(0, "overturned"), designs.nonlinear(1, "overturned", "overturned"))
    design = with_winner(designs.band, nonlinear=(*asked, designs.nonlinear(2)))
    first = only(design, about="bare it stands")
    assert first.severity is Severity.danger
    assert f"at {design.conditions.label(0)}, and bare it stands" in first.text
    second = only(design, about="without the pendulum as well")
    assert second.severity is Severity.warning
    assert f"at {design.conditions.label(1)}, and it" in second.text


def test_frequencies_that_are_worse_are_said_and_grave_ones_a_danger():
    bare = designs.response(0.01, 0.01, 0.01)

    def note(*hung):
        study = Study(responses=(bare, designs.response(*hung)))
        return only(designs.single(), study, about="rocks more")

    mild, grave = note(0.01, 0.015, 0.019), note(0.01, 0.015, 0.021)
    assert (mild.severity, grave.severity) == (Severity.warning, Severity.danger)
    assert mild.text.startswith("At 2.45 Hz")
    assert grave.text.startswith("At 2.6 Hz")


def test_frequencies_at_which_the_pendulum_overturns_the_block_are_a_danger():
    hung = designs.response(0.01, 0.01, np.inf, status=["rocking", "rocking", "overturned"])
    study = Study(responses=(designs.response(0.02, 0.02, 0.02), hung))
    assert only(designs.single(), study, about="OVERTURNS").text.startswith("At 2.6 Hz, same base amplitude")
    count = "Of 3 frequencies tried from 2.4 to 2.6 Hz, 1 overturn the block with the pendulum and 0 without."
    assert count in texts(designs.single(), study)
    assert not any("Hz" in t for t in texts(designs.single(), Study(responses=study.responses[:1])))


def test_the_edges_of_the_settled_motion_are_said():
    exact = designs.motions("piecewise", 0.04, 0.35, multiplier=np.array([0.97]))
    said = texts(with_winner(exact=exact, margin=np.array([0.1])), severity=Severity.warning)
    assert "A stroke of 0.35 rad stretches the linear equations of the pendulum." in said
    assert "The motion attracts slowly (Floquet multiplier 0.970)." in said
    assert "The block could rest under this pendulum, but a start from rest ends in rocking." in said
    rest = designs.motions("piecewise", 0.0, 0.2, "rest")
    assert (
        "keeps 10.0% of the moment"
        in only(with_winner(exact=rest, margin=np.array([0.1])), about="The resting").text
    )


def test_whose_tilts_they_are_is_said_for_every_kind_of_start():
    said = {
        "a start from rest settles into": Starts.rest(),
        "whichever start leads to it": Starts.any(),
        "the motions that 12 starts (seed 5) settle into, the mean over the starts": Starts(size=12, seed=5),
        "the largest motion that one of 12 starts (seed 5)": Starts(size=12, seed=5, worst=True),
    }
    for words, starts in said.items():
        assert words in only(designs.single(starts=starts), about="Tilts are").text


def test_starts_that_overturn_or_do_not_settle_are_counted():
    e = designs.evaluation(0.16, 0.3, lost=np.array([[0.25]]), unsettled=np.array([[0.5]]))
    said = " ".join(texts(with_winner(evaluation=e)))
    assert "From 25.0% of the starts the block overturns with the pendulum, from 0.0% without" in said
    assert "From 50.0% of the starts the motion does not repeat" in said
    kind = np.full((1, 8), 3)
    none = with_winner(designs.band, evaluation=designs.evaluation(np.full(8, 0.1), 0.3, kind=kind))
    assert "Under 8 of 8 conditions no symmetric motion attracts" in " ".join(texts(none))
    path = " ".join(texts(with_winner(source="path")))
    assert "The best design at which a search ended was refused" in path


def test_interruptions_are_said():
    cut = designs.single(status=DesignStatus.interrupted, pendulum=None)
    assert "The search was interrupted; nothing below is the best of the design space." in texts(cut)
    said = texts(designs.single(), Study(left_out=("the time histories",)))
    assert "This report goes without the time histories: its computation was interrupted." in said


def test_models_that_disagree_on_the_bare_block_are_said():
    design = designs.single()
    off = dataclasses.replace(design.bare, searched=designs.motions("smoothed", 0.085))
    assert disagree(design, off).all()
    assert not disagree(design, design.bare).any()
    assert not disagree(designs.band(), designs.band().bare).any()
    other = dataclasses.replace(
        design.bare, searched=designs.motions("smoothed", 0.0833, status="overturned")
    )
    assert disagree(design, other).all()
    # The nonlinear equations may give another amplitude than the linear ones.
    nonlinear = dataclasses.replace(design.bare, searched=designs.motions("segmented", 0.085))
    assert not disagree(design, nonlinear).any()
    assert any("models disagree on the bare block" in t for t in texts(dataclasses.replace(design, bare=off)))
