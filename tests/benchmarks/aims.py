"""The aims of the project in numbers, and the limit that replaces an aim that was not reached."""

import math
from collections.abc import Callable
from typing import Any, NamedTuple

from tests.benchmarks import stored

Rows = list[dict[str, Any]]


class Aim(NamedTuple):
    """One row of the table of aims."""

    benchmark: str
    question: str
    aim: str
    measured: Callable[[Rows], tuple[str, bool]]
    """The measured value in words, and whether it reaches the aim."""
    limit: str
    """The limit that replaces the aim if the aim is not reached, and the reason."""


def _ratios(kind: str, least: float) -> Callable[[Rows], tuple[str, bool]]:
    """Measure the time of the fastest other method over our time, at errors of at most 1e-6."""

    def measured(rows: Rows) -> tuple[str, bool]:
        found = [other["ms"] / ours["ms"] for _, ours, other in stored.module("precision").pairs(rows, kind)]
        if not found:
            return "no answer to compare with", False
        return f"{min(found):.2g} to {max(found):.2g} times", min(found) >= least

    return measured


def _errors(rows: Rows) -> tuple[str, bool]:
    worst = max(r["error"] or 0.0 for r in rows if "default" in r["method"])
    return f"{worst:.0e}", worst <= 1e-9


def _values_cost(rows: Rows) -> tuple[str, bool]:
    mine = {(r["scene"], r["kind"]): r["ms"] for r in rows if r["method"] == "steady_state in jit (default)"}
    ratios = [mine[s, "value"] / ms for (s, kind), ms in mine.items() if kind == "gradient" and ms]
    return f"{max(ratios):.2g}", max(ratios) <= 0.4


def _ensemble(rows: Rows) -> tuple[str, bool]:
    (seconds,) = (r["seconds"] for r in rows if r["what"] == stored.module("engine").ENSEMBLE)
    return f"{seconds:.2f} s", seconds <= 0.35


def _command(name: str, when: str, aim: float) -> Callable[[Rows], tuple[str, bool]]:
    def measured(rows: Rows) -> tuple[str, bool]:
        found = max(r[when] for r in rows if (r["command"] == "tpd optimise") == (name == "tpd optimise"))
        return f"{found:.1f} s", found <= aim

    return measured


def _regret(rows: Rows) -> tuple[str, bool]:
    every, near = stored.module("regret").summary(rows), stored.module("regret").NEAR
    missed, searches = sum(r["missed"] for r in every), sum(len(r["searches"]) for r in every)
    worst = max((r["worst"] for r in every if r["worst"] is not None), default=math.nan)
    nothing = sum(s["status"] != "recommended" for r in every for s in r["searches"])
    none = f"; {nothing} recommend no pendulum, {missed} of them although another search has one"
    return f"{100.0 * worst:.2f} points in {searches} searches{none}", not missed and worst <= near


def _wider(rows: Rows) -> tuple[str, bool]:
    losses = [r["loss"] for r in stored.module("regret").summary(rows) if r["loss"] is not None]
    finite = [loss for loss in losses if math.isfinite(loss)]
    worst, none = max(finite, default=math.nan), len(losses) - len(finite)
    lost = f"; no design in {none} of {len(losses)} wider spaces" if none else ""
    return f"{100.0 * worst:.2f} points{lost}", not none and worst <= stored.module("regret").NEAR


def _best(rows: Rows) -> tuple[str, bool]:
    ours = [r for r in stored.module("optima").summary(rows) if r["method"] == "optax, Newton"]
    hits, seeds = (sum(r[k] for r in ours) for k in ("hits", "seeds"))
    return f"{hits} of {seeds}", 0 < hits == seeds


def _smooth(rows: Rows) -> tuple[str, bool]:
    smoothing = stored.module("smoothing")
    (i,) = (i for i, w in enumerate(smoothing.WIDTHS) if abs(w / 1e-3 - 1.0) < 0.01)
    worst = max(smoothing.errors(rows, e, "both signs", "amplitude")[i].max() for e in (1.0, 0.8))
    return f"{worst:.0e}", worst <= 1e-2


_LOOP = "Limit: as measured. The loop needs the number of periods, may miss events and has no status."
_COMPILED = "Limit: as measured. Numba and XLA compile, and both store the compiled code."
_MEASURED = "Limit: as measured."
AIMS = (
    Aim(
        "precision",
        "Error with default settings against 30 digits",
        "1e-9",
        _errors,
        "Limit: as measured, near a fold.",
    ),
    Aim(
        "precision",
        "Value: time of the fastest other method over our time",
        "0.5",
        _ratios("value", 0.5),
        _LOOP,
    ),
    Aim(
        "precision",
        "Gradient: time of the fastest other method over our time",
        "0.5",
        _ratios("gradient", 0.5),
        _LOOP,
    ),
    Aim(
        "precision",
        "Time of a value over the time of value and gradient, by events",
        "0.4 at most",
        _values_cost,
        _MEASURED,
    ),
    Aim(
        "engine",
        "10,000 runs of an ensemble",
        "0.35 s",
        _ensemble,
        "Limit: as measured. The Numba loop takes less time per run, and has no status.",
    ),
    Aim("commands", "`tpd optimise`, first call", "28 s", _command("tpd optimise", "first", 28.0), _COMPILED),
    Aim(
        "commands",
        "`tpd optimise`, later",
        "8 s",
        _command("tpd optimise", "later", 8.0),
        "Limit: as measured. Nonlinear runs and trial runs take most of the time.",
    ),
    Aim(
        "commands",
        "`check`, `response`, `map`, later",
        "12 s",
        _command("", "later", 12.0),
        "Limit: as measured for `check`, which simulates paired runs with the nonlinear equations.",
    ),
    Aim("regret", "Largest regret of a search", "1 point", _regret, _MEASURED),
    Aim("regret", "Loss by a wider design space, with the same seed", "1 point", _wider, _MEASURED),
    Aim("optima", "Seeds that reach the best value", "all 15", _best, _MEASURED),
    Aim("smoothing", "Error of the smoothed amplitude, width 10⁻³, e ≥ 0.8", "1e-2", _smooth, _MEASURED),
)


def aims() -> str:
    """Return the table of aims."""
    cells = []
    for aim in AIMS:
        found = stored.read(aim.benchmark)
        said, met = ("not measured", False) if found is None else aim.measured(found.rows)
        cells.append((aim.question, aim.aim, said, "reached" if met else aim.limit))
    return stored.markdown(("question", "aim", "measured", "limit and reason, if not reached"), cells)


def overview() -> str:
    """Return the table of the benchmarks, with their questions and minutes."""
    cells = []
    for name in stored.NAMES:
        found = stored.read(name)
        minutes = "" if found is None else f"{found.about['seconds'] / 60:.1f}"
        cells.append((f"[{name}](results/{name}.md)", stored.module(name).QUESTION, minutes))
    return stored.markdown(("benchmark", "question", "minutes"), cells)


def machine() -> str:
    """Return versions, machine and dates of the stored results, in a sentence."""
    abouts = [s.about for name in stored.NAMES if (s := stored.read(name))]
    if not abouts:
        return "Nothing has been measured with this version yet."
    said = sorted({f"{a['machine']}, {a['cores']} cores" for a in abouts})
    days = sorted({a["date"] for a in abouts})
    packages = ", ".join(f"{p} {abouts[0][p]}" for p in stored.PACKAGES)
    when = days[0] if len(days) == 1 else f"{days[0]} to {days[-1]}"
    older = [n for n in stored.NAMES if (s := stored.read(n)) and s.about["code"] == stored.OLDER]
    mark = f" The results of {', '.join(older)} are {stored.OLDER}." if older else ""
    return f"tpd {abouts[0]['version']}, {packages}; {'; '.join(said)}; {when}.{mark}"
