"""Reader of design.json: job and pendulum of a report, for the commands that go on from a design."""

from __future__ import annotations

import argparse
from pathlib import Path
from typing import TYPE_CHECKING, Any

import msgspec

if TYPE_CHECKING:
    from tpd.cli.config import Job
    from tpd.core.scene import Pendulum

_VERSION = 3
"""Version of the file that a report holds its design in."""
_ALONE = (
    "pendulum_mass",
    "mass_ratio",
    "pendulum_length",
    "length_ratio",
    "pendulum_damping",
    "scene",
    "tables",
)
"""Names of options that describe a scene or a pendulum, which a design has of its own."""


class _Pendulum(msgspec.Struct, frozen=True, kw_only=True, forbid_unknown_fields=True):
    """Pendulum of a design: kg, m, 1."""

    mass: float
    length: float
    damping_ratio: float


class _File(msgspec.Struct, frozen=True, kw_only=True):
    """Keys of design.json that are needed here; the others are not read."""

    version: int
    job: dict[str, dict[str, Any]]
    pendulum: _Pendulum | None


def add(command: argparse.ArgumentParser) -> None:
    """Add the argument that names a design."""
    command.add_argument(
        "design",
        type=Path,
        nargs="?",
        metavar="DESIGN",
        help="report directory, or its design.json, in place of a scene and a pendulum by options",
    )


def read(options: argparse.Namespace) -> tuple[Job, Pendulum | None]:
    """Job and pendulum of the design that the options name.

    Raises:
        ValueError: options that describe another scene or pendulum, or a file that cannot be read or is not
            the design of a report of this version.
    """
    if any(getattr(options, name, None) is not None for name in _ALONE):
        raise ValueError(
            f"{options.design} has a scene and a pendulum: give it alone, or the options without it"
        )
    from tpd.cli import config
    from tpd.core.scene import Pendulum

    file = _read(options.design)
    hung = None if file.pendulum is None else Pendulum(**msgspec.structs.asdict(file.pendulum))
    return config.job_of(file.job), hung


def _read(path: Path) -> _File:
    """Keys of a report that are needed here.

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
