"""Names and bounds of the symmetric orbits."""

import pytest

from tpd.compiled import columns
from tpd.compiled.columns import ASKED, SIZES, is_neutral
from tpd.scene.status import Status


def test_statuses_have_the_same_numbers_in_compiled_code():
    others = {"rest": "AT_REST"} | {n: f"{n.upper()}_STATUS" for n in ("aperiodic", "near_fold", "grazing")}
    for number, name in enumerate(Status.__names__[:16]):
        assert getattr(columns, others.get(name, name.upper())) == number


def test_groups_of_columns_contain_every_size_once():
    covered = [i for first, last in sorted(ASKED) for i in range(first, last)]
    assert covered == list(range(SIZES["state"].stop))
    for (first, last), names in ASKED.items():
        places = [SIZES[name] for name in names]
        assert places == ([slice(first, last)] if names == ("state",) else list(range(first, last)))


@pytest.mark.parametrize(
    ("k", "e", "mu", "zeta", "largest", "neutral"),
    [
        # A double multiplier is known to the root of rounding where nothing takes energy.
        (0.0, 1.0, 0.0, 0.2, 1.0 + 5e-7, True),
        (0.0, 1.0, 0.1, 0.0, 0.3, True),
        (0.0, 1.0, 0.1, 0.0, 1.1, False),
        (0.01, 1.0, 0.0, 0.2, 1.0 + 5e-7, False),
        (0.0, 0.9, 0.0, 0.2, 1.0 + 5e-7, False),
        (0.01, 0.9, 0.1, 0.2, 1.0 + 5e-12, True),
    ],
)
def test_an_orbit_without_energy_loss_is_neutral(k, e, mu, zeta, largest, neutral):
    assert bool(is_neutral(k, e, mu, zeta, largest)) is neutral
