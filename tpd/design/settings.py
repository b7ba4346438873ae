"""Settings of the search. This module imports neither JAX nor optax, so that a job file is read quickly."""

from __future__ import annotations

from dataclasses import dataclass, field

from tpd.core import checks

SCATTERED = "slenderness", "friction", "mass", "length", "damping", "restitution"
"""Quantities of the block and of the installation that vary in validation runs under ground motions."""
PULSE_BAND = 0.3, 0.1
"""Default half widths of the band around a pulse, of the period and of the peak acceleration."""
VALIDATION_RUNS = 2048
"""Default number of validation runs under harmonic excitation. One half decides, and the other half is
reported."""
MODELS = ("smoothed", "piecewise")
"""Names of the models that a descent can use."""
OPTIMISERS = ("newton", "adam")
"""Names of the optimisers of optax that can be chosen by name."""
METHODS = ("search", "rule")
"""Methods under ground motions."""


@checks.keywords
@dataclass(frozen=True)
class Descent:
    """Settings of the search under harmonic excitation.

    Optax descends on gradients of a smoothed model. By default smooth functions replace friction and impacts,
    diffrax integrates the equations (25), and each step improves the design and its orbit together (see
    `tpd.design.orbits`). The exact orbits confirm every result. Runs then show how far the bob swings during
    transients, and the descents continue with limits that allow for it.

    Raises:
        ValueError: a count is out of range, the optimiser needs more than gradients, or the model is unknown.

    Example:
        >>> import tpd
        >>> method = tpd.Descent(searches=4, steps=10)
        >>> method.optimiser, method.corrections
        ('newton', 4)
    """

    optimiser: str | object = "newton"
    """Optimiser: newton (`tpd.design.newton`, which also uses the curvature of the worst case), adam, or in
    Python a transformation of optax with steps in shares of the bounds."""
    model: str | object = field(default=None, kw_only=True)
    """Model that gives the gradients of the descents: "smoothed" or `Smoothed(...)` follows the symmetric
    orbits with smoothed signs and impacts; "piecewise" or `Piecewise()` solves these orbits exactly, with
    exact gradients. Default: smoothed, or piecewise if impacts lose much energy."""
    searches: checks.Whole = field(default=4, kw_only=True)
    """Number of designs from which a descent starts. One of them is the first guess."""
    screening: checks.Whole = field(default=256, kw_only=True)
    """Number of designs that are evaluated before the descents, to choose where the descents start."""
    steps: checks.Whole = field(default=20, kw_only=True)
    """Number of steps of each descent."""
    corrections: checks.Whole = field(default=4, kw_only=True)
    """Number of times that runs correct the limits of the descents, after which the best descents continue; 0
    for none."""
    polish: checks.Whole = field(default=60, kw_only=True)
    """Number of further steps on the exact orbits, from the end of each descent."""

    def __post_init__(self) -> None:
        checks.set_checked(self, checks.count, "searches screening steps")
        checks.set_checked(self, checks.count, "corrections polish", 0)
        # Names are checked without an import of optax, which takes a second.
        if isinstance(self.optimiser, str):
            checks.one_of("optimiser", self.optimiser, OPTIMISERS)
        else:
            _check_transformation(self.optimiser)
        if isinstance(self.model, str):
            checks.one_of("model", self.model, MODELS)


def _check_transformation(optimiser: object) -> None:
    """Raise `ValueError` unless the optimiser is a transformation of optax that needs only gradients."""
    # A user who passes a transformation has imported optax already. A user who passes a name does not have to
    # wait for the import.
    import numpy as np
    import optax

    if not isinstance(optimiser, optax.GradientTransformation):
        raise ValueError(
            f"`optimiser` must be a transformation of optax, or one of {', '.join(OPTIMISERS)}, but is "
            f"{checks.quote(optimiser)}"
        )
    # A trial step: an optimiser with a line search also requires the value of the objective, and raises here.
    x = np.array([0.3, 0.6])
    try:
        optimiser.update(np.array([1.0, -0.5]), optimiser.init(x), x)
    except TypeError as error:
        raise ValueError(
            "`optimiser` must make its steps from gradients alone: give an optimiser without a line search"
        ) from error


@checks.keywords
@dataclass(frozen=True, kw_only=True)
class GroundSearch:
    """Settings of the search under ground motions.

    The rule of thumb comes before the search, and all earthquakes validate it. In the cross-fitting of the
    search each group of earthquakes validates a design that was found on the others.

    Raises:
        ValueError: an unknown method, fewer than 4 designs, fewer than 0 steps, or fewer than 2 groups.

    Example:
        >>> import tpd
        >>> tpd.GroundSearch(steps=8)
        GroundSearch(designs=32, steps=8, groups=2, method='search')
    """

    designs: checks.Whole = 32
    """Number of designs that are spread over the design space."""
    steps: checks.Whole = 32
    """Number of designs that follow, each where the trend of the results promises the largest improvement."""
    groups: checks.Whole = 2
    """Number of groups of earthquakes for cross-fitting under records."""
    method: str = "search"
    """Method under pulses and records: search (the rule of thumb, then a search), or rule (only the rule of
    thumb)."""

    def __post_init__(self) -> None:
        checks.set_checked(self, checks.count, "designs", 4)
        checks.set_checked(self, checks.count, "groups", 2)
        checks.one_of("method", self.method, METHODS)
        checks.set_checked(self, checks.count, "steps", 0)
