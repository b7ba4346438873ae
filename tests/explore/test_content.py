"""Content of the page: what it takes from a design, a stored design, a job and a scene."""

import base64
import inspect
import json
from dataclasses import replace

import numpy as np
import pytest

import tpd
from tests import designs
from tests.designs import PENDULUM, SCENE
from tests.explore import made
from tpd.answers.transient import FREE
from tpd.design.job import job_of
from tpd.design.optimise import problem_of
from tpd.explore.content import content
from tpd.explore.tables import NONE

KEYS = {
    "version",
    "title",
    "verdict",
    "scene",
    "limits",
    "other_limits",
    "limit_labels",
    "still",
    "space",
    "recommended",
    "runs",
    "no_runs",
    "controls",
}
BLOCK = {"width": 1.0, "height": 6.0, "mass": 5770.0, "cavity_width": 0.7}
PULSE = {"block": BLOCK, "excitation": {"pulse": "one-sine", "pulse_frequency": 1.0, "pga": 0.5}}


@pytest.fixture(autouse=True)
def small(monkeypatch):
    """Pages of small tables."""
    made.small_tables(monkeypatch)


def values(out: dict) -> dict[str, float]:
    """First values of the controls."""
    return {control["name"]: control["value"] for control in out["controls"]}


def test_the_page_of_a_scene_begins_in_the_middle_of_the_default_space():
    out = content(SCENE)
    assert out.keys() == KEYS | {"tables", "periods", "trials"}
    assert (out["recommended"], out["runs"], out["verdict"]) == (None, [], "")
    own = values(out)
    assert own["mass"] == pytest.approx(SCENE.block.mass * (0.01 * 0.2) ** 0.5)
    assert own["length"] == pytest.approx(0.2 * (0.1 * 1.5) ** 0.5)
    assert (own["frequency"], own["amplitude"]) == (2.5, 0.015)
    assert out["limits"].keys() == {"stroke", "clearance", "worsening"}
    assert out["other_limits"] == ["reserve"]
    assert json.loads(json.dumps(out)).keys() == out.keys()


def test_the_page_of_a_design_begins_with_its_pendulum_and_runs():
    design = made.design()
    out = content(design)
    pendulum, last = design.pendulum, design.validated[-1]
    assert pendulum is not None
    sizes = float(pendulum.mass), float(pendulum.length), float(pendulum.damping_ratio)
    assert tuple(values(out).values())[:3] == sizes
    assert out["verdict"] == design.verdict
    assert tuple(out["recommended"].values()) == sizes
    runs = out["runs"][-1]
    overturned, mean, verdict = runs["rows"]
    change, fell = last.runs.change("overturned"), last.runs.benefit
    assert overturned[2] == (
        f"2.5 % with the pendulum, 12.5 % without it (difference: 95 % interval {100 * change.low:.0f} to "
        f"{100 * change.high:.0f} %)"
    )
    around = f"95 % interval {100 * fell.low:.0f} to {100 * fell.high:.0f} %"
    assert mean[2].endswith(f": reduction {100 * fell.mean:.0f} % ({around})")
    assert mean[3] == overturned[3] == f"validation runs: {last.runs.description}"
    assert verdict[2:] == ("no reason against this design", "validation runs")
    # The range in which the runs hold is the tolerance range of the design.
    si = np.array([float(SCENE.block.mass), 0.2, 1.0])
    for i, end in enumerate(("low", "high")):
        at = np.array([np.minimum, np.maximum][i](design.equivalent[i], last.design))
        np.testing.assert_allclose(runs[end], at * si)


def test_the_values_of_the_design_are_nodes_of_the_table():
    out = content(made.design())
    own = values(out)
    for axis, name in zip(out["tables"]["grid"]["axes"], own, strict=True):
        assert own[name] in axis["values"]
    assert out["tables"].keys() == {"grid", "without", "recommended"}


def test_the_runs_of_the_page_equal_validation_runs():
    problem = problem_of(SCENE)
    ensemble = replace(problem.ensemble, size=100)
    out = content(SCENE)
    trials, own = out["trials"], values(out)
    assert trials["words"].startswith(f"Starts: {problem.words.starts}. Duration: {problem.words.duration}.")
    damping = own["damping"]
    table, share = trials["map"], trials["map"]["fields"]["share"]
    codes = np.frombuffer(base64.b64decode(share["data"]), "<u2") * share["scale"] / (NONE - 1)
    codes = codes.reshape([len(a["values"]) for a in table["axes"]])
    masses, lengths = (a["values"] for a in table["axes"])
    for i, j in ((0, 0), (1, 2), (-1, -2)):
        pendulum = tpd.Pendulum(mass=masses[i], length=lengths[j], damping_ratio=damping)
        runs = tpd.outcomes(SCENE, pendulum, ensemble=ensemble, conditions=problem.conditions)
        assert codes[i, j] == pytest.approx(runs.share_overturned.value, abs=1e-4)
    alone = tpd.outcomes(SCENE, ensemble=ensemble, conditions=problem.conditions)
    assert trials["without"] == alone.share_overturned.value
    assert trials["kinds"] == {
        "all starts": list(range(100)),
        **{label: np.flatnonzero(rows).tolist() for label, rows in alone.starts.items()},
    }
    assert {len(x) for x in trials["scatter"].values()} == {100}
    # The first run is the nominal one, from rest.
    first = {name: x[0] for name, x in trials["scatter"].items()}
    assert (first["growth"], first["phase"], first["start"]) == (0.0, 0.0, [0.0] * 4)
    assert first["nu"] == first["mu"] == first["zeta"] == 1.0


def test_the_page_of_a_rejected_design_begins_with_its_last_validated_pendulum():
    design = made.rejected()
    out = content(design)
    assert out["recommended"] is None
    assert values(out)["mass"] == float(design.validated[-1].pendulum.mass)
    (runs,) = out["runs"]
    assert runs["rows"][-1][2] == " ".join(design.validated[-1].refusals)
    np.testing.assert_allclose(np.divide(runs["high"], runs["low"]), [1.02 / 0.98, 1.02 / 0.98, 1.2 / 0.8])
    assert "recommended" not in out["tables"]


def test_a_stored_design_has_the_content_of_the_design(tmp_path):
    name = "A </script> tower"
    out, again = content(made.design()), content(made.stored(tmp_path, name))
    assert (again["title"], again["verdict"]) == (name, "RECOMMENDED for the stated conditions.")
    for key in ("runs", "recommended", "controls", "tables", "trials", "scene", "limits"):
        assert again[key] == out[key], key


def test_the_page_of_a_job_has_its_limits_and_space():
    limits = {"stroke": 0.3, "mass": 2.0}
    job = job_of({"limits": limits, "space": {"mass_ratio": [0.02, 0.1], "damping_ratio": 0.2}})
    out = content(job)
    assert {name: out["limits"][name] for name in limits} == limits
    assert out["space"]["damping"] == [0.2, 0.2]
    ranges = {control["name"]: (control["low"], control["high"]) for control in out["controls"]}
    assert ranges["damping"] == pytest.approx((0.08, 0.5)), "a fixed value has a slider as well"
    assert ranges["mass"] == pytest.approx((0.02 * 16.224, 0.1 * 16.224))


def test_a_pulse_has_its_acceleration_instead_of_tables():
    job = job_of(PULSE)
    out = content(job)
    assert out.keys() == KEYS | {"grounds", "levels"}
    # Each pulse of the band can be chosen.
    ground, *others = out["grounds"]
    assert len({x["name"] for x in others} - {ground["name"]}) == 4
    codes = np.frombuffer(base64.b64decode(ground["data"]), "<i2").reshape(-1, len(ground["units"]))
    motion = job.shaking
    pieces = np.asarray(motion.pieces())[:, : codes.shape[1]]
    np.testing.assert_allclose(codes * ground["units"], pieces, atol=2e-5 * np.abs(pieces).max())
    assert ground["peak"] == pytest.approx(0.5 * 9.80665)
    assert ground["piece"] == float(motion.piece)
    assert (values(out)["level"], out["levels"]) == (1.0, [])


@pytest.mark.parametrize("bad", [None, 3, "chimney", PENDULUM])
def test_an_argument_that_is_no_design_job_or_scene_is_rejected(bad):
    with pytest.raises(ValueError, match="`design` must be"):
        inspect.unwrap(content)(bad)


def test_stored_runs_under_records_are_the_counted_runs():
    design = designs.ground_design()
    last = design.validated[-1]
    half = replace(last.runs, counted=last.runs.cluster % 2 == 0)
    last = replace(last, deciding_runs=half, reported_runs=half)
    design = replace(design, validated=(*design.validated[:-1], last))
    *_, runs = content(design)["runs"]
    pairs = design.validated[-1].runs
    counted = pairs.counted & pairs.is_answered
    (overturned, mean, _) = runs["rows"]
    assert overturned[3].startswith(f"validation runs: {int(counted.sum())} paired runs")
    assert 0 < counted.sum() < len(counted)
    # One share for each stratum of the levels, with and without the pendulum, of the counted runs.
    levels = np.array([level["overturned"] for level in content(design)["levels"]])
    means = [np.mean(case.is_overturned[counted]) for case in (pairs.with_pendulum, pairs.without_pendulum)]
    assert levels.shape == (16, 2)
    np.testing.assert_allclose(levels.mean(axis=0), means)
    cases = pairs.with_pendulum, pairs.without_pendulum
    shares = [f"{100 * np.mean(case.is_overturned[counted]):.1f} % with" for case in cases]
    tilts = [f"{np.mean(case.severity[counted]):.3g}" for case in cases]
    assert overturned[2].startswith(f"{shares[0]} the pendulum, {shares[1]}out it")
    assert mean[2].startswith(f"{tilts[0]}; without a pendulum {tilts[1]}: reduction ")


def test_a_simulation_lasts_as_long_as_a_validation_run():
    out = content(job_of(PULSE))
    assert out["grounds"][0]["seconds"] == pytest.approx(1.0 + FREE)
    assert content(job_of({"ensemble": {"periods": 70}}))["periods"] == 70
