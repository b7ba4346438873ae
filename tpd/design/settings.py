"""Settings of the search. This module needs neither JAX nor optax, so that a job file is read at once."""

from __future__ import annotations

from dataclasses import dataclass, field

from tpd.core import checks
from tpd.design.criteria import DesignSpace

DEFAULT_SPACE = DesignSpace(damping_ratio=(0.05, 1.0))
"""Bounds of a search under ground motions."""
VALIDATION_SHARE = 0.5
"""Share of the ground motions that a design is not tuned to by default."""
SCATTERED = "slenderness", "friction", "mass", "length", "damping", "restitution"
"""Names of what is uncertain in validation runs under ground motions: block and installation."""
VALIDATION_RUNS = 2048
"""Validation runs under harmonic excitation by default: half of them decide, the other half is quoted."""
MODELS = ("smoothed", "piecewise")
"""Models of a descent that have a name."""
OPTIMISERS = ("adam", "rmsprop")
"""Optimisers of optax that have a name."""


@dataclass(frozen=True)
class Descent:
    """Settings of the search: optax descends on smoothed gradients, and SciPy's SLSQP finishes on exact ones.

    By default signs and impacts are smoothed, diffrax integrates the equations (25), and design and orbit
    converge together, see `tpd.design.orbits`. The descents come near the optimum; a few steps of
    SLSQP on the exact gradients then reach it from the best ends.

    Raises:
        ValueError: a count out of range, an optimiser that needs more than gradients, or another model.
    """

    optimiser: str | object = "adam"
    """Optimiser: adam, rmsprop, or in Python a transformation of optax with steps in shares of the bounds."""
    model: str | object = field(default=None, kw_only=True)
    """Model whose gradients the descents take: "smoothed" or `Smoothed(...)` follows the symmetric orbits
    with smoothed signs and impacts, which is the default unless impacts lose much energy; "piecewise" or
    `Piecewise()` is these orbits themselves, with exact gradients."""
    searches: checks.Whole = field(default=8, kw_only=True)
    """Number of designs from which a search begins."""
    screening: checks.Whole = field(default=512, kw_only=True)
    """Designs solved before the searches, to choose where they begin."""
    steps: checks.Whole = field(default=20, kw_only=True)
    """Number of steps of each descent."""
    finish: checks.Whole = field(default=4, kw_only=True)
    """Number of ends of the descents that SLSQP finishes on the exact gradients; 0 for none."""
    tolerance: checks.Real = field(default=0.01, kw_only=True)
    """Largest relative difference between the tilts of the model and of the exact solution: an end beyond it
    that was not finished is not offered."""

    def __post_init__(self) -> None:
        checks.set_checked(self, checks.count, "searches screening steps")
        checks.set_checked(self, checks.count, "finish", 0)
        checks.set_checked(self, checks.tolerance, "tolerance")
        if isinstance(self.optimiser, str):
            checks.one_of("optimiser", self.optimiser, OPTIMISERS)
        else:
            _check_transformation(self.optimiser)
        if isinstance(self.model, str):
            checks.one_of("model", self.model, MODELS)

    @property
    def optimiser_name(self) -> str:
        """Name of the optimiser; "custom" for a transformation that the user gave."""
        return self.optimiser if isinstance(self.optimiser, str) else "custom"

    @property
    def described(self) -> dict[str, object]:
        """Settings as plain values, enough to repeat the search."""
        names = "searches", "screening", "steps", "finish", "tolerance"
        settings: dict[str, object] = {name: getattr(self, name) for name in names}
        return settings | {"optimiser": self.optimiser_name, "model": repr(self.model)}


def _check_transformation(optimiser: object) -> None:
    """Raise `ValueError` unless the optimiser is one of optax that needs nothing but gradients."""
    # Whoever gives a transformation has imported optax; whoever names one need not wait for it.
    import numpy as np
    import optax

    if not isinstance(optimiser, optax.GradientTransformation):
        raise ValueError(
            f"`optimiser` must be a transformation of optax, or one of {', '.join(OPTIMISERS)}, but is "
            f"{checks.shown(optimiser)}"
        )
    x = np.array([0.3, 0.6])
    try:
        optimiser.update(np.array([1.0, -0.5]), optimiser.init(x), x)
    except TypeError as error:
        raise ValueError(
            "`optimiser` must make its steps from gradients alone: give an optimiser without a line search"
        ) from error


@dataclass(frozen=True, kw_only=True)
class GroundSearch:
    """Trial runs of a search under ground motions.

    Raises:
        ValueError: a count below its least.
    """

    starts: checks.Whole = 32
    """Number of designs spread over the space."""
    steps: checks.Whole = 32
    """Designs that follow where the trend promises most."""

    def __post_init__(self) -> None:
        checks.set_checked(self, checks.count, "starts", 4)
        checks.set_checked(self, checks.count, "steps", 0)
