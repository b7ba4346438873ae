"""Notes: dangers first, each said once and only where it holds."""

import dataclasses

import numpy as np
import pytest

import tpd
from tests.designs import paired
from tests.report.conftest import DESIGNS, SCENE, details, ground, harmonic, tuned
from tpd.design.as_built import Details
from tpd.design.variations import Dependence
from tpd.report.blocks import Severity
from tpd.report.notes import notes, overturns_more, wall_contacts
from tpd.scene.status import Status, code_of

LIGHT = tpd.Pendulum(mass=0.5, length=0.12, damping_ratio=0.1)


def only(design, about: str, study_of=None):
    """The one note that holds these words."""
    (found,) = (n for n in notes(design, Details() if study_of is None else study_of) if about in n.text)
    return found


def said(design, about: str) -> bool:
    return any(about in n.text for n in notes(design, Details()))


def changed(design=None, exact=None, **more):
    """The recommended design with changes of its validation and of its exact motions."""
    design = harmonic() if design is None else design
    best = design.validated[-1]
    if exact is not None:
        orbits = exact.pop("orbits", {})
        exact["orbits"] = best.exact.orbits._replace(**orbits)
        more["exact"] = (
            best.exact._replace(**exact)
            if hasattr(best.exact, "_replace")
            else dataclasses.replace(best.exact, **exact)
        )
    best = dataclasses.replace(best, **more)
    return dataclasses.replace(design, validated=(*design.validated[:-1], best))


@pytest.mark.parametrize(
    ("measure", "stuck", "expected"),
    [
        ("overturning", np.where(np.arange(400) < 120, np.inf, 0.3), "MORE RUNS OVERTURN"),
        ("overturning", np.full(400, 0.5), ""),
        ("tilt", np.full(400, 0.5), "THE MEAN TILT IS LARGER"),
        ("tilt", np.full(400, 0.2), ""),
    ],
)
def test_a_failed_part_is_a_danger_if_it_is_worse_than_no_pendulum_by_what_decides(measure, stuck, expected):
    alone = np.where(np.arange(400) < 20, np.inf, 0.3)
    row = Dependence("failure", "hinge", 0.0, "hinge stuck", paired(stuck, alone), measure, None)
    found = [n for n in notes(harmonic(), Details(variations=(row,))) if "A PART FAILS" in n.text]
    assert [n.severity for n in found] == ([Severity.danger] if expected else [])
    assert all(f"(HINGE STUCK), {expected} THAN WITHOUT A PENDULUM: " in n.text for n in found)


def test_a_bob_that_would_touch_the_walls_is_a_danger_with_a_remedy():
    """Half width 0.04 m, length 0.12 m; a ball of 0.5 kg has a radius of 0.0248 m: 0.1272 rad are left."""
    ball = (0.5 / 7850.0 * 3.0 / (4.0 * np.pi)) ** (1.0 / 3.0)
    most = np.arcsin((0.04 - ball) / 0.12)
    assert wall_contacts(SCENE.block, LIGHT, {"once settled": most - 1e-6, "on the way": most - 1e-6}) == []
    (note,) = wall_contacts(SCENE.block, LIGHT, {"once settled": 0.1, "in a transient": most + 1e-6})
    start = "In a transient the bob, as a solid ball of steel, would reach 0.0400001 m"
    assert note.text.startswith(start)
    assert (
        f"clear of the walls up to an angle of {np.floor(1e3 * most) / 1e3:g} rad between rod and block"
        in note.text
    )
    assert "A search without `--exactly` and `--no-walls` limits the clearance" in note.text
    (note,) = wall_contacts(SCENE.block, dataclasses.replace(LIGHT, mass=16.0), {"settled": 0.0})
    assert note.severity is Severity.danger
    assert "clear of the walls at no angle" in note.text


def test_wall_contact_is_reported_once_for_orbits_transients_and_runs():
    n = len(harmonic().conditions)
    zero = np.zeros(n)
    orbits = {"swing": zero[None], "tilt": zero[None]}
    still = {**dict.fromkeys(("tilt", "settled_tilt", "swing", "settled_swing"), zero), "orbits": orbits}
    light = {"pendulum": LIGHT}
    half = only(changed(exact=dict(still), **light), "TOUCH").text
    assert half.startswith("In half of the validation runs the bob, as a solid ball of steel")
    from_rest = still | {"tilt": np.full(n, 0.3)}
    assert only(changed(exact=from_rest, **light), "TOUCH").text.startswith(
        "In the transient from rest the bob"
    )
    settled = still | {"orbits": orbits | {"swing": np.full((1, n), 0.5)}}
    assert only(changed(exact=settled, **light), "TOUCH").text.startswith("In the settled motion the bob")
    # With walls in the search the runs decide.
    assert not said(tuned(), "TOUCH")


def test_overturning_from_rest_is_a_danger_unless_the_pendulum_prevents_more():
    n = len(harmonic().conditions)
    without = harmonic().problem.without_pendulum.status == "overturned"
    stood = np.flatnonzero(~without)
    status = np.where(np.arange(n) == stood[0], "overturned", "rocking").astype(object).astype(str)
    note = only(changed(exact={"status": status}), "OVERTURNS")
    assert f"OVERTURNS with the pendulum under 1 of {n} conditions, " in note.text
    assert "The pendulum causes overturning under 1 (first: " in note.text
    assert (
        f"(first: {harmonic().conditions.label(int(stood[0]))}), and prevents it under {np.sum(without)}."
        in note.text
    )
    assert note.severity is Severity.note
    worst = np.full(n, "overturned")
    assert only(changed(exact={"status": worst}), "OVERTURNS").severity is Severity.danger


def test_a_note_counts_the_runs_without_a_result():
    runs = harmonic().runs
    outcome = np.where(np.arange(len(runs.group)) < 3, code_of(Status.failed), runs.with_pendulum.outcome)
    lost = dataclasses.replace(runs.with_pendulum, outcome=outcome)
    note = only(changed(reported_runs=dataclasses.replace(runs, with_pendulum=lost)), "have no result")
    assert note.text.startswith(f"3 of {len(runs.group)} runs have no result")


@pytest.mark.parametrize("kind", DESIGNS)
def test_dangers_precede_notes_and_no_note_is_repeated(kind):
    found = notes(DESIGNS[kind](), details(kind))
    order = [n.severity.value for n in found]
    assert order == sorted(order)
    assert len({n.text for n in found}) == len(found)


def test_wall_contact_is_a_danger_at_any_allowed_share():
    for share, count in ((0.62, 1), (0.005, 0)):
        found = notes(changed(tuned(), over_limit=share), Details())
        dangers = [n for n in found if n.severity is Severity.danger]
        assert sum("62.0 % of the surviving runs exceed a limit" in n.text for n in dangers) == count
    assert not said(ground(), "exceed a limit")


def test_significantly_more_overturning_at_a_nearby_frequency_is_a_danger():
    def pair(*cases):
        """Responses with shares of 32 runs each, and Wilson's intervals."""
        plain, at = details().responses[0], np.array([2.0, 2.45, 3.0])
        runs = (
            np.stack([np.repeat(at, 32), [i < round(32 * v) for v in case for i in range(32)]])
            for case in cases
        )
        return tuple(dataclasses.replace(plain, runs=x, frequency=at) for x in runs)

    worse = pair((0.0, 0.0, 0.25), (0.0, 0.5, 0.25))
    assert overturns_more(*worse).tolist() == [False, True, False]
    # 4 of 32 runs against 1 are chance: Newcombe's interval of the difference holds zero.
    assert not overturns_more(*pair((0.03125, 0.0, 0.0), (0.125, 0.0, 0.0))).any()
    note = only(harmonic(), "OVERTURNS more often", Details(responses=worse))
    assert note.severity is Severity.danger
    assert note.text == (
        "At 2.45 Hz the block OVERTURNS more often with the pendulum (share of the runs from rest between "
        "2.33 and 2.57 Hz that overturn: 0 % without the pendulum, 50 % with the pendulum). Linear "
        "model, same base amplitude."
    )


@pytest.mark.parametrize(
    ("words", "exact"),
    [
        ("At a swing of 0.35 rad the linear model", {"settled_swing": np.full(10, 0.35)}),
        (
            "The settled motion attracts slowly (Floquet multiplier 0.970)",
            {"multiplier": np.full(10, 0.97), "status": np.full(10, "rocking")},
        ),
        (
            "Rest is a stable state with this pendulum under 10 of 10 conditions",
            {"margin": np.full(10, 0.1), "status": np.full(10, "rocking")},
        ),
        (
            "Under 10 of 10 conditions the search found no attracting symmetric orbit",
            {"orbits": {"kind": np.full((1, 10), 3)}},
        ),
        (
            "The objective of the descents (what remains of a disturbance, per period) is larger",
            {"value": 9.0},
        ),
    ],
)
def test_other_limitations_of_the_result_are_notes(words, exact):
    assert only(changed(exact=dict(exact)), words).severity is Severity.note
    assert not said(harmonic(), words) or "value" in exact


def test_the_note_on_overturning_names_the_stated_condition():
    design = harmonic()
    conditions, without = design.conditions, design.problem.without_pendulum
    n, stated = len(conditions), (conditions.factor_rows() == 1.0).all(axis=1)
    assert stated.sum() == 1
    same = dataclasses.replace(without, status=np.where(stated, "overturned", "rocking"))
    problem = dataclasses.replace(design.problem)
    vars(problem)["without_pendulum"] = same
    best = dataclasses.replace(design.validated[-1], exact=same)
    both = dataclasses.replace(design, problem=problem, validated=(*design.validated[:-1], best))
    note = only(both, "OVERTURNS")
    assert f"under 1 of {n} conditions, among them the stated one, and without it under 1." in note.text
    assert "causes overturning under 0, and" in note.text
    assert note.severity is Severity.note


def test_designs_of_cross_fitting_outside_of_the_range_of_equal_performance_are_a_note():
    design = dataclasses.replace(harmonic(), equivalent=np.array([[0.05, 0.3, 0.1], [0.1, 0.5, 0.2]]))
    for masses, differ in (((0.06, 0.09), False), ((0.04, 0.09), True), ((0.06, 0.11), True)):
        crossed = np.array([[mass, 0.4, 0.15] for mass in masses])
        assert said(changed(design, crossed=crossed), "lead to different pendulums") is differ
