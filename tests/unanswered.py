"""Motions whose answer is taken away: what the package says of a run that met the bound on events."""

from __future__ import annotations

from collections.abc import Callable
from typing import Any

import numpy as np
import pytest

from tpd.exact.follow import EVENT_BOUND
from tpd.models import compiled_shaken


def unanswered(
    monkeypatch: pytest.MonkeyPatch, where: Callable[[np.ndarray], np.ndarray]
) -> list[np.ndarray]:
    """Let motions by the linear equations end at the bound on events where the function says so of their rows
    of parameters (nu, mu, lam, zeta, k, f, h, rho, e). Returns the rows that are followed from now on."""
    follow_all, followed = compiled_shaken.follow_all, []

    def stub(rows: np.ndarray, *others: Any, **options: Any) -> Any:
        found, by = follow_all(rows, *others, **options)
        followed.append(np.array(rows))
        lost = where(np.asarray(rows))
        # What such a run leaves behind is that of its part of the motion.
        return found._replace(
            status=np.where(lost, EVENT_BOUND, found.status), tilt=np.where(lost, 0.01, found.tilt)
        ), by

    monkeypatch.setattr(compiled_shaken, "follow_all", stub)
    return followed
