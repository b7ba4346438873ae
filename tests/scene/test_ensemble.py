"""Settings of a set of runs."""

import pytest

from tpd.scene.ensemble import Ensemble


@pytest.mark.parametrize(
    ("wrong", "message"),
    [
        ({"periods": 0}, "`periods` must be a whole number, 1 or more, but is 0"),
        ({"seed": -1}, "`seed` must be a whole number, 0 or more, but is -1"),
        ({"tilt": -0.1}, r"`tilt` must be zero or positive, and finite, but is -0\.1"),
        ({"frequency": 0.6}, r"`frequency` must be between 0 and 0\.5, but is 0\.6"),
        ({"ramps": (1.0, -2.0)}, "`ramps` must be zero or positive, and finite, but is -2"),
        ({"ramps": (1.0, 1e300)}, r"`ramps` must be between 0 and 100000, but is 1e\+300"),
    ],
)
def test_ensembles_that_make_no_sense_are_refused(wrong, message):
    with pytest.raises(ValueError, match=message):
        Ensemble(**wrong)
