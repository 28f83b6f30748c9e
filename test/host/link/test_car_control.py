"""Who may set a car in motion, and when: over the port of `carsim link`, with the real firmware."""

import signal
import subprocess
import time
from collections.abc import Callable
from pathlib import Path
from typing import Any

import pytest

from foldcar.errors import FoldcarError
from foldcar.link.car import CommandRefusedError, greet
from foldcar.link.car_logs import list_logs
from foldcar.link.connection import HOST_COMPONENT, HOST_SYSTEM
from foldcar.link.parameters import set_parameter
from link_client import Car, mavlink
from live_car import car_at_port, greeted

ARM, START = mavlink.MAV_CMD_COMPONENT_ARM_DISARM, mavlink.MAV_CMD_FOLDCAR_START_TRIAL
ACCEPTED, NOT_NOW = mavlink.MAV_RESULT_ACCEPTED, mavlink.MAV_RESULT_TEMPORARILY_REJECTED
HELD, LATE = mavlink.FOLDCAR_REFUSAL_HELD, mavlink.FOLDCAR_REFUSAL_LATE


def test_two_hosts_at_once_and_only_the_one_that_armed_drives() -> None:
    with car_at_port() as simulated:
        ours = greet(simulated.port)
        # A second program on the same wire, as behind a router: another system, on the same port.
        other = ours.dialect.MAVLink(None, srcSystem=200, srcComponent=7)

        def sends(*messages: Any) -> None:
            for message in messages:
                ours.connection.stream.write(message.pack(other))
                other.seq = (other.seq + 1) % 256

        def command(number: int, *values: float) -> Any:
            filled = (*values, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0)[:7]
            sends(other.heartbeat_encode(6, 8, 0, 0, 0), other.heartbeat_encode(6, 8, 0, 0, 0))
            sends(other.command_long_encode(1, 1, number, 0, *filled))
            ack = ours.connection.wait_for(
                lambda m: m.get_type() == "COMMAND_ACK" and m.target_system == 200 and m.command == number, 30.0
            )
            assert ack is not None
            return ack

        ours.arm()
        assert ours.connection.status_text == f"armed by host {HOST_SYSTEM}/{HOST_COMPONENT}"
        for number, value in ((START, 0.2), (ARM, 1.0), (mavlink.MAV_CMD_ACTUATOR_TEST, 0.1)):
            refused = command(number, value, 0.0, 5.0)
            assert (refused.result, refused.result_param2) == (NOT_NOW, HELD)
            assert ours.connection.status_text == f"refused: host {HOST_SYSTEM}/{HOST_COMPONENT} holds the car"
        ours.start_trial(0.1, 0.0, 20.0, 3)
        assert command(mavlink.MAV_CMD_FOLDCAR_STOP_TRIAL).result == ACCEPTED
        assert ours.connection.status_text == "stopped by host 200/7"

        assert command(ARM, 1).result == ACCEPTED
        with pytest.raises(
            CommandRefusedError, match=r"refuses to arm: another host has armed it \(host 200/7 holds the car\)$"
        ):
            ours.arm()
        with pytest.raises(FoldcarError, match=r"STAGGER_MS: the car refuses 50: another host has armed it$"):
            set_parameter(ours, "STAGGER_MS", 50.0)
        ours.disarm()
        assert ours.connection.status_text == f"disarmed by host {HOST_SYSTEM}/{HOST_COMPONENT}"
        ours.arm()
        ours.connection.close()


def test_a_start_that_waited_in_a_stopped_car_is_refused(start: Callable[..., Car], tmp_path: Path) -> None:
    record = tmp_path / "record.jsonl"
    car = start("--record", str(record))
    car.connect()
    assert car.command(ARM, 1) == ACCEPTED
    car.process.send_signal(signal.SIGSTOP)
    for _ in range(3):
        car.show_life()
    car.client.mav.command_long_send(1, 1, START, 0, 0.2, 0, 20, 1, 9, 0, 0)
    time.sleep(2.0)
    car.process.send_signal(signal.SIGCONT)

    ack = car.wait_for("COMMAND_ACK", lambda message: message.command == START)

    assert (ack.result, ack.result_param2) == (NOT_NOW, LATE)
    for _ in range(10):
        assert car.wait_for("FOLDCAR_TRIAL", lambda message: True).state == mavlink.FOLDCAR_STATE_ARMED
    assert car.command(START, 0.2, 0, 20, 1, 10) == ACCEPTED
    car.wait_for("FOLDCAR_TRIAL", lambda message: message.state == mavlink.FOLDCAR_STATE_RUNNING)
    words = car.words
    assert car.end() == 0
    again = subprocess.run([*words, "--replay", str(record)], capture_output=True, check=True)
    assert b"to_car_late" in again.stdout and again.stdout == record.read_bytes()


def test_a_car_without_a_design_arms_only_when_that_is_confirmed(
    start: Callable[..., Car], tmp_path: Path, foldcar: Any
) -> None:
    (tmp_path / "params.json").unlink()
    car = start()
    car.connect()
    car.show_life()
    assert car.wait_for("STATUSTEXT", lambda message: True).text == "fault: no car.json"
    beat = car.wait_for("HEARTBEAT", lambda message: message.type == mavlink.MAV_TYPE_GROUND_ROVER)
    assert beat.system_status == mavlink.MAV_STATE_CRITICAL
    assert car.command(ARM, 1) == NOT_NOW
    acknowledge = mavlink.MAV_CMD_FOLDCAR_ACKNOWLEDGE_FAULT
    assert car.command(acknowledge) == NOT_NOW
    car.client.close()
    car.client = None

    refused = foldcar("calibrate-servos", "--port", car.port, "--servo", "1", input="n\n")
    confirmed = foldcar("params", "confirm", "--port", car.port)

    assert refused.returncode == 2 and "a fault is not acknowledged (There is no car.json" in refused.stderr
    assert confirmed.returncode == 0, confirmed.stderr
    assert confirmed.stdout.startswith("acknowledged: There is no car.json")
    assert "TRACK_M          0.111" in confirmed.stdout
    car.connect()
    assert car.command(ARM, 1) == ACCEPTED
    assert car.command(START, 0.2, 0, 20, 0, 1) == ACCEPTED


def test_a_refused_design_is_named_when_arming_is_refused(start: Callable[..., Car], tmp_path: Path) -> None:
    (tmp_path / "car.json").write_text('{"format": 1, "name": "w95"')
    with greeted(start("--design", str(tmp_path / "car.json")).port) as car:
        assert car.request("FOLDCAR_DESIGN").source == car.dialect.FOLDCAR_DESIGN_SOURCE_REFUSED
        if car.connection.status_text != "car.json: is not a JSON object":
            reply = car.connection.wait_for(lambda message: message.get_type() == "STATUSTEXT", 30.0)
            assert reply is not None and reply.text == "car.json: is not a JSON object"
        car.acknowledge_fault()

        with pytest.raises(
            CommandRefusedError, match=r"refuses to arm: its car.json is refused \(car.json: is not a JSON object\)$"
        ):
            car.arm()


def test_while_wheels_turn_a_car_says_why_it_lists_no_logs_and_sets_nothing(start: Callable[..., Car]) -> None:
    with greeted(start().port) as car:
        car.arm()
        car.start_trial(0.1, 0.0, 30.0, 3)

        with pytest.raises(FoldcarError, match="does not list its logs; it says: refused: logs are not read or erased"):
            list_logs(car)
        with pytest.raises(FoldcarError, match=r"refuses 50: its wheels are driven already$"):
            set_parameter(car, "STAGGER_MS", 50.0)

        car.stop_trial()
        assert list_logs(car) == []
        set_parameter(car, "STAGGER_MS", 50.0)
