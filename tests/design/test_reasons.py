"""Statuses and reasons: a sentence for every kind with its numbers, and how far a requirement is missed."""

import math

import pytest

from tpd.design.reasons import DesignStatus, Reason, ReasonKind, one_of_a_kind

NUMBERS = {"value": 0.3, "reference": 0.2, "low": 0.1, "high": 0.4, "total": 3}


@pytest.mark.parametrize("kind", ReasonKind)
def test_each_reason_makes_one_sentence_with_its_numbers(kind):
    said = str(Reason(kind=kind, condition="2.5 Hz", limit="stroke", **NUMBERS))
    assert any(number in said for number in ("30.0 %", "0.3", "0 of 3 runs"))
    assert not any(word in said for word in ("nan", "None", "\n"))


NEARLY = {"value": 0.1999, "low": 0.12, "high": 0.28, "reference": 0.2}
UNSURE = {"value": 0.3, "low": 0.0998, "high": 0.5, "reference": 0.2}
RISE = {"value": -0.1, "low": -0.3, "high": 0.05, "reference": 0.1}
WALL = {"value": 0.01004, "reference": 0.01}
FEW = "falls by 99.5 % (too few earthquakes or overturned runs for an interval)"


@pytest.mark.parametrize(
    ("kind", "given", "words"),
    [
        ("too_little_benefit", NEARLY, "falls by 19.99 % (95 %"),
        # Only what is missed is required: the reduction, its interval or both.
        ("too_little_benefit", NEARLY, "required: a reduction of at least 20.00 %$"),
        ("too_little_benefit", UNSURE, "required: an interval that begins above 10.00 %$"),
        ("too_little_benefit", UNSURE, "interval 9.98 to 50.0 %); req"),
        ("too_little_benefit", {"value": -1e-5, "low": -1.0, "reference": 0.0}, "increases by 0.001 %"),
        # The interval is that of the change which the sentence states.
        ("too_little_benefit", RISE, "increases by 10.0 % (95 % interval -5.0 to 30.0 %)"),
        ("too_little_benefit", RISE | {"value": 0.1, "low": -0.05, "high": 0.3}, "interval -5.0 to 30.0 %)"),
        ("touches_wall", WALL, "at most 1.000 % are allowed"),
        # A limit on an increase and a lower bound have their own quantities.
        (
            "breaks_limit",
            {"limit": "worsening", "value": 0.26, "reference": 0.05},
            ": 26.0 % of the tilt without pendulum, but at most 5.0 % is allowed$",
        ),
        (
            "breaks_limit",
            {"limit": "reserve", "value": 0.03, "reference": 0.05},
            "reserve: 0.03, but at least 0.05 is allowed$",
        ),
        (
            "overturns_more",
            {"value": 2.0, "reference": 1.0, "total": 9},
            "of 9 paired runs, the pendulum causes",
        ),
        # Without enough earthquakes or overturned runs there is no interval.
        ("too_little_benefit", {"value": 0.995, "low": math.nan, "reference": 0.1}, FEW),
        (
            "too_little_benefit",
            {"value": 0.08, "low": -0.04, "high": 0.2, "reference": 0.1, "measure": "overturning"},
            "the share of runs that overturn falls by 8.0 % (95 % interval -4.0 to 20.0 %); re",
        ),
        (
            "too_little_benefit",
            {"reference": 0.1, "measure": "overturning"},
            "share of runs that overturn is unknown (no run overturns without the pendulum)",
        ),
        (
            "too_little_benefit",
            {"value": 0.05, "reference": 0.0, "low": -0.01, "high": 0.11},
            "interval -1.0 to 11.0 %); required: a significant reduction$",
        ),
    ],
)
def test_a_reason_prints_enough_digits_to_differ_from_its_limit(kind, given, words):
    sentence = str(Reason(kind=ReasonKind[kind], **given)) + "$"
    assert words in sentence
    assert "inf" not in sentence


@pytest.mark.parametrize(
    ("kind", "given", "missed"),
    [
        ("touches_wall", {"value": 0.27, "reference": 0.01}, 0.26),
        ("overturns_more", {"value": 30.0, "reference": 10.0, "total": 40}, 0.5),
        ("rests_less", {"value": 10.0, "reference": 30.0, "low": 27.0, "total": 40}, 0.425),
        ("rests_less", {"value": 0.0, "reference": 1.0, "low": 0.9, "total": 1}, 0.9),
        ("worse_condition", {"value": 0.4, "reference": 0.3, "total": 2}, 0.1),
        ("breaks_limit", {"value": 1.2, "reference": 1.0}, 0.2),
        ("breaks_limit", {"limit": "worsening", "value": 0.26, "reference": 0.05}, 0.2),
        ("breaks_limit", {"limit": "reserve", "value": 0.04, "reference": 0.05}, 0.2),
        ("undecided", {"value": 3.0, "total": 64}, 1.0),
        # By what is required, or by what may be chance.
        ("too_little_benefit", {"value": 0.08, "low": 0.02, "reference": 0.1}, 0.02),
        ("too_little_benefit", {"value": 0.2, "low": -0.05, "reference": 0.1}, 0.05),
        ("too_little_benefit", {"value": -0.1, "low": -0.3, "reference": 0.1}, 0.3),
        ("too_little_benefit", {"reference": 0.1}, 1.0),
        # A quantity that is not known is missed most.
        ("breaks_limit", {"reference": 0.3}, math.inf),
        ("touches_wall", {"reference": 0.3}, math.inf),
        ("slides", {"reference": 0.3}, math.inf),
    ],
)
def test_the_shortfall_is_the_distance_from_the_requirement(kind, given, missed):
    assert Reason(kind=ReasonKind[kind], **given).shortfall == pytest.approx(missed)


def test_reasons_are_unique_by_kind_and_limit_and_begin_with_dangers():
    little = Reason(kind=ReasonKind.too_little_benefit, value=0.0, reference=0.1)
    wall = Reason(kind=ReasonKind.touches_wall, limit="clearance", value=0.3)
    swing, again = (Reason(kind=ReasonKind.breaks_limit, limit="stroke", value=x) for x in (1.2, 1.4))
    tilt = Reason(kind=ReasonKind.breaks_limit, limit="tilt", value=1.1)
    assert one_of_a_kind([little, swing, again, tilt, wall]) == [wall, little, swing, tilt]


def test_every_status_has_a_remedy_and_two_are_sound():
    sound = {status for status in DesignStatus if status.is_sound}
    assert sound == {DesignStatus.recommended, DesignStatus.no_uplift}
    assert all(status.remedy.endswith(".") for status in DesignStatus)
    assert all(status.value[:2].isupper() and status.value.endswith(".") for status in DesignStatus)
    assert not any("require" in status.remedy for status in DesignStatus)
    assert len({status.value for status in DesignStatus}) == len(DesignStatus) == 9
