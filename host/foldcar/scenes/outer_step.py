"""The interval at which Scenic looks at a simulation: a program's `param outer_step_s`."""

from typing import Any

from foldcar.scenes.reading import UnusableError

OUTER_STEP_S = 0.25
OUTER_STEP_LIMITS_S = (1 / 240, 60.0)


def outer_step_s(value: Any) -> float:
    """The parameter's value (s). UnusableError if it is no number or beyond the limits."""
    low, high = OUTER_STEP_LIMITS_S
    try:
        step_s = float(value)
    except (TypeError, ValueError):
        raise UnusableError(f"param outer_step_s: {value} is no number") from None
    if not low - 1e-9 <= step_s <= high:
        raise UnusableError(f"param outer_step_s: {value} is not within {low:.4g} to {high:g} s")
    return step_s
