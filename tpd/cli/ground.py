"""Options of pulses, records and blocks, for the commands about ground motions."""

from __future__ import annotations

import argparse
import re
from collections.abc import Iterator, Sequence
from contextlib import contextmanager
from pathlib import Path
from typing import TYPE_CHECKING, Any

from tpd.cli import common
from tpd.formats.orientation import UNKNOWN, VERTICAL

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
_OTHER_MOTIONS = {"vt2": "velocity", "dt2": "displacement"}
"""Endings of files that PEER puts beside those of accelerations."""
_NO_MOTIONS = (
    "md",
    "pdf",
    "html",
    "htm",
    "json",
    "xml",
    "png",
    "jpg",
    "jpeg",
    "svg",
    "doc",
    "docx",
    "log",
    "ini",
)
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
    with _in_options():
        found = Record.read(Path(options.record), **more)
    if VERTICAL in found.notes:
        print(f"note: {options.record} is a {VERTICAL}, but shakes the block sideways here")
    return found


@contextmanager
def _in_options() -> Iterator[None]:
    """Messages about arguments of `Record.read` with the names of the options."""
    try:
        yield
    except ValueError as error:
        words = re.sub(r", such as (?:unit|dt)=\S+", _example, str(error))
        raise ValueError(re.sub(r"`(unit|dt|channel|baseline)`", r"--\1", words)) from None


def _example(found: re.Match[str]) -> str:
    return found[0].replace("unit='g'", "--unit g").replace("dt=", "--dt ")


def add_reading(command: Any, *, baseline: bool = True) -> None:
    """Add the options that say how the files of --records are read."""
    command.add_argument("--dt", type=float, metavar="S", help="sampling interval of files without times")
    command.add_argument("--unit", metavar="UNIT", help="of files that do not say: g, m/s2, cm/s2")
    command.add_argument(
        "--event",
        nargs="+",
        metavar="NAME",
        help="earthquakes of records whose files name none: one name, or one for each of --records "
        "(default: a folder is one earthquake)",
    )
    if baseline:
        command.add_argument("--baseline", choices=("mean", "linear"), help="remove an offset, or a drift")


def reading(options: argparse.Namespace) -> dict[str, Any]:
    """Arguments of `motions` from the options of `add_reading`."""
    return {"dt": options.dt, "unit": options.unit, "events": options.event}


def motions(
    names: Sequence[str],
    baseline: str | None = None,
    *,
    dt: float | None = None,
    unit: str | None = None,
    events: Sequence[str] | None = None,
) -> list[GroundMotion]:
    """All horizontal records of files, folders, or sets by name. What is left out is printed.

    Args:
        names: of files, folders and sets.
        baseline: see `tpd.Record.read`, as are `dt` and `unit`, which go to the files that state none.
        dt: s.
        unit: of the acceleration.
        events: earthquakes of records whose files name none: one, or one for each of `names`. Without it the
            records of a folder are of one earthquake.

    Raises:
        ValueError: nothing, or a file that is no record.
    """
    from dataclasses import replace

    from tpd import records
    from tpd.core.record import Record

    if events is not None and len(events) not in (1, len(names)):
        raise ValueError(
            f"--event must have one name, or one for each of the {len(names)} of --records, but "
            f"has {len(events)}"
        )
    found: list[GroundMotion] = []
    left: list[str] = []
    for i, name in enumerate(names):
        path = Path(name)
        if name in SETS:
            try:
                found += records.fema_p695(SETS[name])
            except ImportError as error:
                raise ValueError(str(error)) from None
        elif name in BUILT_IN:
            found.append(getattr(records, BUILT_IN[name])())
        else:
            files, others = _files_of(path)
            left += others
            assumed = 0
            event = path.resolve().name if path.is_dir() else ""
            event = event if events is None else events[i if len(events) > 1 else 0]
            for file in files:
                with _in_options():
                    read = Record.read_all(file, baseline=baseline, dt=dt, unit=unit)
                for j, record in enumerate(read):
                    label = file.name if len(read) == 1 else f"{file.name}, channel {j}"
                    # The channels of one file are of one earthquake.
                    named = record.event or event or (str(file) if len(read) > 1 else "")
                    if VERTICAL in record.notes:
                        left.append(f"{label} ({VERTICAL})")
                    else:
                        found.append(replace(record, event=named))
                        assumed += path.is_dir() and events is None and not record.event
            if assumed > 1:
                print(
                    f"note: {assumed} records of the folder {name} name no earthquake and are taken for one; "
                    "if they are of several, give the files one by one, with --event"
                )
    if left:
        print(f"left out: {'; '.join(left)}")
    if not found:
        raise ValueError(f"there is no horizontal record in {', '.join(names)}")
    _say_unknown(found)
    return found


def _say_unknown(found: Sequence[Any]) -> None:
    """Print how many records state no orientation, and how many no earthquake."""
    flat = sum(UNKNOWN in getattr(record, "notes", ()) for record in found)
    if flat:
        print(f"note: of {len(found)} records {flat} state no orientation and are taken for horizontal")
    alone = sum(not getattr(record, "event", "") for record in found)
    if alone and len(found) > 1:
        print(
            f"note: of {len(found)} records {alone} name no earthquake and count as one each; if some are "
            "of one, give --event"
        )


def _files_of(path: Path) -> tuple[list[Path], list[str]]:
    """Files of a path that are to be read, and those of a folder that hold no acceleration, in words."""
    if not path.is_dir():
        return [path], []
    files, left = [], [f"{p.name} (a folder in a folder)" for p in sorted(path.iterdir()) if p.is_dir()]
    for file in sorted(p for p in path.iterdir() if p.is_file()):
        ending = file.name.lower().removesuffix(".gz").rpartition(".")[2]
        if ending in _OTHER_MOTIONS:
            left.append(f"{file.name} ({_OTHER_MOTIONS[ending]})")
        elif file.name.startswith((".", "_")) or ending in _NO_MOTIONS or "readme" in file.name.lower():
            left.append(f"{file.name} (no motion)")
        else:
            files.append(file)
    return files, left


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
