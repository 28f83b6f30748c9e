"""Units of trials: placement and deviations, a servo's deadband, parameter files, logs, ports, car.json."""

import grp
import json
import math
import os
import pty
import resource
import signal
import struct
from pathlib import Path
from types import SimpleNamespace
from typing import Any, cast

import pytest

from foldcar.car.body import car_json, design_hash, design_name
from foldcar.car.design import compose
from foldcar.errors import FoldcarError
from foldcar.link.car import ConnectedCar
from foldcar.link.connection import Connection
from foldcar.link.dialect import load_dialect
from foldcar.link.parameters import value_text
from foldcar.link.stream import choose_port, open_stream, permission_text
from foldcar.link.tlog import LogError, TlogWriter, log_damage, read_tlog
from foldcar.trials.cars_log import wait_for_storage
from foldcar.trials.drive_end import drive_end
from foldcar.trials.faults import crash_text
from foldcar.trials.placement import ask_deviations, parse_deviation
from foldcar.trials.servo_edges import ServoEdges, find_edges


@pytest.mark.parametrize(
    "text",
    ["", "C 1 2", "A 1", "A x 2", "A 1 2 3 4", "A nan 1", "A 2000 1", "A 1 1 200"],
)
def test_a_bad_deviation_says_what_is_wrong(text: str) -> None:
    with pytest.raises(FoldcarError, match=r'^deviation "'):
        parse_deviation(text, ["car", "A", "B"])
    with pytest.raises(FoldcarError, match='--deviation "car 5 5": car is given twice'):
        ask_deviations(None, {}, ["car 1 1", "car 5 5"])


# An FS90R, version 2.0.
DATA_SHEET = ServoEdges(1500.0, 45.0)


@pytest.mark.parametrize(("neutral", "deadband", "most"), [(1500, 45, 6), (1512, 41, 8), (1487, 5, 13), (1531, 90, 18)])
def test_a_servos_edges_are_found_within_the_drivers_step(neutral: float, deadband: float, most: int) -> None:
    questions = []

    def turns(pulse_us: int) -> int:
        questions.append(pulse_us)
        return 0 if abs(pulse_us - neutral) <= deadband else int(math.copysign(1, pulse_us - neutral))

    edges = find_edges(turns, DATA_SHEET)

    assert edges.neutral_us == pytest.approx(neutral, abs=2.5) and edges.deadband_us == pytest.approx(deadband, abs=2.5)
    assert len(questions) <= most and len(set(questions)) == len(questions)


def test_a_deadband_that_is_too_wide_is_refused() -> None:
    with pytest.raises(FoldcarError, match=r"a deadband of ±19[0-9.]+ µs is above the maximum 150 µs"):
        find_edges(lambda pulse: 0 if pulse < 1690 else 1, DATA_SHEET)


@pytest.mark.parametrize("direction", [1, -1])
def test_a_servo_that_never_changes_its_direction_is_refused(direction: int) -> None:
    with pytest.raises(FoldcarError, match="in the same direction at all pulses from 1300 to 1700 µs"):
        find_edges(lambda pulse: direction, DATA_SHEET)


def test_a_parameters_value_is_shown_by_its_shortest_decimals() -> None:
    for value, shown in ((0.1, "0.1"), (3.4, "3.4"), (25e6, "25000000"), (0.0, "0"), (-1 / 3, "-0.33333334")):
        assert value_text(struct.unpack("<f", struct.pack("<f", value))[0]) == shown


def heartbeats(count: int) -> list[bytes]:
    d = load_dialect()
    mav = d.MAVLink(None, srcSystem=1, srcComponent=1)
    packets = []
    for k in range(count):
        mav.seq = k % 256
        packets.append(d.MAVLink_heartbeat_message(10, 0, 0, k, 4, 3).pack(mav))
    return packets


def test_a_log_is_whole_up_to_where_it_was_cut(tmp_path: Path) -> None:
    log = TlogWriter(tmp_path / "logs" / "t.tlog")
    for k, packet in enumerate(heartbeats(5)):
        log.write(packet, 1_000_000 + k)
    data = log.file.read_bytes()

    assert [(t, m.custom_mode) for t, m in read_tlog(log.file)] == [(1_000_000 + k, k) for k in range(5)]
    for cut in (1, 8, 20, len(data) // 5 - 1):
        log.file.write_bytes(data[:-cut])
        assert len(list(read_tlog(log.file))) == 4
    log.file.write_bytes(data)
    assert log_damage(log.file) is None
    for damage in (bytes(4096), b"12345678nonsense", bytes(7), b"12345678\xfd\xff"):
        log.file.write_bytes(data + damage)
        assert len(list(read_tlog(log.file))) == 5
        assert f"its last {len(damage)} bytes are not packets" in str(log_damage(log.file))
    log.close()
    with pytest.raises(LogError, match="exists already"):
        TlogWriter(log.file)


def test_a_full_disk_is_told_and_leaves_whole_packets(tmp_path: Path) -> None:
    """A limit on the file's size truncates a packet, as a full disk does."""
    packet = heartbeats(1)[0]
    before = resource.getrlimit(resource.RLIMIT_FSIZE)
    ignored = signal.signal(signal.SIGXFSZ, signal.SIG_IGN)
    log = TlogWriter(tmp_path / "t.tlog")
    try:
        resource.setrlimit(resource.RLIMIT_FSIZE, (2 * (8 + len(packet)) + 10, before[1]))
        log.write(packet)
        log.write(packet)
        with pytest.raises(LogError, match="cannot be written: No space left on device"):
            log.write(packet)
    finally:
        resource.setrlimit(resource.RLIMIT_FSIZE, before)
        signal.signal(signal.SIGXFSZ, ignored)
    log.close()
    assert len(list(read_tlog(log.file))) == 2


def test_car_json_agrees_with_the_simulators_body() -> None:
    design = compose("W_B_W", {"width": 95.0})

    content = car_json(design)

    assert [content[key] for key in ("format", "wheel_radius_m", "length_m", "width_m")] == [1, 0.06, 0.2, 0.095]
    assert [(w["channel"], w["side"], w["direction"]) for w in content["wheels"]] == [
        (1, "left", 1), (2, "right", -1), (3, "left", 1), (4, "right", -1),
    ]  # fmt: skip
    assert not any(name.endswith(("_SIDE", "_DIRECTION")) or name == "TRACK_M" for name in content["parameters"])
    assert len(content["hash"]) == 16 and int(content["hash"], 16)
    assert len(json.dumps(content, indent=2)) < 8192


def test_every_design_has_a_hash_and_a_short_name_of_its_own() -> None:
    designs = [compose("W_B_W", {"width": float(w)}) for w in range(65, 250, 20)]
    designs += [compose("W_B_H_W_H_W", {"radius": 30.0, "W.length": 80.0, "H.fold_up": up}) for up in (0.0, 5.0)]

    assert len({design_hash(design) for design in designs}) == len(designs)
    assert all(0 < len(design_name(design).encode()) <= 32 for design in designs)


@pytest.mark.parametrize(
    ("name", "message"),
    [
        ("/dev/no-such-port", "/dev/no-such-port: no such port"),
        ("/etc/passwd", "/etc/passwd: not a serial port"),
        ("tcp:localhost:99999", "tcp:localhost:99999: not tcp:HOST:PORT"),
        ("tcp:localhost:1", "tcp:localhost:1: cannot be reached: Connection refused"),
        ("tcp:a..b:5760", 'tcp:a..b:5760: "a..b" is not a host name'),
        ("/dev/null", "/dev/null: not a serial port"),
    ],
)
def test_a_port_that_cannot_be_opened_is_reported(name: str, message: str) -> None:
    with pytest.raises(FoldcarError) as error:
        open_stream(name)

    assert str(error.value) == message


def test_no_permission_names_the_group_to_join() -> None:
    group = grp.getgrgid(Path("/dev/tty").stat().st_gid).gr_name

    assert f"belongs to group {group}; `sudo usermod -aG {group} $USER`" in permission_text("/dev/tty")


def test_a_port_that_another_program_uses_is_reported() -> None:
    ours, theirs = pty.openpty()
    first = open_stream(os.ttyname(theirs))
    try:
        with pytest.raises(FoldcarError, match="another program uses this port"):
            open_stream(os.ttyname(theirs))
    finally:
        first.close()
        os.close(ours)
        os.close(theirs)


def ports(monkeypatch: pytest.MonkeyPatch, *found: tuple[str, int | None, int | None]) -> None:
    """The machine's serial ports, as pyserial lists them."""
    listed = [SimpleNamespace(device=d, vid=vid, pid=pid, description="a thing") for d, vid, pid in found]
    monkeypatch.setattr("serial.tools.list_ports.comports", lambda: listed)


def test_the_only_board_is_found(monkeypatch: pytest.MonkeyPatch) -> None:
    ports(monkeypatch, ("/dev/ttyS0", None, None), ("/dev/ttyACM0", 1, 2), ("/dev/ttyUSB1", 0x10C4, 0xEA60))

    assert choose_port(None) == "/dev/ttyUSB1"
    assert choose_port("/dev/pts/3") == "/dev/pts/3"


@pytest.mark.parametrize(
    ("plugged_in", "message"),
    [
        ([], "no car is plugged in"),
        ([("/dev/ttyACM0", 1, 2)], "no port with a Feather's USB bridge.*--port /dev/ttyACM0 "),
        ([("/dev/a", 0x1A86, 0x55D4), ("/dev/b", 0x10C4, 0xEA60)], "/dev/a .*, /dev/b .*; choose one with --port"),
    ],
)
def test_without_a_single_board_a_port_must_be_named(
    monkeypatch: pytest.MonkeyPatch, plugged_in: Any, message: str
) -> None:
    ports(monkeypatch, *plugged_in)

    with pytest.raises(FoldcarError, match=message):
        choose_port(None)


def test_messages_that_come_together_are_all_read() -> None:
    ours, theirs = pty.openpty()
    connection = Connection(open_stream(os.ttyname(theirs)))
    try:
        os.write(ours, b"".join(heartbeats(5)))

        beats = [connection.wait_for(lambda m: m.get_type() == "HEARTBEAT", 5.0) for _ in range(5)]

        assert [message.custom_mode for message in beats if message is not None] == [0, 1, 2, 3, 4]
        assert (connection.received, connection.lost, connection.damaged) == (5, 0, 0)
        os.write(ours, heartbeats(9)[8])
        connection.wait_for(lambda m: m.custom_mode == 8, 5.0)
        assert (connection.received, connection.lost) == (6, 3)
    finally:
        connection.close()
        os.close(ours)
        os.close(theirs)


def test_every_reason_of_a_refusal_has_words_that_complete_a_sentence() -> None:
    dialect = load_dialect()
    car = ConnectedCar(cast(Any, SimpleNamespace(dialect=dialect)))
    reasons = [value for value, entry in dialect.enums["FOLDCAR_REFUSAL"].items() if "ENUM_END" not in entry.name]

    texts = [car.refusal_text(reason) for reason in reasons if reason]

    assert all(text and not text.endswith(".") and text[0].islower() for text in texts)
    assert len(set(texts)) == len(texts) > 30
    assert car.refusal_text(0) is None and car.refusal_text(250) is None


@pytest.mark.parametrize("states", [("NONE",), ("OPEN", "OPEN", "NONE"), ("OPEN", "STORED"), ("OPEN", "OPEN")])
def test_a_flash_that_is_not_ready_is_waited_for_and_that_is_said(states: tuple[str, ...]) -> None:
    dialect = load_dialect()
    arriving = iter(
        SimpleNamespace(get_type=lambda: "FOLDCAR_TRIAL", log=getattr(dialect, f"FOLDCAR_LOG_{state}"))
        for state in states
    )
    connection = SimpleNamespace(wait_for=lambda fits, timeout_s: next(filter(fits, arriving), None))
    lines: list[str] = []

    status = wait_for_storage(cast(Any, SimpleNamespace(dialect=dialect, connection=connection)), lines.append)

    ready = [state for state in states if state != "OPEN"]
    assert (None if status is None else status.log) == (getattr(dialect, f"FOLDCAR_LOG_{ready[0]}") if ready else None)
    assert lines == (["waiting until the car's flash is ready for the next log"] if "OPEN" in states else [])


@pytest.mark.parametrize(
    ("reset_reason", "cause", "addresses", "text"),
    [
        (4, 28, (0x400D1234, 0x400D2342), "load from a forbidden address (0x00000004) at 0x400d1234 0x400d2342"),
        (4, 6, (0x400D1234,), "division by zero at 0x400d1234"),
        (4, 13, (0x400D1234,), "exception 13 at 0x400d1234"),
        (4, 255, (0x400D1234,), "the firmware ended itself at 0x400d1234"),
        (5, 255, (0x400D1234,), "stopped by the interrupt watchdog at 0x400d1234"),
        (6, 255, (0x400D1234,), "stopped by the task watchdog at 0x400d1234"),
        (6, 255, (), "stopped by the task watchdog"),
    ],
)
def test_a_crash_is_described_by_its_cause_and_its_callers(
    reset_reason: int, cause: int, addresses: tuple[int, ...], text: str
) -> None:
    padded = [*addresses, *[0] * 12][:12]

    assert crash_text(load_dialect().MAVLink_foldcar_crash_message(padded, 4, reset_reason, cause)) == text


def test_a_log_that_breaks_off_or_lacks_bytes_is_told() -> None:
    dialect = load_dialect()

    def end(how: str, log_lost: int, lost_bytes: int) -> tuple[str, str | None]:
        message = dialect.MAVLink_foldcar_trial_message(
            20_000, 7, 3_000, 3_000, 0.2, 0.0, dialect.FOLDCAR_STATE_FINISHED, getattr(dialect, f"FOLDCAR_END_{how}"),
            dialect.FOLDCAR_FAULT_NONE, 1, log_lost, dialect.FOLDCAR_LOG_OPEN,
        )  # fmt: skip
        end = drive_end(dialect, message, lost_bytes)
        assert end.elapsed_time_s == 3.0
        return end.ending, end.outcome

    assert end("TIME_LIMIT", 0, 0) == ("time limit, untethered", None)
    assert end("TIME_LIMIT", 12, 40) == ("time limit, untethered, 40 bytes of its log lost", None)
    assert end("STOPPED", 12, 0) == ("stopped, untethered, 12 bytes of its log lost", None)
    assert end("NONE", 0, 0) == ("its log breaks off, untethered", "aborted")
