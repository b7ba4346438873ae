"""The command line: `tpd optimise`. Everything slow is imported when it is needed."""

from __future__ import annotations

import argparse
import sys
from pathlib import Path
from typing import Any

import tpd

_FLAGS: dict[str, tuple[str, str, str, str]] = {
    # flag: (table, key, metavar, help)
    "width": ("block", "width", "M", "whole width of the block, m (default 0.1)"),
    "height": ("block", "height", "M", "whole height of the block, m (default 0.4)"),
    "mass": ("block", "mass", "KG", "mass of the block, kg (default 16.224)"),
    "friction": ("block", "friction", "K", "friction moment of the contact over M g b (default 0.05)"),
    "amplitude": ("motion", "amplitude", "M", "amplitude of the base motion, m (default 0.015)"),
    "frequency": ("motion", "frequency", "HZ", "frequency of the base motion, Hz (default 2.5)"),
    "stroke": ("space", "stroke", "RAD", "largest allowed bob angle, rad (default 0.5)"),
}
_SOUND, _BAD_INPUT, _UNSOUND, _INTERRUPTED = 0, 2, 3, 130


def parser() -> argparse.ArgumentParser:
    """The command line's grammar."""
    top = argparse.ArgumentParser(prog="tpd", description=str(tpd.__doc__).splitlines()[0])
    top.add_argument("--version", action="version", version=f"tpd {tpd.__version__}")
    commands = top.add_subparsers(dest="command", required=True, metavar="COMMAND")
    optimise = commands.add_parser(
        "optimise",
        help="find the pendulum for a block",
        description="Find the pendulum of least settled rocking amplitude from rest. Without options: the "
        "block of Collini et al. (2016). Exit status: 0 found, 2 bad input, 3 no design to rely on, "
        "130 interrupted.",
    )
    optimise.add_argument("--scene", type=Path, metavar="FILE", help="TOML file; options override it")
    for flag, (_, _, metavar, text) in _FLAGS.items():
        optimise.add_argument(f"--{flag}", type=float, metavar=metavar, help=text)
    two: dict[str, Any] = {"type": float, "nargs": 2, "metavar": ("LO", "HI")}
    optimise.add_argument("--mass-ratio", help="bounds of bob over block mass (default 0.01 0.2)", **two)
    optimise.add_argument(
        "--length-ratio", help="bounds of pendulum length over half height (default 0.1 1.5)", **two
    )
    optimise.add_argument(
        "--damping",
        type=float,
        nargs="+",
        metavar="ZETA",
        help="damping ratio of the hinge, or two bounds to search it as well (default 0.1)",
    )
    optimise.add_argument("--starts", type=int, metavar="N", help="searches run at once (default 8)")
    optimise.add_argument("--seed", type=int, metavar="N", help="of every random choice (default 0)")
    optimise.add_argument(
        "--out", type=Path, default=Path("tpd-design"), metavar="DIR", help="default tpd-design"
    )
    optimise.add_argument("--overwrite", action="store_true", help="replace the report in an existing DIR")
    return top


def main(arguments: list[str] | None = None) -> int:
    """Run the command line; returns the exit status."""
    options = parser().parse_args(arguments)
    try:
        return _optimise(options)
    except ValueError as error:
        print(f"tpd: {error}", file=sys.stderr)
        return _BAD_INPUT
    except KeyboardInterrupt:
        print("tpd: interrupted; what is not in the output directory is lost", file=sys.stderr)
        return _INTERRUPTED


def _given(options: argparse.Namespace) -> dict[str, dict[str, Any]]:
    """The job's tables of a scene file, overridden by options."""
    from tpd import job

    tables = {} if options.scene is None else job.read(options.scene)
    job.build(tables)
    over = [(table, key, getattr(options, flag)) for flag, (table, key, _, _) in _FLAGS.items()]
    over += [("space", "mass_ratio", options.mass_ratio), ("space", "length_ratio", options.length_ratio)]
    over += [("space", "damping_ratio", _damping(options.damping))]
    over += [("search", "starts", options.starts), ("search", "seed", options.seed)]
    for table, key, value in over:
        if value is not None:
            tables.setdefault(table, {})[key] = value
    return tables


def _damping(values: list[float] | None) -> float | list[float] | None:
    if values is not None and len(values) > 2:
        raise ValueError(f"`--damping` must be one number or two bounds, but is {len(values)} numbers")
    return values[0] if values is not None and len(values) == 1 else values


def _optimise(options: argparse.Namespace) -> int:
    import jax

    jax.config.update("jax_enable_x64", True)
    from tpd import job, report
    from tpd.optimiser import optimise

    work = job.build(_given(options))
    report.claim(options.out, overwrite=options.overwrite)
    search = work.search
    with _Bar() as bar:
        design = optimise(
            work.scene,
            work.space,
            seed=search.seed,
            starts=search.starts,
            steps=search.steps,
            screening=search.screening,
            tolerance=search.tolerance,
            progress=bar,
        )
        responses = _responses(design, bar)
        files = report.write(options.out, design, work, responses)
    print(report.text(design, responses))
    print("\n".join(f"written: {path}" for path in files))
    if design.interrupted:
        return _INTERRUPTED
    return _SOUND if report.is_sound(design) else _UNSOUND


def _responses(design: Any, bar: Any) -> tuple:
    """Amplitude over frequency without and with the pendulum; not after an interruption."""
    from tpd import plot
    from tpd.response import frequency_response

    if design.interrupted:
        return ()
    hung = (None,) if design.pendulum is None else (None, design.pendulum)
    try:
        return tuple(frequency_response(design.scene, p, plot.band(design), progress=bar) for p in hung)
    except KeyboardInterrupt:
        return ()


class _Bar:
    """One progress bar for all stages, on a terminal only."""

    def __init__(self) -> None:
        self._bar: Any = None
        self._stage = ""

    def __enter__(self) -> _Bar:
        return self

    def __exit__(self, *_: object) -> None:
        if self._bar is not None:
            self._bar.close()

    def __call__(self, stage: str, done: int, total: int) -> None:
        from tqdm import tqdm

        if stage != self._stage or self._bar is None or done == 1:
            if self._bar is not None:
                self._bar.close()
            self._bar = tqdm(total=total, desc=stage, disable=None, leave=False, file=sys.stderr)
            self._stage = stage
        self._bar.update(done - self._bar.n)


if __name__ == "__main__":
    sys.exit(main())
