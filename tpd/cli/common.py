"""Shared by the commands: exit statuses, options of the scene and the pendulum, progress bar, results."""

from __future__ import annotations

import argparse
import contextlib
import sys
from collections.abc import Iterator
from pathlib import Path
from typing import TYPE_CHECKING, Any

from tpd.cli import interrupts
from tpd.cli.options import Option, given

if TYPE_CHECKING:
    from tpd.core.cluster import Cluster
    from tpd.core.progress import Bar
    from tpd.core.scene import Pendulum, Scene

SOUND, BAD_INPUT, UNSOUND, INTERRUPTED = 0, 2, 3, interrupts.INTERRUPTED
"""Exit statuses."""

SCENE = (
    Option("--width", "block", "width", "M"),
    Option("--height", "block", "height", "M"),
    Option("--mass", "block", "mass", "KG"),
    Option("--friction", "block", "friction", "K"),
    Option("--restitution", "block", "restitution", "E"),
    Option("--cavity", "block", "cavity_width", "M"),
    Option("--amplitude", "motion", "amplitude", "M"),
    Option("--frequency", "motion", "frequency", "HZ"),
)
"""Options that describe block and base motion."""


def add_scene(command: argparse.ArgumentParser) -> None:
    """Add the options that describe block and base motion."""
    command.add_argument("--scene", type=Path, metavar="FILE", help="job file in TOML; options override it")
    group = command.add_argument_group(
        "scene",
        "without any: the paper's block and motion; a block of your own needs width, height and mass, and "
        "amplitude and frequency of its motion",
    )
    for option in SCENE:
        option.add(group)


def add_out(command: argparse.ArgumentParser, default: str) -> None:
    """Add the options of the output directory."""
    command.add_argument("--out", type=Path, default=Path(default), metavar="DIR", help=f"default {default}")
    command.add_argument("--overwrite", action="store_true", help="replace the results in an existing DIR")


def add_cluster(command: argparse.ArgumentParser) -> None:
    """Add the options of the processes and machines that compute."""
    group = command.add_argument_group(
        "many processes or machines",
        "with one of these the work is done in chunks, which are stored in DIR.chunks as they finish: the "
        "same command goes on where it was interrupted. Needs `tpd[dask]`",
    )
    either = group.add_mutually_exclusive_group()
    either.add_argument("--workers", type=int, metavar="N", help="processes on this machine")
    either.add_argument("--dask", metavar="ADDRESS", help="scheduler of a Dask cluster, tcp://host:port")


@contextlib.contextmanager
def cluster(options: argparse.Namespace) -> Iterator[Cluster | None]:
    """Cluster that the options ask for, if any; its processes end with the block.

    Raises:
        ValueError: a number of workers below one, Dask is not installed, or the cluster failed.
    """
    if options.workers is None and options.dask is None:
        yield None
        return
    from tpd.core.cluster import Cluster, ClusterError

    # Beside the results and not among them: a directory of results is empty before they are there.
    out = options.out.resolve()
    folder = out.with_name(f"{out.name}.chunks")
    try:
        with Cluster(folder, workers=options.workers, dask=options.dask) as opened:
            yield opened
    except ClusterError as error:
        raise ValueError(str(error)) from None
    finally:
        if folder.exists():
            print(f"chunks: {folder} (the same command goes on from them; not needed once it is done)")


def add_pendulum(command: argparse.ArgumentParser) -> None:
    """Add the options that describe one pendulum."""
    mass, length = command.add_mutually_exclusive_group(), command.add_mutually_exclusive_group()
    mass.add_argument("--pendulum-mass", type=float, metavar="KG", help="mass of the bob, kg")
    mass.add_argument("--mass-ratio", type=float, metavar="MU", help="mass of the bob over the block's")
    length.add_argument("--pendulum-length", type=float, metavar="M", help="length of the pendulum, m")
    length.add_argument(
        "--length-ratio", type=float, metavar="LAM", help="length of the pendulum over the half height"
    )
    command.add_argument(
        "--pendulum-damping", type=float, metavar="ZETA", help="damping ratio of the hinge (default 0.1)"
    )


def tables(options: argparse.Namespace) -> dict[str, dict[str, Any]]:
    """Tables of the job file that `--scene` names, if any, with those of the options in their place.

    Raises:
        ValueError: the file cannot be read, or a value is not allowed.
    """
    from tpd.cli import config

    return config.merged({} if options.scene is None else config.read(options.scene), given(options))


def say(scene: Scene, hung: Pendulum | None = None) -> None:
    """Print block, motion, losses and pendulum, if any, before any work: whose block it is must not be a
    surprise."""
    from tpd.report import scene_words

    more = () if hung is None else (scene_words.pendulum(scene, hung),)
    print("\n".join((*scene_words.lines(scene), *more)), flush=True)


def scene(options: argparse.Namespace) -> Scene:
    """Scene of a job file and the options.

    Raises:
        ValueError: the file cannot be read, or a value is not allowed.
    """
    from tpd.cli import config

    return config.scene_of(tables(options))


def pendulum(options: argparse.Namespace, of: Scene, varied: tuple[str, ...] = ()) -> Pendulum | None:
    """Pendulum of the options, or None without one; a quantity that is varied need not be given.

    Raises:
        ValueError: a pendulum of which half is missing, or a value out of range.
    """
    from tpd.core.scene import Pendulum

    mass = _one(options.pendulum_mass, options.mass_ratio, of.block.mass)
    length = _one(options.pendulum_length, options.length_ratio, of.block.half_height)
    damping = options.pendulum_damping
    # A quantity that is varied takes its values from the axis; the one set here is only a placeholder.
    if mass is None and {"pendulum_mass", "mu"} & set(varied):
        mass = of.block.mass
    if length is None and {"pendulum_length", "lam"} & set(varied):
        length = of.block.half_height
    # Any of the three options asks for a pendulum, so a lone damping ratio is a mistake and not a bare block.
    named = damping is not None or {"pendulum_damping", "zeta"} & set(varied)
    if mass is None and length is None and not named:
        return None
    if mass is None or length is None:
        missing = "--pendulum-mass or --mass-ratio" if mass is None else "--pendulum-length or --length-ratio"
        raise ValueError(f"half of the pendulum is missing: give {missing} as well")
    _check_ratios(options, of)
    return Pendulum(mass=mass, length=length, damping_ratio=0.1 if damping is None else damping)


def _check_ratios(options: argparse.Namespace, of: Scene) -> None:
    """Raise `ValueError` for a bob heavier than the block, a rod longer than it, or a damping in per cent."""
    from tpd.core import checks
    from tpd.core.scene import check_damping

    block = of.block
    bounds = {
        "--pendulum-mass": (options.pendulum_mass, block.mass, "the mass of the block in kg"),
        "--mass-ratio": (options.mass_ratio, 1.0, "a bob as heavy as the block"),
        "--pendulum-length": (options.pendulum_length, block.height, "the height of the block in m"),
        "--length-ratio": (options.length_ratio, 2.0, "a rod as long as the block"),
    }
    for flag, (value, most, words) in bounds.items():
        if value is not None:
            checks.at_most(flag, value, most, words)
    if options.pendulum_damping is not None:
        check_damping("--pendulum-damping", options.pendulum_damping)


def _one(value: float | None, ratio: float | None, unit: float) -> float | None:
    return value if ratio is None else ratio * unit


def inputs(of: Scene, hung: Pendulum | None) -> dict[str, Any]:
    """Inputs of a response or a map, for its JSON."""
    from dataclasses import asdict

    from tpd.core import files

    pendulum = None if hung is None else asdict(hung)
    # Nothing in a response or a map is random.
    return {"scene": asdict(of), "pendulum": pendulum, "versions": files.versions(), "seed": None}


def use_64_bits(*, ground: bool = False) -> None:
    """Set JAX up, see `tpd.core.process`; call this before JAX computes anything.

    `ground` says whether pulses and records are followed, and not harmonics: other code is compiled ahead.
    """
    from tpd.core import process

    folder = process.use_64_bits()
    from tpd.models import compiling

    if folder is not None:
        with contextlib.suppress(OSError):
            compiling.compile_beside(folder, compiling.GROUND if ground else compiling.HARMONIC)


def bar() -> Bar:
    """Return a bar for the stages of a command, see `tpd.core.progress.Bar`."""
    from tpd.core.progress import Bar

    return Bar()


@contextlib.contextmanager
def left_out(what: str) -> Iterator[None]:
    """Let Ctrl-C leave out a part of the report: say so on stderr, and go on with the answer."""
    try:
        yield
    except KeyboardInterrupt:
        print(f"tpd: interrupted; the report goes without {what}", file=sys.stderr)
