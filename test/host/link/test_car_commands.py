"""Commands for one car: its identity, its parameters, calibration of its servos, the simulated car of `foldcar link`."""

import os
import pty
import signal
import threading
from pathlib import Path
from typing import Any

import pytest

from foldcar.errors import FoldcarError
from foldcar.link.car import greet
from foldcar.link.parameters import read_parameters
from foldcar.simulation.carsim import Carsim
from foldcar.trials.plugged_car import check_build
from live_car import car_at_port, greeted
from typist import Typist


def test_the_simulated_firmware_is_recognised(carsim_binary: Path) -> None:
    with car_at_port() as car, greeted(car.port) as connected:
        identity = connected.identity()

    check_build(identity, Carsim(carsim_binary).firmware)
    with pytest.raises(FoldcarError, match=f"build {identity.build}, the simulated one is ffff.*--any-build"):
        check_build(identity, "ffff")


@pytest.mark.parametrize(
    ("noise", "sent"), [(b"", "nothing"), (b"hello, this is no car\r\n" * 20, "bytes that are not MAVLink")]
)
def test_a_port_without_a_car_is_reported(noise: bytes, sent: str) -> None:
    ours, theirs = pty.openpty()
    # Opening a port discards earlier input.
    typed = threading.Timer(0.3, os.write, (ours, noise))
    typed.start()
    try:
        with pytest.raises(FoldcarError, match=f"not a car: it sent {sent} for 1 s; .*foldcar flash"):
            greet(os.ttyname(theirs), 1.0)
    finally:
        typed.join()
        os.close(ours)
        os.close(theirs)


def test_parameters_are_listed_and_set(foldcar: Any, refused: Any) -> None:
    with car_at_port() as car:
        port = ("--port", car.port)
        assert foldcar("params", "set", "CH1_NEUTRAL_US", "1512", *port).stdout.split() == ["CH1_NEUTRAL_US", "1512"]
        for name, value, why in (
            ("CH1_NEUTRAL_US", "9999", "refuses 9999: the value is above the parameter's maximum"),
            ("CH1_SIDE", "2", "its car.json sets this parameter"),
            ("CH1_NEUTRAL_US", "1512,5", 'VALUE: "1512,5" is not a number; write it with a decimal point'),
            ("NO_SUCH", "2", "NO_SUCH: the car refuses 2"),
            ("TRIAL_MAX_S", "1e39", "TRIAL_MAX_S: 1e+39 cannot be stored as a 32-bit floating-point number"),
            # A packet would hold the first 16 characters only.
            ("CH1_DEADBAND_US_AND_MORE", "30", "CH1_DEADBAND_US_AND_MORE: not a parameter's name, which has 1 to "),
        ):
            assert why in refused("params", "set", name, value, *port)
        assert refused("params", "get", "trial_max_s", *port).endswith('did you mean "TRIAL_MAX_S"?')
        assert refused("params", "confirm", *port).startswith("the car has a design, W_B_W 95x200 r60: there is nothing")
        listed = dict(line.split() for line in foldcar("params", "get", *port).stdout.splitlines())

    assert len(listed) >= 50 and listed["CH1_NEUTRAL_US"] == "1512" and listed["CH2_NEUTRAL_US"] == "1500"


@pytest.mark.parametrize("turns_as_designed", [True, False])
def test_a_servo_is_calibrated_by_looking_at_it(turns_as_designed: bool, tmp_path: Path) -> None:
    """The person reports the simulated servo's direction at each pulse: it turns outside 1523 ± 28 µs.

    A right wheel's servo is mounted mirrored, so that it drives forward below its neutral; another one is reversed, and
    then drives forward when the car is told to.
    """
    neutral, deadband, above = 1523, 28, "b\n" if turns_as_designed else "f\n"
    below, direction = "f\n" if turns_as_designed else "b\n", -1 if turns_as_designed else 1
    words = ("calibrate-servos", "--servo", "2")
    questions = (" µs: f, b or n? ", "reversed (y or n)? ", "saved in the car")
    with (
        car_at_port(neutral_us=neutral, deadband_us=deadband, direction=direction) as car,
        Typist(tmp_path, *words, "--port", car.port) as person,
    ):
        person.sees("about 9 questions for each of 1 servo.")
        person.sees("Output 2, right")
        asked = 0
        while "saved" not in (seen := person.sees_one_of(*questions)):
            asked += 1
            pulse = int(person.output.rpartition(" µs: f")[0].split()[-1])
            resting = abs(pulse - neutral) <= deadband
            person.types("y\n" if "(y or n)" in seen else "n\n" if resting else above if pulse > neutral else below)
        assert person.ends() == 0 and asked <= 12
        with greeted(car.port) as connected:
            values = read_parameters(connected)

    calibrated = values["CH2_NEUTRAL_US"], values["CH2_DEADBAND_US"]
    assert calibrated == pytest.approx((neutral, deadband), abs=3)
    assert (values["CH2_DIRECTION"], values["CH2_REVERSED"]) == (-1, 0 if turns_as_designed else 1)


@pytest.mark.parametrize("end", [signal.SIGINT, signal.SIGHUP])
def test_posing_as_a_car_ends_clean(tmp_path: Path, free_course: Path, end: signal.Signals) -> None:
    words = ("link", "l.json", "--experiment", "1", "--set", "width=120", "--tcp", "0", "--speedup", "4")
    with Typist(tmp_path, *words) as person:
        port = "tcp:127.0.0.1:" + person.sees_one_of("Ctrl-C ends").split("tcp:127.0.0.1:")[1].split()[0]
        with greeted(port) as car:
            assert car.identity().name == "W_B_W 120x200 r60"
        person.process.send_signal(end)
        assert person.ends() == 130 and "Traceback" not in person.output

    with pytest.raises(FoldcarError, match="Connection refused"):
        greet(port)
