"""`tpd optimise`."""

from __future__ import annotations

import argparse
from typing import TYPE_CHECKING, Any

from tpd.cli import common

if TYPE_CHECKING:
    from tpd.analysis.compare_models import Check
    from tpd.design.result import Design


def add(commands: Any) -> None:
    """The command's grammar."""
    optimise = commands.add_parser(
        "optimise",
        help="find the pendulum for a block",
        description="Find the pendulum of least settled rocking amplitude from rest. Without options: the "
        "block of Collini et al. (2016). Exit status: 0 found, 2 bad input, 3 no design to rely on, "
        "130 interrupted.",
    )
    common.add_scene(optimise)
    optimise.add_argument(
        "--stroke", type=float, metavar="RAD", help="largest allowed bob angle, rad (default 0.5)"
    )
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
    optimise.add_argument(
        "--starts", type=int, metavar="N", help="searches (default 8, over many conditions 64)"
    )
    optimise.add_argument("--seed", type=int, metavar="N", help="of every random choice (default 0)")
    _add_conditions(optimise)
    common.add_out(optimise, "tpd-design")
    optimise.set_defaults(run=run)


def _add_conditions(optimise: argparse.ArgumentParser) -> None:
    """Options for a design over many conditions; a file's tables say more."""
    many = optimise.add_argument_group("over many conditions")
    many.add_argument(
        "--band",
        type=float,
        nargs=2,
        metavar=("LO", "HI"),
        help="least rocking over a band of frequencies, Hz",
    )
    many.add_argument(
        "--amplitudes", type=float, nargs="+", metavar="X", help="factors on the amplitude of the base motion"
    )
    many.add_argument(
        "--scatter",
        nargs="+",
        metavar="NAME=WIDTH",
        help="what is uncertain, by relative half width: amplitude, frequency, friction, slenderness, mass, "
        "length, damping",
    )
    many.add_argument("--measure", metavar="WORD", help="worst (default), expected or cvar")
    many.add_argument(
        "--walls",
        action="store_true",
        default=None,
        help="a solid ball of steel must keep off the block's walls once it has settled",
    )
    many.add_argument(
        "--by-overturning",
        action="store_true",
        default=None,
        help="of what helps take first what overturns under the fewest conditions",
    )
    many.add_argument(
        "--from-starts",
        type=int,
        metavar="N",
        help="finish over the motions that N starts reach, by events, rather than over all symmetric orbits",
    )
    many.add_argument(
        "--worst-start",
        action="store_true",
        help="count the worst of these, rather than their mean over the starts",
    )
    many.add_argument("--method", metavar="WORD", help="of the search: sequential (default), adam or lbfgs")
    many.add_argument(
        "--pareto",
        action="store_true",
        help="the least rocking for every mass as well, by sequential searches",
    )
    many.add_argument("--resume", action="store_true", help="go on with what an interrupted run left in DIR")


def _scatter(pairs: list[str] | None) -> dict[str, float]:
    out = {}
    for pair in pairs or []:
        name, _, width = pair.partition("=")
        try:
            out[name] = float(width)
        except ValueError:
            raise ValueError(f"`--scatter` must be NAME=WIDTH, such as friction=0.2, but is {pair}") from None
    return out


def _given(options: argparse.Namespace) -> dict[str, dict[str, Any]]:
    """The job's tables of a scene file, overridden by options."""
    return common.tables(
        options,
        [
            ("space", "stroke", options.stroke),
            ("space", "mass_ratio", options.mass_ratio),
            ("space", "length_ratio", options.length_ratio),
            ("space", "damping_ratio", _damping(options.damping)),
            ("search", "starts", options.starts),
            ("search", "seed", options.seed),
            ("search", "method", options.method),
            ("conditions", "band", options.band),
            ("conditions", "amplitudes", options.amplitudes),
            ("conditions", "measure", options.measure),
            ("conditions", "by_overturning", options.by_overturning),
            ("limits", "walls", options.walls),
            ("conditions", "reached", options.from_starts),
            ("conditions", "by_share", False if options.worst_start else None),
            *(("scatter", name, width) for name, width in _scatter(options.scatter).items()),
        ],
    )


def _damping(values: list[float] | None) -> float | list[float] | None:
    if values is not None and len(values) > 2:
        raise ValueError(f"`--damping` must be one number or two bounds, but is {len(values)} numbers")
    return values[0] if values is not None and len(values) == 1 else values


def run(options: argparse.Namespace) -> int:
    """Search, write the report, and say what it is worth."""
    common.use_64_bits()
    from tpd.core import files
    from tpd.design import job
    from tpd.design.single import optimise
    from tpd.report import single as report

    work = job.build(_given(options))
    if work.asked is not None:
        from tpd.cli.over import run_over

        return run_over(options, work)
    if options.pareto or options.resume:
        raise ValueError("`--pareto` and `--resume` go with conditions, such as --band: none are given")
    files.claim(options.out, overwrite=options.overwrite)
    search = work.search
    assert search.tolerance is not None
    with common.Bar() as bar:
        design = optimise(
            work.scene,
            work.space,
            seed=search.seed,
            starts=search.starts,
            steps=search.steps,
            screening=search.screening,
            tolerance=search.tolerance,
            ensemble=work.ensemble,
            progress=bar,
        )
        responses = _responses(design, bar)
        ladder = _ladder(design, bar)
        written = report.write(options.out, design, work, responses, ladder=ladder)
    print(report.text(design, responses))
    if ladder is not None:
        print(ladder.table() + "\n")
    print("\n".join(f"written: {path}" for path in written))
    if design.interrupted:
        return common.INTERRUPTED
    return common.SOUND if report.is_sound(design) else common.UNSOUND


def _ladder(design: Design, bar: common.Bar) -> Check | None:
    """The design by the models that do not take long to compile; `tpd check` has all."""
    from tpd.analysis.compare_models import QUICK, check

    if design.pendulum is None or design.interrupted:
        return None
    with common.left_out("what the models say"):
        limit = design.space.stroke
        return check(design.scene, design.pendulum, stroke=limit, rungs=QUICK, progress=bar)
    return None


def _responses(design: Design, bar: common.Bar) -> tuple:
    """Amplitude over frequency without and with the pendulum; not after an interruption."""
    from tpd.analysis.response import frequency_response
    from tpd.plot import single as plot

    if design.interrupted:
        return ()
    hung = (None,) if design.pendulum is None else (None, design.pendulum)
    with common.left_out("the response over frequency"):
        return tuple(frequency_response(design.scene, p, plot.band(design), progress=bar) for p in hung)
    return ()
