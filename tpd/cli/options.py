"""Options of the command line that set keys of the job file.

An option is declared once, by its table and key. Its type, default and help text come from `job.schema.json`,
so that the help appears without the import of NumPy and of the modules that define the keys.
"""

from __future__ import annotations

import argparse
import json
import re
import sys
from collections import Counter
from dataclasses import dataclass, field
from functools import lru_cache
from importlib import resources
from typing import Any, NoReturn

_NEGATIVE = re.compile(r"-(\d+\.?\d*|\.\d+|inf|nan)(e[+-]?\d+)?", re.IGNORECASE)
"""A negative number."""


class _HelpAll(argparse.Action):
    """Action of argparse that prints the help with all options."""

    def __call__(self, parser: Any, namespace: Any, values: Any, option_string: str | None = None) -> None:
        print(f"{argparse.ArgumentParser.format_help(parser)}{parser.example}", end="")
        parser.exit()


class Parser(argparse.ArgumentParser):
    """Parser that reports an error in one sentence, accepts no abbreviated options, and has a short help."""

    def __init__(self, *, summary: str = "", common: str = "", example: str = "", **settings: Any) -> None:
        """Let `--help` show only a sentence, the common arguments and an example. `--help-all` shows all
        arguments.

        Args:
            summary: the sentence; empty if the parser has one help only.
            common: names of the common arguments. The first has no hyphens.
            example: the example.
            settings: arguments of `argparse.ArgumentParser`.
        """
        # An abbreviation that is unique today may be ambiguous in the next version.
        super().__init__(**{"allow_abbrev": False, **settings})
        self._summary, self._common = f"{summary[:1].upper()}{summary[1:]}.", common.split()
        self.example = f"\nExample:\n  {example}\n"
        if summary:
            self.add_argument("--help-all", action=_HelpAll, nargs=0, help="explain all options and exit")

    def format_help(self) -> str:
        """Return the text of `--help`: for a command the arguments that most people need."""
        if not self._common:
            return super().format_help()
        # An argument without hyphens, such as JOB, is named by its placeholder.
        named = {name: x for x in self._actions for name in (*x.option_strings, x.metavar)}
        short = self.formatter_class(prog=self.prog)
        short.add_usage(f"{self.prog} [options] {self._common[0]}", [], [])
        short.add_text(self._summary)
        short.start_section(f"common options (all options: {self.prog} --help-all)")
        short.add_arguments(named[name] for name in self._common)
        short.end_section()
        return short.format_help() + self.example

    def parse_known_args(self, args: Any = None, namespace: Any = None) -> Any:  # type: ignore[override]
        """Parse the arguments. Reject repeated options, and unknown ones with a suggestion for a misspelt
        one."""
        # Before Python 3.14 argparse takes numbers such as -1e0 for options, unless they begin with a blank.
        words = sys.argv[1:] if args is None else args
        words = [f" {word}" if _NEGATIVE.fullmatch(word) else word for word in words]
        flags = re.findall(r"--?[a-z][\w-]*", self.format_usage())
        for flag, count in Counter(word.partition("=")[0] for word in words).items():
            if count > 1 and flag in flags:
                self.error(f"argument {flag}: it is given {count} times; give it once, with all its values")
        # argparse rejects them in the parser of all commands, which does not have the options of this one.
        options, unknown = super().parse_known_args(words, namespace)
        if unknown:
            flag = next((word for word in unknown if word.startswith("--")), "")
            hint = _suggestion(flag, flags)
            self.error(f"unrecognized arguments: {' '.join(unknown)}{hint}")
        return options, unknown

    def error(self, message: str) -> NoReturn:
        """Print the error in one sentence and exit with the status of invalid input."""
        # argparse would print the whole usage first, and the sentence that matters would scroll away.
        if choice := re.search(r"invalid choice: '(.*?)' \(choose from (.*)\)", message):
            message += _suggestion(choice[1], re.findall(r"[\w-]+", choice[2]))
        from tpd.core.formatting import number_hint

        bad_name = "the name of a file is empty or has control characters"
        message = message.replace("invalid path_of value", bad_name)
        message += number_hint(message)
        self.exit(2, f"{self.prog}: {message} (see {self.prog} --help)\n")


def _suggestion(word: str, allowed: Any) -> str:
    """Return the end of a message that suggests the word that was probably meant; empty if none is close."""
    from tpd.core.formatting import meant

    return meant(word, allowed, listing=False)


@lru_cache(maxsize=1)
def keys() -> dict[str, dict[str, dict[str, Any]]]:
    """Return the JSON schemas of all keys of a job file by table and name."""
    written = resources.files("tpd.design").joinpath("job.schema.json").read_text(encoding="utf-8")
    return {name: table["properties"] for name, table in json.loads(written)["properties"].items()}


def _parts(key: dict[str, Any]) -> list[dict[str, Any]]:
    """Return the alternative schemas of the value of a key, one for each allowed type."""
    return key.get("anyOf", [key])


def _count(part: dict[str, Any]) -> int:
    """Return the number of values that a schema allows: 0 for any number, as in a table."""
    several = part.get("type") in ("array", "object")
    return len(part.get("prefixItems", ())) if several else 1


@dataclass(frozen=True)
class Option:
    """Option that sets a key of the job file."""

    table: str
    """Table of the job file that contains the key."""
    key: str
    words: str = ""
    """Name with its hyphens and the placeholders of its values; empty for those of the schema."""
    value: Any = True
    """Value of the key if the option takes none on the command line."""
    also: dict[str, Any] = field(default_factory=dict)
    """Further keys of the same table that the option sets, with their values."""
    help: str | None = None
    """Help text; None for the description in the schema."""
    one: bool = False
    """Whether the option takes a single value although the key is a list."""

    @property
    def schema(self) -> dict[str, Any]:
        """JSON schema of the key."""
        return keys()[self.table][self.key]

    @property
    def flag(self) -> str:
        """Name with its hyphens."""
        return (self.words or self.schema["option"]).split()[0]

    @property
    def placeholders(self) -> tuple[str, ...]:
        """Placeholders of the values in the help; empty for an option without a value."""
        return tuple((self.words or self.schema["option"]).split()[1:])

    def add(self, parser: Any) -> None:
        """Add the option to a parser or a group of its options."""
        # The default is read from the schema. The help text therefore always agrees with the code.
        default = self.schema.get("default") if self.placeholders else None
        # The first sentence of the description, without its full stop and, unless it begins with an
        # abbreviation such as PGA, without its capital letter.
        text = re.split(r"(?<=[a-z0-9)])\. ", self.schema["description"])[0].removesuffix(".")
        text = text if text[1:2].isupper() else text[:1].lower() + text[1:]
        if default is not None:
            values = default if isinstance(default, list) else [default]
            text += f" (default {' '.join(v if isinstance(v, str) else f'{v:g}' for v in values)})"
        counts = {_count(part) for part in _parts(self.schema)}
        # nargs of argparse: 0 for a switch, None for one value, a number for a vector of fixed length, and
        # "+" where one value and several are both allowed, such as a number or two bounds.
        count = None if self.placeholders else 0
        if self.placeholders and counts != {1} and not self.one:
            count = max(counts) if min(counts) > 1 else "+"
        how: dict[str, Any] = {"nargs": count, "help": (self.help or text).replace("%", "%%")}
        if words := self.placeholders:
            how["metavar"] = words[0] if len(words) == 1 else words
        parser.add_argument(self.flag, action=_Set, option=self, **how)

    def values_of(self, values: Any) -> dict[str, Any]:
        """Return the keys that the option sets with their values.

        Args:
            values: text after the option, or a list of texts.
        """
        parts = _parts(self.schema)
        if any(part.get("type") == "object" for part in parts):
            # The names of files may contain the sign of equality.
            pairs = [text.rpartition("=") for text in values]
            return {self.key: {name or event: event for name, _, event in pairs}}
        is_text = any(part.get("items") == {"type": "string"} for part in parts)
        if not self.placeholders:
            value = self.value
        elif parts == [{**parts[0], "type": "string"}]:
            # The key is a text: a name that looks like a number remains a text.
            value = values
        elif isinstance(values, str):
            value = [values if is_text else number_or_text(values)] if self.one else number_or_text(values)
        else:
            # The entries of a list of names are texts even if they look like numbers. A key that is a number
            # or a list of names, such as `validation_share`, is a number if a number stands alone.
            items = [number_or_text(text) for text in values]
            is_scalar = len(items) == 1 and any(_count(part) == 1 for part in parts)
            is_scalar = is_scalar and not (is_text and isinstance(items[0], str))
            value = items[0] if is_scalar else list(values) if is_text else items
        return {**self.also, self.key: value}


class _Set(argparse.Action):
    """Action of argparse that stores the keys of an `Option` in `tables` of the namespace."""

    def __init__(self, *, option: Option, **settings: Any) -> None:
        # An option that is absent must leave no default behind, so that the value in the job file is used.
        super().__init__(**{**settings, "dest": argparse.SUPPRESS, "default": argparse.SUPPRESS})
        self.option = option

    def __call__(self, parser: Any, namespace: Any, values: Any, option_string: str | None = None) -> None:
        namespace.tables[self.option.table].update(self.option.values_of(values))


class SetWidths(argparse.Action):
    """Action of argparse that stores pairs NAME=WIDTH in the table [scatter]."""

    def __call__(self, parser: Any, namespace: Any, values: Any, option_string: str | None = None) -> None:
        """Read the pairs and store them."""
        pairs = [pair.partition("=") for pair in values]
        for (name, _, width), text in zip(pairs, values, strict=True):
            if not name or not width:
                parser.error(f"`{option_string}` must be NAME=WIDTH, such as friction=0.2, but is {text!r}")
        namespace.tables["scatter"].update({name: number_or_text(width) for name, _, width in pairs})


def number_or_text(text: str) -> int | float | str:
    """Return the number that a text represents, otherwise the text; `job_of` checks which one is allowed."""
    for kind in (int, float):
        try:
            return kind(text)
        except ValueError:
            continue
    return text
