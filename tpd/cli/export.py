"""`tpd export`: block, pendulum and motion for other programs."""

from __future__ import annotations

import argparse
from dataclasses import replace
from pathlib import Path
from typing import TYPE_CHECKING, Any

from tpd.cli import common, ground, stored
from tpd.cli.options import given

if TYPE_CHECKING:
    from tpd.core.scene import Pendulum, Scene

_FILES = {"mjcf": "model.xml", "opensees": "model.tcl", "csv": "histories.csv"}


def add(commands: Any) -> None:
    """Add the command to the grammar of the command line."""
    command = commands.add_parser(
        "export",
        help="write a design as a model of MuJoCo or OpenSees, or its motion as a table",
        description="Write the block and the pendulum of a report, or of the options, as a model for another "
        "program, or their motion from rest as CSV, bare and with the pendulum, under the harmonic of the "
        "report or the options, or the pulse or record that is given. A model in MJCF has no motion. Exit "
        "status: 0 done, 2 bad input, 130 interrupted.",
    )
    stored.add(command)
    common.add_scene(command)
    common.add_pendulum(command)
    ground.add_record(command.add_argument_group("record, in place of the harmonic"))
    ground.add_pulse(command.add_argument_group("pulse, in place of the harmonic"))
    command.add_argument("--scale", type=float, metavar="X", help="factor on a record or pulse (default 1)")
    command.add_argument(
        "--as", dest="kind", required=True, choices=tuple(_FILES), help="mjcf: MuJoCo; csv: the histories"
    )
    command.add_argument(
        "--sliding", type=float, metavar="MU", help="friction of a model on the floor (default 0.6)"
    )
    command.add_argument(
        "--file", type=Path, metavar="FILE", help=f"to write to (default {', '.join(_FILES.values())})"
    )
    command.add_argument("--overwrite", action="store_true", help="replace FILE if it exists")
    command.set_defaults(run=run, does="writing the model")


def run(options: argparse.Namespace) -> int:
    """Write the file, and print what was exported; return the exit status."""
    common.use_64_bits(ground=options.record is not None or options.pulse is not None)
    from tpd import engines
    from tpd.core import files

    _check_options(options)
    file = Path(_FILES[options.kind]) if options.file is None else options.file
    # Before the work: a history may take seconds.
    if file.is_dir() or not file.name:
        raise ValueError(f"--file must name a file, but {file} is a directory")
    if file.exists() and not options.overwrite:
        raise ValueError(f"{file} exists already: choose another name with --file, or pass --overwrite")
    scene, hung = _case(options)
    if options.kind == "mjcf":
        ground.say(scene, hung, "  motion  none: give it to the actuators")
    else:
        common.say(scene, hung) if _harmonic(scene) else ground.say(scene, hung, _words(scene))
    if hung is None and options.design is not None:
        print("The report offers no pendulum: only the bare block is exported.")
    if options.kind == "csv":
        header, rows = _table(scene, hung)
        content = files.as_csv(header, rows)
        for name in (name for name, value in zip(header, rows[-1], strict=True) if value == ""):
            print(f"{name}: the block overturns, and the cells after that are empty")
    else:
        more = {} if options.sliding is None else {"sliding": options.sliding}
        content = getattr(engines, options.kind)(scene, hung, **more)
    print(f"written: {files.place(file, content)}")
    return common.SOUND


def _check_options(options: argparse.Namespace) -> None:
    """Raise `ValueError` for an option that would have no effect."""
    if options.record is None and options.pulse is None:
        idle = {"--scale": options.scale, "--pga": options.pga}
        idle |= {"--pulse-frequency": options.pulse_frequency, "--channel": options.channel}
        idle |= {"--dt": options.dt, "--unit": options.unit, "--baseline": options.baseline}
        words = "needs --record FILE or --pulse KIND"
    else:
        idle = {f"--{name}": value for name, value in given(options).get("motion", {}).items()}
        words = "is of a harmonic: leave it out beside --record or --pulse"
    for name, value in idle.items():
        if value is not None:
            raise ValueError(f"{name} {words}")
    if options.kind == "csv" and options.sliding is not None:
        raise ValueError("--sliding is of a model of MuJoCo or OpenSees, but --as is csv")


def _case(options: argparse.Namespace) -> tuple[Scene, Pendulum | None]:
    """Scene and pendulum of a report of either kind, or of the options.

    Raises:
        ValueError: both, a value that is not allowed, or a design on ground motions without a motion.
    """
    from tpd.core.ground_motion import Pulse

    shaken = options.record is not None or options.pulse is not None
    options.scale = 1.0 if options.scale is None else options.scale
    motion: Any = ground.motion(options) if shaken else None
    if motion is None and options.kind == "mjcf":
        # The model has no motion, but a scene has.
        motion = Pulse.one_sine(acceleration=1.0, frequency=1.0)
    if options.design is None:
        scene = common.scene(options) if motion is None else ground.scene(options, motion)
        return scene, common.pendulum(options, scene)
    stored.alone(options)
    from tpd.design.reading import StoredDesign, read

    # A design on ground motions has a block and a pendulum, but none of the many motions is its own.
    found = read(options.design)
    if isinstance(found, StoredDesign):
        return (found.scene if motion is None else replace(found.scene, motion=motion)), found.pendulum
    if motion is None:
        raise ValueError(f"{found.path} holds no motion: give --record FILE or --pulse KIND")
    return found.scene(motion), found.pendulum


def _harmonic(scene: Scene) -> bool:
    from tpd.core.scene import Harmonic

    return isinstance(scene.motion, Harmonic)


def _words(scene: Scene) -> str:
    from tpd.cli import shake

    return f"  motion  {shake.words(scene.motion)}"


def _table(scene: Scene, hung: Pendulum | None) -> tuple[list[str], list[tuple]]:
    """Header and rows of the motion over time, bare and with the pendulum, from rest by the exact solution;
    numbers are left out once the block has fallen."""
    from tpd.analysis.shaking_history import shaking_history
    from tpd.design.study import time_histories

    if _harmonic(scene):
        found = time_histories(scene, hung)
        # An exact displacement stands beside the acceleration; that of a record would be an integral.
        times, base = found[0].time, _harmonic_base(scene, found[0].time)
        angles = [(h.tilt, h.bob if h.with_pendulum else None) for h in found]
    else:
        histories = [shaking_history(scene, h) for h in ((None,) if hung is None else (None, hung))]
        times, base = histories[0].times, {"base_m_s2": histories[0].base}
        angles = [(h.tilt, h.swing) for h in histories]
    columns: dict[str, Any] = {"time_s": times, **base, "bare_phi_rad": angles[0][0]}
    if hung is not None:
        columns |= {"hung_phi_rad": angles[1][0], "hung_psi_rad": angles[1][1]}
    lists = [column.tolist() for column in columns.values()]
    # An empty cell is read as missing by every program; a word such as "nan" is not.
    return list(columns), [tuple("" if x != x else x for x in row) for row in zip(*lists, strict=True)]


def _harmonic_base(scene: Scene, times: Any) -> dict[str, Any]:
    """Displacement and acceleration of the base."""
    import numpy as np

    moved = float(scene.motion.amplitude) * np.sin(float(scene.motion.rate) * times)
    return {"base_m": moved, "base_m_s2": -(float(scene.motion.rate) ** 2) * moved}
