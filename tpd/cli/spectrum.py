"""`tpd spectrum`: overturning spectrum of a pulse, or rocking spectrum of a record."""

from __future__ import annotations

import argparse
from collections.abc import Iterable
from functools import partial
from typing import Any

import numpy as np

from tpd.answers.spectra import OverturningSpectrum, RockingSpectrum, overturning_spectrum, rocking_spectrum
from tpd.cli import common, outputs
from tpd.cli.interrupts import SOUND
from tpd.core import checks, files
from tpd.core.progress import Bar
from tpd.scene.ground_motion import Pulse
from tpd.scene.scene import Pendulum, Scene

_CASES = ("for the bare block", "with the pendulum")


def run(options: argparse.Namespace, inputs: common.Case) -> int:
    """Follow all blocks, write table and picture; return the exit status."""
    job, pendulum = inputs
    checks.count("--points", options.points, least=2)
    for flag, value in (("--to", options.to), ("--sizes-to", options.sizes_to)):
        if value is not None:
            checks.positive(flag, value)
    scene = job.under(job.shaking)
    is_pulse = isinstance(scene.motion, Pulse)
    if not is_pulse and options.sizes_to is not None:
        raise ValueError("--sizes-to is of the sizes of a pulse, and the job has a record")
    common.say(scene, pendulum, notes=job.messages)
    with Bar() as bar, common.cluster(options) as cluster:
        how = {"gravity": float(scene.gravity), "cluster": cluster}
        make = _overturning if is_pulse else _rocking
        found, content = make(options, scene, pendulum, how | {"progress": partial(bar, "following blocks")})
    tables = {
        "spectrum.csv": files.as_table(found.columns()),
        "spectrum.json": files.as_json(common.inputs(scene, pendulum, job) | content),
    }
    outputs.write(options.out, tables.items(), {"spectrum.png": partial(outputs.plot, found)})
    return SOUND


def _overturning(
    options: argparse.Namespace, scene: Scene, pendulum: Pendulum | None, how: dict[str, Any]
) -> tuple[OverturningSpectrum, dict[str, Any]]:
    """Spectrum of a pulse, and its numbers for JSON."""
    found = overturning_spectrum(
        scene.block,
        scene.motion,
        pendulum,
        frequency_ratios=np.linspace(0.25, options.to or 10.0, options.points),
        acceleration_ratios=np.linspace(0.5, options.sizes_to or 10.0, options.points),
        **how,
    )
    shares, lost = found.safe().tolist(), found.undecided().tolist()
    survived = (_share(x, n, found.without_pendulum.size) for x, n in zip(shares, lost, strict=True))
    print(f"share of the pulses that the block survives: {', '.join(survived)}")
    _say_undecided("pulses", lost, found.without_pendulum.size)
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
    options: argparse.Namespace, scene: Scene, pendulum: Pendulum | None, how: dict[str, Any]
) -> tuple[RockingSpectrum, dict[str, Any]]:
    """Spectrum of a record, and its numbers for JSON."""
    block = scene.block
    if pendulum is not None:
        how = how | {"mass_ratio": pendulum.mass / block.mass, "damping_ratio": pendulum.damping_ratio}
        how["length_ratio"] = pendulum.length / block.half_height
    periods = np.linspace(0.5, options.to or 12.0, options.points)
    found = rocking_spectrum(block, scene.motion, periods=periods, **how)
    lost = found.undecided().tolist()
    _say_undecided("blocks", lost, found.periods.size)
    return found, {"undecided": lost}
