"""`carsim link` as a program: a car to any MAVLink client, repeatable to the byte, with faults on request."""

import json
import subprocess
import time
from collections.abc import Callable
from pathlib import Path
from typing import Any

import pytest

from foldcar.simulation.carsim import Carsim
from link_client import Car, mavlink, write_car_files

SERVO_FIELDS = [f"servo{n}_raw" for n in range(1, 9)]


def has_pulses(message: Any) -> bool:
    return any(getattr(message, field) for field in SERVO_FIELDS)


def test_a_client_gets_every_parameter_and_what_it_sets(start: Callable[..., Car], carsim_binary: Path) -> None:
    car = start()
    client = car.connect()
    client.param_fetch_all()
    values: dict[str, float] = {}
    table = Carsim(carsim_binary).parameter_table()
    while len(values) < len(table):
        message = client.recv_match(type="PARAM_VALUE", blocking=True, timeout=100)
        assert message is not None, f"only {len(values)} of {len(table)}"
        values[message.param_id] = message.param_value
    assert set(values) == set(table)

    client.param_set_send("STAGGER_MS", 55.0)
    assert client.recv_match(type="PARAM_VALUE", blocking=True, timeout=100).param_value == 55.0
    client.param_set_send("STAGGER_MS", -1.0)
    assert client.recv_match(type="PARAM_VALUE", blocking=True, timeout=100).param_value == 55.0


def test_a_trial_ends_like_the_same_run_in_a_batch(
    start: Callable[..., Car], carsim_binary: Path, tmp_path: Path
) -> None:
    parameters = json.loads((tmp_path / "params.json").read_text())
    car = start("--put-back")
    car.connect()
    settings = {"id": "r", "body": "car", "scene": "bump", "speed_m_s": 0.3, "time_limit_s": 20}
    run = {"run": {**settings, "parameters": parameters}}
    lines = [(tmp_path / "body.json").read_text(), (tmp_path / "scene.json").read_text(), json.dumps(run)]
    batch = subprocess.run([carsim_binary, "batch"], input="\n".join(lines), capture_output=True, text=True, check=True)
    expected = json.loads(batch.stdout)
    assert expected["outcome"] == "passed"

    for trial in (3, 4):
        car.drive(0.3, 0.0, 20.0, 0, trial)
        truth = car.wait_for("FOLDCAR_TRUTH", lambda message: message.outcome != 0)
        assert truth.trial_id == trial
        assert truth.outcome == mavlink.FOLDCAR_OUTCOME_PASSED
        # The commands come at any moment of the tick and of the car's coming to rest.
        assert truth.outcome_time == pytest.approx(expected["elapsed_time_s"], abs=0.1)
        assert car.command(mavlink.MAV_CMD_FOLDCAR_STOP_TRIAL) == mavlink.MAV_RESULT_ACCEPTED
        state = car.wait_for("FOLDCAR_TRIAL", lambda message: message.state == mavlink.FOLDCAR_STATE_FINISHED)
        assert state.end == mavlink.FOLDCAR_END_STOPPED and state.trial_id == trial


def test_pulses_stop_within_half_a_second_of_link_loss(start: Callable[..., Car], tmp_path: Path) -> None:
    parameters = json.loads((tmp_path / "params.json").read_text())
    del parameters["CMD_TIMEOUT_MS"]
    (tmp_path / "params.json").write_text(json.dumps(parameters))
    # Above 1 the simulation waits for this process, if the machine is busy.
    car = start("--speedup", "1.001")
    car.connect()
    car.drive(0.2, 0.0, 20.0, 0, 1)
    car.wait_for("SERVO_OUTPUT_RAW", has_pulses)
    car.show_life()
    last_with_pulses = car.wait_for("SERVO_OUTPUT_RAW", has_pulses, alive=False)
    first_off = car.wait_for("SERVO_OUTPUT_RAW", lambda message: not has_pulses(message), alive=False)
    assert 0 < first_off.time_usec - last_with_pulses.time_usec <= 520_000  # a tick for the last sign of life
    trial = car.wait_for("FOLDCAR_TRIAL", lambda message: message.state == mavlink.FOLDCAR_STATE_FAULT)
    assert trial.fault == mavlink.FOLDCAR_FAULT_COMMAND_STALE


def test_faults_stop_the_car_and_are_reported(start: Callable[..., Car]) -> None:
    car = start()
    car.connect()
    for injection, fault in [
        ({"inject": "bus_error", "for_s": 0.1}, mavlink.FOLDCAR_FAULT_BUS),
        ({"inject": "battery", "volts": 3.0, "for_s": 1.0}, mavlink.FOLDCAR_FAULT_BATTERY_LOW),
        ({"inject": "battery_unreadable", "for_s": 0.5}, mavlink.FOLDCAR_FAULT_BATTERY_UNREADABLE),
        ({"inject": "imu_error", "for_s": 0.1}, mavlink.FOLDCAR_FAULT_IMU),
        ({"inject": "brown_out"}, mavlink.FOLDCAR_FAULT_BROWN_OUT),
        ({"inject": "watchdog"}, mavlink.FOLDCAR_FAULT_WATCHDOG),
        ({"inject": "crash"}, mavlink.FOLDCAR_FAULT_CRASH),
    ]:
        car.drive(0.05, 0.0, 20.0, 0, 1)
        car.wait_for("SERVO_OUTPUT_RAW", has_pulses)
        assert "injected" in car.inject(**injection)
        state = car.wait_for("FOLDCAR_TRIAL", lambda message: message.state == mavlink.FOLDCAR_STATE_FAULT)
        assert state.fault == fault
        car.wait_for("SERVO_OUTPUT_RAW", lambda message: not has_pulses(message))
        time.sleep(1.1)  # until the battery is itself again
        assert car.command(mavlink.MAV_CMD_FOLDCAR_ACKNOWLEDGE_FAULT) == mavlink.MAV_RESULT_ACCEPTED


def test_a_client_may_go_and_another_one_come(start: Callable[..., Car]) -> None:
    car = start()
    for _ in range(3):
        client = car.connect()
        client.close()
        time.sleep(0.2)
    client = car.connect()
    first = client.recv_match(type="SERVO_OUTPUT_RAW", blocking=True, timeout=100)
    second = client.recv_match(type="SERVO_OUTPUT_RAW", blocking=True, timeout=100)
    assert 0 < second.time_usec - first.time_usec < 25_000


def test_an_unplugged_cable_comes_back_under_another_name(start: Callable[..., Car]) -> None:
    car = start()
    car.connect()
    car.inject(inject="unplug", for_s=0.5)
    car.port = str(car.line()["port"])
    car.connect()


def test_a_wrong_line_is_answered_and_the_car_goes_on(start: Callable[..., Car]) -> None:
    car = start()
    assert car.inject(inject="earthquake")["error"].startswith("line.inject: ")
    assert "volts" in car.inject(inject="battery")["error"]
    assert "share" in car.inject(inject="drop", share=2)["error"]
    car.connect()


def test_a_record_replays_to_the_same_bytes(start: Callable[..., Car], tmp_path: Path) -> None:
    record = tmp_path / "record.jsonl"
    car = start("--record", str(record))
    car.connect()
    car.drive(0.3, 0.2, 20.0, 1, 5)
    car.inject(inject="corrupt", share=0.05, for_s=0.5)
    car.wait_for("FOLDCAR_TRUTH", lambda message: message.x > 0.2)
    car.inject(inject="brown_out")
    car.wait_for("FOLDCAR_TRIAL", lambda message: message.fault == mavlink.FOLDCAR_FAULT_BROWN_OUT)
    words = car.words
    assert car.end() == 0

    again = subprocess.run([*words, "--replay", str(record)], capture_output=True, check=True)

    assert again.stdout == record.read_bytes()
    assert again.stdout.count(b"from_car") > 30


@pytest.mark.parametrize(
    ("options", "problem"),
    [
        (["--pty", "--tcp", "0"], "needs one of --pty, --tcp PORT and --replay FILE"),
        (["--tcp", "70000"], "--tcp: 70000 is not a number from 0"),
        (["--pty", "--colour", "red"], "unknown option --colour"),
        (["--pty", "--design", "none.json"], "none.json: cannot be read"),
        (["--pty", "--record", "/nowhere/record"], "/nowhere/record: cannot be written"),
    ],
)
def test_wrong_options_are_refused_in_one_line(
    carsim_binary: Path, tmp_path: Path, options: list[str], problem: str
) -> None:
    write_car_files(tmp_path)
    words = [carsim_binary, "link", "--body", tmp_path / "body.json", "--scene", tmp_path / "scene.json", *options]
    done = subprocess.run(words, capture_output=True, text=True, timeout=100, check=False)
    assert done.returncode == 2
    assert problem in done.stderr.splitlines()[0]
    assert done.stdout == ""


def test_a_wrong_file_is_named_with_its_key(carsim_binary: Path, tmp_path: Path) -> None:
    write_car_files(tmp_path)
    (tmp_path / "params.json").write_text('{"TRACK_M": 9}')
    words = [carsim_binary, "link", "--pty", "--body", tmp_path / "body.json", "--scene", tmp_path / "scene.json"]
    done = subprocess.run([*words, "--params", tmp_path / "params.json"], capture_output=True, text=True, check=False)
    assert done.returncode == 2
    assert done.stderr == f"carsim: {tmp_path / 'params.json'}: TRACK_M is above its maximum: 9\n"
