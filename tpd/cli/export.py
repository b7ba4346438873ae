"""`tpd export`: block, pendulum and motion for other programs."""

from __future__ import annotations

import argparse
from pathlib import Path
from typing import Any

import numpy as np

from tpd.cli import common
from tpd.cli.grammar import EXPORTED
from tpd.cli.terminal import SOUND
from tpd.core import files
from tpd.engines.rigid_body import mjcf, opensees
from tpd.scene.scene import Pendulum, Scene


def run(options: argparse.Namespace) -> int:
    """Write the file, print its name and return the exit status."""
    job, pendulum = common.check_inputs(options)
    file = Path(EXPORTED[options.kind]) if options.out is None else options.out
    # The file is checked before the work, because a history may take seconds. Users edit an exported model,
    # so a file is never replaced without --overwrite.
    files.claim(file, overwrite=options.overwrite, is_file=True)
    has_motion = options.kind != "mjcf"
    scene = job.single if has_motion else job.scene
    motion = "" if has_motion else "none; the actuators of the model have to provide it"
    common.print_header(scene, pendulum, motion, job.messages)
    if pendulum is None and options.design is not None:
        print("The report has no pendulum. The file contains only the block without a pendulum.")
    if options.kind == "csv":
        # JAX is set up here and not before, so that the export of a model does not wait for it.
        common.set_up_jax(job)
        columns, overturns = _columns(scene, pendulum, job.settles)
        content = files.as_table(columns)
        # A column that ends with NaN belongs to a motion that was not followed to its end.
        for name in (name for name in overturns if columns[name][-1] != columns[name][-1]):
            reason = "the block overturns" if overturns[name] else "the motion has no solution"
            print(f"{name}: {reason}; the cells after that time are empty")
    else:
        # Without a coefficient the exported model has the default one.
        sliding = scene.block.base_friction
        friction = {} if sliding is None else {"sliding": sliding}
        content = {"mjcf": mjcf, "opensees": opensees}[options.kind](scene, pendulum, **friction)
    print(f"written: {files.place(file, content, overwrite=options.overwrite)}")
    return SOUND


def _columns(
    scene: Scene, pendulum: Pendulum | None, settles: bool
) -> tuple[dict[str, Any], dict[str, bool]]:
    """Compute the motion from rest by the exact solution, without and with the pendulum.

    The motion settles under a harmonic.

    Returns:
        Columns of the table by name, NaN after the block has overturned, and whether it overturns, by the
        names of the columns with angles.
    """
    from tpd.answers.motion_history import motion_history
    from tpd.answers.run_table import cases_of
    from tpd.design.as_built import time_histories

    if settles:
        histories = time_histories(scene, pendulum)
        # A harmonic has an exact displacement. That of a record would have to be integrated, and drifts.
        times, rate = histories[0].times, float(scene.excitation.rate)
        displacement = float(scene.excitation.amplitude) * np.sin(rate * times)
        base = {"base_m": displacement, "base_m_s2": -(rate**2) * displacement}
    else:
        histories = tuple(motion_history(scene, h) for h in cases_of(pendulum))
        times, base = histories[0].times, {"base_m_s2": histories[0].base}
    columns, overturns = {"time_s": times, **base}, dict[str, bool]()
    for h in histories:
        own = {"without_tilt_rad": h.tilt}
        own = own if h.swing is None else {"with_tilt_rad": h.tilt, "with_swing_rad": h.swing}
        columns |= own
        # A table that ends early needs a reason for each case.
        overturns |= dict.fromkeys(own, h.overturned)
    return columns, overturns
