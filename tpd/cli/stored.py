"""Reader of design.json: job and pendulum of a report, for the commands that go on from a design."""

from __future__ import annotations

import argparse
from pathlib import Path
from typing import TYPE_CHECKING

if TYPE_CHECKING:
    from tpd.cli.config import Job
    from tpd.core.scene import Pendulum

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
    alone(options)
    from tpd.cli import config
    from tpd.design.reading import read_design

    found = read_design(options.design)
    return config.job_of(found.job), found.pendulum


def alone(options: argparse.Namespace) -> None:
    """Raise `ValueError` where options describe a scene or a pendulum beside a design."""
    if any(getattr(options, name, None) is not None for name in _ALONE):
        raise ValueError(
            f"{options.design} has a scene and a pendulum: give it alone, or the options without it"
        )
