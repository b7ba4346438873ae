"""Shared by the commands: job, design and pendulum of the options, cluster, what is said and written."""

from __future__ import annotations

import argparse
import contextlib
import sys
from collections.abc import Iterable, Iterator
from dataclasses import asdict
from typing import Any, NamedTuple

from tpd.cli.options import given, put
from tpd.core import checks, files, progress
from tpd.design import job as jobs
from tpd.design.criteria import check_cavity
from tpd.design.stored_design import read_design
from tpd.records.read import summary
from tpd.scene.scene import Block, Pendulum, Scene, check_damping

MOST = {"mu": (1.0, "a bob as heavy as the block"), "lam": (2.0, "a rod as long as the block")}
"""Largest ratios of a pendulum, and what they stand for."""
WITHOUT, WITH = "without a pendulum", "with the pendulum"
"""Names of both cases."""
_NEEDED = {
    **dict.fromkeys(("assess", "optimise", "check"), "settings"),
    **dict.fromkeys(("shake", "spectrum"), "shaking"),
    "fragility": "ground_motions",
}
"""Properties of a job that commands need; the others need its scene."""
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


def checked(options: argparse.Namespace) -> Case:
    """Read and check all inputs of a command, and claim its folder, before anything heavy is imported.

    Raises:
        ValueError: a file that cannot be read or is not the design of a report of this version, options that
            describe another block or pendulum beside a design, a value that is not allowed, a motion that the
            command is not about, or a folder that holds results.
    """
    _complete_motion(options)
    found = case(options)
    asker = "--engine" if getattr(options, "engine", None) else f"`tpd {options.command}`"
    if options.command in ("response", "map") or asker == "--engine":
        again = "--scene FILE" if options.design is None else f"--scene {options.design / 'scene.toml'}"
        _ = found.job.settled_scene(asker, again)
    # Properties of a job are checked when they are read.
    _ = getattr(found.job, _NEEDED.get(options.command, "scene"))
    if options.command == "optimise":
        check_cavity(found.job.block, found.job.limits)
    if (out := getattr(options, "out", None)) is not None:
        files.claim(out, overwrite=options.overwrite)
    return found


def _complete_motion(options: argparse.Namespace) -> None:
    """Add the part of a motion that a job needs and a command does not."""
    tables = given(options)
    motion = tables.get("motion", {})
    if options.command == "spectrum" and "pulse" in motion:
        if idle := {"pulse_frequency", "pga"} & set(motion):
            flag = f"--{min(idle).replace('_', '-')}"
            raise ValueError(f"{flag} has no effect here: pulses of every frequency and size are tried")
        put(options, "motion", {"pulse_frequency": 1.0})
    elif options.command == "assess" and "records" in motion and not {"scales", "pga"} & set(motion):
        # A block can be followed through records as they are.
        put(options, "motion", {"scales": [1.0], "intensity": "scale"})
    elif options.command == "export" and options.kind == "mjcf" and not (options.design or motion):
        # The model has no motion, but a job has.
        put(options, "motion", {"pulse": "one-sine", "pulse_frequency": 1.0})


def case(options: argparse.Namespace) -> Case:
    """Job and pendulum of the design that the options name, or of a job file and the options.

    Raises:
        ValueError: see `checked`.
    """
    stated, name = given(options), getattr(options, "design", None)
    if name is None:
        # Two names of one file are the same job.
        named = {x.resolve(): x for x in (getattr(options, "job", None), options.scene) if x is not None}
        if len(named) > 1:
            raise ValueError(f"give one job file: JOB is {options.job}, and --scene is {options.scene}")
        job = jobs.job_of(jobs.merged({} if not named else jobs.read(*named.values()), stated))
        return Case(job, pendulum(options, job.block) if hasattr(options, "pendulum_mass") else None)
    others = {"amplitude", "frequency"} & set(stated.get("motion", {})) or set(stated) - {"motion"}
    if others or any(getattr(options, x, None) is not None for x in ("scene", *_PENDULUM)):
        raise ValueError(f"{name} has a scene and a pendulum: give it alone, or the options without it")
    found = read_design(name)
    return Case(jobs.job_of(jobs.merged(found.tables, stated)), found.pendulum)


def set_up(job: jobs.Job) -> None:
    """Set JAX up before any module imports it, and begin to compile what the job needs."""
    from tpd.core import process
    from tpd.exact import compiling

    if (folder := process.use_64_bits()) is not None:
        with contextlib.suppress(OSError):
            compiling.compile_beside(folder, job.compiled)


def say(
    scene: Scene,
    pendulum: Pendulum | None = None,
    motion: str = "",
    notes: Iterable[str] = (),
    alone: Any = None,
) -> None:
    """Print the block, its motion and losses, when the resting block lifts and slides (a
    `tpd.theory.no_uplift.AtRest`) where that is given, and the pendulum if there is one. The user must notice
    a wrong default before any work. Other words for the motion can be given."""
    # Words of the report stand above its designs.
    from tpd.report import words

    more = () if pendulum is None else (words.pendulum_line(scene, pendulum),)
    rest = () if alone is None else (str(alone),)
    progress.say("\n".join((*notes, *words.scene_lines(scene, motion), *rest, *more)), sys.stdout)


def pendulum(options: argparse.Namespace, block: Block) -> Pendulum | None:
    """Pendulum of the options, or None without one; what a map varies need not be given.

    Raises:
        ValueError: a pendulum of which half is missing, a bob heavier than the block, a rod longer than it,
            or a damping in per cent.
    """
    mu, lam, damping = options.mass_ratio, options.length_ratio, options.pendulum_damping
    mass = options.pendulum_mass if mu is None else mu * block.mass
    length = options.pendulum_length if lam is None else lam * block.half_height
    # A quantity that is varied takes its values from the axis; the one set here is only a placeholder.
    axes = (getattr(options, name, None) for name in "xy")
    varied = {axis[0].replace("-", "_") for axis in axes if axis}
    if mass is None and {"pendulum_mass", "mu"} & varied:
        mass = block.mass
    if length is None and {"pendulum_length", "lam"} & varied:
        length = block.half_height
    # Any of the three options asks for a pendulum, so a lone damping ratio is a mistake and not a bare block.
    named = damping is not None or {"pendulum_damping", "zeta"} & varied
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


def cases(pendulum: Pendulum | None) -> dict[str, Pendulum | None]:
    """Pendulum by what a case is called: the bare block and, if one is given, the block with it."""
    return {WITHOUT: None} if pendulum is None else {WITHOUT: None, WITH: pendulum}


def inputs(scene: Scene, pendulum: Pendulum | None, job: jobs.Job | None = None) -> dict[str, Any]:
    """Inputs of a command, for its JSON; samples of records are left out. Of a job of ground motions the JSON
    says what was read."""
    stated = asdict(scene)
    stated["motion"] = {name: x for name, x in stated["motion"].items() if getattr(x, "shape", ()) == ()}
    bob = None if pendulum is None else asdict(pendulum)
    # Nothing in these commands is random.
    found = {"scene": stated, "pendulum": bob, "versions": files.versions(), "seed": None}
    return found if job is None else found | {"reading": summary(job.motions, job.notes)}
