"""The function `tpd.plot`, which draws every result that has a picture."""

from __future__ import annotations

from collections.abc import Callable
from typing import Any

import numpy as np
from matplotlib.axes import Axes

from tpd.answers.design_map import DesignMap
from tpd.answers.fold_curve import FoldCurve
from tpd.answers.fragility import Fragility
from tpd.answers.response import Branches, Response
from tpd.answers.spectra import OverturningSpectrum, RockingSpectrum
from tpd.core import checks
from tpd.design.as_built import Details
from tpd.design.design import Design
from tpd.plots import animation, compare, drawing, landscape, maps, response
from tpd.plots.style import saved
from tpd.scene.record import Record


def plot(
    result: Any,
    what: str | None = None,
    *,
    quantity: str | None = None,
    state: str | None = None,
    without: Response | Branches | None = None,
    own: float | None = None,
    ax: Any = None,
    axes: Any = None,
) -> Any:
    """Draw a result, and return the axes (an array if there are several).

    Args:
        result: a design, a record, or the answer of `design_map`, `fold_curve`, `settled_response`,
            `branches`, `fragility`, `overturning_spectrum` or `rocking_spectrum`.
        what: name of the picture of a design. For a map it is another name of `quantity`, and for a fragility
            of `state`. The pictures of a design are:

            - "landscape" (the default): tilt over mass ratio and length ratio, with the limits;
            - "drawing": block and pendulum to scale;
            - "benefit": validation runs with and without the pendulum, over all runs and for each condition
              (under ground motions, for each group);
            - "motion" (harmonic excitation only): first periods of the motion from rest.
        quantity: quantity of a map: "amplitude" (the default), "swing" or "margin".
        state: damage state of a fragility; by default "overturned".
        without: response or branches without the pendulum over the same quantity, which are drawn as well.
        own: value of the design, which is marked in a response.
        ax: axes to draw on, a sequence if the picture has several; by default those of a new figure. A
            drawing always has its own figure.
        axes: another name of `ax`, for a response, branches, an overturning spectrum and a record.

    Raises:
        ValueError: the result has no picture, an argument does not apply to the result or has a value that is
            not allowed, or a design does not have the data of the picture.

    Example:
        >>> import tpd
        >>> response = tpd.settled_response(tpd.paper_scene(), "frequency", [2.0, 2.5, 3.0])
        >>> axes = tpd.plot(response, own=2.5)
        >>> axes[-1].get_xlabel()
        'frequency of the excitation (Hz)'
        >>> axes[0].figure.savefig("response.png")  # doctest: +SKIP
    """
    # The first matching class decides.
    kind = next((kind for base, kind in _KINDS.items() if isinstance(result, base)), None)
    if kind is None:
        names = ", ".join(base.__name__ for base in _KINDS)
        raise ValueError(f"`result` must have a picture ({names}), but is {checks.quote(result)}")
    # The last name is that of the axes.
    draw, *allowed = kind
    stated = {"what": what, "quantity": quantity, "state": state, "without": without, "own": own}
    options: dict[str, Any] = {}
    for name, value in (stated | {"ax": ax, "axes": axes}).items():
        if value is None:
            continue
        # `what` and `ax` are valid for all results, but some plot functions have other names for them.
        target = next((x for x in (name, *_NAMES.get(name, ())) if x in allowed), "")
        if not target:
            of = type(result).__name__
            raise ValueError(f"`{name}` does not apply to a {of}: allowed are {', '.join(allowed)}")
        if target in options:
            raise ValueError(f"`{name}` has two values: {checks.quote([options[target], value])}")
        options[target] = value
    # Without this check Matplotlib would fail later with a message about a missing attribute.
    for each in np.ravel(np.array(options.get(allowed[-1], []), dtype=object)):
        checks.instance(allowed[-1], each, Axes)
    return draw(result, **options)


def draw(name: str, design: Design, details: Details) -> bytes:
    """Return the content of a picture file of a report.

    Args:
        name: name of the file, which gives its format.
        design: the answer of `optimise`.
        details: the answer of `tpd.details`, with the results of this picture.
    """
    scene, histories, limit = design.scene, details.histories, design.stroke_limit
    drawings: dict[str, Callable[[], Any]] = {
        "search.png": lambda: landscape.plot_landscape(design),
        "benefit.svg": lambda: compare.plot_benefit(design),
        "drawing.svg": lambda: drawing.plot_design(design),
        "response.svg": lambda: response.plot_response(details.responses, scene.excitation.frequency),
        "motion.svg": lambda: response.plot_motions(histories, scene.block.slenderness, stroke_limit=limit),
        "animation.gif": lambda: animation.animate(scene, design.pendulum, histories),
    }
    checks.one_of("name", name, tuple(drawings))
    return saved(drawings[name](), name.rpartition(".")[2])


def draw_design(design: Design, what: str = "landscape", ax: Any = None) -> Any:
    """Draw one picture of a design, see `plot`."""
    # Designs for ground motions have fewer pictures. The message of an error must list the right ones.
    checks.one_of("what", what, design.problem.pictures)
    return _OF_DESIGN[what](design, ax)


def draw_cases(
    result: Any, without: Response | Branches | None = None, own: float | None = None, axes: Any = None
) -> Any:
    """Draw a response or branches and, if there are any, those without the pendulum."""
    checks.optional("without", without, type(result))
    if without is not None and without.name != result.name:
        raise ValueError(f"`without` must be over `{result.name}`, but is over `{without.name}`")
    cases: list[Any] = [result] if without is None else [without, result]
    if isinstance(result, Branches):
        return response.plot_branches(cases, axes)
    return response.plot_response(cases, None if own is None else checks.number("own", own), axes=axes)


_OF_DESIGN: dict[str, Callable[[Any, Any], Any]] = {
    "landscape": landscape.plot_landscape,
    "drawing": drawing.plot_design,
    "benefit": compare.plot_benefit,
    "motion": response.plot_start,
}
"""Functions that draw a design, by the values of `what`."""
_NAMES = {"what": ("quantity", "state"), "ax": ("axes",)}
"""Names that plot functions have for the arguments `what` and `ax`."""
_KINDS: dict[type, tuple[Any, ...]] = {
    Design: (draw_design, "what", "ax"),
    DesignMap: (maps.plot_map, "quantity", "ax"),
    FoldCurve: (maps.plot_fold_curve, "ax"),
    Response: (draw_cases, "without", "own", "axes"),
    Branches: (draw_cases, "without", "axes"),
    Fragility: (maps.plot_fragility, "state", "ax"),
    OverturningSpectrum: (maps.plot_overturning_spectrum, "axes"),
    RockingSpectrum: (maps.plot_rocking_spectrum, "ax"),
    Record: (maps.plot_record, "axes"),
}
"""Plot function of each class of results, and the names of its optional arguments, the axes last."""
