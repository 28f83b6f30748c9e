"""The car at its port, through lost links and pulled cables: connected, connected again, asked for its log.

Input: ports, answers of the person who plugs it in. Output: the connected car; how an untethered drive ended.
"""

import time
from pathlib import Path

from foldcar.errors import FoldcarError
from foldcar.link.car import Car, greet
from foldcar.link.ports import SERIAL_PATHS, choose_port
from foldcar.link.stream import LinkLostError
from foldcar.trials.driving import DriveEnd, collect
from foldcar.trials.person import Answers, Buttons, warn

# Without a person to ask, how long to wait for an untethered car after its time limit.
COMES_BACK_S = 60.0
PLUGGED: Buttons = (("", "It is plugged in"), ("q", "Give up"))


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

    def collect(self, number: int, log: Path, time_limit_s: float, answers: Answers | None) -> DriveEnd:
        """Wait until an untethered car is connected again, and merge its log of trial ``number`` into ``log``."""
        end_s = time.monotonic() + time_limit_s + COMES_BACK_S
        question = "The car drives on. When it has stopped, plug it in and press Enter, or type its port; q gives up: "
        while True:
            typed = "" if answers is None else answers.line(question, PLUGGED)
            if typed.lower() == "q":
                return DriveEnd("did not come back", "aborted", None)
            try:
                self.connect_again(typed)
                if self.connected.state() == self.connected.dialect.FOLDCAR_STATE_RUNNING:
                    raise LinkLostError("the car still drives")
                return collect(self.connected, number, log)
            except FoldcarError as error:
                if answers is not None:
                    warn(error)
                elif time.monotonic() > end_s:
                    return DriveEnd("did not come back", "aborted", None, error)
            time.sleep(1.0)
