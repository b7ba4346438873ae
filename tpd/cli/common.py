"""Shared by the commands: exit statuses, job, design and pendulum of the options, progress bar, results."""

from __future__ import annotations

import argparse
import contextlib
import sys
from collections.abc import Iterable, Iterator
from pathlib import Path
from typing import TYPE_CHECKING, Any, NamedTuple

from tpd.cli import interrupts
from tpd.cli.options import Option, given
from tpd.core import progress

if TYPE_CHECKING:
    from tpd.cluster.cluster import Cluster
    from tpd.design.job import Job
    from tpd.scene.scene import Block, Pendulum, Scene

SOUND, BAD_INPUT, UNSOUND, INTERRUPTED = 0, 2, 3, interrupts.INTERRUPTED
"""Exit statuses."""

BLOCK = (
    Option("--width", "block", "width", "M"),
    Option("--height", "block", "height", "M"),
    Option("--mass", "block", "mass", "KG"),
    Option("--friction", "block", "friction", "K"),
    Option("--restitution", "block", "restitution", "E"),
    Option("--cavity", "block", "cavity_width", "M"),
)
HARMONIC = (
    Option("--amplitude", "motion", "amplitude", "M"),
    Option("--frequency", "motion", "frequency", "HZ"),
)
PULSE = (
    Option("--pulse", "motion", "pulse", "KIND"),
    Option("--pulse-frequency", "motion", "pulse_frequency", "HZ"),
    Option("--cycles", "motion", "cycles", "N"),
    Option("--phase", "motion", "phase", "RAD"),
    Option("--pga", "motion", "pga", "G"),
)
READING = (
    Option("--channel", "motion", "channel", "N"),
    Option("--dt", "motion", "dt", "S"),
    Option("--unit", "motion", "unit", "UNIT"),
    Option("--baseline", "motion", "baseline", "WORD"),
)
RECORD = (
    Option("--record", "motion", "records", "FILE", one=True, help="record of an accelerograph"),
    *READING,
    Option(
        "--scale",
        "motion",
        "scales",
        "X",
        one=True,
        also={"intensity": "scale"},
        help="factor on a pulse or record",
    ),
)
RECORDS = (
    Option("--records", "motion", "records", "FILE"),
    Option("--scales", "motion", "scales", "X"),
    Option("--intensity", "motion", "intensity", "WORD"),
    Option("--event", "motion", "event", "NAME"),
    *READING,
)
"""Options that describe block and motion."""
MOST = {"mu": (1.0, "a bob as heavy as the block"), "lam": (2.0, "a rod as long as the block")}
"""Largest ratios of a pendulum, and what they stand for."""
_PENDULUM = "pendulum_mass", "mass_ratio", "pendulum_length", "length_ratio", "pendulum_damping"


class Case(NamedTuple):
    """Job, and the pendulum that is given beside it."""

    job: Job
    pendulum: Pendulum | None


def add_case(command: argparse.ArgumentParser, *motions: tuple[Option, ...]) -> None:
    """Add the options that name a design, or describe a block, its motion and a pendulum."""
    command.add_argument(
        "design",
        type=Path,
        nargs="?",
        metavar="DESIGN",
        help="report directory, or its design.json: its job and its pendulum, in place of --scene",
    )
    add_scene(command, *motions)
    group = command.add_argument_group("pendulum")
    mass, length = group.add_mutually_exclusive_group(), group.add_mutually_exclusive_group()
    mass.add_argument("--pendulum-mass", type=float, metavar="KG", help="mass of the bob, kg")
    mass.add_argument("--mass-ratio", type=float, metavar="MU", help="mass of the bob over the block's")
    length.add_argument("--pendulum-length", type=float, metavar="M", help="length of the pendulum, m")
    length.add_argument(
        "--length-ratio", type=float, metavar="LAM", help="length of the pendulum over the half height"
    )
    group.add_argument(
        "--pendulum-damping", type=float, metavar="ZETA", help="damping ratio of the hinge (default 0.1)"
    )


def add_scene(command: argparse.ArgumentParser, *motions: tuple[Option, ...]) -> None:
    """Add the options that describe a block and motions of these kinds."""
    command.add_argument("--scene", type=Path, metavar="FILE", help="job file in TOML; options override it")
    add_group(
        command,
        "block",
        BLOCK,
        "without any: the paper's; a block of your own needs width, height and mass, and a motion of its own",
    )
    add_group(
        command,
        "motion",
        tuple(option for kind in motions for option in kind),
        "a harmonic, a pulse or records, in place of that of FILE or DESIGN",
    )


def add_group(
    command: argparse.ArgumentParser, title: str, options: Iterable[Option], text: str | None = None
) -> argparse._ArgumentGroup:
    """Add options as a group."""
    group = command.add_argument_group(title, text)
    for option in options:
        option.add(group)
    return group


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
    from tpd.cluster.cluster import Cluster, ClusterError

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


def case(
    options: argparse.Namespace, varied: tuple[str, ...] = (), over: dict[str, dict[str, Any]] | None = None
) -> Case:
    """Job and pendulum of the design that the options name, or of a job file and the options.

    Args:
        options: as parsed.
        varied: quantities of the pendulum that need not be given.
        over: further tables, in place of those of the options.

    Raises:
        ValueError: a file that cannot be read or is not the design of a report of this version, options that
            describe another block or pendulum beside a design, or a value that is not allowed.
    """
    from tpd.core import process

    folder = process.use_64_bits()
    from tpd.design import job as jobs
    from tpd.models import compiling

    stated = given(options) if over is None else over
    name = getattr(options, "design", None)
    if name is None:
        job = jobs.job_of(jobs.merged({} if options.scene is None else jobs.read(options.scene), stated))
        hung = pendulum(options, job.block, varied) if hasattr(options, "pendulum_mass") else None
    else:
        others = {"amplitude", "frequency"} & set(stated.get("motion", {})) or set(stated) - {"motion"}
        if others or any(getattr(options, x, None) is not None for x in ("scene", *_PENDULUM)):
            raise ValueError(f"{name} has a scene and a pendulum: give it alone, or the options without it")
        from tpd.design.reading import read_design

        found = read_design(name)
        job, hung = jobs.job_of(jobs.merged(found.tables, stated)), found.pendulum
    if folder is not None:
        with contextlib.suppress(OSError):
            what = compiling.HARMONIC if job.kind == "harmonic" else compiling.GROUND
            compiling.compile_beside(folder, what)
    return Case(job, hung)


def harmonic(options: argparse.Namespace, varied: tuple[str, ...] = ()) -> tuple[Scene, Pendulum | None]:
    """Scene and pendulum of the options, for the commands about settled motions.

    Raises:
        ValueError: as `case`, or a motion that is not harmonic.
    """
    job, hung = case(options, varied)
    if job.kind != "harmonic":
        name = "--scene FILE" if options.design is None else f"--scene {options.design / 'scene.toml'}"
        raise ValueError(
            f"`tpd {options.command}` is about harmonic motion, and the job has "
            f"{'a pulse' if job.kind == 'pulse' else 'records'}: give {name} with --amplitude and --frequency"
        )
    return job.scene, hung


def say(scene: Scene, hung: Pendulum | None = None, motion: str = "", notes: Iterable[str] = ()) -> None:
    """Print block, motion, losses and pendulum, if any, before any work: whose block it is must not be a
    surprise. A motion that is not harmonic is described by `motion`."""
    from tpd.report import words

    lines = (*words.block_lines(scene), f"  motion  {motion}") if motion else words.scene_lines(scene)
    more = () if hung is None else (words.pendulum_line(scene, hung),)
    progress.say("\n".join((*notes, *lines, *more)), sys.stdout)


def words(motion: Any) -> str:
    """A pulse or record in words."""
    name = getattr(motion, "name", "") or getattr(motion, "kind", "motion")
    return f"{name}, {float(motion.pga):.4g} m/s^2 at most, {float(motion.duration):.4g} s"


def pendulum(options: argparse.Namespace, block: Block, varied: tuple[str, ...] = ()) -> Pendulum | None:
    """Pendulum of the options, or None without one; a quantity that is varied need not be given.

    Raises:
        ValueError: a pendulum of which half is missing, a bob heavier than the block, a rod longer than it,
            or a damping in per cent.
    """
    from tpd.core import checks
    from tpd.scene.scene import Pendulum, check_damping

    mu, lam, damping = options.mass_ratio, options.length_ratio, options.pendulum_damping
    mass = options.pendulum_mass if mu is None else mu * block.mass
    length = options.pendulum_length if lam is None else lam * block.half_height
    # A quantity that is varied takes its values from the axis; the one set here is only a placeholder.
    if mass is None and {"pendulum_mass", "mu"} & set(varied):
        mass = block.mass
    if length is None and {"pendulum_length", "lam"} & set(varied):
        length = block.half_height
    # Any of the three options asks for a pendulum, so a lone damping ratio is a mistake and not a bare block.
    named = damping is not None or {"pendulum_damping", "zeta"} & set(varied)
    if mass is None and length is None and not named:
        return None
    if mass is None or length is None:
        missing = "--pendulum-mass or --mass-ratio" if mass is None else "--pendulum-length or --length-ratio"
        raise ValueError(f"half of the pendulum is missing: give {missing} as well")
    bounds = {
        "--pendulum-mass": (options.pendulum_mass, block.mass, "the mass of the block in kg"),
        "--mass-ratio": (mu, *MOST["mu"]),
        "--pendulum-length": (options.pendulum_length, block.height, "the height of the block in m"),
        "--length-ratio": (lam, *MOST["lam"]),
    }
    for flag, (value, most, what) in bounds.items():
        if value is not None:
            checks.at_most(flag, value, most, what)
    if damping is not None:
        check_damping("--pendulum-damping", damping)
    return Pendulum(mass=mass, length=length, damping_ratio=0.1 if damping is None else damping)


def inputs(scene: Scene, hung: Pendulum | None) -> dict[str, Any]:
    """Inputs of a command, for its JSON; samples of records are left out."""
    from dataclasses import asdict

    from tpd.core import files

    stated = asdict(scene)
    stated["motion"] = {name: x for name, x in stated["motion"].items() if getattr(x, "shape", ()) == ()}
    pendulum = None if hung is None else asdict(hung)
    # Nothing in these commands is random.
    return {"scene": stated, "pendulum": pendulum, "versions": files.versions(), "seed": None}


def write(out: Path, content: Iterable[tuple[str, str | bytes]]) -> None:
    """Write files into the directory of a command and print their names."""
    from tpd.core import files

    # Everything is drawn before the first file is written: an interruption leaves all files or none.
    for name, data in list(content):
        progress.say(f"written: {files.place(out / name, data)}", sys.stdout)
