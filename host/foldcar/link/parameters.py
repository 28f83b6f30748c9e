"""Reads and sets a car's parameters over the link.

Values are transferred as 32-bit floating-point numbers, and compared as such.
"""

import struct
import time
from collections.abc import Sequence
from typing import Any

from foldcar.errors import FoldcarError
from foldcar.link.car import ANSWER_S, TRIES, ConnectedCar
from foldcar.link.connection import CAR_COMPONENT, CAR_SYSTEM

# Time limit for all parameters, and the silence after which missing ones are requested again.
LIST_S = 20.0
QUIET_S = 0.4
# The largest 32-bit floating-point number, and the longest name that a packet holds, in bytes.
MAX_FLOAT32 = (2 - 2**-23) * 2.0**127
MAX_NAME_BYTES = 16
# The messages with which a car answers a setting.
ANSWERS = ("PARAM_VALUE", "FOLDCAR_PARAM_REFUSED")
# Requests per burst: a car's receive buffer is small.
BURST = 4


def read_parameters(car: ConnectedCar) -> dict[str, float]:
    """Return all parameters by name, in the car's order. Lost ones are requested again.

    Raises FoldcarError if some are missing after 20 s.
    """
    # The PARAM_VALUE message of each parameter, by its index: the car numbers its parameters.
    received: dict[int, Any] = {}
    # How many parameters the car has; None before its first answer.
    count: int | None = None
    list_request = car.dialect.MAVLink_param_request_list_message(CAR_SYSTEM, CAR_COMPONENT)
    car.connection.send(list_request)
    end_s = time.monotonic() + LIST_S
    while count is None or len(received) < count:
        if time.monotonic() > end_s:
            received_text = f"{len(received)} of {count} parameters" if count else "no parameter"
            raise FoldcarError(f"{car.port}: the car has sent {received_text} in {LIST_S:g} s; is the cable good?")
        message = car.connection.wait_for(lambda m: m.get_type() == "PARAM_VALUE", QUIET_S)
        if message is not None:
            count = message.param_count
            received[message.param_index] = message
        elif count is None:
            car.connection.send(list_request)
        else:
            missing_indices = [index for index in range(count) if index not in received]
            _request_parameters(car, missing_indices[:BURST])
    in_order = [received[index] for index in sorted(received)]
    return {message.param_id: message.param_value for message in in_order}


def _request_parameters(car: ConnectedCar, indices: Sequence[int]) -> None:
    """Request single parameters by their indices."""
    for index in indices:
        # The name is empty, because the index says which parameter is requested.
        request = car.dialect.MAVLink_param_request_read_message(CAR_SYSTEM, CAR_COMPONENT, b"", index)
        car.connection.send(request)


def set_parameter(car: ConnectedCar, name: str, value: float) -> None:
    """Set and save one parameter. Raises FoldcarError, with the reason, if the car refuses it or does not answer."""
    if not name.isascii() or not 0 < len(name) <= MAX_NAME_BYTES:
        # A packet would contain only the beginning of a longer name, which may be another parameter's name.
        raise FoldcarError(f"{name}: not a parameter's name, which has 1 to {MAX_NAME_BYTES} ASCII characters")
    if not fits_float32(value):
        raise FoldcarError(f"{name}: {value:g} cannot be stored as a 32-bit floating-point number")
    dialect = car.dialect
    kind = dialect.MAV_PARAM_TYPE_REAL32
    for _ in range(TRIES):
        car.connection.send(dialect.MAVLink_param_set_message(CAR_SYSTEM, CAR_COMPONENT, name.encode(), value, kind))
        answer = car.connection.wait_for(lambda m: m.get_type() in ANSWERS and m.param_id == name, ANSWER_S)
        if answer is None:
            continue
        if answer.get_type() == "FOLDCAR_PARAM_REFUSED":
            raise FoldcarError(f"{name}: the car refuses {value:g}: {car.refusal_text(answer.reason)}")
        if equal_float32(answer.param_value, value):
            return
        raise FoldcarError(f"{name}: the car refuses {value:g}; it stays {answer.param_value:g}")
    raise FoldcarError(f"{name}: the car does not answer")


def equal_float32(a: float, b: float) -> bool:
    """Return whether two values are equal as 32-bit floating-point numbers."""
    return struct.pack("<f", a) == struct.pack("<f", b)


def fits_float32(value: float) -> bool:
    """Return whether the value is finite and within the range of 32-bit floating-point numbers."""
    return abs(value) <= MAX_FLOAT32


def value_text(value: float) -> str:
    """Return the shortest decimal text of the 32-bit number: 3.4, not 3.4000001."""
    for digits in range(1, 10):
        rounded = float(f"{value:.{digits}g}")
        if equal_float32(rounded, value):
            return f"{rounded:.9g}"
    # ``value`` is a number that no 32-bit number equals. Nine digits are as many as any 32-bit number needs.
    return f"{value:.9g}"
