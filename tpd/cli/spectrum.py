"""`tpd spectrum`: overturning spectrum of a pulse, or rocking spectrum of a record."""

from __future__ import annotations

import argparse
from collections.abc import Iterable
from functools import partial
from typing import TYPE_CHECKING, Any

from tpd.cli import common
from tpd.cli.options import given
from tpd.core.progress import Bar

if TYPE_CHECKING:
    from tpd.answers.spectra import OverturningSpectrum, RockingSpectrum
    from tpd.scene.scene import Pendulum, Scene

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
        "spectrum",
        help="overturning and rocking spectra",
        description=_DESCRIPTION,
        epilog="\nExample: tpd spectrum --scene tower.toml --pulse ricker",
    )
    common.add_case(spectrum, common.PULSE, common.RECORD)
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
        "--sizes-to", type=float, metavar="X", help="largest a_p/(g tan alpha) of a pulse (default 10)"
    )
    common.add_cluster(spectrum)
    common.add_out(spectrum, "tpd-spectrum")
    spectrum.set_defaults(run=run, does="following blocks, for {out}")


def run(options: argparse.Namespace) -> int:
    """Follow all blocks, write table and picture; return the exit status."""
    motion = given(options).get("motion", {})
    if "pulse" in motion:
        if idle := {"pulse_frequency", "pga"} & set(motion):
            flag = f"--{min(idle).replace('_', '-')}"
            raise ValueError(f"{flag} has no effect here: pulses of every frequency and size are tried")
        motion["pulse_frequency"] = 1.0
    job, hung = common.case(options)
    from tpd.core import checks, files

    checks.count("--points", options.points, least=2)
    for flag, value in (("--to", options.to), ("--sizes-to", options.sizes_to)):
        if value is not None:
            checks.positive(flag, value)
    scene = job.under(job.shaking)
    if job.kind == "records" and options.sizes_to is not None:
        raise ValueError("--sizes-to is of the sizes of a pulse, and the job has a record")
    files.claim(options.out, overwrite=options.overwrite)
    common.say(scene, hung, common.words(scene.motion), job.notes)
    with Bar() as bar, common.cluster(options) as cluster:
        how = {"gravity": float(scene.gravity), "cluster": cluster}
        make = _overturning if job.kind == "pulse" else _rocking
        found, content = make(options, scene, hung, how | {"progress": partial(bar, "following blocks")})
    import numpy as np

    from tpd.plot import style

    written = {
        "spectrum.csv": files.as_table(found.columns()),
        "spectrum.json": files.as_json(common.inputs(scene, hung) | content),
        "spectrum.png": style.png(np.ravel(found.plot())[0].figure),
    }
    common.write(options.out, written.items())
    return common.SOUND


def _overturning(
    options: argparse.Namespace, scene: Scene, hung: Pendulum | None, how: dict[str, Any]
) -> tuple[OverturningSpectrum, dict[str, Any]]:
    """Spectrum of a pulse, and its numbers for JSON."""
    import numpy as np

    from tpd.answers.spectra import overturning_spectrum
    from tpd.scene.ground_motion import Pulse

    assert isinstance(scene.motion, Pulse)
    found = overturning_spectrum(
        scene.block,
        scene.motion,
        hung,
        frequency_ratios=np.linspace(0.25, options.to or 10.0, options.points),
        acceleration_ratios=np.linspace(0.5, options.sizes_to or 10.0, options.points),
        **how,
    )
    shares, lost = found.safe().tolist(), found.undecided().tolist()
    survived = (_share(x, n, found.bare.size) for x, n in zip(shares, lost, strict=True))
    print(f"share of the pulses that the block survives: {', '.join(survived)}")
    _say_undecided("pulses", lost, found.bare.size)
    return found, {"survived": shares, "undecided": lost}


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


def _rocking(
    options: argparse.Namespace, scene: Scene, hung: Pendulum | None, how: dict[str, Any]
) -> tuple[RockingSpectrum, dict[str, Any]]:
    """Spectrum of a record, and its numbers for JSON."""
    import numpy as np

    from tpd.answers.spectra import rocking_spectrum

    block = scene.block
    if hung is not None:
        ratios = {"mass_ratio": hung.mass / block.mass, "length_ratio": hung.length / block.half_height}
        how = how | ratios | {"damping_ratio": hung.damping_ratio}
    periods = np.linspace(0.5, options.to or 12.0, options.points)
    found = rocking_spectrum(block, scene.motion, periods=periods, **how)
    lost = found.undecided().tolist()
    _say_undecided("blocks", lost, found.periods.size)
    return found, {"undecided": lost}
