"""Shared by the commands: job, design and pendulum of the options, cluster, what is said and written."""

from __future__ import annotations

import argparse
import contextlib
import sys
from collections.abc import Iterable, Iterator
from dataclasses import asdict
from typing import Any, NamedTuple

from tpd.cli.options import given
from tpd.core import checks, files, progress
from tpd.design import job as jobs
from tpd.design.criteria import check_cavity
from tpd.design.reading import read_design
from tpd.records.reading import described, summary
from tpd.scene.scene import Block, Pendulum, Scene, check_damping

MOST = {"mu": (1.0, "a bob as heavy as the block"), "lam": (2.0, "a rod as long as the block")}
"""Largest ratios of a pendulum, and what they stand for."""
BARE, HUNG = "bare block", "with the pendulum"
"""Names of both cases."""
_PENDULUM = "pendulum_mass", "mass_ratio", "pendulum_length", "length_ratio", "pendulum_damping"


class Case(NamedTuple):
    """Job, and the pendulum that is given beside it."""

    job: jobs.Job
    pendulum: Pendulum | None


@contextlib.contextmanager
def cluster(options: argparse.Namespace) -> Iterator[Any]:
    """Cluster that the options ask for, if any; its processes end with the block.

    Raises:
        ValueError: a number of workers below one, Dask is not installed, or the cluster failed.
    """
    if options.workers is None and options.dask is None:
        yield None
        return
    # Dask takes a second to import.
    from tpd.cluster.cluster import Cluster, ClusterError

    # Beside the results and not among them: a directory of results is empty before they are there.
    out = options.out.resolve()
    folder = out.with_name(f"{out.name}.chunks")
    try:
        with Cluster(folder, workers=options.workers, dask=options.dask) as opened:
            # At the beginning: after Ctrl-C nothing is printed.
            hint = "the same command goes on from them; not needed once it is done"
            progress.say(f"chunks: {folder} ({hint})", sys.stdout)
            yield opened
    except ClusterError as error:
        raise ValueError(str(error)) from None


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
    stated = given(options) if over is None else over
    name = getattr(options, "design", None)
    if name is None:
        job = jobs.job_of(jobs.merged({} if options.scene is None else jobs.read(options.scene), stated))
        hung = pendulum(options, job.block, varied) if hasattr(options, "pendulum_mass") else None
    else:
        others = {"amplitude", "frequency"} & set(stated.get("motion", {})) or set(stated) - {"motion"}
        if others or any(getattr(options, x, None) is not None for x in ("scene", *_PENDULUM)):
            raise ValueError(f"{name} has a scene and a pendulum: give it alone, or the options without it")
        found = read_design(name)
        job, hung = jobs.job_of(jobs.merged(found.tables, stated)), found.pendulum
    return Case(job, hung)


def checked(options: argparse.Namespace) -> Case | None:
    """Read and check all inputs of a command, and claim its folder, before anything heavy is imported; None
    for a command without a job.

    Raises:
        ValueError: as `case`, and for a folder that holds results.
    """
    # A spectrum has pulses of all frequencies, and an exported model needs no motion: these commands fill in
    # what is missing. What a command varies along an axis need not be given either.
    varied, fills_in = tuple(f"pendulum_{name}" for name in ("mass", "length", "damping")), False
    if options.command == "spectrum":
        fills_in = "pulse" in given(options).get("motion", {})
    elif options.command == "export":
        fills_in = options.design is None
    if fills_in or not hasattr(options, "scene"):
        return None
    if options.command in ("response", "map"):
        harmonic(options, varied)
    found = case(options, varied)
    # Properties of a job are checked when they are read.
    _ = found.job.settings if options.command in ("optimise", "check") else found.job.scene
    if options.command == "optimise":
        check_cavity(found.job.block, found.job.limits)
    if (out := getattr(options, "out", None)) is not None:
        files.claim(out, overwrite=options.overwrite)
    return found


def set_up(found: Case | None) -> None:
    """Set JAX up before any module imports it, and begin to compile what the job needs."""
    from tpd.core import process
    from tpd.exact import compiling

    folder = process.use_64_bits()
    if folder is not None and found is not None:
        with contextlib.suppress(OSError):
            what = compiling.HARMONIC if found.job.kind == "harmonic" else compiling.GROUND
            compiling.compile_beside(folder, what)


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
    # Words of the report stand above its designs.
    from tpd.report import words

    lines = (*words.block_lines(scene), f"  motion  {motion}") if motion else words.scene_lines(scene)
    more = () if hung is None else (words.pendulum_line(scene, hung),)
    progress.say("\n".join((*notes, *lines, *more)), sys.stdout)


def shaken(motion: Any) -> str:
    """A pulse or record in words."""
    name = getattr(motion, "name", "") or getattr(motion, "kind", "motion")
    return f"{name}, {float(motion.pga):.4g} m/s^2 at most, {float(motion.duration):.4g} s"


def motions(job: jobs.Job) -> tuple[str, tuple[str, ...]]:
    """Words for the ground motions of a job, and lines on its records, those that are held out included;
    empty for a harmonic."""
    if job.conditions is None or not job.conditions.motions:
        return "", ()
    found, stripes = job.conditions.motions, ", ".join(f"{x:g}" for x in job.conditions.scales)
    what = shaken(found[0]) if job.kind == "pulse" else f"{len(found)} record{'s' * (len(found) > 1)}"
    groups = job.held_out if isinstance(job.held_out, dict) else {}
    held = [f"held out, {name}: {line}" for name, group in groups.items() for line in described(group)]
    return f"{what}, each at {job.conditions.intensity} {stripes}", (*job.told, *held, *job.held_notes)


def pendulum(options: argparse.Namespace, block: Block, varied: tuple[str, ...] = ()) -> Pendulum | None:
    """Pendulum of the options, or None without one; a quantity that is varied need not be given.

    Raises:
        ValueError: a pendulum of which half is missing, a bob heavier than the block, a rod longer than it,
            or a damping in per cent.
    """
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


def cases(hung: Pendulum | None) -> dict[str, Pendulum | None]:
    """Pendulum by what a case is called: the bare block and, if one is given, the block with it."""
    return {BARE: None} if hung is None else {BARE: None, HUNG: hung}


def inputs(scene: Scene, hung: Pendulum | None, job: jobs.Job | None = None) -> dict[str, Any]:
    """Inputs of a command, for its JSON; samples of records are left out. Of a job of ground motions the JSON
    says what was read."""
    stated = asdict(scene)
    stated["motion"] = {name: x for name, x in stated["motion"].items() if getattr(x, "shape", ()) == ()}
    pendulum = None if hung is None else asdict(hung)
    # Nothing in these commands is random.
    found = {"scene": stated, "pendulum": pendulum, "versions": files.versions(), "seed": None}
    return found if job is None else found | {"reading": summary(job.motions, job.notes)}
