"""Connects to a car, checks it before a trial, and connects again after its cable was unplugged.

Input: ports, a car's identity and parameters, answers of the person beside it. Output: the connected car, its design, and
how an untethered drive ended. Raises FoldcarError with a remedy.
"""

import contextlib
import time
from collections.abc import Mapping
from pathlib import Path
from typing import Any

from foldcar.car.body import body_json, design_hash
from foldcar.car.design import Design
from foldcar.errors import FoldcarError
from foldcar.link.car import ANSWER_S, CarIdentity, CommandRefusedError, ConnectedCar, NoCarError, greet
from foldcar.link.parameters import equal_float32, read_parameters, set_parameter
from foldcar.link.stream import SERIAL_PATHS, LinkLostError, choose_port
from foldcar.scenes.fingerprint import scene_name
from foldcar.simulation.carsim import Carsim
from foldcar.study.experiments import TRIAL_LIMIT, Experiment
from foldcar.study.family import Family
from foldcar.trials.cars_log import merge_cars_log
from foldcar.trials.drive_end import DriveEnd
from foldcar.trials.erasing import erase_stored_logs
from foldcar.trials.faults import acknowledge_faults, fault_line
from foldcar.trials.person import PersonAnswers, print_line, print_warning

SIMULATED_TEXT = "SIMULATED CAR"
# If nobody is asked: how long to wait for an untethered car after its time limit.
RECONNECT_TIMEOUT_S = 60.0

# Suffixes of parameters that may differ from the design's, because they depend on servos and board.
CALIBRATED = (
    "_REVERSED", "_NEUTRAL_US", "_DEADBAND_US", "_GAIN_US",
    "PWM_OSC_HZ", "OE_WIRED", "BUTTON_WIRED", "SERVO_DIVIDER", "SERVO_MIN_V",
)  # fmt: skip


class PluggedCar:
    """The connection to a car, which may break; ``car`` is None if no car is connected."""

    def __init__(self) -> None:
        self.car: ConnectedCar | None = None
        self._port = ""
        self._has_fetched_log = False

    @property
    def connected(self) -> ConnectedCar:
        """The connected car; a car must be connected."""
        assert self.car is not None
        return self.car

    def connect(self, port: str) -> None:
        """Connect to the car at a port. Raises FoldcarError."""
        self.car, self._port = greet(port), port

    def close(self) -> None:
        """Close the connection; it must not be used afterwards."""
        car, self.car = self.car, None
        if car is not None:
            car.connection.close()

    def connect_again(self, typed_port: str) -> None:
        """Connect at the typed port or, if it is "", at the last one; if that is gone, detect the new one.

        Raises FoldcarError.
        """
        port = typed_port or self._port
        if not typed_port and port.startswith(SERIAL_PATHS) and not Path(port).exists():
            port = choose_port(None)
        self.close()
        self.connect(port)

    def collect(
        self, number: int, log: Path, time_limit_s: float, answers: PersonAnswers | None, identity: CarIdentity
    ) -> DriveEnd:
        """Wait until a car that drove without its cable is plugged in again, and fetch its log of trial ``number``.

        The car's log is merged into the file ``log``. If ``answers`` is not None, a person says when to try and when to
        give up. Otherwise this tries to connect every second until a timeout.
        """
        end_s = time.monotonic() + time_limit_s + RECONNECT_TIMEOUT_S
        question = "The car drives on. When it has stopped, plug it in and press Enter, or type its port; q gives up: "
        while True:
            answer = "" if answers is None else answers.line(question)
            if answer.lower() == "q":
                return DriveEnd("did not come back", "aborted", None)
            try:
                self.connect_again(answer)
                require_same_car(self.connected, identity)
                if self.connected.is_under_way(self.connected.request("FOLDCAR_TRIAL")):
                    raise LinkLostError("the car still drives, counts or waits for its button")
                end = merge_cars_log(self.connected, number, log, print_line)
                self._has_fetched_log = True
                return end
            except FoldcarError as error:
                if answers is not None:
                    print_warning(error)
                elif time.monotonic() > end_s:
                    return DriveEnd("did not come back", "aborted", None, error)
            time.sleep(1.0)

    def offer_to_erase_logs(self, store: Path, answers: PersonAnswers | None) -> None:
        """Ask whether the car's logs are to be erased, if this session has stored one of them.

        Without ``answers``, they stay. An error is printed only, because all trials are stored.
        """
        if not self._has_fetched_log or answers is None or self.car is None:
            return
        question = "Compare the car's logs with the store, and erase them if all are stored? [y/N]: "
        if answers.line(question).lower() in ("y", "yes"):
            try:
                erase_stored_logs(self.car, store, None)
            except FoldcarError as error:
                print_warning(error)


def welcome(
    car: ConnectedCar,
    experiment: Experiment,
    family: Family,
    carsim: Carsim,
    answers: PersonAnswers | None,
    any_build: bool,
) -> tuple[CarIdentity, Design]:
    """Print the car's identity and state, and compare its parameters with the design's.

    If ``answers`` is None, nothing is asked. With ``any_build`` the car's firmware may be of another build than carsim's.
    Raises FoldcarError with a remedy if the car cannot drive the trials.
    """
    identity = car.identity()
    battery = car.battery_v()
    print_line(f"car       {identity.name or 'without a design'} ({identity.hash or 'no car.json'}) at {car.port}")
    print_line(f"firmware  {identity.build}")
    if identity.simulated:
        print_line(f"{SIMULATED_TEXT}: its trials are stored as simulated and do not count as trials of built cars")
    elif identity.simulated is None:
        print_line("its firmware does not say whether it is simulated: its trials do not count until you correct them")
    print_line(f"battery   {'unreadable' if battery is None else f'{battery:.2f} V'}")
    design = design_of(identity, experiment, family)
    if not any_build:
        check_build(identity, carsim.firmware)
    _end_earlier_trial(car)
    for line in acknowledge_faults(car, answers):
        if answers is None:
            print_line(f"fault     {line}")
    values, table = read_parameters(car), carsim.parameter_table()
    body = body_json(design)
    print_line(f"servos    {_servo_battery_text(car, values, body['supply_v'])}")
    settings = experiment.settings(design, body, table)
    expected = {name: row.default for name, row in table.items()} | settings["parameters"]
    limit_s = settings["time_limit_s"]
    if values.get(TRIAL_LIMIT, limit_s) < limit_s:
        set_parameter(car, TRIAL_LIMIT, limit_s)
        print_line(f"{TRIAL_LIMIT} set from {values[TRIAL_LIMIT]:g} to {limit_s:g} s for this experiment")
    differences = {
        name: expected_value
        for name, expected_value in expected.items()
        if name in values and not equal_float32(values[name], expected_value) and name != TRIAL_LIMIT
    }
    print_line("parameters that differ from the design:" if differences else "parameters as in the design")
    for name, expected_value in differences.items():
        calibrated = "  (calibrated)" if name.endswith(CALIBRATED) else ""
        print_line(f"  {name:<16} {values[name]:g} instead of {expected_value:g}{calibrated}")
    return identity, design


def _servo_battery_text(car: ConnectedCar, parameters: Mapping[str, float], assumed_v: float) -> str:
    """Return the voltage of the servos' battery, on which the speed depends, or that it is assumed."""
    if not parameters.get("SERVO_DIVIDER"):
        return f"battery not measured; the simulation assumes {assumed_v:g} V"
    measured_v = car.servo_battery_v()
    if measured_v is None:
        return "battery unreadable: is it switched on?"
    return f"{measured_v:.2f} V, simulated with {assumed_v:g} V"


def require_same_car(car: ConnectedCar, identity: CarIdentity) -> None:
    """Raise FoldcarError if the car's design or firmware differs from ``identity``."""
    current = car.identity()
    is_same_car = identity.hash == current.hash and identity.simulated == current.simulated
    if not is_same_car or identity.build != current.build:
        before = f"{identity.name} ({identity.hash}, firmware {identity.build})"
        after = f"{current.name} ({current.hash}, firmware {current.build})"
        raise FoldcarError(f"{car.port}: the car has changed from {before} to {after}: start a new session for it")


def _end_earlier_trial(car: ConnectedCar) -> None:
    """Stop a car that still drives a trial of an earlier program, and ask for its state afterwards.

    Such a car needs the heartbeats of its host. If this program pauses later, for example to ask something, the car would
    report the fault of a silent host in the middle of the session.
    """
    car.connection.catch_up()
    if car.is_under_way(car.request("FOLDCAR_TRIAL")):
        car.stop_trial()
        print_line("driving   an earlier trial; it is stopped now")
        car.connection.catch_up()
        car.request("FOLDCAR_TRIAL")


def design_of(identity: CarIdentity, experiment: Experiment, family: Family) -> Design:
    """Return the design of ``family`` with the car's hash. Raises FoldcarError if no design has it."""
    if identity.refused:
        raise FoldcarError("the car refuses its own car.json: load the design again with `foldcar flash`")
    if not identity.hash:
        raise FoldcarError("the car has no design: load one with `foldcar flash LISTING --experiment ID --design-only`")
    for design in family:
        if design_hash(design) == identity.hash:
            return design
    expected_text = f"one of the {len(family)} of experiment {experiment.id}"
    if len(family) == 1:
        # The options --set have chosen a single design.
        expected_text = "the one that --set chooses"
    raise FoldcarError(
        f"the car is {identity.name} ({identity.hash}), which is not {expected_text}: name its own listing, or load the "
        "design that was built with `foldcar flash`"
    )


def check_build(identity: CarIdentity, simulated_build: str) -> None:
    """Raise FoldcarError if the build of the car's firmware differs from the simulated one."""
    if identity.build != simulated_build:
        raise FoldcarError(
            f"the car's firmware is build {identity.build}, the simulated one is {simulated_build}: load that with "
            "`foldcar flash`, or drive anyway with --any-build"
        )


def enter_sample(car: ConnectedCar, scene: Mapping[str, Any], sample: int, experiment: Experiment) -> None:
    """Move a simulated car to the start of a sample, whose scene is ``scene``.

    Raises FoldcarError if the car has a fault, or if `foldcar link` has not loaded this scene. Raises NoCarError if the
    car does not answer.
    """
    # Only a disarmed car can be moved.
    with contextlib.suppress(CommandRefusedError):
        car.disarm()
    if car.enter_scene(scene_name(scene, sample)):
        return
    fault = fault_line(car)
    if fault is not None:
        raise FoldcarError(f"the simulated car does not move to sample {sample}, because it has a fault: {fault}")
    if car.connection.silence_s() > ANSWER_S:
        raise NoCarError(f"{car.port}: the simulated car does not answer: is `foldcar link` stopped?")
    # `place` begins with the file of the experiment's listing.
    listing = experiment.place.partition(": ")[0]
    raise FoldcarError(
        f"the simulated car cannot drive in sample {sample} of experiment {experiment.id}: start `foldcar link` with "
        f"this experiment of {listing} as it is now, and with --sample {sample}"
    )
