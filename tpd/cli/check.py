"""`tpd check`: the design of a report by all models."""

from __future__ import annotations

import argparse
import math
from dataclasses import replace
from pathlib import Path
from typing import Any

import msgspec

from tpd.cli import common

_VERSION = 2
"""Version of the file that a report holds its design in."""


class _Pendulum(msgspec.Struct, frozen=True, kw_only=True, forbid_unknown_fields=True):
    """Pendulum of a design: kg, m, 1."""

    mass: float
    length: float
    damping_ratio: float


class _File(msgspec.Struct, frozen=True, kw_only=True):
    """Keys of design.json that a check needs; the others are not read."""

    version: int
    job: dict[str, dict[str, Any]]
    pendulum: _Pendulum | None


def add(commands: Any) -> None:
    """Add the command to the grammar of the command line."""
    command = commands.add_parser(
        "check",
        help="solve a design by all models",
        description="Solve the design of a report by every model, from the closed forms to the nonlinear "
        "equations, and print the results. Exit status: 0 the nonlinear equations confirm it, 2 bad input, "
        "3 they do not, 130 interrupted.",
    )
    command.add_argument("design", type=Path, metavar="DESIGN", help="report directory, or its design.json")
    command.add_argument(
        "--quick", action="store_true", help="leave out the smoothed models, which take long to compile"
    )
    command.set_defaults(run=run, does="solving the design of {design} by every model")


def run(options: argparse.Namespace) -> int:
    """Solve the design by all models and print the results; return the exit status."""
    file = _read(options.design)
    common.use_64_bits()
    from tpd.analysis.compare_models import MODELS, QUICK, check
    from tpd.cli import config
    from tpd.core.scene import Pendulum
    from tpd.design.criteria import stroke_limit

    job = config.job_of(file.job)
    pendulum = None if file.pendulum is None else Pendulum(**msgspec.structs.asdict(file.pendulum))
    with common.bar() as bar:
        models = QUICK if options.quick else MODELS
        found = check(job.scene, pendulum, stroke=stroke_limit(job.limits), models=models, progress=bar)
    print(found.table())
    if pendulum is None:
        print("\nthe bare block: the report offers no pendulum")
        return common.SOUND
    against = found.objections
    if job.file.size > 1:
        print("\nA design for many conditions: the models above see the scene's own shaking only.")
        # More rocking under this shaking may be the price of less in the worst of all conditions.
        against = replace(found, bare=math.inf).objections
        if found.top.status == "overturned" and math.isinf(found.bare):
            against = ()
    for objection in found.objections:
        print(f"\n{'DO NOT USE' if objection in against else 'under this shaking'}: {objection}.")
    if not found.objections:
        print("\nThe nonlinear equations have nothing against this design under this shaking, from rest.")
    return common.UNSOUND if against else common.SOUND


def _read(path: Path) -> _File:
    """Job and pendulum of a report.

    Raises:
        ValueError: the file cannot be read, or is not the design of a report of this version.
    """
    file = path / "design.json" if path.is_dir() else path
    try:
        content = msgspec.json.decode(file.read_bytes())
    except OSError as error:
        raise ValueError(f"cannot read {file}: {error.strerror or error}") from None
    except (UnicodeDecodeError, msgspec.DecodeError, RecursionError):
        raise ValueError(f"{file} is not a design in JSON") from None
    if not isinstance(content, dict) or not {"job", "pendulum"} <= set(content):
        raise ValueError(f"{file} is not a design: it has no `job` and `pendulum`")
    version = content.get("version", 1)
    if version != _VERSION:
        raise ValueError(f"{file} must be of version {_VERSION}, but is of {version!r}: run the job again")
    try:
        return msgspec.convert(content, _File, strict=True)
    except msgspec.ValidationError:
        raise ValueError(
            f"{file} is not a design: its `job` or `pendulum` is not what a report holds"
        ) from None
