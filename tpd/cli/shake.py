"""`tpd shake`: one block under a pulse or a record, with and without a pendulum."""

from __future__ import annotations

import argparse
from collections.abc import Iterator
from typing import TYPE_CHECKING, Any

from tpd.cli import common, ground

if TYPE_CHECKING:
    from tpd.analysis.shaking_history import ShakingHistory
    from tpd.analysis.transient import Transient
    from tpd.core.scene import Pendulum, Scene

_DESCRIPTION = (
    "Follow a block from rest through one pulse or record, exactly between the samples, bare and, if one is "
    "given, with a pendulum: largest angles, impacts, whether and when it overturns, and the friction that "
    "the base needs. Exit status: 0 done, 2 bad input, 3 the block overturns in the last of the cases, 130 "
    "interrupted."
)


def add(commands: Any) -> None:
    """Add the command to the grammar of the command line."""
    shake = commands.add_parser("shake", help="a block under one pulse or record", description=_DESCRIPTION)
    ground.add_block(shake)
    common.add_pendulum(shake)
    ground.add_record(shake.add_argument_group("record"))
    ground.add_pulse(shake.add_argument_group("pulse"))
    shake.add_argument(
        "--scale", type=float, default=1.0, metavar="X", help="factor on the motion (default 1)"
    )
    shake.add_argument(
        "--free", type=float, default=20.0, metavar="S", help="free motion after it (default 20)"
    )
    common.add_out(shake, "tpd-shake")
    shake.set_defaults(run=run, does="shaking the block, for {out}")


def run(options: argparse.Namespace) -> int:
    """Follow the block, write histories and pictures, and print what happened; return the exit status."""
    common.use_64_bits(ground=True)
    from tpd.analysis.shaking_history import shaking_history
    from tpd.analysis.transient import transient
    from tpd.core import files
    from tpd.core.status import status_name

    motion = ground.motion(options)
    scene = ground.scene(options, motion)
    hung = ground.pendulum(options, scene)
    files.claim(options.out, overwrite=options.overwrite)
    ground.say(scene, hung, f"  motion  {words(motion)}")
    cases = {"bare block": None} if hung is None else {"bare block": None, "with the pendulum": hung}
    found = {name: transient(scene, h, free=options.free) for name, h in cases.items()}
    histories = {name: shaking_history(scene, h, free=options.free) for name, h in cases.items()}
    for name, answer in found.items():
        print(
            f"{name}: {answer}\n  friction  {histories[name].needed_friction:.3g} keeps the base from sliding"
        )
    for path, content in list(_files(scene, hung, found, histories)):
        print(f"written: {files.place(options.out / path, content)}")
    # With a pendulum it is the pendulum's outcome that counts.
    last = list(found.values())[-1]
    return common.UNSOUND if status_name(last.status) == "overturned" else common.SOUND


def words(motion: Any) -> str:
    """A ground motion in words."""
    name = getattr(motion, "name", "") or getattr(motion, "kind", "motion")
    return f"{name}, {float(motion.pga):.4g} m/s^2 at most, {float(motion.duration):.4g} s"


def _files(
    scene: Scene,
    hung: Pendulum | None,
    found: dict[str, Transient],
    histories: dict[str, ShakingHistory],
) -> Iterator[tuple[str, str | bytes]]:
    from tpd.core import files
    from tpd.core.status import status_name
    from tpd.plot import style
    from tpd.plot.shaking import plot_shaking

    header = ("case", "time_s", "base_m_s2", "tilt_rad", "swing_rad", "horizontal_N", "vertical_N")
    yield "histories.csv", files.as_csv(header, _rows(histories))
    hits = ((name, *hit) for name, h in histories.items() for hit in h.impacts)
    yield "impacts.csv", files.as_csv(("case", "time_s", "rate_after_rad_s"), hits)
    numbers = ("tilt", "swing", "relative", "tilt_time", "uplift_time", "overturning_time")
    results = {
        name: {key: float(getattr(answer, key)) for key in numbers}
        | {"impacts": int(answer.impacts), "status": status_name(answer.status)}
        | {"needed_friction": histories[name].needed_friction}
        for name, answer in found.items()
    }
    yield "shake.json", files.as_json({**ground.inputs(scene, hung), "results": results})
    axes = plot_shaking(list(histories.values()), float(scene.block.slenderness))
    yield "histories.png", style.png(axes[0].figure)
    yield "animation.gif", _animation(scene, hung, histories, results)


def _animation(
    scene: Scene, hung: Pendulum | None, histories: dict[str, ShakingHistory], results: dict[str, Any]
) -> bytes:
    """GIF of ten seconds about the largest tilt, or about the fall, of the first case."""
    import numpy as np

    from tpd.design.study import TimeHistory
    from tpd.plot.animation import animate

    films = []
    for h in histories.values():
        bob = np.zeros_like(h.tilt) if h.swing is None else h.swing
        films.append(
            TimeHistory(model="exact", with_pendulum=h.swing is not None, time=h.times, tilt=h.tilt, bob=bob)
        )
    # Six seconds before it and four after it.
    first = next(iter(results.values()))
    middle = min(first["tilt_time"], first["overturning_time"])
    return animate(scene, hung, films, start=max(0.0, middle - 6.0))


def _rows(histories: dict[str, ShakingHistory]) -> Iterator[tuple]:
    import numpy as np

    for name, h in histories.items():
        swing = np.zeros_like(h.tilt) if h.swing is None else h.swing
        for row in zip(h.times, h.base, h.tilt, swing, h.horizontal, h.vertical, strict=True):
            yield (name, *row)
