"""`tpd export`: block, pendulum and motion for other programs."""

from __future__ import annotations

import argparse
from pathlib import Path
from typing import Any

import numpy as np

from tpd.cli import common
from tpd.cli.grammar import EXPORTED
from tpd.cli.interrupts import SOUND
from tpd.core import files
from tpd.engines.rigid_body import mjcf, opensees
from tpd.scene.scene import Pendulum, Scene


def run(options: argparse.Namespace) -> int:
    """Write the file, and print what was exported; return the exit status."""
    job, pendulum = common.checked(options)
    if options.kind == "csv" and options.sliding is not None:
        raise ValueError("--sliding is of a model of MuJoCo or OpenSees, but --as is csv")
    file = Path(EXPORTED[options.kind]) if options.file is None else options.file
    # Before the work: a history may take seconds.
    if file.is_dir() or not file.name:
        raise ValueError(f"--file must name a file, but {file} is a directory")
    if file.exists() and not options.overwrite:
        raise ValueError(f"{file} exists already: choose another name with --file, or pass --overwrite")
    has_motion = options.kind != "mjcf"
    scene = job.single if has_motion else job.scene
    common.say(scene, pendulum, "" if has_motion else "none: give it to the actuators", job.messages)
    if pendulum is None and options.design is not None:
        print("The report offers no pendulum: only the bare block is exported.")
    if options.kind == "csv":
        # A model does not wait for JAX.
        common.set_up(job)
        columns, fallen = _columns(scene, pendulum)
        content = files.as_table(columns)
        for name in (name for name, column in columns.items() if column[-1] != column[-1]):
            why = "the block overturns" if name[: len("without")] in fallen else "the motion has no answer"
            print(f"{name}: {why}, and the cells after that are empty")
    else:
        sliding = scene.block.base_friction if options.sliding is None else options.sliding
        more = {} if sliding is None else {"sliding": sliding}
        content = {"mjcf": mjcf, "opensees": opensees}[options.kind](scene, pendulum, **more)
    print(f"written: {files.place(file, content)}")
    return SOUND


def _columns(scene: Scene, pendulum: Pendulum | None) -> tuple[dict[str, Any], set[str]]:
    """Motion over time, bare and with the pendulum, from rest by the exact solution, NaN once the block has
    fallen; and which of "without" and "with" overturn."""
    from tpd.answers.motion_history import motion_history
    from tpd.design.as_built import time_histories

    if hasattr(scene.motion, "amplitude"):
        found = time_histories(scene, pendulum)
        # An exact displacement stands beside the acceleration; that of a record would be an integral.
        times, rate = found[0].time, float(scene.motion.rate)
        moved = float(scene.motion.amplitude) * np.sin(rate * times)
        base = {"base_m": moved, "base_m_s2": -(rate**2) * moved}
        angles = [(h.tilt, h.bob if h.with_pendulum else None, h.overturned) for h in found]
    else:
        histories = [motion_history(scene, h) for h in common.cases(pendulum).values()]
        times, base = histories[0].times, {"base_m_s2": histories[0].base}
        angles = [(h.tilt, h.swing, h.overturned) for h in histories]
    columns: dict[str, Any] = {"time_s": times, **base, "without_tilt_rad": angles[0][0]}
    if pendulum is not None:
        columns |= {"with_tilt_rad": angles[1][0], "with_swing_rad": angles[1][1]}
    return columns, {name for name, (*_, falls) in zip(("without", "with"), angles, strict=False) if falls}
