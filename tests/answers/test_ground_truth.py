"""Motions under pulses and records against arithmetic of 50 digits (`tests/ground_truth.py`)."""

import jax
import numpy as np
import pytest

import tpd
from tests import ground_truth
from tpd.answers.transient import Transient

TABLE = ground_truth.load()
CASES = {case["name"]: case for case in TABLE["cases"]}
SI = ("bob", "length", "damping", "friction", "restitution", "scale")


def motion_of(case) -> tpd.Pulse | tpd.Record:
    """Ground motion of a case, its size included."""
    m, scale = case["motion"], float(case["scene"]["scale"])
    peak, frequency = float(m.get("peak", 1.0)), float(m.get("frequency", 1.0))
    match m["kind"]:
        case "samples" if m.get("record") == "el_centro":
            return tpd.records.el_centro().scaled(scale)
        case "samples":
            return tpd.Record(np.array(m["acceleration"], dtype=float), float(m["dt"])).scaled(scale)
        case "mavroeidis":
            shape = {"cycles": float(m["gamma"]), "phase": float(m["phase"])}
            pulse = tpd.Pulse.mavroeidis_papageorgiou(
                velocity=float(m["velocity"]), frequency=frequency, **shape
            )
            return pulse.scaled(scale)
        case kind:
            return getattr(tpd.Pulse, kind)(acceleration=peak, frequency=frequency).scaled(scale)


def scene_of(s, motion) -> tuple[tpd.Scene, tpd.Pendulum | None]:
    block = tpd.Block(**{k: float(s[k]) for k in ("width", "height", "mass", "friction", "restitution")})
    hung = None
    if "bob" in s:
        hung = tpd.Pendulum(
            mass=float(s["bob"]), length=float(s["length"]), damping_ratio=float(s["damping"])
        )
    return tpd.Scene(block, motion, float(s.get("gravity", 9.80665))), hung


def followed(case) -> tuple[tpd.Scene, Transient]:
    scene, hung = scene_of(case["scene"], motion_of(case))
    rate = float(scene.rate)
    y0 = np.array(case["y0"], dtype=float) * [1.0, 1.0, rate, rate]
    return scene, tpd.transient(scene, hung, y0=y0, free=float(case["free"]))


@pytest.mark.parametrize("name", CASES)
def test_a_motion_is_that_of_fifty_digits(name):
    case = CASES[name]
    known = case["results"]
    scene, found = followed(case)
    assert (tpd.status_name(found.status) == "overturned") == known["overturned"]
    assert float(found.uplift_time) == pytest.approx(float(known["uplift_time"]), rel=1e-7, abs=1e-12)
    if known["overturned"]:
        return
    tolerance = 1e-10
    assert float(found.tilt) == pytest.approx(float(known["tilt"]), rel=tolerance)
    assert float(found.tilt_time) == pytest.approx(float(known["tilt_time"]), rel=1e-6)
    if known["swing"] is not None:
        assert float(found.swing) == pytest.approx(float(known["swing"]), rel=tolerance)
        assert float(found.relative) == pytest.approx(float(known["relative_swing"]), rel=tolerance)
    # The end lies tens of impacts later.
    rate = float(scene.rate)
    end = np.asarray(found.state) / [1.0, 1.0, rate, rate]
    for value, digits in zip(end, known["end"], strict=True):
        if digits is not None:
            assert value == pytest.approx(float(digits), rel=1e-7, abs=1e-9)


@pytest.mark.parametrize("name", [n for n, c in CASES.items() if "derivatives" in c["results"]])
def test_its_derivatives_are_those_of_fifty_digits(name):
    case = CASES[name]
    scene, hung = scene_of(case["scene"], motion_of(case))
    assert hung is not None
    block, motion = scene.block, scene.motion
    rate = float(scene.rate)
    y0 = np.array(case["y0"], dtype=float) * [1.0, 1.0, rate, rate]

    def tilt(x):
        changed = tpd.Block(
            width=block.width,
            height=block.height,
            mass=block.mass,
            friction=x["friction"],
            restitution=x["restitution"],
        )
        pendulum = tpd.Pendulum(mass=x["bob"], length=x["length"], damping_ratio=x["damping"])
        return tpd.transient(
            tpd.Scene(changed, motion.scaled(x["scale"])), pendulum, y0=y0, free=float(case["free"])
        ).tilt

    at = {"bob": hung.mass, "length": hung.length, "damping": hung.damping_ratio, "scale": 1.0}
    at |= {"friction": block.friction, "restitution": block.restitution}
    found = jax.grad(tilt)({k: float(v) for k, v in at.items()})
    own = float(case["scene"]["scale"])
    for key in SI:
        value = float(found[key]) / (own if key == "scale" else 1.0)
        assert value == pytest.approx(float(case["results"]["derivatives"][key]), rel=1e-8, abs=1e-10), key


@pytest.mark.parametrize("row", TABLE["critical"], ids=lambda row: row["name"])
def test_critical_scales_are_those_of_fifty_digits(row):
    s, m = row["scene"], row["motion"]
    size = 9.80665 * float(s["width"]) / float(s["height"])
    pulse = getattr(tpd.Pulse, m["kind"])(acceleration=size, frequency=float(m["frequency"]))
    scene, hung = scene_of(s, pulse)
    assert float(tpd.critical_scale(scene, hung).scale) == pytest.approx(float(row["scale"]), rel=1e-10)
