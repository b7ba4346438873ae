"""An ensemble of runs that judges designs, the bare block's run once for all of them."""

from __future__ import annotations

from collections.abc import Callable
from functools import partial

from tpd.analysis.ensemble import Ensemble, Outcomes, Verdict, outcomes, verdict
from tpd.core.progress import Progress
from tpd.core.scene import Pendulum, Scene
from tpd.core.threads import aside
from tpd.design.result import Candidate


class Jury:
    """The runs of the bare block begin at once, aside, since following them has to be compiled; unless
    there is nothing to be judged."""

    def __init__(self, scene: Scene, ensemble: Ensemble, progress: Progress | None, needed: bool) -> None:
        self.scene, self.ensemble = scene, ensemble
        self.progress: Callable[[int, int], None] | None = None
        if progress is not None:
            self.progress = partial(progress, "ensemble")
        self._bare: Outcomes | None = None
        self._known: dict[Pendulum, Verdict] = {}
        self._thread = aside(self._run) if needed else None

    def _run(self) -> None:
        self._bare = outcomes(self.scene, ensemble=self.ensemble, workers=1)

    def verdict(self, pendulum: Pendulum) -> Verdict:
        """What the ensemble says of a pendulum."""
        if self._thread is not None:
            self._thread.join()
        if pendulum not in self._known:
            bare = outcomes(self.scene, ensemble=self.ensemble) if self._bare is None else self._bare
            self._known[pendulum] = verdict(
                self.scene, pendulum, ensemble=self.ensemble, bare=bare, progress=self.progress
            )
        return self._known[pendulum]

    def objections(self, candidate: Candidate) -> tuple[str, ...]:
        """What it has against a design."""
        found = self.verdict(pendulum_of(self.scene, candidate))
        return (found.objection,) if found.harms else ()


def pendulum_of(scene: Scene, of: Candidate) -> Pendulum:
    """A design in SI."""
    return scene.pendulum(
        mass_ratio=of.mass_ratio, length_ratio=of.length_ratio, damping_ratio=of.damping_ratio
    )
