"""Checks the messages of a car that come from the link or from a log.

Input: a decoded message. Output: the message with its strings decoded as UTF-8, or None if it has an impossible number.
"""

import math
from typing import Any

from foldcar.shown_text import shown_line

# Largest values of the fields that are used: angles (rad), positions (m), speeds (m/s, rad/s), times (ms, s), sizes.
# A day is the longest trial that a store keeps, 2^32 ms the longest time since boot, 2^128 the limit of float32.
DAY_S = 86_400.0
LIMITS: dict[str, dict[str, float]] = {
    "ATTITUDE": {"roll": 10, "pitch": 10, "yaw": 10},
    "FOLDCAR_TRUTH": {
        **dict.fromkeys(("x", "y", "z", "heading", "pitch", "roll", "speed", "yaw_rate"), 1e5),
        "outcome": 4, "outcome_time": DAY_S, "time_usec": 1000 * 2**32,
    },
    "FOLDCAR_TRIAL": {"elapsed_ms": 1000 * DAY_S},
    "PARAM_VALUE": {"param_value": 2.0**128},
    "LOG_ENTRY": {"num_logs": 1000, "size": 1 << 26},
}  # fmt: skip


def checked_message(message: Any) -> Any | None:
    """Return the message with its strings decoded as UTF-8; None if it has an impossible number.

    Example: messages = [checked_message(message) for message in mav.parse_buffer(data)]
    """
    kind = message.get_type()
    for name, limit in LIMITS.get(kind, {}).items():
        value = getattr(message, name)
        # Before the outcome, its time is NaN.
        is_unset = name == "outcome_time" and not message.outcome and math.isnan(value)
        if not (abs(value) <= limit or is_unset):
            return None
    if kind == "PARAM_VALUE" and message.param_index >= message.param_count:
        return None
    if "char" in getattr(message, "fieldtypes", ()):
        for name in message.fieldnames:
            raw = getattr(message, f"_{name}_raw", None)
            if isinstance(raw, bytes):
                setattr(message, name, shown_line(raw.split(b"\0", 1)[0].decode("utf-8", "replace")))
    return message
