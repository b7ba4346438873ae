"""Six scenes of the linear equations (25) without impact loss, and their answers to 30 digits.

    .venv/bin/python -m tests.benchmarks.precision.scenes

writes `truth.json` anew: the settled amplitude and its derivatives by central differences of 60-digit
orbits (`tests/truth.py`, which shares nothing with the package), a quarter of an hour.
"""

import json
import sys
from pathlib import Path
from typing import NamedTuple

import numpy as np

TRUTH = Path(__file__).with_name("truth.json")

REST = (0.0, 0.0, 0.0, 0.0)
PENDULUM, FRICTION = (1, 2, 3), (4, 5, 6)
"""Places of mu, lam, zeta; of k, f, xi."""


class Scene(NamedTuple):
    """What is settled into from `y0` at tau = 0, and near which state that orbit is there."""

    name: str
    x: tuple[float, ...]
    """nu, mu, lam, zeta, k, f, xi, e."""
    y0: tuple[float, ...]
    near: tuple[float, ...]
    wrt: tuple[int, int, int]
    """Places in `x` of the parameters that the gradient is asked for."""

    def moved(self, i: int, by: float) -> "Scene":
        """With the parameter in place `i` changed by `by`."""
        return self._replace(x=(*self.x[:i], self.x[i] + by, *self.x[i + 1 :]))


# fmt: off
SCENES = (
    Scene("block alone", (0.2, 0.0, 0.4, 0.2, 0.05, 0.1, 2.0, 1.0), (0.16, 0.0, 0.0, 0.0),
          (0.0426636405, 0.613270291, 0.0971547824, -0.596154769), FRICTION),
    Scene("light tuned pendulum", (0.25, 0.05, 0.2, 0.1, 0.05, 0.377, 2.67, 1.0), REST,
          (0.0368859592, 0.875780728, 0.135586804, -4.56582915), PENDULUM),
    Scene("heavy pendulum", (0.25, 0.2, 0.8, 0.1, 0.05, 0.5, 3.5, 1.0), REST,
          (0.0106520573, 0.0344785154, 0.24508296, 0.407575188), PENDULUM),
    Scene("stiff rest", (0.15, 0.19, 0.62, 1.46, 0.05, 0.19, 2.17, 1.0), REST,
          (1.05610289e-06, -0.0416576758, 0.000156531407, -0.0230155789), PENDULUM),
    Scene("near a fold", (0.25, 0.2, 0.8, 0.1, 0.05, 0.076, 3.5, 1.0), (0.0293, 0.085, 0.002, -0.055),
          (0.02925461, 0.08459745, 0.00180409, -0.05476497), PENDULUM),
    Scene("stick-slip", (0.25, 0.2, 0.34, 0.25, 0.28, 0.59, 2.62, 1.0), REST,
          (0.04613478, 0.13784047, 0.06886029, -1.43450283), PENDULUM),
)
# fmt: on


def load() -> dict[str, tuple[float, np.ndarray]]:
    """Amplitude and gradient of every scene by its name."""
    rows = json.loads(TRUTH.read_text())
    return {r["name"]: (float(r["amplitude"]), np.array([float(v) for v in r["gradient"]])) for r in rows}


def main() -> None:
    """Write the truth anew."""
    from tests.truth import DIGITS, mp, settled

    step, rows = mp.mpf(10) ** -14, []
    for scene in SCENES:
        x = [mp.mpf(v) for v in scene.x]
        orbit = settled(x, scene.near, 1)
        slopes = []
        for i in scene.wrt:
            sides = [settled([*x[:i], x[i] + way * step, *x[i + 1 :]], orbit.end, 1) for way in (1, -1)]
            slopes.append((sides[0].amplitude - sides[1].amplitude) / (2 * step))
        row = {"name": scene.name, "amplitude": mp.nstr(orbit.amplitude, DIGITS)}
        rows.append(row | {"gradient": [mp.nstr(v, DIGITS - 4) for v in slopes]})
        print(f"{scene.name}: {mp.nstr(orbit.amplitude, 12)}", file=sys.stderr)
    TRUTH.write_text("[\n" + ",\n".join(json.dumps(row) for row in rows) + "\n]\n")


if __name__ == "__main__":
    main()
