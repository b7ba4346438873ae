"""The regimes in which a method loses its footing."""

from typing import NamedTuple


class Regime(NamedTuple):
    name: str
    tests: tuple[str, ...]


REGIMES: tuple[Regime, ...] = (Regime("x", ("tests/test_atlas.py::test_every_test_of_the_table_exists",)),)
