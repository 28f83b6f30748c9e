"""When the messages of a log were, by the car's clock.

Input: messages with the host's times. Output: times (µs since 1970) that begin at the host's and go on by the car's: at
a simulation's other rate the host's would not be the car's seconds, and from a real car they have the link's delays.
What has no time of the car's lies between its neighbours as it does by the host's clock.
"""

from collections.abc import Sequence
from typing import Any

import numpy

from foldcar.link.connection import CAR_SYSTEM

# Messages that come out of order by less do not mean that the car was reset.
DISORDER_US = 1_000_000


def car_times_us(messages: Sequence[tuple[int, Any]]) -> list[int]:
    """A time for each message, in the log's order."""
    anchors: list[tuple[int, int]] = []
    own: dict[int, int] = {}
    offset_us: int | None = None
    last_boot_us = 0
    for index, (host_us, message) in enumerate(messages):
        boot_us = _since_boot_us(message)
        if boot_us is None:
            continue
        if offset_us is None:
            offset_us = host_us - boot_us
        elif boot_us < last_boot_us - DISORDER_US:
            # A reset set the clock back; the host's says how long it took.
            before_host_us, before_us = anchors[-1]
            offset_us = before_us + (host_us - before_host_us) - boot_us
        last_boot_us = boot_us
        own[index] = offset_us + boot_us
        if not anchors or (host_us > anchors[-1][0] and own[index] >= anchors[-1][1]):
            anchors.append((host_us, own[index]))
    if not anchors:
        return [host_us for host_us, _ in messages]
    hosts, cars = (numpy.array(side, dtype=float) for side in zip(*anchors, strict=True))
    origin = hosts[0]
    between = numpy.interp([host_us - origin for host_us, _ in messages], hosts - origin, cars - origin)
    # Before the first and after the last time of the car's the host's clock goes on.
    times = []
    for index, (host_us, _) in enumerate(messages):
        beyond = min(0.0, host_us - hosts[0]) + max(0.0, host_us - hosts[-1])
        times.append(own.get(index, round(between[index] + beyond + origin)))
    return times


def _since_boot_us(message: Any) -> int | None:
    """The car's time in a message, if it is the car's or its simulator's."""
    if message.get_srcSystem() != CAR_SYSTEM:
        return None
    if message.get_type() == "FOLDCAR_TRUTH":
        return int(message.time_usec)
    boot_ms = getattr(message, "time_boot_ms", None)
    return None if boot_ms is None else 1000 * int(boot_ms)
