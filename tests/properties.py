"""How often a property is tried."""

from hypothesis import settings


def examples(count: int) -> settings:
    """Return settings of so many examples; ten times as many in the profile `random`."""
    return settings(max_examples=count * settings().max_examples // 100)
