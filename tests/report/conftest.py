"""Small real designs of both kinds of excitation, each searched once in a session, with their studies."""

import functools
from dataclasses import replace

import tpd
from tpd.design.as_built import Details
from tpd.design.design import Design
from tpd.design.job import job_of
from tpd.design.reasons import DesignStatus, Reason, ReasonKind
from tpd.report.json import as_json
from tpd.report.summary import summary

SCENE = tpd.paper_scene()
COLUMN = tpd.Block(width=1.0, height=6.0, mass=5000.0, cavity_width=0.8, restitution=0.9595)
STRIKES = Reason(kind=ReasonKind.touches_wall, limit="clearance", value=0.27, reference=0.01)
LITTLE = Reason(kind=ReasonKind.too_little_benefit, value=-0.02, reference=0.1, low=-0.1, high=0.06)


@functools.cache
def harmonic(at_least: float = 0.1, measure: str | None = None) -> Design:
    """A pendulum that is recommended for the paper's block, or rejected for less than a share of benefit."""
    return tpd.optimise(
        SCENE,
        tpd.DesignSpace(damping_ratio=0.1),
        limits=tpd.limits.POINT_BOB,
        method=tpd.Descent(searches=2, screening=32, steps=4, corrections=1, polish=10),
        ensemble=tpd.Ensemble(size=128),
        requirements=tpd.limits.Requirements(at_least=at_least, reduce=measure),
    )


def rejected() -> Design:
    """A search of which every design that was validated has too little benefit."""
    return harmonic(0.9, "tilt")


@functools.cache
def ground() -> Design:
    """A search under two built-in records, too few for a verdict."""
    records = tpd.records.el_centro(), tpd.records.loma_prieta()
    conditions = tpd.Conditions.records(records, (2.0, 3.0))
    how = {"method": tpd.GroundSearch(designs=4, steps=2), "validation_share": 0.5}
    return tpd.optimise(COLUMN, conditions=conditions, **how)


@functools.cache
def details(kind: str = "harmonic") -> Details:
    """What the report of a design shows beside it."""
    return tpd.details(DESIGNS[kind]())


def flat(text: str) -> str:
    """Return a text without its line breaks."""
    return " ".join(text.split())


def with_job(design: Design, **tables: dict) -> Design:
    """Return a design whose problem keeps the job of these tables."""
    return replace(design, problem=replace(design.problem, job=job_of(tables)))


def json_text(design: Design, job: dict, details: Details | None = None) -> str:
    """Return the content of design.json, by default without further results."""
    details = Details() if details is None else details
    return as_json(with_job(design, **job), details, summary(design, details))


def tuned() -> Design:
    """The design of `ground`, as if no earthquake had been held out."""
    return replace(ground(), status=DesignStatus.tuned_only)


def against(*reasons: Reason, design: Design | None = None) -> Design:
    """A design with one validated pendulum, which is rejected for these reasons."""
    design = harmonic() if design is None else design
    bad = replace(design.validated[-1], reasons=reasons)
    return replace(design, status=DesignStatus.not_recommended, validated=(bad,))


DESIGNS = {"harmonic": harmonic, "rejected": rejected, "ground": ground, "tuned": tuned}
