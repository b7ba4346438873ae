"""Notes: dangers first, each said once and only where it holds."""

import dataclasses

import numpy as np
import pytest

import tpd
from tests import designs
from tpd.answers.attractors import Starts
from tpd.answers.paired import Verdict
from tpd.answers.statistics import Share
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


def with_winner(base=designs.single, pendulum=designs.HUNG, **changes):
    design = base()
    winner = dataclasses.replace(design.winner, **changes)
    return dataclasses.replace(design, verified=(*design.verified[:-1], winner), pendulum=pendulum)


def struck(stroke, peak_swing):
    """Notes on strikes of a bob of 0.5 kg: block and bob peak at 0.06 rad and this angle."""
    peaks = {"peak": np.array([0.06]), "peak_stroke": np.array([peak_swing])}
    design = with_winner(pendulum=LIGHT, exact=designs.motions(0.04, stroke, **peaks), paired=None)
    return [t for t in texts(design) if "STRIKE" in t]


def test_a_bob_that_would_strike_the_walls_is_a_danger_with_a_remedy():
    """Half width 0.05 m, length 0.12 m; a ball of 0.5 kg has a radius of 0.0248 m: 0.2118 rad are left."""
    ball = (0.5 / 7850.0 * 3.0 / (4.0 * np.pi)) ** (1.0 / 3.0)
    most = np.arcsin((0.05 - ball) / 0.12)
    # The bob's angle and the block's tilt together: 0.04 rad settled, 0.06 rad on the way.
    assert struck(most - 0.04 - 1e-6, most - 0.06 - 1e-6) == []
    (text,) = struck(0.1, most - 0.06 + 1e-6)
    start = "On the way from rest the bob, as a solid ball of steel, would reach 0.05 m from the block's axis"
    assert text.startswith(start)
    assert f"up to {np.floor(1e3 * most) / 1e3:g} rad between rod and block" in text
    assert "Without `--exactly` the search asks for room" in text
    # 0.12 m times sin(0.5), and the radius.
    (text,) = struck(0.46, 0.6)
    assert text.startswith("Once settled the bob, as a solid ball of steel, would reach 0.0823 m")
    (note,) = strikes(designs.SCENE.block, dataclasses.replace(LIGHT, mass=16.0), {"settled": 0.0})
    assert note.severity is Severity.danger
    assert "keeps off them at no angle" in note.text


def test_walls_are_watched_in_the_ensemble_too():
    """Half of the runs reach 0.1 rad of bob and block each, 0.2 rad together: 0.0238 m."""
    quiet, heavier = designs.motions(0.01, 0.01), dataclasses.replace(LIGHT, mass=0.6)
    design = with_winner(pendulum=heavier, exact=quiet, paired=designs.paired(tilt=0.1))
    # 0.12 m times sin(0.2), and the radius of 0.0263 m.
    said = "In half of the paired runs the bob, as a solid ball of steel, would reach 0.0502"
    assert only(design, about="STRIKE").text.startswith(said)
    lost = Verdict(hung=designs.outcomes(30), bare=designs.outcomes(30))
    assert not any("STRIKE" in t for t in texts(with_winner(pendulum=heavier, exact=quiet, paired=lost)))


def test_over_conditions_the_search_may_know_larger_angles_than_the_start_from_rest():
    quiet = designs.motions(np.full(8, 0.01), 0.01)
    design = with_winner(designs.band, LIGHT, exact=quiet, paired=None)
    said = "Once settled the bob, as a solid ball of steel, would reach 0.0849 m"
    assert said in only(design, about="STRIKE").text
    # Of a search over starts at rest the exact solution has the last word.
    assert not any("STRIKE" in t for t in texts(dataclasses.replace(design, starts=Starts.rest())))


def test_overturning_from_rest_is_counted_and_a_danger_where_the_bare_block_stands():
    status = np.array(["overturned", "overturned", *["rocking"] * 6])
    design = with_winner(designs.band, exact=designs.motions(np.full(8, 0.05), 0.3, status))
    note = only(design, about="OVERTURNS")
    assert note.severity is Severity.danger
    said = "under 1 of 8 conditions that it stands without, and saves it under 0. The first: "
    assert f"{said}{design.conditions.label(1)}." in note.text
    rest = designs.survey("nonlinear", 8).at(np.array([0]))
    severity = np.array([[1.0, 1.0, *[0.3] * 6]])
    for bare, count, kind in ((severity[0], 2, Severity.note), (rest.bare, 0, Severity.danger)):
        found = with_winner(designs.band, rest=dataclasses.replace(rest, severity=severity, bare=bare))
        said = f"of 8 conditions: 2 overturn the block with the pendulum, {count} without"
        assert only(found, about=said).severity is kind
    assert "from rest, of" not in str(notes(with_winner(designs.band, rest=rest), designs.study()))


def test_that_it_overturns_less_is_shown_by_significantly_fewer_runs():
    for worse, better, shown in ((0, 0, False), (3, 5, False), (0, 19, True)):
        late = np.where(np.arange(40) >= 40 - better, "overturned", "rocking")
        bare = dataclasses.replace(designs.outcomes(0), status=late)
        verdict = Verdict(hung=designs.outcomes(worse), bare=bare)
        assert (verdict.worse, verdict.better) == (worse, better)
        unsaid = "Nothing shows that the block overturns less"
        assert any(unsaid in t for t in texts(with_winner(paired=verdict))) is not shown


def test_dangers_come_first():
    order = [n.severity.value for n in notes(designs.band(), designs.study())]
    assert order == sorted(order)
    assert set(order) == {s.value for s in Severity}


@pytest.mark.mends("strikes in most of the runs were information where a job allows them")
def test_strikes_are_a_danger_whatever_a_job_allows():
    for share, said in ((0.62, 1), (0.005, 0)):
        design = with_winner(designs.around, strikes=share)
        design = dataclasses.replace(design, worth=tpd.limits.Worth(strikes=0.9, runs=40))
        found = texts(design, severity=Severity.danger)
        assert sum("The bob strikes a wall in 62.0% of the paired runs" in t for t in found) == said


def test_more_overturnings_in_a_band_are_a_danger_where_chance_does_not_explain_them():
    def pair(*cases):
        """Responses with shares of 32 runs each, and Wilson's intervals."""
        shares = (np.array([Share.of(np.arange(32) < round(32 * v)) for v in case]).T for case in cases)
        plain = designs.response(0.01, 0.01, 0.01)
        return tuple(dataclasses.replace(plain, overturning=x) for x in shares)

    worse = pair((0.0, 0.0, 0.25), (0.0, 0.5, 0.25))
    assert overturns_more(*worse).tolist() == [False, True, False]
    # 4 of 32 runs against 1 are chance: Newcombe's interval of the difference holds zero.
    assert not overturns_more(*pair((0.03125, 0.0, 0.0), (0.125, 0.0, 0.0))).any()
    note = only(designs.single(), Study(responses=worse), about="OVERTURNS more often")
    assert note.severity is Severity.danger
    said = "At 2.45 Hz the block OVERTURNS more often with this pendulum: near 2.45 Hz in 50% of the runs"
    assert note.text.startswith(f"{said} from rest, 0% without")
    assert not overturns_more(*[designs.response(0.01, 0.01, 0.01)] * 2).any()


NEUTRAL = designs.evaluation(np.full(8, 0.1), 0.3, kind=np.full((1, 8), 3))
EDGE = {"exact": designs.motions(0.04, 0.35, multiplier=np.array([0.97])), "margin": np.array([0.1])}


@pytest.mark.parametrize(
    ("said", "design", "study"),
    [
        ("A stroke of 0.35 rad stretches the linear equations of the pendulum.", with_winner(**EDGE), NONE),
        ("The motion attracts slowly (Floquet multiplier 0.970).", with_winner(**EDGE), NONE),
        ("The block could rest under this pendulum, but a start from rest ends", with_winner(**EDGE), NONE),
        (
            "Under 8 of 8 conditions no symmetric motion that attracts was found.",
            with_winner(designs.band, evaluation=NEUTRAL),
            NONE,
        ),
        ("The worst settled tilt, which the searches make small, is larger", with_winner(value=0.4), NONE),
    ],
)
def test_what_else_changes_the_conclusions_is_a_note(said, design, study):
    assert only(design, study, about=said).severity is Severity.note
    assert not any(said in t for t in texts(designs.single()))
