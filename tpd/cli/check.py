"""`tpd check`: a design through the whole ladder of models."""

from __future__ import annotations

import argparse
import json
import math
from dataclasses import replace
from pathlib import Path
from typing import Any

from tpd.cli import common


def add(commands: Any) -> None:
    """Add the command to the command line's grammar."""
    command = commands.add_parser(
        "check",
        help="take a design through all models",
        description="Take the design of a report through the ladder of models and print what each says. "
        "Exit status: 0 the nonlinear equations confirm it, 2 bad input, 3 they do not, 130 interrupted.",
    )
    command.add_argument("design", type=Path, metavar="DESIGN", help="report directory, or its design.json")
    command.add_argument(
        "--quick", action="store_true", help="leave out the smoothed models, which take long to compile"
    )
    command.set_defaults(run=run)


def run(options: argparse.Namespace) -> int:
    """Run it; returns the exit status."""
    job_tables, hung = _read(options.design)
    common.use_64_bits()
    from tpd.analysis.compare_models import QUICK, RUNGS, check
    from tpd.core.scene import Pendulum
    from tpd.design import job

    work = job.build(job_tables)
    pendulum = None if hung is None else Pendulum(**hung)
    with common.Bar() as bar:
        rungs = QUICK if options.quick else RUNGS
        found = check(work.scene, pendulum, stroke=work.space.stroke, rungs=rungs, progress=bar)
    print(found.table())
    if pendulum is None:
        print("\nthe bare block: the report offers no pendulum")
        return 0
    against = found.objections
    if work.asked is not None:
        print(
            "\nA design for many conditions: the models above are asked under the scene's own shaking only."
        )
        # More rocking here may be the price of less in the worst of all conditions.
        against = replace(found, bare=math.inf).objections
        if found.top.status == "overturned" and math.isinf(found.bare):
            against = ()
    for objection in found.objections:
        print(f"\n{'DO NOT USE' if objection in against else 'under this shaking'}: {objection}.")
    if not found.objections:
        print("\nThe nonlinear equations have nothing against this design under this shaking, from rest.")
    return common.UNSOUND if against else common.SOUND


def _read(path: Path) -> tuple[dict[str, Any], dict[str, float] | None]:
    """The job and the pendulum of a report."""
    file = path / "design.json" if path.is_dir() else path
    try:
        content = json.loads(file.read_text(encoding="utf-8"))
    except OSError as error:
        raise ValueError(f"cannot read {file}: {error.strerror or error}") from None
    except (UnicodeDecodeError, json.JSONDecodeError):
        raise ValueError(f"{file} is not a design in JSON") from None
    if not isinstance(content, dict) or not {"job", "pendulum"} <= set(content):
        raise ValueError(f"{file} is not a design: it has no `job` and `pendulum`")
    job, hung = content["job"], content["pendulum"]
    if not isinstance(job, dict) or not (hung is None or _is_pendulum(hung)):
        raise ValueError(f"{file} is not a design: its `job` or `pendulum` is not what a report holds")
    return job, hung


def _is_pendulum(hung: Any) -> bool:
    return isinstance(hung, dict) and set(hung) == {"mass", "length", "damping_ratio"}
