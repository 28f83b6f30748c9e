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
    if not _has_possible_numbers(message):
        return None
    has_strings = "char" in getattr(message, "fieldtypes", ())
    if has_strings:
        for name in message.fieldnames:
            # pymavlink keeps the bytes of each string in a further attribute.
            string_bytes = getattr(message, f"_{name}_raw", None)
            if isinstance(string_bytes, bytes):
                used_bytes = string_bytes.split(b"\0", 1)[0]
                setattr(message, name, shown_line(used_bytes.decode("utf-8", "replace")))
    return message


def _has_possible_numbers(message: Any) -> bool:
    """Return whether all numbers of a message are within their limits."""
    message_type = message.get_type()
    if message_type == "PARAM_VALUE" and message.param_index >= message.param_count:
        return False
    for name, limit in LIMITS.get(message_type, {}).items():
        value = getattr(message, name)
        # As long as there is no outcome, its time is NaN.
        if name == "outcome_time" and not message.outcome and math.isnan(value):
            continue
        # NaN is not possible elsewhere; it is never within the limit.
        is_within_limit = abs(value) <= limit
        if not is_within_limit:
            return False
    return True
