"""The aims of the project in numbers, and the limit that replaces an aim that was not reached."""

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


def _ratios(kind: str, least: float, peer: str = "") -> Callable[[Rows], tuple[str, bool]]:
    """Measure the time of the fastest other method over our time, at errors of at most 1e-6."""

    def measured(rows: Rows) -> tuple[str, bool]:
        found = [o["ms"] / m["ms"] for _, m, o in stored.module("precision").pairs(rows, kind, peer)]
        if not found:
            return "no answer to compare with", False
        return f"{min(found):.2g} to {max(found):.2g} times", min(found) >= least

    return measured


def _front(kind: str) -> Callable[[Rows], tuple[str, bool]]:
    def measured(rows: Rows) -> tuple[str, bool]:
        of = stored.module("precision")
        # Other ways of ours do not push a default off the front.
        rows = [r for r in rows if "default" in r["method"] or not r["ours"]]
        scenes = list(dict.fromkeys(r["scene"] for r in rows))
        good = [any("default" in m for m in of.on_front(rows, s, kind)) for s in scenes]
        return f"{sum(good)} of {len(good)} scenes", all(good)

    return measured


def _errors(rows: Rows) -> tuple[str, bool]:
    worst = max(r["error"] or 0.0 for r in rows if "default" in r["method"])
    return f"{worst:.0e}", worst <= 1e-9


def _slopes_cost(rows: Rows) -> tuple[str, bool]:
    mine = {(r["scene"], r["kind"]): r["ms"] for r in rows if r["method"] == "steady_state in jit (default)"}
    slopes = {s: ms for (s, kind), ms in mine.items() if kind == "gradient" and ms}
    ratios = [ms / mine[s, "value"] for s, ms in slopes.items()]
    return f"{max(ratios):.2g}", max(ratios) <= 2.0


def _rate(aim: float) -> Callable[[Rows], tuple[str, bool]]:
    def measured(rows: Rows) -> tuple[str, bool]:
        engine = stored.module("engine")
        ours, scipy = (engine.per_design(rows, what) for what in (engine.GRADIENTS, engine.BY_SCIPY))
        return f"{1.0 / ours:,.0f} per second, {scipy / ours:,.0f} times SciPy on one core", 1.0 / ours >= aim

    return measured


def _batch(rows: Rows) -> tuple[str, bool]:
    engine = stored.module("engine")
    ratio = engine.per_design(rows, engine.BY_LOOP) / engine.per_design(rows, engine.GRADIENTS)
    return f"{ratio:.0f} times", ratio >= 1000.0


def _ensemble(rows: Rows) -> tuple[str, bool]:
    (seconds,) = (r["seconds"] for r in rows if r["what"] == stored.module("engine").ENSEMBLE)
    return f"{seconds:.2f} s", seconds <= 0.35


def _command(name: str, when: str, aim: float) -> Callable[[Rows], tuple[str, bool]]:
    def measured(rows: Rows) -> tuple[str, bool]:
        found = max(r[when] for r in rows if (r["command"] == "tpd optimise") == (name == "tpd optimise"))
        return f"{found:.1f} s", found <= aim

    return measured


def _grid(rows: Rows) -> tuple[str, bool]:
    found = stored.module("benefit").behind(rows)
    worst = max(found.values(), default=0.0)
    return f"{worst:.1f} points below at most, in {len(found)} scenes (negative: above)", worst <= 2.0


def _band(rows: Rows) -> tuple[str, bool]:
    (r,) = (r for r in rows if r["scene"] == stored.module("benefit").BAND)
    return f"{r['first']:.1f} s, then {r['seconds']:.1f} s", r["first"] <= 20.0 and r["seconds"] <= 3.0


def _found(rows: Rows) -> tuple[str, bool]:
    ours = [r for r in stored.module("optima").summary(rows) if r["method"] == "optax and SLSQP finish"]
    hits, seeds = (sum(r[k] for r in ours) for k in ("hits", "seeds"))
    return f"{hits} of {seeds}", hits == seeds


def _designs(rows: Rows) -> tuple[str, bool]:
    until = {(r["problem"], r["method"]): r["until"] for r in stored.module("optima").summary(rows)}
    shares = []
    for problem, method in until:
        if method == "optax and SLSQP finish":
            others = [v for (p, m), v in until.items() if p == problem and m.endswith("restarted")]
            shares.append(until[problem, method] / min(others))
    return ", ".join(f"{share:.0%}" for share in shares), max(shares) <= 0.05


def _smooth(rows: Rows) -> tuple[str, bool]:
    smoothing = stored.module("smoothing")
    (i,) = (i for i, w in enumerate(smoothing.WIDTHS) if abs(w / 1e-3 - 1.0) < 0.01)
    worst = max(smoothing.errors(rows, e, "both signs", "amplitude")[i].max() for e in (1.0, 0.8))
    return f"{worst:.0e}", worst <= 1e-2


def _kills(rows: Rows) -> tuple[str, bool]:
    r = rows[-1]
    return f"{r['same']} of {r['kills']}", r["same"] == r["kills"]


def _guards(rows: Rows) -> tuple[str, bool]:
    seen = [all(r["fails"]) for r in rows]
    return f"{sum(seen)} of {len(seen)}", all(seen)


def _mutations(rows: Rows) -> tuple[str, bool]:
    places = sum(r["places"] - r["equivalent"] for r in rows)
    noticed = places - sum(len(r["survivors"]) for r in rows)
    return f"{noticed / places:.0%} of {places}", noticed >= 0.95 * places


_LOOP = "Limit: the time of the loop, which needs the number of periods, may miss events and has no status."
_COMPILED = "Limit: as measured. Numba and XLA compile, and both store the compiled code."
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
        "Value of one scene: a default setting is on the Pareto front",
        "all six",
        _front("value"),
        _LOOP,
    ),
    Aim(
        "precision",
        "Gradient of one scene: a default setting is on the Pareto front",
        "all six",
        _front("gradient"),
        _LOOP,
    ),
    Aim(
        "precision",
        "Value: time of the fastest other method over our time",
        "10",
        _ratios("value", 10.0),
        _LOOP,
    ),
    Aim(
        "precision",
        "Gradient: time of the fastest other method over our time",
        "10",
        _ratios("gradient", 10.0),
        "Limit: the loop needs six runs for the gradient, and we need one; both are compiled.",
    ),
    Aim(
        "precision", "Gradient: time of SciPy over our time", "10", _ratios("gradient", 10.0, "SciPy"), _LOOP
    ),
    Aim(
        "precision",
        "Time of a gradient over the time of a value, by events",
        "2 at most",
        _slopes_cost,
        "As measured.",
    ),
    Aim(
        "engine",
        "Designs with gradients, multipliers and statuses",
        "105,000 per second",
        _rate(105_000.0),
        "Limit: as measured. Above 10⁴ designs the rate is constant, and the arithmetic limits it.",
    ),
    Aim(
        "engine",
        "Gradients of a batch: time of the loop over our time",
        "1000",
        _batch,
        "Limit: as measured. The exponentials of one orbit alone take longer.",
    ),
    Aim(
        "engine",
        "10,000 runs of an ensemble",
        "0.35 s",
        _ensemble,
        "Limit: as measured. The Numba loop takes half of this time per run, and has no status.",
    ),
    Aim("commands", "`tpd optimise`, first call", "30 s", _command("tpd optimise", "first", 30.0), _COMPILED),
    Aim(
        "commands",
        "`tpd optimise`, later",
        "8 s",
        _command("tpd optimise", "later", 8.0),
        "Limit: as measured. Most of the nonlinear runs last all of their 100 periods.",
    ),
    Aim("commands", "`check`, `response`, `map`, first call", "12 s", _command("", "first", 12.0), _COMPILED),
    Aim(
        "commands",
        "`check`, `response`, `map`, later",
        "4 s",
        _command("", "later", 4.0),
        "Limit: as measured for `check`, which simulates paired runs with the nonlinear equations.",
    ),
    Aim(
        "benefit",
        "Default design against the best of a grid, other runs",
        "at most 2 points below",
        _grid,
        "Limit: 5 points, because few runs do not resolve the edges of a narrow region.",
    ),
    Aim(
        "benefit",
        "Design for 20 frequencies, first, later",
        "20 s, 3 s",
        _band,
        "Limit: as measured. The search takes a quarter of the time, and runs take the rest.",
    ),
    Aim("optima", "Seeds that reach the best value", "all 15", _found, "As measured."),
    Aim(
        "optima",
        "Designs until the best value, over those of the best derivative-free method",
        "5 %",
        _designs,
        "Limit: screening and descents take 112 designs, and Nelder-Mead needs few in a single basin.",
    ),
    Aim("smoothing", "Error of the smoothed amplitude, width 10⁻³, e ≥ 0.8", "1e-2", _smooth, "As measured."),
    Aim(
        "cluster",
        "Calculations with the same digits after a worker was killed",
        "all",
        _kills,
        "As measured.",
    ),
    Aim(
        "mutations", "Changed operators and constants that a test notices", "95 %", _mutations, "As measured."
    ),
    Aim("guards", "Guards with a test that fails without the guard", "all", _guards, "As measured."),
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
    return f"tpd {abouts[0]['version']}, {packages}; {'; '.join(said)}; {when}."
