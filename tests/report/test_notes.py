"""Notes: dangers first, each said once and only where it holds."""

import dataclasses

import numpy as np
import pytest

import tpd
from tests import designs
from tpd.answers.attractors import Starts
from tpd.answers.paired import Verdict
from tpd.design.result import DesignStatus
from tpd.design.study import Study
from tpd.report.blocks import Severity
from tpd.report.notes import notes, overturns_more, strikes

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


def strike_notes(pendulum=LIGHT, **changes):
    exact = designs.motions(0.04, changes.pop("stroke"), **changes)
    design = with_winner(exact=exact, paired=None)
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
    start = "On the way from rest the bob, as a solid ball of steel, would reach 0.05 m from the block's axis"
    assert text.startswith(start)
    assert f"up to {np.floor(1e3 * most) / 1e3:g} rad between rod and block" in text
    assert "Without `--exactly` the search asks for room" in text
    (text,) = strike_notes(stroke=0.46, **peaks(0.6))
    # 0.12 m times sin(0.5), and the radius.
    assert text.startswith("Once settled the bob, as a solid ball of steel, would reach 0.0823 m")


def test_a_ball_wider_than_the_block_fits_at_no_angle():
    heavy = dataclasses.replace(designs.HUNG, mass=16.0)
    (note,) = strikes(designs.SCENE.block, heavy, {"settled": 0.0})
    assert note.severity is Severity.danger
    assert "keeps off them at no angle" in note.text


def test_walls_are_watched_in_the_ensemble_too():
    """Half of the runs reach 0.1 rad of bob and block each, 0.2 rad together: 0.0238 m."""
    quiet = designs.motions(0.01, 0.01)
    runs = designs.paired(tilt=0.1)
    design = with_winner(exact=quiet, paired=runs)
    design = dataclasses.replace(design, pendulum=dataclasses.replace(LIGHT, mass=0.6))
    text = only(design, about="STRIKE").text
    # 0.12 m times sin(0.2), and the radius of 0.0263 m.
    assert text.startswith("In half of the paired runs the bob, as a solid ball of steel, would reach 0.0502")
    lost = Verdict(hung=designs.outcomes(30), bare=designs.outcomes(30))
    design = dataclasses.replace(with_winner(exact=quiet, paired=lost), pendulum=design.pendulum)
    assert not any("STRIKE" in t for t in texts(design))


def test_over_conditions_the_search_may_know_larger_angles_than_the_start_from_rest():
    quiet = designs.motions(np.full(8, 0.01), 0.01)
    design = dataclasses.replace(with_winner(designs.band, exact=quiet, paired=None), pendulum=LIGHT)
    assert (
        "Once settled the bob, as a solid ball of steel, would reach 0.0849 m"
        in only(design, about="STRIKE").text
    )
    # Of a search over starts at rest the exact solution has the last word.
    assert not any("STRIKE" in t for t in texts(dataclasses.replace(design, starts=Starts.rest())))


def test_overturning_from_rest_is_counted_and_a_danger_where_the_bare_block_stands():
    status = np.array(["overturned", "overturned", *["rocking"] * 6])
    exact = designs.motions(np.full(8, 0.05), 0.3, status)
    design = with_winner(designs.band, exact=exact)
    note = only(design, about="OVERTURNS")
    assert note.severity is Severity.danger
    said = "under 1 of 8 conditions that it stands without, and saves it under 0. The first: "
    assert f"{said}{design.conditions.label(1)}." in note.text


@pytest.mark.parametrize(("worse", "better", "fewer"), [(0, 0, False), (3, 5, False), (0, 19, True)])
def test_that_it_overturns_less_is_shown_by_significantly_fewer_runs(worse, better, fewer):
    size, order = 40, np.arange(40)
    hung, bare = designs.outcomes(worse), designs.outcomes(0)
    late = np.where(order >= size - better, "overturned", "rocking")
    verdict = Verdict(hung=hung, bare=dataclasses.replace(bare, status=late))
    assert (verdict.worse, verdict.better) == (worse, better)
    said = any("Nothing shows that the block overturns less" in t for t in texts(with_winner(paired=verdict)))
    assert said is not fewer


def test_overturnings_from_rest_are_counted_and_more_of_them_are_a_danger():
    rest = designs.survey("nonlinear", 8).at(np.array([0]))
    severity = np.array([[1.0, 1.0, *[0.3] * 6]])
    both = with_winner(designs.band, rest=dataclasses.replace(rest, severity=severity, bare=severity[0]))
    note = only(both, about="of 8 conditions: 2 overturn the block with the pendulum, 2 without")
    assert note.severity is Severity.note
    more = with_winner(designs.band, rest=dataclasses.replace(rest, severity=severity))
    assert only(more, about="2 overturn the block with the pendulum, 0 without").severity is Severity.danger
    assert "from rest, of" not in str(notes(with_winner(designs.band, rest=rest), designs.study()))


def test_dangers_come_first():
    order = [n.severity.value for n in notes(designs.band(), designs.study())]
    assert order == sorted(order)
    assert set(order) == {s.value for s in Severity}


@pytest.mark.mends("strikes in most of the runs were information where a job allows them")
def test_strikes_are_a_danger_whatever_a_job_allows():
    for share, said in ((0.62, 1), (0.005, 0)):
        design = dataclasses.replace(designs.around(), worth=tpd.limits.Worth(strikes=0.9, runs=40))
        winner = dataclasses.replace(design.winner, strikes=share)
        found = texts(dataclasses.replace(design, verified=(winner,)), severity=Severity.danger)
        assert sum("The bob strikes a wall in 62.0% of the paired runs" in t for t in found) == said


def shares(*values, runs=32):
    """Shares of so many runs each, with Wilson's intervals."""
    from tpd.answers.statistics import Share

    return np.array([Share.of(np.arange(runs) < round(v * runs)) for v in values]).T


def test_more_overturnings_in_a_band_are_a_danger_where_chance_does_not_explain_them():
    def pair(hung, bare):
        return tuple(
            dataclasses.replace(designs.response(0.01, 0.01, 0.01), overturning=shares(*x))
            for x in (bare, hung)
        )

    worse = pair((0.0, 0.5, 0.25), (0.0, 0.0, 0.25))
    assert overturns_more(*worse).tolist() == [False, True, False]
    # 4 of 32 runs against 1 are chance: Newcombe's interval of the difference holds zero.
    assert not overturns_more(*pair((0.125, 0.0, 0.0), (0.03125, 0.0, 0.0))).any()
    (note,) = [n for n in notes(designs.single(), Study(responses=worse)) if "OVERTURNS more often" in n.text]
    assert note.severity is Severity.danger
    assert note.text.startswith(
        "At 2.45 Hz the block OVERTURNS more often with this pendulum: near 2.45 Hz in 50% of the runs from "
        "rest, 0% without"
    )
    none = designs.response(0.01, 0.01, 0.01)
    assert not overturns_more(none, none).any()


def test_the_edges_of_the_settled_motion_are_said():
    exact = designs.motions(0.04, 0.35, multiplier=np.array([0.97]))
    said = texts(with_winner(exact=exact, margin=np.array([0.1])), severity=Severity.note)
    assert "A stroke of 0.35 rad stretches the linear equations of the pendulum." in said
    assert "The motion attracts slowly (Floquet multiplier 0.970)." in said
    assert "The block could rest under this pendulum, but a start from rest ends in rocking." in said


def test_conditions_without_a_motion_that_attracts_are_counted():
    kind = np.full((1, 8), 3)
    none = with_winner(designs.band, evaluation=designs.evaluation(np.full(8, 0.1), 0.3, kind=kind))
    assert "Under 8 of 8 conditions no symmetric motion attracts" in " ".join(texts(none))


def test_a_pendulum_whose_settled_tilt_is_larger_is_said():
    said = "The worst settled tilt, which the searches make small, is larger with this pendulum"
    assert not any(said in t for t in texts(designs.single()))
    (note,) = [n for n in notes(with_winner(value=0.4), Study()) if said in n.text]
    assert note.severity is Severity.note


def test_interruptions_are_said():
    cut = designs.single(status=DesignStatus.interrupted, pendulum=None)
    assert "The search was interrupted; nothing below is the best of the design space." in texts(cut)
    said = texts(designs.single(), Study(left_out=("the time histories",)))
    assert "This report goes without the time histories: its computation was interrupted." in said
