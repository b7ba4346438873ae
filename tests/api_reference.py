"""Write the reference of all public names, `notebooks/guide/api.md`, from the source, without running it.

    .venv/bin/python -m tests.api_reference

Signatures, fields and errors are those of the code; a sentence is the first one of its docstring.
"""

from __future__ import annotations

import re
from pathlib import Path

import griffe

ROOT = Path(__file__).parents[1]
PAGE = ROOT / "notebooks" / "guide" / "api.md"
WIDTH = 100
HEAD = """\
# Public names

All names of `tpd`, by what you want to do, as `python -m tests.api_reference` writes them from the source.
Units are SI where nothing else is said, angles are in rad. What is not on this page may change.

"""
GROUPS = {
    "Describe the block and what shakes it": (
        "Block Pendulum Scene Harmonic Pulse Record records paper_scene Parameters Terms"
    ),
    "Design a pendulum": (
        "optimise Design DesignSpace Conditions Risk limits Descent Sequential GroundSearch front "
        "optimise_all Job"
    ),
    "Judge a pendulum": "check verdict Ensemble outcomes engines",
    "Pulses and earthquakes": ("transient critical_scale fragility overturning_spectrum rocking_spectrum"),
    "Motions under harmonic shaking": (
        "steady_state simulate Starts attractors settled_response branches symmetric_orbits periodic_orbit "
        "design_map theory"
    ),
    "Choose a model": "Auto Piecewise Smoothed Segmented",
    "Statuses": "Status status_name",
    "Run many at once": "in_chunks Cluster",
}
"""Titles of the page, with the names below each."""
BESIDE = {
    "Design": (
        "design.result.HarmonicDesign",
        "design.ground.design.GroundDesign",
        "design.result.DesignStatus",
    ),
    "Auto": ("models.base.AbstractModel",),
}
"""Classes that are not at the top, by the name that they stand below."""
NOTES = {
    "Describe the block and what shakes it": (
        "`Block`, `Pendulum`, `Harmonic`, `Scene`, `Pulse` and `Record` are pytrees of floats, so that a "
        "gradient with respect to a pendulum is a pendulum of slopes: `.mass` in rad/kg, `.length` in "
        "rad/m."
    ),
    "Pulses and earthquakes": (
        "`jit`, `vmap` and `grad` take `transient` and `critical_scale`; the others run many motions "
        "themselves. [Ground motion](ground_motion.md) explains them."
    ),
    "Motions under harmonic shaking": (
        "`jit`, `vmap` and `grad` take `steady_state`, `simulate` (in `times` forward mode only), "
        "`symmetric_orbits` and `periodic_orbit`, with any model but `Auto`; the others take plain numbers. "
        "A `subject` is `Parameters`, or a `Scene` with the `pendulum` beside it."
    ),
    "Choose a model": "[Models](models.md) says which to take.",
    "Statuses": "[Statuses](statuses.md) explains each.",
}


def sentence(item: griffe.Object | griffe.Alias) -> str:
    """First sentence of the docstring."""
    text = " ".join(item.docstring.value.split("\n\n")[0].split()) if item.docstring else ""
    # A capital or "al." before the stop is an abbreviation: "N. Ricker", "Collini et al. (2016)".
    return re.split(r"(?<![A-Z]\.)(?<!al\.)(?<!Bull\.)(?<=[.:])\s+(?=[A-Z`(])", text, maxsplit=1)[0].rstrip(
        ":"
    )


def shown(expression: str | griffe.Expr, package: griffe.Module) -> str:
    """Source of a default; the number itself where it is a constant of the package."""
    if isinstance(expression, griffe.ExprName) and expression.canonical_path.startswith("tpd."):
        value = str(getattr(package[expression.canonical_path.removeprefix("tpd.")], "value", ""))
        return value if re.fullmatch(r"[-+\d.e_]+", value) else expression.name
    # Makers of fields: `field(default=1.0, ...)`, `_parameter(1.0)`.
    made = re.match(r"(?:\w+\.)?(?:field|_\w+)\((.*)\)$", str(expression), flags=re.DOTALL)
    if made is None:
        return str(expression)
    given = re.search(r"default=([^,()]+)", made[1])
    return given[1] if given else made[1] if re.fullmatch(r"[\w.]+", made[1]) else ""


def signature(item: griffe.Function, name: str, package: griffe.Module) -> str:
    """Call of a function, on one line or with a line for each argument."""
    words: list[str] = []
    stars = griffe.ParameterKind
    for parameter in item.parameters:
        if parameter.name in ("self", "cls"):
            continue
        if parameter.kind is stars.keyword_only and not any(word.startswith("*") for word in words):
            words.append("*")
        prefix = {stars.var_positional: "*", stars.var_keyword: "**"}.get(parameter.kind, "")
        word = prefix + parameter.name + (f": {parameter.annotation}" if parameter.annotation else "")
        plain = parameter.default is None or prefix
        words.append(word if plain else f"{word} = {shown(parameter.default, package)}")
        if parameter.kind is stars.positional_only:
            words.append("/")
    end = f" -> {item.returns}" if item.returns and item.name != "__init__" else ""
    line = f"{name}({', '.join(words)}){end}"
    return line if len(line) <= WIDTH else f"{name}(\n    " + ",\n    ".join(words) + f",\n){end}"


def cell(text: str) -> str:
    return " ".join(text.split())


def sections(item: griffe.Object) -> list[str]:
    """Arguments and errors of a docstring."""
    lines: list[str] = []
    for section in item.docstring.parse("google", warnings=False) if item.docstring else ():
        if isinstance(section, griffe.DocstringSectionParameters):
            lines += [f"- `{entry.name}`: {cell(entry.description)}" for entry in section.value] + [""]
        if isinstance(section, griffe.DocstringSectionRaises):
            for entry in section.value:
                lines += [f"Raises `{entry.annotation}`: {cell(entry.description)}", ""]
    return lines


def bases(item: griffe.Class, described: set[str]) -> list[griffe.Class]:
    """Bases that the page describes."""
    return [base for base in item.mro() if base.path in described]


def members(item: griffe.Class, described: set[str]) -> list[griffe.Object | griffe.Alias]:
    """Public members of a class and of its bases, but for what the page says of a base already."""
    said = {id(owner) for base in bases(item, described) for owner in (base, *base.mro())}
    known = {name for base in bases(item, described) for name in base.all_members}
    found: dict[str, griffe.Object | griffe.Alias] = {}
    for owner in (*reversed(item.mro()), item):
        if id(owner) not in said:
            found |= {name: m for name, m in owner.members.items() if not name.startswith("_")}
    return [m for name, m in found.items() if name not in known]


def is_enum(item: griffe.Class) -> bool:
    return any(str(base).rpartition(".")[2] in ("Enum", "Enumeration", "StrEnum") for base in item.bases)


def fields(item: griffe.Class, package: griffe.Module, described: set[str]) -> list[str]:
    """Fields, then properties; of an enum its names."""
    attributes = [m for m in members(item, described) if m.is_attribute and (m.annotation or is_enum(item))]
    properties = [m for m in attributes if "property" in m.labels]
    stored = [m for m in attributes if "property" not in m.labels]
    if is_enum(item):
        return [f"One of {', '.join(f'`{m.name}`' for m in stored)}.", ""]
    lines = []
    for m in stored:
        kind = f": {cell(str(m.annotation))}" if m.annotation else ""
        default = shown(m.value, package) if m.value is not None else ""
        said = cell(m.docstring.value) if m.docstring else ""
        lines.append(f"- `{m.name}{kind}{' = ' * bool(default)}{default}`" + f": {said}" * bool(said))
    if properties:
        lines += ["", "Properties:", ""]
        lines += [f"- `{m.name}: {cell(str(m.annotation))}`: {sentence(m)}" for m in properties]
    return [*lines, ""] if lines else []


def methods(item: griffe.Class, package: griffe.Module, described: set[str]) -> list[str]:
    """Calls of a class, with the first sentence of each."""
    lines: list[str] = []
    for m in members(item, described):
        if m.is_function:
            static = {"staticmethod", "classmethod"} & m.labels
            name = f"{item.name}.{m.name}" if static else f".{m.name}"
            lines += ["```py", signature(m, name, package), "```", "", sentence(m), "", *sections(m)]
    return lines


def answers(item: griffe.Function, package: griffe.Module) -> list[griffe.Class]:
    """Classes of the package that a function returns."""
    names = item.returns.iterate() if isinstance(item.returns, griffe.Expr) else ()
    found = []
    for name in names:
        path = name.canonical_path if isinstance(name, griffe.ExprName) else ""
        if path.startswith("tpd."):
            found.append(package[path.removeprefix("tpd.")])
    return [target for one in found if (target := one.final_target if one.is_alias else one).is_class]


class Reference:
    """The page, as it grows: an answer that several calls return is described once."""

    def __init__(self) -> None:
        self.package = griffe.load("tpd", search_paths=[str(ROOT)], resolve_aliases=True)
        self.lines: list[str] = []
        self.described = {self.target(name).path for name in " ".join(GROUPS.values()).split()}

    def target(self, name: str) -> griffe.Object:
        item = self.package[name]
        return item.final_target if item.is_alias else item

    def function(self, item: griffe.Function, name: str) -> None:
        self.lines += [
            "```py",
            signature(item, name, self.package),
            "```",
            "",
            sentence(item),
            "",
            *sections(item),
        ]
        for answer in answers(item, self.package):
            if answer.path not in self.described:
                self.lines += [f"**`{answer.name}`**: {sentence(answer)}", ""]
                self.described.add(answer.path)
                self.members(answer)

    def members(self, item: griffe.Class) -> None:
        """Fields, errors and methods of a class."""
        above = [f"`{base.name}`" for base in bases(item, self.described)]
        self.lines += [f"A kind of {' and of '.join(above)}.", ""] if above else []
        self.lines += fields(item, self.package, self.described)
        self.lines += [*sections(item), *methods(item, self.package, self.described)]

    def one(self, item: griffe.Object, name: str) -> None:
        if item.is_function:
            self.function(item, name)
        elif item.is_class:
            self.lines += [sentence(item), ""]
            made = item.members.get("__init__")
            if made and "dataclass" not in item.labels:
                self.lines += [
                    "```py",
                    signature(made, item.name, self.package),
                    "```",
                    "",
                    *sections(made),
                ]
            self.described.add(item.path)
            self.members(item)
        elif item.is_attribute:
            self.lines += [f"`{name} = {item.value}`" + f": {sentence(item)}" * bool(sentence(item)), ""]
        for inner in BESIDE.get(name, ()):
            self.lines += [f"#### `{self.target(inner).name}`", ""]
            self.one(self.target(inner), inner)

    def module(self, item: griffe.Module, name: str) -> None:
        self.lines += [sentence(item), ""]
        public = item.exports or [name for name, path in item.imports.items() if path.startswith("tpd.")]
        # What others are derived from, and what they return, comes before them.
        for inner in sorted(
            map(str, public), key=lambda inner: (inner not in ("Limit", "EngineVerdict"), inner)
        ):
            entry = item[inner].final_target if item[inner].is_alias else item[inner]
            if entry.path in self.described:
                continue
            if not entry.is_attribute:
                self.lines += [f"#### `{name}.{inner}`", ""]
            self.one(entry, f"{name}.{inner}")

    def text(self) -> str:
        """The whole page."""
        for title, names in GROUPS.items():
            self.lines += [f"## {title}", "", *([NOTES[title], ""] if title in NOTES else [])]
            for name in names.split():
                item = self.target(name)
                self.lines += [f"### `{name}`", ""]
                self.module(item, name) if item.is_module else self.one(item, name)
        index = "\n".join(
            f"- [{title}](#{title.lower().replace(' ', '-')}): "
            + ", ".join(f"[`{name}`](#{name.lower()})" for name in names.split())
            for title, names in GROUPS.items()
        )
        body = re.sub(r"\n{3,}", "\n\n", "\n".join(self.lines)).strip()
        return f"{HEAD}{index}\n\n{body}\n"


if __name__ == "__main__":
    PAGE.write_text(Reference().text(), encoding="utf-8")
