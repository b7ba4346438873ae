"""Write the reference of all public names, `notebooks/guide/api.md`, from the source, without running it.

    .venv/bin/python -m tests.api_reference

Signatures, fields and errors are those of the code; a sentence is the first one of its docstring.
"""

from __future__ import annotations

import re
import textwrap
from pathlib import Path

import griffe

ROOT = Path(__file__).parents[1]
PAGE = ROOT / "notebooks" / "guide" / "api.md"
WIDTH = 100
HEAD = """\
# Public names

*For users of Python: after this page you can call every public name, and know what it returns.*

All names of `tpd`, by what you want to do, as `python -m tests.api_reference` writes them from the source.
Units are SI unless stated otherwise, and angles are in rad. Names that are not on this page may change.
`Real` is a number, `Whole` a whole number, and `Vector` a list or an array of numbers. Numbers can be
Python, NumPy or JAX numbers, or arrays of one element. Results that are tables have the methods `columns()`,
a dictionary of arrays, and `to_dataframe()`, which needs pandas. Bad input is a `ValueError` with one
sentence. Functions that simulate raise a `RuntimeError` if JAX is in 32-bit mode. `progress` is True for a
bar on stderr, or a function that is called with the finished and the whole work. `workers` is a number of
threads, by default all cores.

Every docstring has a tested example, which `help(tpd.fold_curve)` prints. This page shows those of **the ten
names that most people need:** [`tpd.Block`](#block), [`tpd.Harmonic`](#harmonic),
[`tpd.Record.read`](#record), [`tpd.Scene`](#scene), [`tpd.assess`](#assess), [`tpd.optimise`](#optimise),
[`tpd.check`](#check), [`tpd.plot`](#plot), [`tpd.write_report`](#write_report) and
[`tpd.steady_state`](#steady_state).

"""
MOST_USED = set(re.findall(r"\[`tpd\.(\w+)", HEAD))
INTERNAL = {
    "Model": "check most_periods settle solve_steady trajectory",
    "Assessment": "guess measures",
    "Bob": "inertia_share reach rod_share",
    "Conditions": "axis column description factor_rows ranks scattered subset tables units which",
    "Design": ("at_bounds equivalent exact_motions remedy rod_angle search sliding swing"),
    "DesignSpace": (
        "bounds bounds_at ends hinge_ratio logarithms names of sample scaled searched slopes unscaled"
    ),
    "EngineVerdict": "ensemble finer losses scene sliding step step_matters",
    "Ensemble": "dealt draws half_widths seeded starts widths",
    "Fragility": "cases changed measure p_medians quakes unanswered",
    "GroundMotion": "digest in_drawing piece pieces quantities swing_in_drawing",
    "Harmonic": "in_drawing in_words quantities swing_in_drawing",
    "Hazard": "factor measure",
    "Job": (
        "all_messages bob check_motion compiled full ground_motions hazard in_words intensity messages "
        "method motions notes only search settles shaking single tables under file_notes"
    ),
    "PairedRuns": (
        "annual cluster counted description ends excess_reduction first_measure group half is_answered only "
        "passed reduction starts_without_benefit summary worse"
    ),
    "Parameters": "hinge numbers",
    "Piecewise": "accuracy equations limits",
    "Nonlinear": "accuracy equations limits",
    "Pulse": "piece pieces",
    "Record": "piece pieces",
    "Risk": "cap name",
    "Runs": (
        "cluster columns condition ended impacts is_lifted lam mu nu of reshape rows stands starts summary"
    ),
    "Scene": "quantities",
    "Smoothed": "cycle resolution round_off settle_exactly solve_steady widths",
    "StoredDesign": "content path",
    "Tabular": "columns to_dataframe",
    "Trials": "best_without limits of risk undecided",
    "Validation": "is_harmful measure_of_runs",
}
"""Fields and methods by their class that users do not need, or that the page describes once at the top."""
HIDDEN = {"explore": "page.explore", "relative_length": "relative_length"}
"""Functions by the name of the module that has the same name and therefore hides them."""
EVERYWHERE = {
    "JAX is in 32-bit mode.",
    "bad input.",
    "progress",
    "number of threads; all cores by default.",
    "processes or machines instead of threads.",
}
"""Reasons of errors, and arguments, that the page describes once at the top."""
GROUPS = {
    "Describe the block and its excitation": (
        "Block Pendulum Scene Harmonic Pulse Record records paper_scene Parameters Terms"
    ),
    "Design a pendulum": (
        "optimise Design DesignSpace Conditions Risk limits Descent GroundSearch "
        "optimise_all Job details read_design"
    ),
    "Show a result": "plot explore write_report",
    "Check a block or a pendulum": "assess check paired_runs Ensemble outcomes engines",
    "Pulses and earthquakes": (
        "transient critical_scale fragility Hazard annual_rates overturning_spectrum rocking_spectrum"
    ),
    "Motions under harmonic excitation": (
        "steady_state simulate Starts attractors settled_response branches symmetric_orbits periodic_orbit "
        "design_map fold_curve theory"
    ),
    "Choose a model": "Auto Piecewise Nonlinear Smoothed",
    "Statuses": "Status status_name",
    "Run many at once": "in_chunks",
}
"""Titles of the page, with the names below each."""
BESIDE = {
    "Harmonic": ("scene.ground_motion.GroundMotion",),
    "Design": (
        "design.reasons.DesignStatus",
        "design.validate.Validation",
        "design.refine.Trials",
    ),
}
"""Classes that are not at the top, by the name that they stand below."""
NOTES = {
    "Describe the block and its excitation": (
        "`Block`, `Pendulum`, `Harmonic`, `Scene`, `Pulse` and `Record` are pytrees of floats. `jax.grad` "
        "with respect to a `Pendulum` returns a `Pendulum` whose fields hold the derivatives: `.mass` in "
        "rad/kg, `.length` in rad/m."
    ),
    "Pulses and earthquakes": (
        "`jit`, `vmap` and `grad` take `transient` and `critical_scale`; the others run many motions "
        "themselves. [Ground motion](ground_motion.md) explains them."
    ),
    "Motions under harmonic excitation": (
        "`jit`, `vmap` and `grad` take `steady_state`, `simulate` (in `times` forward mode only), "
        "`symmetric_orbits` and `periodic_orbit`, with any model but `Auto`; the others take plain numbers. "
        "A `subject` is `Parameters`, or a `Scene` with the `pendulum` beside it."
    ),
    "Choose a model": "[Models](models.md) says which to take.",
    "Statuses": "[Statuses](statuses.md) explains each.",
}

Item = griffe.Object | griffe.Alias


def sentence(item: Item) -> str:
    """First sentence of the docstring."""
    text = cell(item.docstring.value.split("\n\n")[0]) if item.docstring else ""
    # A capital or "al." before the stop is an abbreviation: "N. Ricker", "Collini et al. (2016)".
    ends = r"(?<![A-Z]\.)(?<!al\.)(?<!Bull\.)(?<!Seismol\.)(?<!Soc\.)(?<!Am\.)(?<=[.:])\s+(?=[A-Z`(])"
    return re.sub(":$", ".", re.split(ends, text, maxsplit=1)[0])


def cell(text: object) -> str:
    return " ".join(str(text).split())


def arguments(item: Item) -> list[griffe.DocstringParameter]:
    """Arguments that a docstring describes."""
    found = item.docstring.parse("google", warnings=False) if item.docstring else ()
    return [entry for s in found if isinstance(s, griffe.DocstringSectionParameters) for entry in s.value]


def sections(item: Item, name: str = "") -> list[str]:
    """Arguments and errors of a docstring, and the example of a name that most people need."""
    lines: list[str] = []
    for entry in arguments(item):
        if not EVERYWHERE & {entry.name, cell(entry.description)}:
            kind = f": {cell(entry.annotation)}" if entry.annotation else ""
            lines.append(f"- `{entry.name}{kind}`: {cell(entry.description)}")
    lines += [""] * bool(lines)
    for section in item.docstring.parse("google", warnings=False) if item.docstring else ():
        if isinstance(section, griffe.DocstringSectionRaises):
            for entry in (entry for entry in section.value if cell(entry.description) not in EVERYWHERE):
                # An error belongs to the list of arguments above it.
                del lines[-1:]
                lines += [f"- Raises `{entry.annotation}`: {cell(entry.description)}", ""]
        if (
            isinstance(section, griffe.DocstringSectionAdmonition)
            and section.title == "Example"
            and name in MOST_USED
        ):
            lines += ["```pycon", section.value.contents, "```", ""]
    return lines


def is_enum(item: griffe.Class) -> bool:
    return any(str(base).rpartition(".")[2] in ("Enum", "Enumeration", "StrEnum") for base in item.bases)


class Reference:
    """The page, as it grows: an answer that several calls return is described once."""

    def __init__(self) -> None:
        self.package = griffe.load("tpd", search_paths=[str(ROOT)], resolve_aliases=True)
        self.lines: list[str] = []
        self.described = {self.target(name).path for name in " ".join(GROUPS.values()).split()}

    def target(self, name: str) -> griffe.Object:
        return self.visible(self.package[name])

    @staticmethod
    def visible(item: Item) -> griffe.Object:
        """Object behind an import, and the function behind a module of the same name."""
        item = item.final_target if item.is_alias else item
        hidden = HIDDEN.get(item.name) if item.is_module else None
        return item[hidden] if hidden else item

    def default(self, expression: str | griffe.Expr) -> str:
        """Source of a default; the number itself where it is a constant of the package."""
        if isinstance(expression, griffe.ExprName) and expression.canonical_path.startswith("tpd."):
            value = str(getattr(self.package[expression.canonical_path.removeprefix("tpd.")], "value", ""))
            return value if re.fullmatch(r"[-+\d.e_]+", value) else expression.name
        # Makers of fields: `field(default=1.0, ...)`, `_parameter(1.0)`.
        made = re.match(r"(?:\w+\.)?(?:field|_\w+|setting)\((.*)\)$", str(expression), flags=re.DOTALL)
        if made is None:
            return str(expression)
        # `setting` has the name, the check and the default.
        given = re.search(r"default=([^,()]+)|^'\w+', [\w.]+, ([^,()]+)", made[1])
        return (given[1] or given[2]) if given else made[1] if re.fullmatch(r"[\w.]+", made[1]) else ""

    def call(self, item: griffe.Function, name: str) -> str:
        """Call of a function, in which arguments with a description have no type."""
        words: list[str] = []
        kinds = griffe.ParameterKind
        described = {entry.name for entry in arguments(item)} | EVERYWHERE
        for parameter in item.parameters:
            if parameter.name in ("self", "cls"):
                continue
            if parameter.kind is kinds.keyword_only and not any(word.startswith("*") for word in words):
                words.append("*")
            prefix = {kinds.var_positional: "*", kinds.var_keyword: "**"}.get(parameter.kind, "")
            word = f"{prefix}{parameter.name}"
            word += f": {parameter.annotation}" if parameter.name not in described else ""
            plain = parameter.default is None or prefix
            words.append(word if plain else f"{word} = {self.default(parameter.default)}")
            if parameter.kind is kinds.positional_only:
                words.append("/")
        end = f" -> {item.returns}" if item.returns and item.name != "__init__" else ""
        return f"{name}({', '.join(words)}){end}"

    def block(self, item: griffe.Function, name: str) -> list[str]:
        """Call of a function as lines of code."""
        lines = textwrap.wrap(self.call(item, name), WIDTH, subsequent_indent="    ", break_on_hyphens=False)
        return ["```py", *lines, "```", ""]

    def function(self, item: griffe.Function, name: str) -> None:
        """A call with its errors, and what it returns if that is a class of the package."""
        self.lines += [*self.block(item, name), sentence(item), "", *sections(item, name)]
        names = item.returns.iterate() if isinstance(item.returns, griffe.Expr) else ()
        paths = [one.canonical_path for one in names if isinstance(one, griffe.ExprName)]
        for answer in (self.target(path[4:]) for path in paths if path.startswith("tpd.")):
            if answer.is_class and answer.path not in self.described:
                self.lines += [f"**`{answer.name}`**: {sentence(answer)}", ""]
                self.members(answer, "")

    def members(self, item: griffe.Class, heading: str = "Properties:") -> None:
        """Fields, properties, errors and methods of a class, but for what the page says of a base already."""
        self.described.add(item.path)
        above = [base for base in item.mro() if base.path in self.described]
        said = {id(owner) for base in above for owner in (base, *base.mro())}
        found: dict[str, Item] = {}
        for owner in (*reversed(item.mro()), item):
            if id(owner) not in said:
                public = {name: m for name, m in owner.members.items() if not name.startswith("_")}
                internal = INTERNAL.get(owner.name, "").split()
                found |= {name: m for name, m in public.items() if name not in internal}
        shown = [m for name, m in found.items() if not any(name in base.all_members for base in above)]
        if above:
            self.lines += [f"A kind of {' and of '.join(f'`{base.name}`' for base in above)}.", ""]
        attributes = [m for m in shown if m.is_attribute and (m.annotation or is_enum(item))]
        stored = [m for m in attributes if "property" not in m.labels]
        computed = [m for m in attributes if "property" in m.labels]
        if is_enum(item):
            self.lines += [f"One of {', '.join(f'`{m.name}`' for m in stored if m.value)}.", ""]
        else:
            self.lines += map(self.field, stored)
            # Nobody makes a result, and its fields and properties are one list.
            self.lines += ["", heading, ""] if computed and heading else []
            self.lines += [f"- `{m.name}: {cell(m.annotation)}`: {sentence(m)}" for m in computed]
        self.lines += [*sections(item, item.name), ""]
        calls = [m for m in shown if m.is_function]
        self.lines += ["Calls:", ""] * bool(calls and heading)
        for m in calls:
            name = f"{item.name}.{m.name}" if {"staticmethod", "classmethod"} & m.labels else f".{m.name}"
            self.lines += [f"- `{self.call(m, name)}`: {sentence(m)}"]
            inner = "\n".join(line for line in sections(m) if line).splitlines()
            self.lines += [f"  {line}".rstrip() for line in inner]
        self.lines += [""]

    def field(self, m: Item) -> str:
        kind = f": {cell(m.annotation)}" if m.annotation else ""
        default = self.default(m.value) if m.value is not None else ""
        said = f": {cell(m.docstring.value)}" if m.docstring and m.docstring.value else ""
        return f"- `{m.name}{kind}{' = ' * bool(default)}{default}`{said}"

    def one(self, item: griffe.Object, name: str) -> None:
        """A name, with the classes that stand below it."""
        if item.is_function:
            self.function(item, name)
        elif item.is_class:
            self.lines += [sentence(item), ""]
            made = item.members.get("__init__")
            if made and "dataclass" not in item.labels:
                self.lines += [*self.block(made, item.name), *sections(made)]
            self.members(item)
        elif item.is_attribute:
            self.lines += [f"`{name} = {item.value}`" + f": {sentence(item)}" * bool(sentence(item)), ""]
        for inner in BESIDE.get(name, ()):
            self.lines += [f"#### `{self.target(inner).name}`", ""]
            self.one(self.target(inner), inner)

    def module(self, item: griffe.Module, name: str) -> None:
        """Public names of a module: what others are derived from, and what they return, comes first."""
        self.lines += [sentence(item), ""]
        imported = {name: m.target_path for name, m in item.members.items() if m.is_alias}
        public = item.exports or [name for name, path in imported.items() if path.startswith("tpd.")]
        kinds: list[tuple[str, griffe.Class]] = []
        for inner in sorted(map(str, public), key=lambda x: (x not in ("Limit", "EngineVerdict"), x)):
            entry = self.visible(item[inner])
            if entry.is_class and any(base.name == "Limit" for base in entry.mro()):
                kinds.append((f"{name}.{inner}", entry))
            elif entry.path not in self.described:
                self.lines += [] if entry.is_attribute else [f"#### `{name}.{inner}`", ""]
                self.one(entry, f"{name}.{inner}")
        if kinds:
            self.lines += ["Kinds of `Limit`:", "", "| limit | meaning | argument |", "|---|---|---|"]
            self.lines += [self.row(entry, call) for call, entry in kinds] + [""]

    def row(self, item: griffe.Class, name: str) -> str:
        """Row of a table of classes that have one field each."""
        (field,) = (m for m in item.members.values() if m.annotation and "instance-attribute" in m.labels)
        default = self.default(field.value) if field.value is not None else ""
        call = f"`{name}({field.name}{' = ' * bool(default)}{default})`"
        cells = (text.replace("|", "\\|") for text in (call, sentence(item), sentence(field)))
        return f"| {' | '.join(cells)} |"

    def text(self) -> str:
        """The whole page."""
        index = []
        for title, names in GROUPS.items():
            self.lines += [f"## {title}", "", NOTES.get(title, ""), ""]
            for name in names.split():
                self.lines += [f"### `{name}`", ""]
                item = self.target(name)
                self.module(item, name) if item.is_module else self.one(item, name)
            links = ", ".join(f"[`{name}`](#{name.lower()})" for name in names.split())
            index.append(f"- [{title}](#{title.lower().replace(' ', '-')}): {links}")
        body = re.sub(r"\n{3,}", "\n\n", "\n".join(self.lines)).strip()
        # The names of kinds of numbers stand without the module that has them.
        body = re.sub(r"\bchecks\.(?=(Real|Whole|Vector)\b)", "", body)
        return HEAD + "\n".join(index) + f"\n\n{body}\n"


if __name__ == "__main__":
    PAGE.write_text(Reference().text(), encoding="utf-8")
