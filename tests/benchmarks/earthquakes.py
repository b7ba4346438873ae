"""Benefit of a pendulum in earthquakes: square blocks of masonry by height and slenderness.

Housner's restitution, walls of a tenth of the width, a bob of steel of at most 10 % of the mass. Half of the
far-field earthquakes of FEMA P695 (the extra `records`) validate; PGA/(g tan α) is 1.5, 2, 3 and 4.
"""

import time
from typing import Any

import numpy as np

import tpd
from tests.benchmarks.stored import columns

QUESTION = "Which blocks benefit from a pendulum in earthquakes that the search did not use?"
MEASURES = "compiled", "design"
SEED = 0
HEIGHTS, SLENDERNESS, STRIPES = (1.0, 3.0, 8.0, 20.0), (0.12, 0.2, 0.3), (1.5, 2.0, 3.0, 4.0)
COLUMN = {"width": 0.7, "height": 4.0, "mass": 2210.0, "radius_of_gyration": 1.18, "cavity_width": 0.5}
"""Column of the README, for its picture."""


def masonry(height: float, nu: float) -> tpd.Block:
    """Return a square tube of 1800 kg/m³ whose walls are a tenth of its width thick."""
    width, cavity = nu * height, 0.8 * nu * height
    mass = 1800.0 * (width**2 - cavity**2) * height
    gyration = ((height**2 + width**2 + cavity**2) / 12.0) ** 0.5
    return tpd.Block(width=width, height=height, mass=mass, radius_of_gyration=gyration, cavity_width=cavity)


def designed(block: tpd.Block, quick: bool, space: tpd.DesignSpace | None = None, method: Any = None) -> Any:
    """Return the design for a block, with a smaller tilt required: the earthquakes are few."""
    far = tpd.records.fema_p695("far-field")
    conditions = tpd.Conditions.records(far[:12] if quick else far, STRIPES[:2] if quick else STRIPES)
    more = {"requirements": tpd.limits.Requirements(reduce="tilt")} | (
        {} if method is None else {"method": method}
    )
    return tpd.optimise(block, space, conditions=conditions, seed=SEED, **more)


def run(quick: bool) -> list[dict[str, Any]]:
    """Return a row for each block; the last one is the column of the README."""
    rows = []
    method = tpd.GroundSearch(designs=4, steps=2) if quick else tpd.GroundSearch(designs=16, steps=8)
    space = tpd.DesignSpace(mass_ratio=(0.01, 0.1), damping_ratio=(0.05, 1.0))
    blocks = [(h, nu, masonry(h, nu)) for h in HEIGHTS for nu in SLENDERNESS][: 1 if quick else None]
    for height, nu, block in [*blocks, (None, None, tpd.Block(**COLUMN))]:
        begun = time.perf_counter()
        whole = height is None and not quick
        found = designed(block, quick, *(() if whole else (space, method)))
        row = {"height": height, "nu": nu, "status": found.status.name}
        row["seconds"] = time.perf_counter() - begun
        if (runs := found.runs) is not None:
            fell, tilt = runs.change("overturned"), runs.change("mean tilt")
            row |= {"overturned": [fell.without_pendulum, fell.with_pendulum], "design": list(found.nearest)}
            for name, x in (("difference", fell), ("tilt", tilt)):
                row[name] = [x.difference, x.low, x.high]
        rows.append(row)
        if whole:
            _draw(found)
    return rows


def _draw(found: Any) -> None:
    """Draw the picture of the README, which needs the runs themselves; they are not stored."""
    from tests.benchmarks.stored import PICTURES
    from tpd.plots.style import saved

    (PICTURES / "column.png").write_bytes(saved(tpd.plot(found, "benefit")))


def table(rows: list[dict[str, Any]]) -> str:
    """Return a row for each block: validation earthquakes, differences with 95 % intervals."""
    names = [f"{r['height']:g} m, ν = {r['nu']:g}" if r["height"] else "column of 4 m (README)" for r in rows]
    between = "{{{0}[0]:+.3f}} ({{{0}[1]:+.3f}} to {{{0}[2]:+.3f}})"
    heads = {"block": "{block}", "status": "{status}"}
    heads |= {"overturned without, with pendulum": "{overturned[0]:.1%}, {overturned[1]:.1%}"}
    heads |= {"difference": between.format("difference")}
    heads |= {"change of the mean of tilt/ν": between.format("tilt")}
    return columns([r | {"block": n} for r, n in zip(rows, names, strict=True)], **heads, s="{seconds:.0f}")


def pictures(rows: list[dict[str, Any]]) -> dict[str, Any]:
    """Draw the change of the mean tilt in the validation motions over height and slenderness."""
    from tpd.plots.style import INK, new_axes

    ax = new_axes(size=(6.4, 3.8))
    change = np.full((len(SLENDERNESS), len(HEIGHTS)), np.nan)
    for r in rows:
        if r["height"] is None:
            continue
        i, j = SLENDERNESS.index(r["nu"]), HEIGHTS.index(r["height"])
        words = r["status"]
        if "tilt" in r:
            change[i, j] = 100.0 * r["tilt"][0]
            shares = "{:.0%} → {:.0%}".format(*r["overturned"])
            words = f"{change[i, j]:+.0f}\n{shares}".replace("-", "−")
        ink = "white" if change[i, j] < -12 else INK
        weight = "bold" if r["status"] == "recommended" else "normal"
        ax.text(j, i, words, ha="center", va="center", fontsize=8, weight=weight, color=ink)
    image = ax.imshow(change, origin="lower", aspect="auto", cmap="Blues_r", vmin=-24.0, vmax=4.0)
    ax.figure.colorbar(image, label="change of the mean tilt (% of ν)")
    ax.set_xticks(range(len(HEIGHTS)), [f"{h:g}" for h in HEIGHTS])
    ax.set_yticks(range(len(SLENDERNESS)), [f"{nu:g}" for nu in SLENDERNESS])
    ax.set(xlabel="height of the block (m)", ylabel="slenderness width/height (-)")
    title = "above: change of the mean tilt (% of ν); below: overturned without → with; bold: recommended"
    ax.set_title(title, size=8)
    return {"benefit_grid.png": ax.figure}
