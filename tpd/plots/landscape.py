"""Landscape of a search: the tilt over mass ratio and length ratio, edges of the limits, and the answer."""

from __future__ import annotations

from typing import Any, NamedTuple, cast

import numpy as np
from matplotlib.axes import Axes
from matplotlib.ticker import MaxNLocator

from tpd.design.ground.design import GroundDesign
from tpd.design.objective import Orbits, geometry_of, margins
from tpd.design.result import Design, HarmonicDesign
from tpd.plots.style import HALO, INK, LABELS, ORANGE, edge, legend, new_axes, own_style
from tpd.scene.parameters import as_arrays

_GRID = 48
"""Points along each axis."""
_NEIGHBOURS = 24
"""Designs within about two widths of the window of a trend: it is narrower where more were followed."""
_LEAST = 0.02
"""Least width of this window, in shares of the space."""
_HATCH = "#bdbdbd"
_FLOOR = 1e-3
"""Ridge of the fits, which keeps them finite where a window is all but empty."""


class _Seen(NamedTuple):
    """Designs that were followed: arrays of leading axis m."""

    at: np.ndarray
    """Shares of the space, (m, d)."""
    tilt: np.ndarray
    excess: dict[str, np.ndarray]
    """Limited sizes over their limits, less one, by name."""
    bare: float
    words: str
    """Quantity and equations."""


@own_style()
def plot_landscape(design: Design, ax: Axes | None = None) -> Axes:
    """Draw the tilt over mass and length ratio at the damping of the best design, as a shaded field: the
    darker, the more the block tilts.

    The field is the trend through all designs that were followed from rest, under the linear equations: of a
    ground-motion design its response surface, else a mean over neighbours, linear in the design. Hatched is
    where designs break a limit; each edge bears the name of its limit. Thin lines are the ways of the
    descents, crosses designs that the verification refused, the star is the answer.

    Args:
        design: an answer of `tpd.optimise`.
        ax: default that of a new figure.
    """
    seen, best = _seen(design), _best(design)
    ax = cast(Axes, new_axes(size=(7.0, 5.0)) if ax is None else ax)
    mu, lam = (np.linspace(*bounds, _GRID) for bounds in (design.space.mass_ratio, design.space.length_ratio))
    plane = np.stack(np.meshgrid(mu, lam), axis=-1).reshape(-1, 2)
    designs = np.column_stack([plane, np.full(len(plane), best[2])])
    unit = design.space.scaled(designs)
    smooth = _Smoother(seen.at, unit)
    surface = design.surface if isinstance(design, GroundDesign) else None
    field = smooth(seen.tilt) if surface is None else surface.at(unit)[0]
    _shade(ax, mu, lam, field.reshape(_GRID, _GRID), seen, float(best[2]))
    # Logarithms of the sizes: many go with a power of mass or length, and a fit that is linear holds further.
    sizes = {
        name: np.log(np.clip(np.nan_to_num(1.0 + x, nan=10.0), 0.1, 10.0)) for name, x in seen.excess.items()
    }
    edges = {name.replace("_", " "): smooth(x).reshape(_GRID, _GRID) for name, x in sizes.items()}
    worst = np.max([np.full((_GRID, _GRID), -1.0), *edges.values()], axis=0)
    if (worst > 0.0).any():
        beyond = ax.contourf(mu, lam, worst, levels=[0.0, np.inf], colors="none", hatches=["//"])
        beyond.set_edgecolor(_HATCH)
        beyond.set_linewidth(0.0)
    crossed = {name: x for name, x in edges.items() if x.min() < 0.0 < x.max()}
    for i, (name, x) in enumerate(crossed.items()):
        edge(ax, mu, lam, x, name, (i + 1.0) / (len(crossed) + 1.0))
    if isinstance(design, HarmonicDesign):
        scene, conditions = design.scene, design.conditions
        common = as_arrays(scene.parameters()), conditions, design.space, design.risk, design.limits
        least = margins(Orbits(*common, geometry_of(scene, conditions, design.limits)), designs).min(axis=1)
        if least.min() < 0.0 < least.max():
            least = least.reshape(_GRID, _GRID)
            edge(ax, mu, lam, least, "stays at rest", 0.5, color=INK, style="--")
        for i, path in enumerate(design.search.paths):
            ax.plot(*path[:, :2].T, color=INK, lw=0.5, label=None if i else "ways of the descents")
        refused = np.array([v.design for v in design.verified if v.reasons]).reshape(-1, 3)
        _points(ax, refused, "X", 7.0, "refused", "white")
    elif isinstance(design, GroundDesign) and design.searched is not None:
        found = design.searched
        _points(ax, found.designs, ".", 3.0, "designs followed", INK)
        _points(ax, found.designs[found.undecided > 0], "s", 9.0, "runs without an answer", "none")
    offered = design.pendulum is not None
    label = "answer" if offered else "best found, not offered"
    _points(ax, best[None], "*", 17.0, label, ORANGE if offered else "white")
    ax.set(xlabel=LABELS["mu"], ylabel=LABELS["lam"], xlim=mu[[0, -1]], ylim=lam[[0, -1]])
    legend(ax, columns=4)
    return ax


def _best(design: Design) -> np.ndarray:
    """(mu, lam, zeta) of the best design, offered or not."""
    if isinstance(design, GroundDesign):
        found = design.searched
        assert found is not None
        return found.designs[np.nanargmin(found.value)] if design.best is None else design.best
    assert isinstance(design, HarmonicDesign)
    if design.best is not None:
        return design.best.design
    search = design.search
    return (
        design.surveys[0].designs[0] if design.surveys else search.screened[np.argmin(search.screened_value)]
    )


def _seen(design: Design) -> _Seen:
    """The designs that a search followed; where it did not come so far, those that it screened."""
    scaled = design.space.scaled
    if isinstance(design, GroundDesign):
        found = design.searched
        assert found is not None
        found = found.at(np.isfinite(found.value))
        excess = dict(zip(design.names, found.sizes.T - 1.0, strict=True))
        return _Seen(scaled(found.designs), found.value, excess, design.bare, "risk of the tilt over ν")
    assert isinstance(design, HarmonicDesign)
    if design.surveys:
        s, words = design.surveys[0], "mean tilt over ν from rest"
        return _Seen(scaled(s.designs), s.severity.mean(axis=1), s.excess, float(s.bare.mean()), words)
    s, words = design.search, "risk of the tilt over ν, screened"
    limits = {"limits": np.where(s.screened_feasible, -0.5, 1.0)}
    return _Seen(scaled(s.screened), np.clip(s.screened_value, -1.0, 1.0), limits, design.bare.value, words)


class _Smoother:
    """Values at places (m, d) as a trend at others (n, d): in a window about each a fit linear in the
    place (J. Fan and I. Gijbels, Local Polynomial Modelling and Its Applications, 1996)."""

    def __init__(self, at: np.ndarray, to: np.ndarray) -> None:
        apart = at[None] - to[:, None]
        squares, k = np.sum(apart**2, axis=-1), min(_NEIGHBOURS, len(at) - 1)
        width = np.maximum(0.5 * np.sqrt(np.partition(squares, k, axis=1)[:, k]), _LEAST)[:, None]
        basis = np.concatenate([np.ones((*apart.shape[:2], 1)), apart / width[..., None]], axis=-1)
        # Far from all designs each counts a little: the trend is their mean there.
        weight = np.exp(-0.5 * squares / width**2) + 1e-12
        left = np.einsum("nm,nmi,nmj->nij", weight, basis, basis)
        left = left + _FLOOR * np.eye(left.shape[-1]) * np.array([0.0, *[1.0] * at.shape[1]])
        # The first row of the inverse gives the trend at the place itself.
        first = np.linalg.inv(left)[:, 0]
        self._weights = np.einsum("ni,nmi,nm->nm", first, basis, weight)

    def __call__(self, values: np.ndarray) -> np.ndarray:
        return self._weights @ values


def _shade(ax: Axes, mu: np.ndarray, lam: np.ndarray, field: np.ndarray, seen: _Seen, zeta: float) -> None:
    """The field, and contours with their values."""
    # Worse than the bare block is bad enough: there is nothing to tell apart beyond it.
    low, high = float(field.min()), float(min(field.max(), max(seen.bare, np.quantile(field, 0.5))))
    levels = MaxNLocator(14).tick_values(low, high)
    style: dict[str, Any] = {"levels": levels, "extend": "max" if field.max() > levels[-1] else "neither"}
    shades = ax.contourf(mu, lam, field, cmap="Blues", **style)
    lines = ax.contour(mu, lam, field, levels=levels[::3], colors=INK, linewidths=0.4)
    for text in ax.clabel(lines, fmt="%.3g", fontsize=7):
        text.set_path_effects(HALO)
    bar = cast(Any, ax.figure).colorbar(shades, ax=ax, label=f"{seen.words}, at ζ = {zeta:.2g} (-)")
    bar.ax.set_title(f"bare: {seen.bare:.2g}", fontsize=8)


def _points(ax: Axes, designs: np.ndarray, marker: str, size: float, label: str, mfc: str) -> None:
    if len(designs):
        ax.plot(*designs[:, :2].T, ls="", marker=marker, ms=size, mfc=mfc, mec=INK, label=label)
