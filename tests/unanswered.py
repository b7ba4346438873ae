"""Motions whose answer is taken away: what the package says of a run that met the bound on events."""

from __future__ import annotations

from collections.abc import Callable
from typing import Any

import numpy as np
import pytest

from tpd.compiled import simulate
from tpd.scene.status import Status, code_of, status_of
from tpd.theory.equations import Terms


def unanswered(
    monkeypatch: pytest.MonkeyPatch, where: Callable[[np.ndarray], np.ndarray]
) -> list[np.ndarray]:
    """Let motions by the linear model end at the bound on events where the function says so of their rows
    of parameters. Returns the rows that are followed from now on."""
    follow, followed = simulate.follow, []

    def stub(equations: Terms, rows: np.ndarray, *others: Any, **options: Any) -> Any:
        found = follow(equations, rows, *others, **options)
        if equations is not Terms.linear or np.ndim(rows) == 1:
            return found
        followed.append(np.array(rows))
        lost = where(np.asarray(rows))
        # What such a run leaves behind is that of its part of the motion.
        ends = np.where(lost, code_of(Status.event_bound), code_of(found.status))
        return found._replace(status=status_of(ends), tilt=np.where(lost, 0.01, found.tilt))

    monkeypatch.setattr(simulate, "follow", stub)
    return followed
