"""Options of the command line that set keys of the job file. Each is declared once, by its table and key.

Type, default and help text are those of the key in the schema.
"""

from __future__ import annotations

import argparse
from dataclasses import dataclass, field
from typing import Any, NoReturn

from tpd.cli.schema import keys


class Parser(argparse.ArgumentParser):
    """A parser that says in one sentence what is wrong, and takes no abbreviated options."""

    def __init__(self, **settings: Any) -> None:
        # An abbreviation that is unique today need not be so in the next version.
        super().__init__(**{"allow_abbrev": False, **settings})

    def error(self, message: str) -> NoReturn:
        """Print the sentence and leave with the exit status of bad input."""
        # argparse prints its whole usage first; the one sentence that matters would scroll away.
        self.exit(2, f"{self.prog}: {message} (see {self.prog} --help)\n")


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

    def add(self, parser: argparse._ActionsContainer) -> None:
        """Add the option to a parser."""
        key = keys()[self.table][self.key]
        # The default is read from the schema, so that a help text cannot drift from the code.
        has_default = self.metavar is not None and key.default is not None
        text = key.description + (f" (default {_shown(key.default)})" if has_default else "")
        several = self.metavar is not None and key.counts != (1,)
        count = key.counts[0] if len(key.counts) == 1 and key.counts[0] > 1 else "+"
        parser.add_argument(
            self.flag,
            action=_Set,
            option=self,
            nargs=0 if self.metavar is None else count if several else None,
            metavar=self.metavar,
            help=self.help or text,
        )

    def sets(self, values: Any) -> dict[str, Any]:
        """Keys of the table, and their values, of what is written after the option."""
        counts = keys()[self.table][self.key].counts
        if self.metavar is None:
            value = self.value
        elif isinstance(values, str):
            value = plain(values)
        else:
            read = [plain(text) for text in values]
            value = read[0] if len(read) == 1 and 1 in counts else read
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


def _shown(default: Any) -> str:
    """A default as it would be written after the option."""
    values = default if isinstance(default, tuple) else (default,)
    return " ".join(v if isinstance(v, str) else f"{v:g}" for v in values)
