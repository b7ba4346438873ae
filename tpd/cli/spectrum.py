"""`tpd spectrum`: overturning spectrum of a pulse, or rocking spectrum of a record."""

from __future__ import annotations

import argparse
from collections.abc import Iterable, Iterator
from typing import TYPE_CHECKING, Any

from tpd.cli import common, ground

if TYPE_CHECKING:
    from tpd.analysis.overturning_spectrum import OverturningSpectrum
    from tpd.analysis.rocking_spectrum import RockingSpectrum
    from tpd.core.cluster import Cluster
    from tpd.core.scene import Pendulum, Scene

_DESCRIPTION = (
    "With --pulse: what a pulse of every frequency and size does to the block, over omega_p/p and "
    "a_p/(g tan alpha). With --record: the largest tilt of blocks of the same slenderness and every size, "
    "over 2 pi/p. Bare and, if one is given, with a pendulum. Exit status: 0 done, 2 bad input, 130 "
    "interrupted."
)


_CASES = ("for the bare block", "with the pendulum")


def add(commands: Any) -> None:
    """Add the command to the grammar of the command line."""
    spectrum = commands.add_parser(
        "spectrum", help="overturning and rocking spectra", description=_DESCRIPTION
    )
    ground.add_block(spectrum)
    common.add_pendulum(spectrum)
    ground.add_record(spectrum.add_argument_group("record"))
    ground.add_pulse(spectrum.add_argument_group("pulse"))
    spectrum.add_argument(
        "--scale", type=float, default=1.0, metavar="X", help="factor on a record (default 1)"
    )
    spectrum.add_argument(
        "--points", type=int, default=120, metavar="N", help="along each axis (default 120)"
    )
    spectrum.add_argument(
        "--to",
        type=float,
        metavar="X",
        help="largest omega_p/p (default 10), or largest 2 pi/p in s (default 12)",
    )
    spectrum.add_argument(
        "--sizes-to", type=float, default=10.0, metavar="X", help="a_p/(g tan alpha) (default 10)"
    )
    common.add_cluster(spectrum)
    common.add_out(spectrum, "tpd-spectrum")
    spectrum.set_defaults(run=run, does="following blocks, for {out}")


def run(options: argparse.Namespace) -> int:
    """Follow all blocks, write table and picture; return the exit status."""
    common.use_64_bits(ground=True)
    from tpd.core import checks, files

    checks.count("--points", options.points, least=2)
    if options.pulse is not None and options.pulse_frequency is None:
        # Every frequency is tried: that of the pulse is no matter.
        options.pulse_frequency = 1.0
    motion = ground.motion(options)
    scene = ground.scene(options, motion)
    hung = ground.pendulum(options, scene)
    files.claim(options.out, overwrite=options.overwrite)
    ground.say(scene, hung, f"  motion  {options.pulse or options.record}")
    with common.bar() as bar, common.cluster(options) as cluster:
        make = _overturning if options.pulse is not None else _rocking
        written = list(make(options, scene, hung, bar, cluster))
    for path, content in written:
        print(f"written: {files.place(options.out / path, content)}")
    return common.SOUND


def _overturning(
    options: argparse.Namespace, scene: Scene, hung: Pendulum | None, bar: Any, cluster: Cluster | None
) -> Iterator[tuple[str, str | bytes]]:
    import numpy as np

    from tpd.analysis.overturning_spectrum import overturning_spectrum
    from tpd.core import files
    from tpd.core.ground_motion import Pulse
    from tpd.plot import style

    assert isinstance(scene.motion, Pulse)
    found = overturning_spectrum(
        scene.block,
        scene.motion,
        hung,
        frequency_ratios=np.linspace(0.25, options.to or 10.0, options.points),
        acceleration_ratios=np.linspace(0.5, options.sizes_to, options.points),
        gravity=float(scene.gravity),
        cluster=cluster,
        progress=lambda done, total: bar("following pulses", done, total),
    )
    shares, lost = found.safe(), found.undecided().tolist()
    survived = (_share(x, n, found.bare.size) for x, n in zip(shares, lost, strict=True))
    print(f"share of the pulses that the block survives: {', '.join(survived)}")
    _say_undecided("pulses", lost, found.bare.size)
    header = ("frequency_ratio", "acceleration_ratio", "bare", "hung")
    yield "spectrum.csv", files.as_csv(header, _cells(found))
    yield (
        "spectrum.json",
        files.as_json(
            {
                **ground.inputs(scene, hung),
                "survived": [float(x) for x in shares],
                "undecided": lost,
            }
        ),
    )
    yield "spectrum.png", style.png(found.plot()[0].figure)


def _share(safe: float, lost: int, total: int) -> str:
    """Share of all pulses that the block survives: a range, if some have no answer."""
    if not lost:
        return f"{safe:.1%}"
    # Of no answer at all there is no share either.
    low = 0.0 if lost == total else safe * (1.0 - lost / total)
    return f"{low:.1%} to {low + lost / total:.1%}"


def _say_undecided(what: str, counts: Iterable[int], total: int) -> None:
    """Say how many runs, bare and with the pendulum, have no answer."""
    cases = [f"{n} of {total} {case}" for n, case in zip(counts, _CASES, strict=False) if n]
    if cases:
        print(f"{what} without an answer: {', '.join(cases)}")


def _cells(found: OverturningSpectrum) -> Iterator[tuple]:
    """Rows of the table: -1 is unknown, 0 stands, 1 rocks, 2 + n overturns after n impacts."""
    for i, size in enumerate(found.acceleration_ratios):
        for j, ratio in enumerate(found.frequency_ratios):
            yield ratio, size, found.bare[i, j], "" if found.hung is None else found.hung[i, j]


def _rocking(
    options: argparse.Namespace, scene: Scene, hung: Pendulum | None, bar: Any, cluster: Cluster | None
) -> Iterator[tuple[str, str | bytes]]:
    import numpy as np

    from tpd.analysis.rocking_spectrum import rocking_spectrum
    from tpd.core import files
    from tpd.plot import style

    ratios = {}
    if hung is not None:
        block = scene.block
        ratios = {
            "mass_ratio": hung.mass / block.mass,
            "length_ratio": hung.length / block.half_height,
            "damping_ratio": hung.damping_ratio,
        }
    found = rocking_spectrum(
        scene.block,
        scene.motion,
        periods=np.linspace(0.5, options.to or 12.0, options.points),
        gravity=float(scene.gravity),
        cluster=cluster,
        progress=lambda done, total: bar("following blocks", done, total),
        **ratios,
    )
    lost = found.undecided().tolist()
    _say_undecided("blocks", lost, found.periods.size)
    yield "spectrum.csv", files.as_csv(("period_s", "bare", "hung"), _tilts(found))
    yield (
        "spectrum.json",
        files.as_json({**ground.inputs(scene, hung), "undecided": lost}),
    )
    yield "spectrum.png", style.png(found.plot().figure)


def _tilts(found: RockingSpectrum) -> Iterator[tuple]:
    """Rows of the table: largest tilt over the slenderness; nan is unknown."""
    for i, period in enumerate(found.periods):
        yield period, found.bare[i], "" if found.hung is None else found.hung[i]
