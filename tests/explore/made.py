"""A recommended design that is made by hand, without a search, and the file of its report."""

import functools
import json
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

import tpd
from tests.designs import SCENE, paired
from tpd.design.design import Design
from tpd.design.optimise import problem_of
from tpd.design.reasons import DesignStatus, Reason, ReasonKind
from tpd.design.stored_design import VERSION, StoredDesign
from tpd.design.validate import Validation
from tpd.explore import content as module
from tpd.report.json import json_of

RATIOS = np.array([0.1, 0.6, 0.12])
EQUIVALENT = np.array([[0.09, 0.58, 0.1], [0.105, 0.61, 0.15]])
LITTLE = Reason(kind=ReasonKind.too_little_benefit, value=-0.02, reference=0.1, low=-0.1, high=0.06)


def small_tables(monkeypatch: pytest.MonkeyPatch) -> None:
    """Let the tables of a page have few nodes, because no test reads between them."""
    for name in ("_COUNTS", "_FINE", "_SHARES"):
        monkeypatch.setattr(module, name, dict.fromkeys(getattr(module, name), 3))


@functools.cache
def design() -> Design:
    """A pendulum in the paper's block, with 40 paired runs."""
    rng = np.random.default_rng(0)
    tilt = rng.uniform(0.1, 0.4, 40)
    # One block in eight overturns without the pendulum, one in forty with it.
    alone = np.where(np.arange(40) % 8 == 0, np.inf, tilt)
    with_pendulum = np.where(np.arange(40) == 0, np.inf, 0.6 * tilt)
    validated = Validation(
        design=RATIOS,
        pendulum=SCENE.pendulum(mass_ratio=0.1, length_ratio=0.6, damping_ratio=0.12),
        exact=None,
        deciding_runs=paired(with_pendulum, alone, design=RATIOS),
        reported_runs=None,
        measure="tilt",
        over_limit=0.0,
        reasons=(),
        status=DesignStatus.recommended,
    )
    status = DesignStatus.recommended
    return Design(problem=problem_of(SCENE), status=status, validated=(validated,), equivalent=EQUIVALENT)


def rejected() -> Design:
    """The same pendulum, rejected for too little benefit."""
    (only,) = design().validated
    return replace(
        design(),
        status=DesignStatus.not_recommended,
        validated=(replace(only, reasons=(LITTLE,)),),
        equivalent=None,
    )


def stored(folder: Path, name: str = "") -> StoredDesign:
    """Write the design.json of a report with what the page reads of it, and read it."""
    own = design()
    content = {
        "version": VERSION,
        "status": "recommended",
        "verdict": "RECOMMENDED for the stated conditions.",
        "pendulum": json_of(own.pendulum),
        "job": {"project": {"name": name}} if name else {},
        "versions": {},
        "validated": json_of(own.validated),
        "equivalent": EQUIVALENT.tolist(),
    }
    folder.mkdir(exist_ok=True)
    (folder / "design.json").write_text(json.dumps(content))
    return tpd.read_design(folder)
