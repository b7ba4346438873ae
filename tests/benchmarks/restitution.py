"""How well dry friction stands for impacts: settled amplitudes with the velocity ratio e, and with e = 1 and
the friction `tpd.theory.equivalent_friction` of the amplitude that this leads to, over random scenes.

.venv/bin/python -m tests.benchmarks.restitution
"""

from dataclasses import replace
from typing import NamedTuple

import jax
import numpy as np

jax.config.update("jax_enable_x64", True)

import tpd  # noqa: E402
from tpd.models.rows import settle_all  # noqa: E402
from tpd.scene.impacts import housner  # noqa: E402
from tpd.scene.status import names_of  # noqa: E402

SCENES, SEED = 400, 5
ITERATIONS = 16
"""Of the fixed point: amplitude to friction to amplitude."""
FIXED = 1e-4
"""Relative change of the amplitude in the last of them that counts as none."""


MOVING = ("rocking", "sticking")


class Motions(NamedTuple):
    """What scenes settle into, arrays of length n."""

    kind: np.ndarray
    """Name of the status: rocking, sticking, rest, overturned, or else."""
    amplitude: np.ndarray
    periods: np.ndarray
    state: np.ndarray


def scenes() -> tpd.Parameters:
    """Half of them with a pendulum, half with friction as well, half with Housner's ratio."""
    rng = np.random.default_rng(SEED)

    def drawn(low: float, high: float, share: float = 1.0, otherwise: float = 0.0) -> np.ndarray:
        return np.where(rng.random(SCENES) < share, rng.uniform(low, high, SCENES), otherwise)

    nu, mu = drawn(0.1, 0.35), drawn(0.01, 0.2, 0.5)
    tied = housner(nu, 0.75 / (1.0 + nu**2), mu)
    return tpd.Parameters(
        nu=nu,
        mu=mu,
        lam=drawn(0.1, 1.5),
        zeta=drawn(0.02, 0.3),
        k=nu * drawn(0.0, 0.2, 0.5),
        f=nu * drawn(0.8, 2.0),
        xi=drawn(1.5, 5.0),
        e=np.where(rng.random(SCENES) < 0.5, tied, rng.uniform(0.7, 1.0, SCENES)),
    )


def settled(p: tpd.Parameters, y0: np.ndarray) -> Motions:
    """By the exact solution."""
    s = settle_all(p, y0)
    names = names_of(s.status)
    return Motions(names, np.asarray(s.amplitude), np.asarray(s.periods), np.asarray(s.y))


def with_friction(p: tpd.Parameters, y0: np.ndarray, first: np.ndarray) -> tuple[Motions, np.ndarray]:
    """The same with friction in place of impacts, at the fixed point from the amplitudes `first`; and whether
    that was reached."""
    phi, toppling = first, (1.0 + p.mu) * p.nu / (1.0 + 2.0 * p.mu)
    for _ in range(ITERATIONS):
        k = p.k + np.asarray(tpd.theory.equivalent_friction(p, phi))
        found = settled(replace(p, k=k, e=np.ones(SCENES)), y0)
        before, phi = (
            phi,
            np.where(np.isin(found.kind, MOVING), np.minimum(found.amplitude, 2 * toppling), phi),
        )
    return found, np.abs(phi - before) <= FIXED * phi


def told(label: str, truth: Motions, found: Motions, fixed: np.ndarray, among: np.ndarray) -> str:
    """A line of the table: errors where both move alike, and how many end in another kind."""
    moves = among & np.isin(truth.kind, MOVING)
    alike = moves & (found.kind == truth.kind) & fixed
    error = np.abs(found.amplitude[alike] / truth.amplitude[alike] - 1.0)
    same = alike & (found.periods == truth.periods)
    other = among & (truth.kind != found.kind)
    return (
        f"{label:22}{among.sum():6}{moves.sum():8}{alike.sum():7}{same.sum():13}"
        f"{np.median(error):9.2%}{np.quantile(error, 0.9):9.2%}{other.sum():7}"
    )


def changes(truth: Motions, found: Motions, among: np.ndarray) -> str:
    """How many end in another kind, by both kinds."""
    other = among & (truth.kind != found.kind)
    pairs, counts = np.unique(
        [f"{a} to {b}" for a, b in zip(truth.kind[other], found.kind[other], strict=True)], return_counts=True
    )
    return "  other: " + ", ".join(f"{n} {pair}" for pair, n in zip(pairs, counts, strict=True))


def main() -> None:
    """Print the table."""
    p, rest = scenes(), np.zeros((SCENES, 4))
    truth = settled(p, rest)
    moving, hung = np.isin(truth.kind, MOVING), p.mu > 0.0
    tied = np.isclose(p.e, housner(p.nu, p.inertia_ratio, p.mu))
    size, itself = np.where(moving, truth.amplitude, 0.0), np.where(moving[:, None], truth.state, 0.0)
    head = f"{'scenes':>28}{'moving':>8}{'alike':>7}{'same period':>13}"
    print(f"{head}{'median':>9}{'90 %':>9}{'other':>7}")
    for label, y0, first, of in (
        ("from rest", rest, np.zeros(SCENES), np.ones(SCENES, bool)),
        ("from the motion itself", itself, size, moving),
    ):
        found, fixed = with_friction(p, y0, first)
        print(told(label, truth, found, fixed, of))
        print(told("  bare block", truth, found, fixed, of & ~hung))
        print(told("  with a pendulum", truth, found, fixed, of & hung))
        print(told("  Housner's e", truth, found, fixed, of & tied))
        print(changes(truth, found, of), flush=True)


if __name__ == "__main__":
    main()
