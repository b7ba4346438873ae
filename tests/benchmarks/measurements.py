"""Impacts and overturning against measurements, without a fit: Housner's e, and shares over p PGV/(g tan α).

Source: 134 free-rocking trials of limestone blocks, 0.05 m thick and 0.2 to 0.75 m high (Colombo and others,
2026, CC BY 4.0, DOI 10.60756/uminho-jh25). The numbers are means over blocks of equal proportions of e at the
first impact. A third party processed them, so they are an indication. No measured shares of overturning are
known here that have a free licence. The curves therefore check only the law for a sudden push.
"""

from typing import Any

import numpy as np

import tpd
from tests.benchmarks.stored import columns

QUESTION = "Do impacts and overturning agree with what was measured on real blocks?"
MEASURES = "scene", "compiled", "design/ground_motion"
SEED = 0
LIMESTONE = {
    **{4: (12, 0.940), 5: (10, 0.940), 6: (12, 0.932), 7: (9, 0.962), 8: (11, 0.954), 9: (12, 0.973)},
    **{10: (13, 0.983), 11: (10, 0.968), 12: (8, 0.996), 13: (13, 0.996), 14: (13, 0.947), 15: (11, 0.971)},
}
"""Trials and mean velocity ratio e, by height over width."""
LEVELS = 0.25, 3.0
"""Ends of the levels, p PGV/(g tan α). A sudden push overturns a block at rest from 1 on, whatever its size
and shape."""
BLOCKS = {"statue": (0.45, 1.8, 390.0), "column": (0.7, 4.0, 2210.0), "chimney": (1.3, 10.0, 16280.0)}
"""Width and height in m, and mass in kg."""


def run(quick: bool) -> list[dict[str, Any]]:
    """Return a row for each group of trials, and one for each block under the far-field records."""
    rows = []
    for ratio, (trials, measured) in LIMESTONE.items():
        e = float(tpd.Block(width=1.0 / ratio, height=1.0, mass=2e3 / ratio**2).velocity_ratio)
        rows.append({"ratio": ratio, "trials": trials, "housner": e, "measured": measured})
    records = tpd.records.fema_p695("far-field")[: 4 if quick else None]
    conditions = tpd.Conditions.records(records, LEVELS, intensity="pgv_star")
    for name, (width, height, mass) in BLOCKS.items():
        block = tpd.Block(width=width, height=height, mass=mass)
        assessment = tpd.assess(block, conditions=conditions, seed=SEED)
        # The stated block has Housner's e, and the blocks that vary have the measured scatter of e.
        for kind, runs in (("Housner's e", assessment.stated), ("scatter", assessment.runs)):
            levels = assessment.problem.levels
            shares = [float(np.mean(runs.is_overturned[of_level])) for of_level in levels.values()]
            rows.append({"block": f"{name}, {height:g} m", "e": kind, "levels": [*levels], "shares": shares})
    return rows


def table(rows: list[dict[str, Any]]) -> str:
    """Return a table of e with its mean difference, and one of the shares that overturn."""
    groups, curves = ([r for r in rows if key in r] for key in ("ratio", "block"))
    apart = [r["measured"] - r["housner"] for r in groups]
    mean = np.average(apart, weights=[r["trials"] for r in groups])
    groups = [r | {"apart": x} for r, x in zip(groups, apart, strict=True)]
    heads = {"height/width": "{ratio}", "trials": "{trials}", "e of Housner": "{housner:.3f}"}
    heads |= {"measured": "{measured:.3f}", "difference": "{apart:+.3f}"}
    text = f"Mean difference over all trials: {mean:+.4f}. Shares that overturn, by p PGV/(g tan α):"
    shares = {level: f"{{shares[{i}]:.0%}}" for i, level in enumerate(curves[0]["levels"])}
    return "\n\n".join(
        (columns(groups, **heads), text, columns(curves, **{"block": "{block}", "e": "{e}"}, **shares))
    )
