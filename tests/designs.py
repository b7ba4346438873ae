"""Designs and studies made by hand, with plausible numbers, for tests of reports and pictures."""

import dataclasses
from typing import NamedTuple

import numpy as np
from tpd.design.many import FrontPoint
from tpd.design.result import DesignStatus, HarmonicDesign
from tpd.design.study import Study, TimeHistory
from tpd.design.survey import ON_THE_WAY, Survey
from tpd.design.verified import Bare, LossCase, Motions, Reason, ReasonKind, Step, Verified

import tpd
from tpd.answers.attractors import Starts
from tpd.answers.ensemble import Ensemble, Outcomes
from tpd.answers.paired import Benefit, Verdict, benefit_of
from tpd.answers.response import Response
from tpd.design.criteria import DEFAULT_LIMITS, POINT_BOB, DesignSpace, Evaluation, Risk, Worth
from tpd.design.descend import Active
from tpd.design.search import Search, SearchStatus
from tpd.scene.conditions import Conditions

SCENE = tpd.paper_scene()
HUNG = tpd.Pendulum(mass=1.6224, length=0.12, damping_ratio=0.1)
RATIOS = (0.1, 0.6, 0.1)
NAMES = ("mu", "lam", "zeta", "nu", "k", "f", "xi")
SIZES = ("merit", "tilt", "stroke", "reserve")
REASON = Reason(
    step=Step.nonlinear, kind=ReasonKind.breaks_limit, condition="2.5 Hz", limit="stroke", value=1.2
)


class Method(NamedTuple):
    name: str
    tolerance: float


def evaluation(tilt, stroke, **changes) -> Evaluation:
    tilt = np.atleast_2d(np.asarray(tilt, dtype=float))
    one, slope = np.ones_like(tilt), np.zeros((*tilt.shape, 3))
    values = {
        "merit": tilt,
        "tilt": tilt,
        "stroke": stroke * one,
        "margin": -0.2 * one,
        "multiplier": 0.8 * one,
        "reserve": 0.3 * one,
        "kind": np.zeros(tilt.shape, dtype=int),
        "turn": np.zeros((*tilt.shape, 4)),
        "design": np.array([RATIOS]),
    }
    return Evaluation(**({f"{name}_slope": slope for name in SIZES} | values | changes))


def motions(amplitude, stroke=0.3, status="rocking", **changes) -> Motions:
    amplitude = np.atleast_1d(np.asarray(amplitude, dtype=float))
    one = np.ones_like(amplitude)
    status = np.broadcast_to(np.asarray(status, dtype="<U16"), amplitude.shape)
    lost = status == "overturned"
    values = {
        "status": status,
        "amplitude": np.where(lost, np.inf, amplitude),
        "stroke": np.where(lost, np.inf, stroke),
        "peak": np.where(lost, np.inf, 1.5 * amplitude),
        "peak_stroke": np.where(lost, np.inf, 1.4 * stroke),
        "multiplier": 0.8 * one,
        "periods": np.ones(amplitude.shape, dtype=int),
    }
    return Motions(**(values | changes))


def outcomes(lost: int, size: int = 40, tilt: float = 0.1, equations: str = "linear") -> Outcomes:
    over = np.arange(size) < lost
    angle = np.where(over, np.inf, tilt)
    return Outcomes(
        equations=equations,
        ensemble=Ensemble(size=size, seed=0),
        status=np.where(over, "overturned", "rocking"),
        peak=angle,
        amplitude=angle,
        peak_stroke=angle,
        stroke=angle,
        ramp=np.where(np.arange(size) % 2, 2.0, 0.0),
    )


def paired(lost: int = 2, lost_bare: int = 20, tilt: float = 0.05) -> Verdict:
    """Forty runs of the nonlinear equations; the bare block rocks 0.1 rad where it stands."""
    hung, bare = (outcomes(n, tilt=x, equations="nonlinear") for n, x in ((lost, tilt), (lost_bare, 0.1)))
    return Verdict(hung=hung, bare=bare)


def benefit(of: Verdict, conditions: int = 1) -> Benefit:
    return benefit_of(of, SCENE.block.slenderness, np.arange(40) % conditions)


def verified(**changes) -> Verified:
    """The paper's block under its own shaking, with a pendulum that halves the rocking."""
    values = {
        "mass_ratio": RATIOS[0],
        "length_ratio": RATIOS[1],
        "damping_ratio": RATIOS[2],
        "value": 0.16,
        "evaluation": evaluation(0.16, 0.3),
        "exact": motions(0.04),
        "margin": np.array([-0.2]),
        "rest": survey("nonlinear", 1).at(np.array([0])),
        "paired": paired(),
        "benefit": benefit(paired()),
        "strikes": 0.0,
        "stationarity": 1e-3,
        "active": (Active("limit", "stroke", "the scene's own shaking", 1.0),),
        "source": "survey",
        "reasons": (),
    }
    return Verified(**(values | changes))


def search(**changes) -> Search:
    rng = np.random.default_rng(0)
    screened = np.array([0.01, 0.1, 0.1]) + rng.random((60, 3)) * np.array([0.19, 1.4, 0.0])
    values = {
        "screened": screened,
        "screened_value": 0.2 + 2.0 * np.abs(screened[:, 1] - 0.6) * 0.2,
        "screened_feasible": screened[:, 1] < 1.1,
        "paths": (screened[[0, 1]], screened[[2, 3, 4]]),
        "ends": np.array([RATIOS, screened[4]]),
        "end_values": np.array([0.16, np.inf]),
        "statuses": (SearchStatus.at_limit, SearchStatus.infeasible),
        "mismatch": np.array([[2e-6, 3e-5], [np.inf, 0.0]]),
        "lost": np.array([0, 4]),
        "evaluations": 100,
        "description": "60 designs screened",
        "descended": 0.17,
        "finished": 0.16,
    }
    return Search(**(values | changes))


def single(**changes) -> HarmonicDesign:
    """A design for the scene's own shaking."""
    values = {
        "scene": SCENE,
        "space": DesignSpace(),
        "conditions": Conditions(),
        "starts": Starts.rest(),
        "risk": Risk.worst(),
        "limits": POINT_BOB,
        "method": Method("descent", 0.01),
        "ensemble": Ensemble(size=40, seed=0),
        "worth": Worth(runs=40),
        "seed": 3,
        "status": DesignStatus.found,
        "pendulum": HUNG,
        "verified": (verified(),),
        "bare": Bare(
            value=0.3333,
            evaluation=evaluation(0.3333, 0.0),
            exact=motions(0.0833335),
            paired=outcomes(20, equations="nonlinear"),
        ),
        "nearest": None,
        "search": search(),
    }
    return HarmonicDesign(**(values | changes))


def band(**changes) -> HarmonicDesign:
    """A design for eight frequencies, over all symmetric orbits; the bare block overturns at the lowest."""
    n, conditions = 8, Conditions.band(SCENE, 1.5, 4.0, 8)
    tilt, kind = np.linspace(0.3, 0.0, n), np.zeros((1, n), dtype=int)
    kind[0, -1] = 2
    over = np.where(np.arange(n) == 0, "overturned", "rocking")
    lost = {"status": over}
    offered = verified(
        value=0.3,
        evaluation=evaluation(tilt, np.linspace(0.45, 0.1, n), kind=kind),
        exact=motions(0.2 * tilt, np.linspace(0.4, 0.1, n), ["rocking"] * (n - 1) + ["rest"]),
        margin=np.linspace(-0.5, 0.1, n),
        rest=survey("nonlinear", n).at(np.array([0])),
        benefit=benefit(paired(), n),
        active=(Active("condition", "tilt", "1.5 Hz", 0.2),),
    )
    bare = Bare(
        value=0.6,
        evaluation=evaluation(2.0 * tilt, 0.0),
        exact=motions(0.4 * tilt, 0.0, **lost),
        paired=outcomes(20, equations="nonlinear"),
    )
    values = {
        "conditions": conditions,
        "starts": Starts.any(),
        "method": Method("sequential", 0.01),
        "verified": (dataclasses.replace(offered, value=0.2, reasons=(REASON,)), offered),
        "bare": bare,
    }
    return single(**(values | changes))


def around(**changes) -> HarmonicDesign:
    """A design for the neighbourhood of the shaking, with everything that a default job has."""
    conditions = Conditions.around(SCENE)
    n = len(conditions)
    offered = verified(
        value=0.2,
        evaluation=evaluation(np.full(n, 0.2), 0.3),
        exact=motions(np.full(n, 0.05)),
        margin=np.full(n, -0.2),
        rest=survey("nonlinear", n).at(np.array([0])),
        benefit=benefit(paired(), n),
    )
    bare = Bare(
        value=0.4,
        evaluation=evaluation(np.full(n, 0.4), 0.0),
        exact=motions(np.full(n, 0.1), 0.0),
        paired=outcomes(20, equations="nonlinear"),
    )
    values = {
        "conditions": conditions,
        "verified": (offered,),
        "bare": bare,
        "surveys": (survey("linear", n), survey("nonlinear", n)),
        "limits": DEFAULT_LIMITS,
        "losses": (loss_case("friction"), loss_case("impacts", lost=20, tilt=0.1)),
    }
    return single(**(values | changes))


def survey(equations: str, conditions: int) -> Survey:
    """Four designs; the second one, best of all, strikes a wall on the way."""
    severity = np.repeat(np.array([[0.3], [0.2], [0.35], [1.0]]), conditions, axis=1)
    return Survey(
        designs=np.array([RATIOS, (0.2, 0.8, 0.1), (0.05, 0.5, 0.2), (0.02, 1.4, 0.1)]),
        severity=severity,
        bare=np.full(conditions, 0.4),
        excess={
            "stroke": np.array([-0.4, -0.1, -0.6, -1.0]),
            "room": np.array([-0.3, -0.2, -0.5, -0.9]),
            ON_THE_WAY: np.array([-0.1, 0.4, -0.2, -0.9]),
        },
        equations=equations,
    )


def loss_case(name: str, lost: int = 2, tilt: float = 0.05) -> LossCase:
    runs = paired(lost=lost, tilt=tilt)
    return LossCase(
        name=name,
        friction=0.05,
        velocity_ratio=0.9,
        benefit=benefit(runs),
        overturned=runs.hung.overturned,
        overturned_bare=runs.bare.overturned,
        at_rest=runs.hung.at_rest,
        at_rest_bare=runs.bare.at_rest,
    )


def refused() -> HarmonicDesign:
    """A search whose only design was refused."""
    bad = verified(reasons=(REASON,), rest=None, paired=None, benefit=None)
    return single(status=DesignStatus.refused, pendulum=None, verified=(bad,))


def response(*amplitudes, frequency=(2.4, 2.45, 2.6), status="rocking") -> Response:
    return Response(
        frequency=np.array(frequency),
        amplitude=np.array(amplitudes),
        stroke=np.full(len(amplitudes), 0.1),
        status=np.broadcast_to(np.asarray(status, dtype="<U16"), len(amplitudes)),
    )


def history(with_pendulum: bool, size: float = 0.08, lost: bool = False) -> TimeHistory:
    time = np.linspace(0.0, 9.6, 24 * 60 + 1)
    tilt = size * np.sin(2.0 * np.pi * 2.5 * time) * (1.0 - np.exp(-time))
    if lost:
        tilt = np.where(time > 3.0, np.nan, np.sign(tilt[1]) * 0.01 * np.exp(2.0 * time))
    bob = 0.3 * np.sin(2.0 * np.pi * 2.5 * time + 1.0)
    return TimeHistory(
        with_pendulum=with_pendulum,
        time=time,
        tilt=tilt,
        bob=np.where(np.isfinite(tilt), bob, np.nan),
        overturned=lost,
    )


def study(**changes) -> Study:
    """Everything that a report of `single` shows."""
    frequency = tuple(2.5 * np.linspace(0.7, 1.5, 41))
    ratio = np.array(frequency) / 2.5
    bare = response(
        *(0.08 / ratio), frequency=frequency, status=np.where(ratio < 0.75, "overturned", "rocking")
    )
    hung = response(*(0.04 / ratio), frequency=frequency, status=np.where(ratio > 1.4, "rest", "rocking"))
    values = {
        "histories": (history(False, 0.08), history(True, 0.04)),
        "responses": (bare, hung),
        "usage": (("stroke", 0.6), ("offset", 0.8), ("reserve", -4.0)),
    }
    return Study(**(values | changes))


def front() -> tuple[FrontPoint, ...]:
    """None is offered with the lightest bob; the last point is the answer."""
    none = FrontPoint(0.8112, "refused", None, (np.nan,) * 3)
    return (
        none,
        FrontPoint(1.2, "found", HUNG, (0.2, 0.1, 0.3)),
        FrontPoint(1.6224, "found", HUNG, (0.5, 0.4, 0.6)),
    )


def all_refused(*verified) -> HarmonicDesign:
    """A search around a motion, with what stands against these designs."""
    return around(status=DesignStatus.refused, pendulum=None, verified=verified)


def against(kind, value, reference=0.0, **more) -> Reason:
    return Reason(step=Step.benefit, kind=kind, value=value, reference=reference, **more)


STRIKES = against(ReasonKind.strikes, 0.27, 0.01)
LITTLE = against(ReasonKind.too_little_benefit, 0.08, 0.1, low=0.02)
