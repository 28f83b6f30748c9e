"""Trials with the real firmware, posing as a car: `foldcar log` and its relatives as a person types them."""

import contextlib
import hashlib
import json
import os
import pty
import signal
import subprocess
import sys
import threading
import time
from collections import Counter
from collections.abc import Iterator
from pathlib import Path
from typing import Any

import pytest

from foldcar.car.body import body_json
from foldcar.car.car_file import car_json
from foldcar.car.design import compose
from foldcar.errors import FoldcarError
from foldcar.link.car import Car, greet
from foldcar.link.mcap_export import export_mcap
from foldcar.link.parameters import read_file
from foldcar.link.simulated_car import SimulatedCar, simulated_car
from foldcar.link.tlog import read_tlog
from foldcar.store.reader import Store
from foldcar.store.trial_records import Trial
from foldcar.trials.identity import check_build
from study_car import empty_scene
from typist import Typist

# A course without obstacles: at 0.69 m/s the goal is 1.45 s away.
PROGRAM = """
model model
ego = new Robot at (0, 0), facing -90 deg
block = new Bump at (0.5, 0.6), facing -90 deg
goal = new Goal at (1.0, 0), facing -90 deg
"""


@pytest.fixture
def listing(tmp_path: Path) -> Path:
    """Two widths on a free course, two samples, 3 s."""
    (tmp_path / "free.scenic").write_text(PROGRAM)
    data = {
        "experiments": {"1": {"veh_id": 1, "env_id": 1, "params": {"timeout": 3, "environments": 2}}},
        "vehicles": {"1": {"type": "W_B_W", "params": [{"common": {"width": [95, 120]}}]}},
        "environments": {"1": {"scenic_filename": "free.scenic", "seed": 1}},
    }
    (tmp_path / "l.json").write_text(json.dumps(data))
    return tmp_path / "l.json"


@contextlib.contextmanager
def car_at_port(
    binary: Path, width: float = 95.0, goal_x_m: float | None = 1.0, tcp: bool = False, **servo: float
) -> Iterator[SimulatedCar]:
    """A simulated car with its goal at ``goal_x_m``; ``servo`` is how its servos really are."""
    design = compose("W_B_W", {"width": width})
    body = body_json(design)
    for wheel in body["wheels"]:
        wheel["servo"].update(servo)
    scene = empty_scene(goal_x_m=goal_x_m)
    port = 0 if tcp else None
    with simulated_car(binary, body, scene, car_json(design), 1.0, port, subprocess.PIPE) as car:
        yield car


def inject(car: SimulatedCar, **what: Any) -> None:
    assert car.process.stdin is not None
    car.process.stdin.write(json.dumps(what) + "\n")
    car.process.stdin.flush()


def trials_in(store: Path) -> list[Trial]:
    with Store.open(store) as opened:
        return list(opened.trials())


def moving(folder: Path) -> bool:
    """Whether the log of the trial that runs shows a car on its way, for two tenths of a second or more."""
    for file in folder.glob("s-logs/*.tlog"):
        log = list(read_tlog(file))
        moved = [t for t, m in log if m.get_type() == "FOLDCAR_TRUTH" and m.speed > 0.1]
        if moved and log[-1][0] - moved[0] >= 200_000:
            return True
    return False


LOG = ("log", "l.json", "--experiment", "1", "--store", "s.db")


def test_a_person_drives_a_trial(tmp_path: Path, listing: Path, carsim_binary: Path) -> None:
    with car_at_port(carsim_binary, goal_x_m=None) as car, Typist(
        tmp_path, *LOG, "--port", car.port, "--countdown", "1"
    ) as person:
        assert "W_B_W 95x200 r60" in person.sees("Measured deviations")
        person.sees("deviation: ")
        person.types("A 5 -3 90\n")
        person.sees("deviation: ")
        person.types("Z 1 2\n")
        person.sees("begins with none of car, A")
        person.types("\n")
        person.sees("Enter starts")
        person.types("\n")
        person.sees("Countdown 1 s")
        person.sees("driving")
        person.watches_until(lambda: moving(tmp_path))
        person.types("s")
        person.sees("stopped by key")
        person.sees("Outcome:")
        person.types("fine\n")
        person.sees("type one of p (passed)")
        person.types("o\n")
        person.sees("Note")
        person.types("hit a chair\n")
        person.sees("Trial 1: off_course")
        # The next one: another sample; none wanted.
        person.sees("Trial 2: sample 1")
        person.sees("deviation: ")
        person.types("\n")
        person.sees("Enter starts")
        person.types("q\n")
        assert person.ends() == 0

    (trial,) = trials_in(tmp_path / "s.db")
    assert (trial.outcome, trial.ending, trial.note, trial.sample) == ("off_course", "stopped by key", "hit a chair", 0)
    assert trial.design["width_mm"] == 95 and trial.firmware_build and trial.design_hash
    assert trial.deviations["A"] == pytest.approx((0.005, -0.003, 1.5707963))
    assert trial.elapsed_time_s is not None and 0.1 < trial.elapsed_time_s < 3
    log = tmp_path / str(trial.log)
    assert hashlib.sha256(log.read_bytes()).hexdigest() == trial.log_sha256
    assert (tmp_path / "s-logs" / "place-1-0.png").read_bytes()[:4] == b"\x89PNG"


def test_a_script_drives_trials_that_other_tools_read(
    tmp_path: Path, listing: Path, carsim_binary: Path, foldcar: Any
) -> None:
    with car_at_port(carsim_binary) as car:
        answer = foldcar(*LOG, "--port", car.port, "--yes", "--countdown", "0", "--trials", "2", "--operator", "Ada")

    assert answer.returncode == 0, answer.stderr
    first, second = trials_in(tmp_path / "s.db")
    assert [(t.outcome, t.ending, t.sample, t.operator) for t in (first, second)] == [
        ("passed", "goal", 0, "Ada"), ("passed", "goal", 1, "Ada"),
    ]  # fmt: skip
    replay = foldcar("trials", "replay", "s.db", "1", "--plot", "pair.png")
    assert replay.returncode == 0 and "both agree" in replay.stdout, replay.stderr
    simulated_s = float(replay.stdout.splitlines()[2].split()[2])
    # The firmware's start is up to a tick later, and its wheels start from rest as they then are.
    assert first.elapsed_time_s == pytest.approx(simulated_s, abs=0.2)

    log = tmp_path / str(first.log)
    kinds = Counter(message.get_type() for _, message in read_tlog(log))
    assert kinds["PARAM_VALUE"] >= 50 and kinds["FOLDCAR_DESIGN"] >= 1
    assert {"COMMAND_LONG", "COMMAND_ACK", "SERVO_OUTPUT_RAW", "HEARTBEAT", "FOLDCAR_TRIAL"} <= set(kinds)
    times = [time_us for time_us, _ in read_tlog(log)]
    assert times == sorted(times) and abs(times[0] / 1e6 - time.time()) < 600
    dump = subprocess.run(
        [sys.executable, "-m", "pymavlink.tools.mavlogdump", str(log)]
        if not (beside := Path(sys.executable).with_name("mavlogdump.py")).is_file()
        else [sys.executable, str(beside), str(log)],
        capture_output=True, text=True, check=True,
        env={key: value for key, value in os.environ.items() if not key.startswith("MAVLINK")},
    ).stdout.splitlines()  # fmt: skip
    assert len(dump) == len(times) and not any("BAD_DATA" in line for line in dump)
    for kind in ("PARAM_VALUE", "COMMAND_LONG", "SERVO_OUTPUT_RAW"):
        assert sum(f" {kind} " in line for line in dump) == kinds[kind]
    check_export(log, tmp_path / "t.mcap")


def check_export(log: Path, file: Path) -> None:
    """Every message of ``log`` is in its MCAP export, under a schema that it keeps."""
    from mcap.reader import make_reader

    count = export_mcap(log, file, {"trial": "1"})

    messages = list(read_tlog(log))
    with file.open("rb") as opened:
        read = list(make_reader(opened).iter_messages())
    told = [(schema, channel, m) for schema, channel, m in read if schema is not None and channel.topic != "/log"]
    assert count == len(told) == len(messages)
    python = {"integer": int, "number": int | float | None, "string": str, "array": list}
    for schema, channel, message in told:
        properties, content = json.loads(schema.data)["properties"], json.loads(message.data)
        assert channel.topic.endswith(schema.name) and set(properties) == set(content)
        for name, value in content.items():
            assert isinstance(value, python[properties[name]["type"]]), (channel.topic, name)
    truth = [m for _, m in messages if m.get_type() == "FOLDCAR_TRUTH"]
    places = [json.loads(m.data)["x"] for _, c, m in told if c.topic == "/simulator/FOLDCAR_TRUTH"]
    assert places == [m.x for m in truth]


def test_a_pulled_cable_aborts_the_trial_and_keeps_what_was_received(
    tmp_path: Path, listing: Path, carsim_binary: Path
) -> None:
    with (
        car_at_port(carsim_binary, goal_x_m=None) as car,
        Typist(tmp_path, *LOG, "--port", car.port, "--countdown", "0", "--deviation", "car 0 0") as person,
    ):
        person.sees("Enter starts")
        person.types("\n")
        person.watches_until(lambda: moving(tmp_path))
        inject(car, inject="unplug", for_s=1.5)
        person.sees("Trial 1: aborted")
        (trial,) = trials_in(tmp_path / "s.db")
        assert (trial.outcome, trial.ending) == ("aborted", "link lost")
        person.sees("Plug the car in")
        # Its port has another name now; its fault, that the host was silent, has to be acknowledged.
        assert car.process.stdout is not None
        lines = (json.loads(line) for line in car.process.stdout)
        person.types(next(line["port"] for line in lines if "port" in line) + "\n")
        person.sees("fault     The host was silent")
        person.types("y\n")
        person.sees("Enter starts")
        person.types("\n")
        person.sees("Outcome")
        person.types("i\n")
        person.sees("Note")
        person.types("\n")
        person.sees("Trial 2: timeout")
        person.sees("Enter starts")
        person.types("q\n")
        assert person.ends() == 0

    first, second = trials_in(tmp_path / "s.db")
    assert (second.outcome, second.ending, second.elapsed_time_s) == ("timeout", "time limit", pytest.approx(3, abs=0.05))
    pulses = [m.servo1_raw for _, m in read_tlog(tmp_path / str(first.log)) if m.get_type() == "SERVO_OUTPUT_RAW"]
    assert pulses[-1] > 0


def test_a_killed_program_loses_nothing_it_received(
    tmp_path: Path, listing: Path, carsim_binary: Path, foldcar: Any
) -> None:
    with car_at_port(carsim_binary, goal_x_m=None) as car:
        with Typist(tmp_path, *LOG, "--port", car.port, "--countdown", "0", "--yes") as person:
            person.watches_until(lambda: moving(tmp_path))
            person.process.kill()
            person.process.wait()
        (trial,) = trials_in(tmp_path / "s.db")
        log = tmp_path / str(trial.log)
        before = log.read_bytes()
        assert (trial.outcome, trial.ending, trial.log_sha256) == ("aborted", "running", None)
        assert [m for _, m in read_tlog(log) if m.get_type() == "SERVO_OUTPUT_RAW"][-1].servo1_raw > 0
        await_fault(car.port)

        again = foldcar(*LOG, "--port", car.port, "--countdown", "0", "--yes")

    assert again.returncode == 0, again.stderr
    assert "Trial 1 was interrupted" in again.stdout and "fault     The host was silent" in again.stdout
    first, second = trials_in(tmp_path / "s.db")
    assert (first.outcome, first.ending) == ("aborted", "the program was ended")
    assert first.log_sha256 == hashlib.sha256(before).hexdigest() and log.read_bytes() == before
    assert second.outcome == "timeout"


def await_fault(port: str) -> None:
    """Wait until the car has latched a fault: half a second of its clock after the last sign of a host's life."""
    for _ in range(100):
        # To look is a sign of life too.
        time.sleep(1.0)
        watcher = greet(port)
        state = watcher.state()
        watcher.connection.close()
        if state == watcher.dialect.FOLDCAR_STATE_FAULT:
            return
    pytest.fail("the car does not notice that its host is gone")


def test_a_car_that_still_drives_an_earlier_trial_is_stopped_first(
    tmp_path: Path, listing: Path, carsim_binary: Path, foldcar: Any
) -> None:
    with car_at_port(carsim_binary, goal_x_m=None) as car:
        before = greet(car.port)
        before.arm()
        # Untethered, so that it drives on however long the next program takes to start.
        before.start_trial(0.1, 0.0, 30.0, 77, untethered=True)
        before.connection.close()
        answer = foldcar(*LOG, "--port", car.port, "--countdown", "0", "--yes")

    assert answer.returncode == 0, answer.stderr
    assert "driving   an earlier trial, which is stopped now\n" in answer.stdout and "fault " not in answer.stdout
    (trial,) = trials_in(tmp_path / "s.db")
    assert (trial.outcome, trial.ending) == ("timeout", "time limit")


def test_a_board_that_restarts_aborts_the_trial(
    tmp_path: Path, listing: Path, carsim_binary: Path
) -> None:
    with (
        car_at_port(carsim_binary, goal_x_m=None) as car,
        Typist(tmp_path, *LOG, "--port", car.port, "--countdown", "0", "--yes") as person,
    ):
        person.watches_until(lambda: moving(tmp_path))
        inject(car, inject="brown_out")
        person.ends()

    (trial,) = trials_in(tmp_path / "s.db")
    assert (trial.outcome, trial.ending) == ("aborted", "the car restarted")


def test_a_full_disk_stops_the_car(tmp_path: Path, listing: Path, carsim_binary: Path) -> None:
    with car_at_port(carsim_binary, goal_x_m=None) as car:
        process = subprocess.run(
            [sys.executable, "-c", f"import resource; from foldcar.link import tlog\n{SHORT_LOG}", *LOG,
             "--port", car.port, "--countdown", "0", "--yes"],
            cwd=tmp_path, capture_output=True, text=True, check=False,
        )  # fmt: skip
        watcher = greet(car.port)
        state, pulses = watcher.state(), watcher.request("SERVO_OUTPUT_RAW").servo1_raw
        watcher.connection.close()

    assert process.returncode == 2
    assert process.stderr.startswith("foldcar: error: s-logs/trial-0001-") and "No space left on device" in process.stderr
    assert state in (watcher.dialect.FOLDCAR_STATE_DISARMED, watcher.dialect.FOLDCAR_STATE_FINISHED) and pulses == 0
    (trial,) = trials_in(tmp_path / "s.db")
    assert (trial.outcome, trial.ending) == ("aborted", "log could not be written")
    assert len(list(read_tlog(tmp_path / str(trial.log)))) > 100


# A hundred packets after the command to start (31010), no file may grow any more: to the log, the disk is full.
SHORT_LOG = """
write, since = tlog.TlogWriter.write, []
def limited(self, packet, time_us=None):
    if since or (31010).to_bytes(2, 'little') in packet:
        since.append(packet)
    if len(since) > 100:
        resource.setrlimit(resource.RLIMIT_FSIZE, (self._size + 5, resource.RLIM_INFINITY))
    try:
        write(self, packet, time_us)
    finally:
        resource.setrlimit(resource.RLIMIT_FSIZE, (resource.RLIM_INFINITY, resource.RLIM_INFINITY))
tlog.TlogWriter.write = limited
from foldcar.cli import main
main()
"""


def test_another_design_is_refused_and_does_not_move(
    tmp_path: Path, listing: Path, carsim_binary: Path, foldcar: Any
) -> None:
    with car_at_port(carsim_binary, width=150.0) as car:
        answer = foldcar(*LOG, "--port", car.port, "--yes")
        other = foldcar("params", "get", "TRACK_M", "--port", car.port)

    assert answer.returncode == 2
    assert "the car is W_B_W 150x200 r60" in answer.stderr and "not one of the 2 of experiment 1" in answer.stderr
    assert "foldcar flash" in answer.stderr and answer.stderr.count("\n") == 1
    assert not (tmp_path / "s.db").exists() and not (tmp_path / "s-logs").exists()
    assert float(other.stdout.split()[1]) == pytest.approx(body_json(compose("W_B_W", {"width": 150.0}))["track_m"])


def test_the_simulated_firmware_is_recognised(carsim_binary: Path) -> None:
    from foldcar.simulation.carsim import Carsim

    with car_at_port(carsim_binary) as car:
        connected = greet(car.port)
        identity = connected.identity()
        connected.connection.close()

    check_build(identity, Carsim(carsim_binary).firmware)
    with pytest.raises(FoldcarError, match=f"build {identity.build}, simulated is ffff.*--any-build"):
        check_build(identity, "ffff")


@pytest.mark.parametrize(
    ("noise", "said"), [(b"", "says nothing"), (b"hello, this is no car\r\n" * 20, "sends what is no MAVLink")]
)
def test_a_port_that_is_no_car_is_told(noise: bytes, said: str) -> None:
    ours, theirs = pty.openpty()
    # Opening a port throws away what came before.
    typed = threading.Timer(0.3, os.write, (ours, noise))
    typed.start()
    try:
        with pytest.raises(FoldcarError, match=f"is no car: it {said} for 1 s; .*foldcar flash"):
            greet(os.ttyname(theirs), 1.0)
    finally:
        typed.join()
        os.close(ours)
        os.close(theirs)


def test_parameters_are_saved_compared_and_restored(tmp_path: Path, carsim_binary: Path, foldcar: Any) -> None:
    with car_at_port(carsim_binary) as car:
        port = ("--port", car.port)
        assert foldcar("params", "save", "p.parm", *port).returncode == 0
        assert foldcar("params", "set", "CH1_NEUTRAL_US", "1512", *port).stdout.split() == ["CH1_NEUTRAL_US", "1512"]
        differing = foldcar("params", "diff", "p.parm", *port).stdout
        refused = foldcar("params", "set", "CH1_NEUTRAL_US", "9999", *port)
        fixed = foldcar("params", "set", "CH1_SIDE", "2", *port)
        unknown = foldcar("params", "set", "NO_SUCH", "2", *port)
        restored = foldcar("params", "load", "p.parm", *port)
        same = foldcar("params", "diff", "p.parm", *port).stdout

    saved = read_file(tmp_path / "p.parm")
    assert len(saved) >= 50 and saved["CH1_NEUTRAL_US"] == 1500
    assert "CH1_NEUTRAL_US           1512         1500" in differing and "1 of" in differing
    reasons = ("it stays 1512", "is set by car.json", "NO_SUCH: the car refuses 2")
    for answer, why in zip((refused, fixed, unknown), reasons, strict=True):
        assert answer.returncode == 2 and why in answer.stderr and answer.stderr.count("\n") == 1, answer.stderr
    assert restored.stdout.splitlines()[0].split() == ["CH1_NEUTRAL_US", "1500"]
    assert same.startswith("0 of")


def test_a_servo_is_calibrated_by_looking_at_it(tmp_path: Path, carsim_binary: Path) -> None:
    """The person sees what the simulated servo does at each pulse: it turns outside 1523 ± 28 µs."""
    neutral, deadband = 1523, 28
    words = ("calibrate-servos", "--output", "2")
    with (
        car_at_port(carsim_binary, neutral_us=neutral, deadband_us=deadband) as car,
        Typist(tmp_path, *words, "--port", car.port) as person,
    ):
        person.sees("Output 2, right")
        while "saved" not in person.sees_one_of(" µs: f, b or n? ", "saved in the car"):
            pulse = int(person.said.rpartition(" µs: f")[0].split()[-1])
            # A right wheel's servo is mounted mirrored: it drives forward below its neutral.
            person.types("n\n" if abs(pulse - neutral) <= deadband else "b\n" if pulse > neutral else "f\n")
        assert person.ends() == 0
        connected = greet(car.port)
        found = values_of(connected, "CH2_NEUTRAL_US", "CH2_DEADBAND_US")
        connected.connection.close()

    assert found == pytest.approx([neutral, deadband], abs=2)


def values_of(car: Car, *names: str) -> list[float]:
    from foldcar.link.parameters import read_parameters

    values = read_parameters(car)
    return [values[name] for name in names]


def test_an_untethered_car_brings_its_log_home(
    tmp_path: Path, listing: Path, carsim_binary: Path
) -> None:
    with (
        car_at_port(carsim_binary, goal_x_m=None, tcp=True) as car,
        Typist(tmp_path, *LOG, "--port", car.port, "--countdown", "0", "--yes", "--untethered") as person,
    ):
        person.watches_until(lambda: moving(tmp_path))
        inject(car, inject="unplug", for_s=4)
        assert person.ends() == 0, person.said

    (trial,) = trials_in(tmp_path / "s.db")
    assert (trial.outcome, trial.ending) == ("timeout", "time limit, untethered")
    assert trial.elapsed_time_s == pytest.approx(3, abs=0.05)
    log = list(read_tlog(tmp_path / str(trial.log)))
    assert [time_us for time_us, _ in log] == sorted(time_us for time_us, _ in log)
    drive = [(t, m) for t, m in log if m.get_type() == "FOLDCAR_TRIAL" and m.trial_id == trial.id and m.end == 0]
    elapsed = [m.elapsed_ms / 1000 for _, m in drive]
    assert max(elapsed) > 2.5 and max(b - a for a, b in zip(sorted(elapsed), sorted(elapsed)[1:], strict=False)) < 0.25
    # The car's clock, moved onto ours, agrees with what was heard of it live.
    offsets = [t / 1e6 - m.elapsed_ms / 1000 for t, m in drive]
    assert max(offsets) - min(offsets) < 0.5


@pytest.mark.parametrize("end", [signal.SIGINT, signal.SIGTERM, signal.SIGHUP])
def test_posing_as_a_car_ends_clean(
    tmp_path: Path, listing: Path, carsim_binary: Path, end: signal.Signals
) -> None:
    words = ("link", "l.json", "--experiment", "1", "--set", "width=120", "--tcp", "0", "--speedup", "4")
    with Typist(tmp_path, *words) as person:
        port = "tcp:127.0.0.1:" + person.sees_one_of("Ctrl-C ends").split("tcp:127.0.0.1:")[1].split()[0]
        car = greet(port)
        assert car.identity().name == "W_B_W 120x200 r60"
        car.connection.close()
        person.process.send_signal(end)
        assert person.ends() == 0 and "Traceback" not in person.said

    with pytest.raises(FoldcarError, match="Connection refused"):
        greet(port)


def test_ctrl_c_stops_the_car_and_aborts_the_trial(tmp_path: Path, listing: Path, carsim_binary: Path) -> None:
    with car_at_port(carsim_binary, goal_x_m=None) as car:
        with Typist(tmp_path, *LOG, "--port", car.port, "--countdown", "0", "--yes") as person:
            person.watches_until(lambda: moving(tmp_path))
            person.process.send_signal(signal.SIGINT)
            assert person.ends() == 130 and "Traceback" not in person.said
        watcher = greet(car.port)
        state, pulses = watcher.state(), watcher.request("SERVO_OUTPUT_RAW").servo1_raw
        watcher.connection.close()

    assert state == watcher.dialect.FOLDCAR_STATE_DISARMED and pulses == 0
    (trial,) = trials_in(tmp_path / "s.db")
    assert (trial.outcome, trial.ending) == ("aborted", "Ctrl-C") and trial.log_sha256 is not None
