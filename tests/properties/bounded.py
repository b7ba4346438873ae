"""Settings of all property tests: the same examples in every run, a stated number of them, none stored."""

from hypothesis import HealthCheck, Phase, settings


def bounded(examples: int) -> settings:
    """Settings with so many examples; nothing is shrunk, because one example compiles nothing new."""
    return settings(
        deadline=None,
        derandomize=True,
        max_examples=examples,
        database=None,
        phases=[Phase.explicit, Phase.generate],
        suppress_health_check=[HealthCheck.filter_too_much, HealthCheck.too_slow],
    )
