"""Steps that the commands share: read and check the inputs, print the header."""

from __future__ import annotations

import argparse
import contextlib
import sys
from collections.abc import Iterable
from dataclasses import asdict
from typing import Any, NamedTuple

from tpd.core import checks, files, progress
from tpd.design import job as jobs
from tpd.design.stored_design import read_design
from tpd.design.tables import EXCITATIONS
from tpd.limits import check_cavity
from tpd.records.read import summary
from tpd.report import words
from tpd.report.blocks import wrapped
from tpd.scene.quantities import named
from tpd.scene.scene import Block, Pendulum, Scene, check_damping

LARGEST = {"mu": (1.0, "a bob as heavy as the block"), "lam": (2.0, "a rod as long as the block is high")}
"""Largest mass ratio and length ratio of a pendulum, with their meaning."""
WITHOUT = "without a pendulum"
CASES = WITHOUT, "with the pendulum"
"""Names of the two cases in printed results and in files, in the order of
`tpd.answers.run_table.cases_of`."""
_REQUIRED = {
    **dict.fromkeys(("assess", "optimise", "check"), "settings"),
    **dict.fromkeys(("shake", "spectrum"), "shaking"),
    "fragility": "ground_motions",
}
"""Property of the job that a command needs; other commands need the scene."""
_PENDULUM = "pendulum_mass", "mass_ratio", "pendulum_length", "length_ratio", "pendulum_damping"


class Case(NamedTuple):
    """Inputs of a command."""

    job: jobs.Job
    """Block, excitation and settings."""
    pendulum: Pendulum | None
    """Pendulum of the design or of the options; None without a pendulum."""


def check_inputs(options: argparse.Namespace) -> Case:
    """Read and check all inputs of a command and its output folder, before JAX is imported.

    Raises:
        ValueError: a file cannot be read or is not the design of a report of this version, options describe
            another block or pendulum beside a design, a value is not allowed, the command does not support
            the kind of motion, or the output folder contains files.
    """
    _complete_motion(options)
    case = read_case(options)
    asker = "--engine" if getattr(options, "engine", None) else f"`tpd {options.command}`"
    if asker == "--engine":
        # An engine simulates one motion.
        _ = case.job.single
    elif options.command in ("response", "map") and not case.job.settles:
        again = "FILE" if options.design is None else options.design / "scene.toml"
        raise ValueError(
            f"{asker} needs a harmonic motion, but the job has {EXCITATIONS[case.job.kind]}: give --scene "
            f"{again} with --amplitude and --frequency"
        )
    # A job checks a part of its inputs when the property that needs them is read for the first time.
    _ = getattr(case.job, _REQUIRED.get(options.command, "scene"))
    if options.command in ("optimise", "check") and asker != "--engine":
        # Problems check this as well, but only after JAX is imported.
        check_cavity(case.job.block, case.job.limits)
    # The commands without an activity write a single file, and check it themselves.
    if options.activity and (out := getattr(options, "out", None)) is not None:
        files.claim(out, overwrite=options.overwrite)
    return case


_SIZE_KEYS = {"records", "scales", "pga", "intensity"}
"""Keys of records and of their sizes."""


def _complete_motion(options: argparse.Namespace) -> None:
    """Add keys of the motion that every job requires although the command does not use them."""
    motion = options.tables.get("excitation", {})
    if options.command == "spectrum" and motion.get("pulse"):
        if unused := {"pulse_frequency", "pga"} & set(motion):
            flag = f"--{min(unused).replace('_', '-')}"
            raise ValueError(f"{flag} has no effect here: a spectrum has pulses of all frequencies and sizes")
        # Any frequency and size will do: the spectrum replaces them.
        options.tables["excitation"].update({"pulse_frequency": 1.0, "pga": 1.0})
    elif options.command == "assess" and motion.keys() & _SIZE_KEYS == {"records"}:
        # Without a scale the block is assessed under the records as they are. A design needs scales.
        options.tables["excitation"].update({"scales": [1.0], "intensity": "scale"})
    elif options.command == "export" and options.kind == "mjcf" and not (options.design or motion):
        # The model for MuJoCo contains no motion, so any motion will do.
        options.tables["excitation"].update({"pulse": "one-sine", "pulse_frequency": 1.0, "pga": 1.0})


def read_case(options: argparse.Namespace) -> Case:
    """Read the job and the pendulum from a design, or from a job file and the options.

    Raises:
        ValueError: see `check_inputs`.
    """
    tables, name = options.tables, getattr(options, "design", None)
    if name is None:
        # JOB and --scene may name the same file.
        paths = {x.resolve(): x for x in (getattr(options, "job", None), options.scene) if x is not None}
        if len(paths) > 1:
            pair = f"{options.job} and {options.scene}"
            raise ValueError(f"JOB and --scene must name the same job file, but are {pair}")
        job = jobs.job_of(*jobs.merge_tables({} if not paths else jobs.read_tables(*paths.values()), tables))
        has_pendulum, height = hasattr(options, "pendulum_mass"), job.space.hinge_height
        return Case(job, read_pendulum(options, job.block, height) if has_pendulum else None)
    if name.suffix == ".toml" and name.is_file():
        raise ValueError(f"{name} is a job file, but DESIGN is the folder of a report: write --scene {name}")
    # A design may be combined with another pulse or record, and with a friction of the base.
    excitation, block = (tables.get(table, {}).keys() for table in ("excitation", "block"))
    more = set(tables) - {"excitation", "block"}, excitation & {"amplitude", "frequency"}
    others = *more, block - {"base_friction"}
    if any(others) or any(getattr(options, x, None) is not None for x in ("scene", *_PENDULUM)):
        raise ValueError(f"{name} contains a scene and a pendulum: give either DESIGN or options for these")
    design = read_design(name)
    return Case(jobs.job_of(*jobs.merge_tables(design.job.tables, tables)), design.pendulum)


def set_up_jax(job: jobs.Job) -> None:
    """Configure JAX before any module imports it, and start to compile what the job needs."""
    from tpd.compiled import compiling
    from tpd.core import jax_setup

    if (folder := jax_setup.use_64_bits()) is not None:
        # Compilation in the background saves time; without it the modules are compiled when they are used.
        with contextlib.suppress(OSError):
            compiling.compile_beside(folder, job.compiled)


def print_header(
    scene: Scene,
    pendulum: Pendulum | None = None,
    motion: str = "",
    notes: Iterable[str] = (),
    at_rest: Any = None,
    to: Any = None,
) -> None:
    """Print the inputs of a command, so that the user notices a wrong default before the work begins.

    Args:
        scene: block, losses and excitation.
        pendulum: equivalent point mass, printed if there is one.
        motion: description of the motion instead of that of the scene.
        notes: lines on the records that were read, printed first.
        at_rest: `tpd.theory.no_uplift.AtRest` with the accelerations of uplift and sliding; None if the
            command varies the motion.
        to: stream; by default standard output.
    """
    rest = () if at_rest is None else at_rest.lines
    point = () if pendulum is None else (words.pendulum_line(scene, pendulum),)
    rows = (*words.scene_lines(scene, motion), *rest, *point)
    lines = (line for row in rows for line in wrapped(row, rest=" " * 14))
    progress.say("\n".join((*notes, *lines)), to or sys.stdout)


def read_pendulum(options: argparse.Namespace, block: Block, hinge: Any = None) -> Pendulum | None:
    """Return the pendulum of the options, or None without one.

    Args:
        options: mass and length in SI units or as ratios. The options of `tpd map` may vary one of them.
        block: block to which the ratios refer.
        hinge: height of the hinge above the base, m; None for the top.

    Raises:
        ValueError: mass or length is missing, the bob is heavier than the block, the rod is longer than the
            block is high, or the damping ratio is not allowed.
    """
    mu, lam, damping = options.mass_ratio, options.length_ratio, options.pendulum_damping
    mass = options.pendulum_mass if mu is None else mu * block.mass
    length = options.pendulum_length if lam is None else lam * block.centroid
    # A map replaces a quantity that it varies, so its value here does not matter.
    axes = (getattr(options, name, None) for name in "xy")
    varied = {named(axis[0]) for axis in axes if axis}
    if mass is None and {"pendulum_mass", "mu"} & varied:
        mass = block.mass
    if length is None and {"pendulum_length", "lam"} & varied:
        length = block.centroid
    # A damping ratio alone shows that a pendulum is meant: its mass and length were forgotten.
    has_damping = damping is not None or {"pendulum_damping", "zeta"} & varied
    if mass is None and length is None and not has_damping:
        return None
    if mass is None:
        raise ValueError("the pendulum has no mass: give --pendulum-mass or --mass-ratio as well")
    if length is None:
        raise ValueError("the pendulum has no length: give --pendulum-length or --length-ratio as well")
    longest = (block.height, "the height of the block in m")
    longest = longest if hinge is None else (hinge, "the height of the hinge in m")
    bounds = {
        "--pendulum-mass": (options.pendulum_mass, block.mass, "the mass of the block in kg"),
        "--mass-ratio": (mu, *LARGEST["mu"]),
        "--pendulum-length": (options.pendulum_length, *longest),
        "--length-ratio": (lam, block.height / block.centroid, "a rod as long as the block is high"),
    }
    for flag, (value, largest, meaning) in bounds.items():
        if value is not None:
            checks.at_most(flag, value, largest, meaning)
    damping = 0.1 if damping is None else damping
    check_damping("--pendulum-damping", damping)
    return Pendulum(mass=mass, length=length, damping_ratio=damping, hinge_height=hinge)


def json_inputs(scene: Scene, pendulum: Pendulum | None, job: jobs.Job | None = None) -> dict[str, Any]:
    """Return the inputs of a command for its JSON file.

    Args:
        scene: block and excitation; samples of records are left out.
        pendulum: None without a pendulum.
        job: job of ground motions, for the facts about its records.
    """
    tables = asdict(scene)
    tables["excitation"] = {
        name: x for name, x in tables["excitation"].items() if getattr(x, "shape", ()) == ()
    }
    point = None if pendulum is None else asdict(pendulum)
    # The seed is null because these commands use no random numbers.
    content = {"scene": tables, "pendulum": point, "versions": files.versions(), "seed": None}
    return content if job is None else content | {"records": summary(job.motions, job.notes)}
