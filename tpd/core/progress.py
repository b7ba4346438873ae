"""Reports of progress to whoever waits for a long piece of work."""

from __future__ import annotations

from collections.abc import Callable

Progress = Callable[[str, int, int], None]
"""Called after every unit of work with the stage's name, the units done and the units in all."""
