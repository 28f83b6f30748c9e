"""Impossible numbers, endless lists and other languages from a car: each is stopped where it enters."""

import contextlib
import math
import socket
import threading
import time
from collections.abc import Callable, Iterator
from pathlib import Path
from typing import Any

import pytest

from foldcar.errors import FoldcarError
from foldcar.link import car_logs, parameters
from foldcar.link.car import ConnectedCar
from foldcar.link.car_logs import StoredLog, fetch_log, list_logs
from foldcar.link.connection import Connection
from foldcar.link.dialect import load_dialect
from foldcar.link.parameters import read_parameters
from foldcar.link.stream import LinkLostError, Stream
from foldcar.link.tlog import TlogWriter, read_tlog
from foldcar.store.reader import Store
from foldcar.store.tables import BY_NAME
from foldcar.store.trial_paths import trial_path
from foldcar.trials import driving
from foldcar.trials.drive_view import DriveView
from full_store import change

d = load_dialect()
PLACE = dict.fromkeys(("x", "y", "z", "heading", "pitch", "roll", "speed", "yaw_rate"), 0.0)
TRUTH = {**PLACE, "time_usec": 1, "distance_to_target": math.nan, "trial_id": 1, "outcome_time": math.nan, "outcome": 0}
TRIAL = {
    **{"time_boot_ms": 9, "trial_id": 1, "elapsed_ms": 5, "time_limit_ms": 9, "speed": 0.0, "yaw_rate": 0.0},
    **{"state": 2, "end": 0, "fault": 0, "flags": 0},
}
ATTITUDE = {**dict.fromkeys(("roll", "pitch", "yaw", "rollspeed", "pitchspeed", "yawspeed"), 0.0), "time_boot_ms": 1}
KINDS = {
    "FOLDCAR_TRUTH": (d.MAVLink_foldcar_truth_message, TRUTH),
    "ATTITUDE": (d.MAVLink_attitude_message, ATTITUDE),
    "FOLDCAR_TRIAL": (d.MAVLink_foldcar_trial_message, TRIAL),
    "LOG_ENTRY": (d.MAVLink_log_entry_message, {"id": 1, "num_logs": 1, "last_log_num": 1, "time_utc": 0, "size": 10}),
    "PARAM_VALUE": (
        d.MAVLink_param_value_message,
        {"param_id": b"A", "param_value": 1.0, "param_type": 9, "param_count": 1, "param_index": 0},
    ),
}


def packet(kind: str, **changed: Any) -> bytes:
    """A packet of a car: a message with plausible numbers except those that are changed."""
    message, values = KINDS[kind]
    return bytes(message(**{**values, **changed}).pack(d.MAVLink(None, srcSystem=1, srcComponent=1)))


@contextlib.contextmanager
def car_that_sends(*packets: bytes, endless: bool = False) -> Iterator[ConnectedCar]:
    """A car that sends packets once, or again and again."""
    ours, its = socket.socketpair()
    stop = threading.Event()

    def send() -> None:
        with contextlib.suppress(OSError):
            while not stop.is_set():
                its.sendall(b"".join(packets))
                if not endless:
                    break

    ours.setblocking(False)
    thread = threading.Thread(target=send)
    thread.start()
    connection = Connection(Stream("car", ours, ours.recv, ours.send))
    try:
        yield ConnectedCar(connection)
    finally:
        stop.set()
        connection.close()
        its.close()
        thread.join()


@pytest.mark.parametrize(
    ("kind", "changed"),
    [
        ("FOLDCAR_TRUTH", {"x": math.nan}),
        ("FOLDCAR_TRUTH", {"roll": 1e30}),
        ("FOLDCAR_TRUTH", {"time_usec": 2**63}),
        ("FOLDCAR_TRUTH", {"outcome": 1}),
        ("FOLDCAR_TRUTH", {"outcome": 1, "outcome_time": 1e30}),
        ("FOLDCAR_TRUTH", {"outcome": 9, "outcome_time": 1.0}),
        ("ATTITUDE", {"pitch": math.nan}),
        ("ATTITUDE", {"yaw": -math.inf}),
        ("FOLDCAR_TRIAL", {"elapsed_ms": 2**32 - 1}),
        ("LOG_ENTRY", {"size": 2**32 - 1}),
        ("LOG_ENTRY", {"num_logs": 65535}),
        ("PARAM_VALUE", {"param_value": math.nan}),
        ("PARAM_VALUE", {"param_index": 7}),
    ],
)
def test_a_message_with_a_number_that_no_car_can_have_is_damaged(tmp_path: Path, kind: str, changed: Any) -> None:
    packets = packet(kind, **changed), packet(kind)
    log = TlogWriter(tmp_path / "a.tlog")
    with car_that_sends(*packets) as car:
        received = car.connection.wait_for(lambda message: message.get_type() == kind, 10.0)
        assert car.connection.damaged == 1
    for sent in packets:
        log.write(sent)
    log.close()

    (logged,) = [message for _, message in read_tlog(log.file)]
    assert logged.get_msgbuf() == received.get_msgbuf() == packets[1]


def test_a_path_ends_with_the_longest_trial(store: Path) -> None:
    """A car whose clock jumps asks for no path of years."""
    log = store.parent / "s-logs" / "trial-0009-20261122T113100Z.tlog"
    hour_us = 3_600_000_000
    with contextlib.closing(TlogWriter(log)) as writer:
        writer.write(packet("FOLDCAR_TRIAL"))
        for time_us in (4_000, 1_004_000, 900 * hour_us):
            writer.write(packet("FOLDCAR_TRUTH", time_usec=time_us))
    change(store, BY_NAME["trial"], "id = 1", log="s-logs/trial-0009-20261122T113100Z.tlog", log_sha256=None)

    with Store.open(store) as opened:
        rows = trial_path(opened, opened.trial(1)).rows
        assert rows is not None and rows[-1, 0] == pytest.approx(1.0)


def test_texts_of_cars_are_utf_8() -> None:
    names = dict(name="Käfer 虫".encode(), hash=b"1", build=b"2")
    message = d.MAVLink_foldcar_design_message(0.06, 0.1, 1, 4, **names)
    with car_that_sends(bytes(message.pack(d.MAVLink(None, srcSystem=1, srcComponent=1)))) as car:
        design = car.connection.wait_for(lambda message: message.get_type() == "FOLDCAR_DESIGN", 10.0)

    assert design.name == "Käfer 虫"


def test_texts_of_cars_stay_in_their_line() -> None:
    """A name or a status text can neither add a line to what is printed nor steer a terminal."""
    mav = d.MAVLink(None, srcSystem=1, srcComponent=1)
    design = d.MAVLink_foldcar_design_message(0.06, 0.1, 1, 4, name=b"w95\nX 1\t\x1b[2J", hash=b"1\r2", build=b"2\x9b")
    status = d.MAVLink_statustext_message(4, b"refused:\nfoldcar: error: none\x07")
    value = packet("PARAM_VALUE", param_id=b"A\nB 7")
    with car_that_sends(bytes(design.pack(mav)), bytes(status.pack(mav)), value) as car:
        values = read_parameters(car)
        received = car.connection.latest["FOLDCAR_DESIGN"]

    assert (received.name, received.hash) == (r"w95\nX 1\t\x1b[2J", r"1\r2")
    assert car.connection.warning_text == r"refused:\nfoldcar: error: none\x07"
    assert values == {r"A\nB 7": 1.0}


@pytest.mark.parametrize(
    ("packets", "ask", "message"),
    [
        ((packet("LOG_ENTRY", num_logs=2),), list_logs, "does not list its logs"),
        ((packet("LOG_ENTRY", num_logs=65535),), list_logs, "does not list its logs"),
        (
            (bytes(d.MAVLink_log_data_message(1, 900, 9, [0] * 90).pack(d.MAVLink(None, srcSystem=1, srcComponent=1))),),
            lambda car: fetch_log(car, StoredLog(1, 1 << 25)),
            "log 1 is incomplete",
        ),
        ((packet("PARAM_VALUE", param_count=3),), read_parameters, "has sent 1 of 3 parameters"),
    ],
)
def test_what_a_car_repeats_for_ever_ends(
    monkeypatch: pytest.MonkeyPatch, packets: tuple[bytes, ...], ask: Callable[[ConnectedCar], object], message: str
) -> None:
    for module, name in ((car_logs, "LIST_S"), (car_logs, "FETCH_S"), (parameters, "LIST_S")):
        monkeypatch.setattr(module, name, 0.5)
    with car_that_sends(*packets, endless=True) as car, pytest.raises(FoldcarError, match=message):
        ask(car)


def test_a_car_that_never_ends_its_trial_is_left() -> None:
    ending = pytest.raises(LinkLostError, match="does not end trial 1 at its time limit")
    with car_that_sends(packet("FOLDCAR_TRIAL"), endless=True) as car, ending:
        driving._watch(car, 1, DriveView(0, 3.0, None), time.monotonic() + 0.3)
