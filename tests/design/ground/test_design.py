"""Verdicts on designs under ground motions."""

import numpy as np
from tpd.design.ground import design
from tpd.design.ground.judgement import Judged, Pairs, Role

import tpd
from tpd.answers.statistics import Interval, Lognormal


def test_the_verdict_follows_from_intervals_and_the_least_benefit():
    def group(role, shift, low, high):
        pair = np.stack([np.full(120, 0.5), 0.5 + shift + np.repeat(0.01 * np.arange(-3, 3), 20)])
        runs = Pairs(pair, pair, np.repeat(np.arange(6), 20))
        none = (Lognormal(1.0, 0.3, np.zeros((2, 2)), False),) * 2
        counts = dict.fromkeys(("counts", "unknown"), (np.zeros(2), np.zeros(2)))
        intervals = dict.fromkeys(("difference", "linear", "tilt"), Interval(shift, low, high))
        shares = dict.fromkeys(("strikes", "linear_strikes", "changed"), 0.0)
        sizes = {"motions": 6, "events": 6, "undecided": 0, "stripes": np.array([1.0, 2.0])}
        of = {"name": "", "role": role, "overturned": (0.5, 0.5 + shift), "fits": none, "runs": runs}
        return Judged(**of, **counts, **intervals, **shares, **sizes)

    tuned, held = Role.tuned, Role.held_out
    good, harm = group(held, -0.2, -0.3, -0.1), group(held, 0.2, 0.1, 0.3)
    helped, nothing = group(tuned, -0.2, -0.3, -0.1), group(held, 0.0, -0.1, 0.1)
    for groups, least, status, said in (
        ((helped,), 0.1, "tuned_only", ""),
        ((helped, good), 0.1, "found", ""),
        ((helped, good), 0.5, "refused", "were asked for"),
        ((helped, harm), 0.1, "refused", "overturns more often"),
        ((helped, good, harm), 0.1, "refused", "overturns more often"),
        ((group(tuned, 0.2, 0.1, 0.3), good), 0.1, "refused", "overturns more often"),
        ((helped, nothing), 0.1, "refused", "no benefit is significant"),
    ):
        found = design.verdict_of(groups, tpd.limits.Worth(at_least=least, strikes=0.1))
        assert found.status.name == status
        assert said in (found.reasons or ("",))[0]
