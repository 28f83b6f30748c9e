"""The car at its port: connected, shown and checked before a trial, connected again after a pulled cable.

Input: ports, the identity and the parameters that a car reports, answers of the person beside it. Output: the connected
car, the design of the experiment; how an untethered drive ended; or a FoldcarError with a
remedy.
"""

import time
from collections.abc import Mapping
from pathlib import Path
from typing import Any

from foldcar.car.body import body_json, design_hash
from foldcar.car.design import Design
from foldcar.errors import FoldcarError
from foldcar.link.car import Car, CarIdentity, greet
from foldcar.link.parameters import equal_float32, read_parameters, set_parameter
from foldcar.link.stream import SERIAL_PATHS, LinkLostError, choose_port
from foldcar.scenes.fingerprint import scene_name
from foldcar.simulation.carsim import Carsim
from foldcar.study.experiments import TRIAL_LIMIT, Experiment
from foldcar.study.family import Family
from foldcar.trials.driving import DriveEnd, collect
from foldcar.trials.person import Answers, say, warn

SIMULATED_TEXT = "SIMULATED CAR"
# Without a person to ask, how long to wait for an untethered car after its time limit.
COMES_BACK_S = 60.0

# Endings of the names of parameters which may differ from the design's because they depend on servos and board.
CALIBRATED = ("_NEUTRAL_US", "_DEADBAND_US", "_GAIN_US", "PWM_OSC_HZ", "OE_WIRED")


class PluggedCar:
    """The connection to a car, which may break; ``car`` is None while there is none."""

    def __init__(self) -> None:
        self.car: Car | None = None
        self._port = ""

    @property
    def connected(self) -> Car:
        """The car, where there must be one."""
        assert self.car is not None
        return self.car

    def connect(self, port: str) -> None:
        """Connect to the car at a port. FoldcarError."""
        self.car, self._port = greet(port), port

    def close(self) -> None:
        """Close the connection, which nothing must use any more."""
        car, self.car = self.car, None
        if car is not None:
            car.connection.close()

    def connect_again(self, typed: str) -> None:
        """Connect at the typed port, the last or a new one: a port's name may change after unplugging. FoldcarError."""
        port = typed or self._port
        if not typed and port.startswith(SERIAL_PATHS) and not Path(port).exists():
            port = choose_port(None)
        self.close()
        self.connect(port)

    def collect(
        self, number: int, log: Path, time_limit_s: float, answers: Answers | None, identity: CarIdentity
    ) -> DriveEnd:
        """Wait until an untethered car is connected again, and merge its log of trial ``number`` into ``log``."""
        end_s = time.monotonic() + time_limit_s + COMES_BACK_S
        question = "The car drives on. When it has stopped, plug it in and press Enter, or type its port; q gives up: "
        while True:
            typed = "" if answers is None else answers.line(question)
            if typed.lower() == "q":
                return DriveEnd("did not come back", "aborted", None)
            try:
                self.connect_again(typed)
                require_same_car(self.connected, identity)
                if self.connected.state() == self.connected.dialect.FOLDCAR_STATE_RUNNING:
                    raise LinkLostError("the car still drives")
                return collect(self.connected, number, log)
            except FoldcarError as error:
                if answers is not None:
                    warn(error)
                elif time.monotonic() > end_s:
                    return DriveEnd("did not come back", "aborted", None, error)
            time.sleep(1.0)


def welcome(
    car: Car, experiment: Experiment, family: Family, carsim: Carsim, answers: Answers | None, any_build: bool
) -> tuple[CarIdentity, Design]:
    """Print the car's identity and state, and compare its parameters with the design's.

    Without ``answers`` nothing is asked. FoldcarError with a remedy if it cannot drive the experiment's trials.
    """
    identity = car.identity()
    battery = car.battery_v()
    say(f"car       {identity.name or 'without a design'} ({identity.hash or 'no car.json'}) at {car.port}")
    say(f"firmware  {identity.build}")
    if identity.simulated:
        say(f"{SIMULATED_TEXT}: its trials are stored as simulated and do not count as trials of built cars")
    elif identity.simulated is None:
        say("its firmware does not say whether it is simulated: its trials do not count until someone does")
    say(f"battery   {'unreadable' if battery is None else f'{battery:.2f} V'}")
    design = design_of(identity, experiment, family)
    if not any_build:
        check_build(identity, carsim.firmware)
    _end_earlier_trial(car)
    _clear_fault(car, answers)
    values, table = read_parameters(car), carsim.parameter_table()
    settings = experiment.settings(design, body_json(design), table)
    expected = {name: row.default for name, row in table.items()} | settings["parameters"]
    limit_s = settings["time_limit_s"]
    if values.get(TRIAL_LIMIT, limit_s) < limit_s:
        set_parameter(car, TRIAL_LIMIT, limit_s)
        say(f"{TRIAL_LIMIT} set from {values[TRIAL_LIMIT]:g} to {limit_s:g} s for this experiment")
    differing = {
        name: wanted
        for name, wanted in expected.items()
        if name in values and not equal_float32(values[name], wanted) and name != TRIAL_LIMIT
    }
    say("parameters that differ from the design:" if differing else "parameters as in the design")
    for name, wanted in differing.items():
        calibrated = "  (calibrated)" if name.endswith(CALIBRATED) else ""
        say(f"  {name:<16} {values[name]:g} instead of {wanted:g}{calibrated}")
    return identity, design


def require_same_car(car: Car, identity: CarIdentity) -> None:
    """FoldcarError if the car's design or firmware is another than in ``identity``."""
    now = car.identity()
    if (now.hash, now.build, now.simulated) != (identity.hash, identity.build, identity.simulated):
        before, after = (f"{known.name} ({known.hash}, firmware {known.build})" for known in (identity, now))
        raise FoldcarError(f"{car.port}: the car is {after} now, and was {before}: begin a new session with it")


def _end_earlier_trial(car: Car) -> None:
    """Stop a car that drives on because the program before was ended, and learn its state as it is now.

    Left alone, it would latch the fault of a silent host at our next long pause, after faults were asked for.
    """
    car.connection.catch_up()
    if car.request("FOLDCAR_TRIAL").state == car.dialect.FOLDCAR_STATE_RUNNING:
        car.stop_trial()
        say("driving   an earlier trial, which is stopped now")
        car.connection.catch_up()
        car.request("FOLDCAR_TRIAL")


def _clear_fault(car: Car, answers: Answers | None) -> None:
    fault = car.fault_text()
    if fault is None:
        return
    say(f"fault     {fault}")
    if answers is not None and answers.line("Acknowledge it? [Y/n] ").lower() not in ("", "y", "yes"):
        raise FoldcarError(f"the car has a fault that is not acknowledged: {fault}")
    car.acknowledge_fault()


def design_of(identity: CarIdentity, experiment: Experiment, family: Family) -> Design:
    """The design of ``family`` (the experiment's, or part of it) that has the car's hash; FoldcarError if none has."""
    if identity.refused:
        raise FoldcarError("the car refuses its own car.json: load the design again with `foldcar flash`")
    if not identity.hash:
        raise FoldcarError("the car has no design: load one with `foldcar flash LISTING --experiment ID --design-only`")
    for design in family:
        if design_hash(design) == identity.hash:
            return design
    several = f"one of the {len(family)} of experiment {experiment.id}"
    chosen = "the one that --set chooses" if len(family) == 1 else several
    raise FoldcarError(
        f"the car is {identity.name} ({identity.hash}), which is not {chosen}: name its own listing, or load the "
        "design that was built with `foldcar flash`"
    )


def check_build(identity: CarIdentity, simulated: str) -> None:
    """FoldcarError if the car's firmware is not of the build that is simulated."""
    if identity.build != simulated:
        raise FoldcarError(
            f"the car's firmware is build {identity.build}, the simulated one is {simulated}: load that with "
            "`foldcar flash`, or drive anyway with --any-build"
        )


def enter_sample(car: Car, scene: Mapping[str, Any], sample: int, experiment: Experiment) -> None:
    """Move a simulated car to the sample whose scene is ``scene``; FoldcarError if it has no such scene."""
    if not car.enter_scene(scene_name(scene, sample)):
        raise FoldcarError(
            f"the simulated car cannot drive in sample {sample} of experiment {experiment.id}: start `foldcar link` with "
            f"this experiment of {experiment.place.partition(': ')[0]} as it is now, and with --sample {sample}"
        )
