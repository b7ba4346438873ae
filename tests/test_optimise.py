"""The main job on a small budget: one run, looked at from many sides."""

import json

import numpy as np
import pytest

import tpd
from tpd.design.job import Job, Search, build, dump, tables
from tpd.design.result import DesignStatus, StartStatus
from tpd.design.single import searched_with
from tpd.plot import single as plot
from tpd.report import notes
from tpd.report import single as report

SMALL = {"starts": 3, "steps": 10, "screening": 64}
SPACE = tpd.DesignSpace(mass_ratio=(0.01, 0.1), stroke=1.5)


@pytest.fixture(scope="module")
def stages():
    return []


@pytest.fixture(scope="module")
def design(stages):
    return tpd.optimise(
        tpd.paper_scene(), SPACE, seed=1, progress=lambda *event: stages.append(event), **SMALL
    )


def test_the_answer_is_exact_and_within_the_limits(design):
    assert design.status is DesignStatus.found
    p = design.scene.parameters(design.pendulum)
    exact = tpd.steady_state(p)
    assert float(exact.amplitude) == pytest.approx(design.amplitude, rel=1e-9)
    assert float(exact.stroke) == pytest.approx(design.stroke, rel=1e-9)
    assert design.stroke <= SPACE.stroke
    low, high = SPACE.bounds
    x = np.array([design.winner.mass_ratio, design.winner.length_ratio])
    assert np.all((x >= low) & (x <= high))


def test_it_lessens_the_rocking_of_the_papers_block(design):
    assert design.amplitude_without == pytest.approx(0.0833335, abs=1e-6)
    assert design.amplitude < 0.95 * design.amplitude_without
    tried, _, _ = design.overturned_nearby
    assert tried == 8
    assert design.peak[0] >= 0.9 * design.amplitude, "the way there is no smaller than the end"


def test_the_nonlinear_equations_have_nothing_against_the_design_and_had_against_others(design):
    first, last = design.rounds[0], design.rounds[-1]
    assert first.limit == SPACE.stroke
    assert first.objections, "by the linear optimum the block overturns"
    assert len(design.rounds) > 1
    assert last.objections == ()
    assert last.limit < first.limit
    assert (last.mass_ratio, last.length_ratio) == (design.winner.mass_ratio, design.winner.length_ratio)
    found = tpd.check(design.scene, design.pendulum, stroke=SPACE.stroke, rungs=("uplift",))
    assert found.top.stroke == pytest.approx(last.stroke)
    assert found.top.amplitude == pytest.approx(last.amplitude)
    assert found.objections == ()


def test_a_design_that_no_round_could_mend_is_not_offered(design):
    import dataclasses

    bad = dataclasses.replace(
        design, pendulum=None, status=DesignStatus.nonlinear_objects, rounds=design.rounds[:1]
    )
    text = report.text(bad)
    assert text.startswith("NO DESIGN TO OFFER")
    assert f"refused: {design.rounds[0].objections[0]}" in text
    assert not report.is_sound(bad)


def test_both_models_agree_on_the_winner_and_the_bare_block(design):
    for candidate in (design.winner, design.bare):
        assert candidate.agree
        assert abs(candidate.difference) < design.tolerance


def test_every_start_has_a_path_and_a_status(design):
    assert len(design.starts) == SMALL["starts"]
    assert all(isinstance(s, StartStatus) for s in design.starts)
    assert design.history.designs.shape[0] == SMALL["starts"]
    assert design.history.amplitude.shape == design.history.designs.shape[:2]
    assert design.history.screened.shape == (SMALL["screening"], 3)


def test_progress_covers_every_stage(design, stages):
    assert design is not None
    expected = {"screening", "searching", "finishing", "verifying", "ensemble"}
    assert {name for name, _, _ in stages} == expected
    assert all(0 < done <= total for _, done, total in stages)


def test_the_report_says_it_in_words(design):
    text = report.text(design)
    assert text.startswith(DesignStatus.found.value)
    assert f"{design.pendulum.mass:.4g} kg" in text
    assert "losses friction k = 0.05" in text
    assert "exact      smoothed" in text
    assert "stroke of" in text, "a large stroke is warned of"


def test_the_json_is_sorted_complete_and_finite(design):
    job = Job(scene=design.scene, space=SPACE, search=Search(seed=1, **SMALL))
    content = json.loads(report.as_json(design, job))
    assert list(content) == sorted(content)
    assert content["status"] == "found"
    assert content["pendulum"]["mass"] == pytest.approx(design.pendulum.mass)
    assert content["parameters"]["mu"] == pytest.approx(design.winner.mass_ratio)
    assert content["seed"] == 1
    assert {"python", "tpd", "jax", "diffrax", "optax"} <= set(content["versions"])
    assert content["job"] == json.loads(json.dumps(tables(job)))


@pytest.mark.parametrize(
    "losses",
    [{}, {"restitution": "housner"}, {"restitution": 0.9}, {"restitution": "housner", "friction": 0.02}],
    ids=str,
)
def test_a_job_survives_being_written_and_read(losses):
    import tomllib

    scene = tpd.Scene(tpd.Block(width=0.1, height=0.4, mass=16.0, **losses), tpd.paper_scene().motion)
    job = Job(scene=scene, space=tpd.DesignSpace(damping_ratio=(0.05, 0.3)), search=Search(seed=7))
    assert build(tomllib.loads(dump(job))) == job
    assert build(json.loads(json.dumps(tables(job)))) == job


def test_a_report_names_what_takes_the_energy():
    sizes = {"width": 0.1, "height": 0.4, "mass": 16.0}
    told = {
        (): "friction k = 0.05",
        (("restitution", "housner"),): "impact loss: Housner, e = 0.9118",
        (("restitution", 0.9), ("friction", 0.02)): "impact loss: e = 0.9; friction k = 0.02",
    }
    for losses, text in told.items():
        assert notes.losses(tpd.Block(**sizes, **dict(losses))) == text


def test_disagreement_is_said_first_and_is_not_sound(design):
    import dataclasses

    winner = dataclasses.replace(design.winner, smoothed_amplitude=1.0, agree=False)
    bad = dataclasses.replace(design, winner=winner, status=DesignStatus.models_disagree)
    assert report.text(bad).startswith("DO NOT USE")
    assert "MODELS DISAGREE" in report.text(bad)
    assert not report.is_sound(bad)
    assert report.is_sound(design)


def test_ctrl_c_leaves_what_was_found_so_far():
    def stop(stage, done, _):
        if stage == "screening" and done == 5:
            raise KeyboardInterrupt

    cut = tpd.optimise(tpd.paper_scene(), SPACE, seed=1, progress=stop, **SMALL)
    assert cut.interrupted
    assert set(cut.starts) == {StartStatus.interrupted}
    assert len(cut.history.screened) == 5
    assert cut.bare.amplitude == pytest.approx(0.0833335, abs=1e-6)
    assert report.text(cut).startswith("INTERRUPTED")
    assert not report.is_sound(cut)


@pytest.mark.parametrize("stage", ["searching", "verifying"])
def test_ctrl_c_in_the_search_keeps_the_best_design(stage):
    def stop(now, done, _):
        if now == stage and done == 2:
            raise KeyboardInterrupt

    cut = tpd.optimise(tpd.paper_scene(), SPACE, seed=1, progress=stop, **SMALL)
    assert cut.interrupted
    assert cut.winner is not None
    assert cut.winner.stroke <= SPACE.stroke


@pytest.mark.slow
def test_one_step_is_enough_to_answer():
    one = tpd.optimise(tpd.paper_scene(), SPACE, seed=1, starts=3, steps=1, screening=24)
    assert one.winner is not None


def test_a_block_that_rests_needs_no_pendulum():
    import dataclasses

    calm = dataclasses.replace(tpd.paper_scene(), motion=tpd.Harmonic(amplitude=0.005, frequency=2.5))
    design = tpd.optimise(calm, SPACE, **SMALL)
    assert design.status is DesignStatus.no_uplift
    assert design.pendulum is None
    assert design.amplitude == design.amplitude_without == 0.0
    assert report.is_sound(design)
    assert "no pendulum to offer" in report.text(design)


def test_a_block_that_rests_by_the_linear_equations_alone_is_no_calm_one(monkeypatch):
    import dataclasses

    # A stub: from rest the bare block lifts by both equations or by none.
    monkeypatch.setattr("tpd.design.single_rounds.nonlinear", lambda p: (0.03, 0.0, "rocking"))
    calm = dataclasses.replace(tpd.paper_scene(), motion=tpd.Harmonic(amplitude=0.005, frequency=2.5))
    design = tpd.optimise(calm, SPACE, **SMALL)
    assert design.status is DesignStatus.nonlinear_objects
    assert design.pendulum is None
    (told,) = design.rounds
    assert (told.amplitude, told.mass_ratio) == (0.03, 0.0)
    assert told.objections == (
        "by the nonlinear equations the bare block does not settle at rest but ends rocking",
    )
    assert not report.is_sound(design)
    assert "refused: by the nonlinear equations the bare block does not settle" in report.text(design)


HOUSNER = tpd.Scene(
    tpd.Block(width=0.1, height=0.4, mass=16.224, restitution="housner"), tpd.paper_scene().motion
)


def test_a_search_runs_on_a_model_that_has_the_blocks_losses():
    assert isinstance(searched_with(tpd.paper_scene().parameters()), tpd.Smoothed)
    assert isinstance(searched_with(HOUSNER.parameters()), tpd.Piecewise)
    with pytest.raises(ValueError, match="`e` must be between 1 and 1 in the smoothed model"):
        tpd.optimise(HOUSNER, SPACE, model=tpd.Smoothed())


@pytest.mark.slow
def test_a_block_with_impact_loss_is_searched_exactly():
    found = tpd.optimise(HOUSNER, SPACE, seed=1, starts=2, steps=4, screening=16)
    assert found.searched_with == "piecewise"
    assert found.bare.amplitude == pytest.approx(0.083845, abs=1e-6)
    assert found.bare.agree
    assert found.winner.smoothed_amplitude == pytest.approx(found.winner.amplitude, rel=1e-9, abs=1e-12)
    text = report.text(found)
    assert "losses impact loss: Housner, e = 0.9118" in text
    assert "exact     piecewise" in text
    assert {name for name, _ in plot.pictures(found, ())} == {"search.png", "motion.png"}


def test_a_pendulum_that_saves_by_luck_is_called_fragile(design):
    import dataclasses

    lucky = dataclasses.replace(design, status=DesignStatus.fragile, overturned_nearby=(8, 2, 1))
    text = report.text(lucky)
    assert text.startswith("DO NOT RELY ON IT")
    assert "DANGER: of 8 shakings within 1 %" in text
    assert not report.is_sound(lucky)


@pytest.mark.parametrize(
    ("wrong", "message"),
    [
        ({"starts": 0}, "`starts` must be a whole number, 1 or more, but is 0"),
        ({"tolerance": 0.0}, "`tolerance` must be positive"),
        ({"seed": -1}, "`seed` must be zero or positive"),
    ],
)
def test_bad_settings_are_refused(wrong, message):
    with pytest.raises(ValueError, match=message):
        tpd.optimise(tpd.paper_scene(), **wrong)


@pytest.mark.parametrize(
    ("wrong", "message"),
    [
        ({"mass_ratio": (0.2, 0.1)}, "`mass_ratio` must be an interval low < high"),
        ({"length_ratio": (0.1, 0.1)}, "`length_ratio` must be an interval"),
        ({"length_ratio": (0.1, 3.0)}, "within 0.001 to 2"),
        ({"mass_ratio": (float("nan"), 0.1)}, "`mass_ratio` must be an interval"),
        ({"damping_ratio": -0.1}, "`damping_ratio` must be between 0 and 2"),
        ({"stroke": 0.0}, "`stroke` must be positive"),
    ],
)
def test_bad_spaces_are_refused(wrong, message):
    with pytest.raises(ValueError, match=message):
        tpd.DesignSpace(**wrong)
