"""Options of the command line that set keys of the job file. Each is declared once, by its table and key.

Type, default and help text are those of the key in `job.schema.json`: nothing here imports JAX.
"""

from __future__ import annotations

import argparse
import json
import re
from dataclasses import dataclass, field
from functools import lru_cache
from importlib import resources
from typing import Any, NoReturn


class _Help(argparse.HelpFormatter):
    """Help whose examples stand on lines of their own."""

    def _fill_text(self, text: str, width: int, indent: str) -> str:
        said, _, example = text.partition("\nExample: ")
        more = f"\n\nExample:\n  {example}" if example else ""
        return super()._fill_text(said, width, indent) + more


class Parser(argparse.ArgumentParser):
    """A parser that says in one sentence what is wrong, and takes no abbreviated options."""

    def __init__(self, **settings: Any) -> None:
        # An abbreviation that is unique today need not be so in the next version.
        super().__init__(**{"allow_abbrev": False, "formatter_class": _Help, **settings})

    def parse_known_args(self, args: Any = None, namespace: Any = None) -> Any:  # type: ignore[override]
        """Refuse unknown options here, where those that may be meant are known."""
        found, others = super().parse_known_args(args, namespace)
        if others:
            flag = next((word for word in others if word.startswith("--")), "")
            self.error(
                f"unrecognized arguments: {' '.join(others)}{_meant(flag, self._option_string_actions)}"
            )
        return found, others

    def error(self, message: str) -> NoReturn:
        """Print the sentence and leave with the exit status of bad input."""
        # argparse prints its whole usage first; the one sentence that matters would scroll away.
        if chosen := re.search(r"invalid choice: '(.*?)' \(choose from (.*)\)", message):
            message += _meant(chosen[1], re.findall(r"[\w-]+", chosen[2]))
        from tpd.core.formatting import decimal_comma

        message += decimal_comma(message)
        self.exit(2, f"{self.prog}: {message} (see {self.prog} --help)\n")


def _meant(word: str, known: Any) -> str:
    from tpd.core.formatting import meant

    return meant(word, known, listing=False)


@lru_cache(maxsize=1)
def keys() -> dict[str, dict[str, dict[str, Any]]]:
    """JSON schemas of all keys of a job file by table and name."""
    written = resources.files("tpd.design").joinpath("job.schema.json").read_text(encoding="utf-8")
    return {name: table["properties"] for name, table in json.loads(written)["properties"].items()}


def _parts(key: dict[str, Any]) -> list[dict[str, Any]]:
    """Alternatives of a key."""
    return key.get("anyOf", [key])


def _count(part: dict[str, Any]) -> int:
    """Number of values; 0 stands for any number of them."""
    if part.get("type") != "array":
        return 1
    return len(part.get("prefixItems", ()))


@dataclass(frozen=True)
class Option:
    """An option that sets `key` in `table`. Without a `metavar` it takes no value, and sets `value`."""

    flag: str
    table: str
    key: str
    metavar: str | tuple[str, ...] | None = None
    value: Any = True
    also: dict[str, Any] = field(default_factory=dict)
    """Further keys of the table, and what the option sets them to."""
    help: str | None = None
    """In place of the text of the schema."""
    one: bool = False
    """Whether it takes one value of a key that is a list."""

    def add(self, parser: argparse._ActionsContainer) -> None:
        """Add the option to a parser."""
        key = keys()[self.table][self.key]
        # The default is read from the schema, so that a help text cannot drift from the code.
        default = key.get("default") if self.metavar is not None else None
        text = _clause(key["description"])
        if default is not None:
            values = default if isinstance(default, list) else [default]
            text += f" (default {' '.join(v if isinstance(v, str) else f'{v:g}' for v in values)})"
        counts = {_count(part) for part in _parts(key)}
        count = 0 if self.metavar is None else None
        if self.metavar is not None and counts != {1} and not self.one:
            count = max(counts) if min(counts) > 1 else "+"
        parser.add_argument(
            self.flag,
            action=_Set,
            option=self,
            nargs=count,
            metavar=self.metavar,
            help=(self.help or text).replace("%", "%%"),
        )

    def sets(self, values: Any) -> dict[str, Any]:
        """Keys of the table, and their values, of what is written after the option."""
        parts = _parts(keys()[self.table][self.key])
        texts = any(part.get("items") == {"type": "string"} for part in parts)
        if self.metavar is None:
            value = self.value
        elif parts == [{**parts[0], "type": "string"}]:
            value = values
        elif isinstance(values, str):
            value = [values if texts else plain(values)] if self.one else plain(values)
        else:
            # A list of names has no numbers, but a lone number may stand in its place.
            read = [plain(text) for text in values]
            is_one = len(read) == 1 and any(_count(part) == 1 for part in parts)
            is_one = is_one and not (texts and isinstance(read[0], str))
            value = read[0] if is_one else list(values) if texts else read
        return {**self.also, self.key: value}


class _Set(argparse.Action):
    """Put what an option sets into the tables that the namespace has as `tables`."""

    def __init__(self, *, option: Option, **settings: Any) -> None:
        # Suppressed, so that an option that is not given leaves no trace and the file's value stands.
        super().__init__(**{**settings, "dest": argparse.SUPPRESS, "default": argparse.SUPPRESS})
        self.option = option

    def __call__(self, parser: Any, namespace: Any, values: Any, option_string: str | None = None) -> None:
        put(namespace, self.option.table, self.option.sets(values))


class SetWidths(argparse.Action):
    """Put pairs NAME=WIDTH into the table [scatter]."""

    def __call__(self, parser: Any, namespace: Any, values: Any, option_string: str | None = None) -> None:
        """Read the pairs."""
        pairs = [pair.partition("=") for pair in values]
        for (name, _, width), written in zip(pairs, values, strict=True):
            if not name or not width:
                parser.error(
                    f"`{option_string}` must be NAME=WIDTH, such as friction=0.2, but is {written!r}"
                )
        put(namespace, "scatter", {name: plain(width) for name, _, width in pairs})


def put(namespace: argparse.Namespace, table: str, values: dict[str, Any]) -> None:
    """Put values into the tables of a namespace."""
    if getattr(namespace, "tables", None) is None:
        namespace.tables = {}
    namespace.tables.setdefault(table, {}).update(values)


def given(namespace: argparse.Namespace) -> dict[str, dict[str, Any]]:
    """Tables that the options set."""
    return getattr(namespace, "tables", None) or {}


def plain(text: str) -> int | float | str:
    """A number where the text is one, else the text: the schema says which is allowed."""
    for kind in (int, float):
        try:
            return kind(text)
        except ValueError:
            continue
    return text


def _clause(text: str) -> str:
    """First sentence of a description, without a capital and its full stop."""
    first = re.split(r"(?<=[a-z0-9)])\. ", text)[0].removesuffix(".")
    return first if first[1:2].isupper() else first[:1].lower() + first[1:]
