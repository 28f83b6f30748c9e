"""When, on a film's clock, the trial's began: by the car's first movement.

Input: a track, how the simulated car sets off in the same trial. Output: the film's time of the trial's start and its
standard deviation. The simulated car is driven by the same firmware: film and simulation are laid over each other between
3 and 40 mm from the start. Servos of one kind differ in how soon they turn by some 10 ms, which remains. The
attitudes in a car's log come ten times a second and 15 to 30 ms late: they tell no better.
"""

from dataclasses import dataclass

import numpy

from foldcar.camera.detection import Floats
from foldcar.errors import FoldcarError

SET_OFF_M = numpy.linspace(0.003, 0.040, 12)
SERVOS_S = 0.015
REST_S = 0.1


@dataclass(frozen=True)
class Start:
    """The trial's start on the film's clock (s), and its standard deviation."""

    film_s: float
    error_s: float


def find_start(times_s: Floats, poses: Floats, simulated: Floats, where: str) -> Start:
    """The start of the trial; ``simulated`` are rows of time in the trial, x, y.

    FoldcarError, beginning with ``where``, if the car moves from the film's first frame on, or never.
    """
    resting = times_s < times_s[0] + REST_S
    away = numpy.linalg.norm(poses[:, :2] - numpy.median(poses[resting, :2], axis=0), axis=1)
    if numpy.ptp(poses[resting, :2], axis=0).max() > SET_OFF_M[0]:
        raise FoldcarError(f"{where}: the car moves from the first frame on: begin to film before it starts")
    beyond = numpy.flatnonzero(away > SET_OFF_M[-1])
    simulated_away = numpy.linalg.norm(simulated[:, 1:3] - simulated[0, 1:3], axis=1)
    if not len(beyond) or simulated_away.max() < SET_OFF_M[-1]:
        raise FoldcarError(
            f"{where}: the car does not move by {1000 * SET_OFF_M[-1]:.0f} mm: its start is not to be seen"
        )
    # What lies before is the last time that it stood still.
    first = int(beyond[0])
    reached = [_when(times_s[: first + 1], away[: first + 1], far) for far in SET_OFF_M]
    end = int(numpy.argmax(simulated_away >= SET_OFF_M[-1]))
    wanted = [_when(simulated[: end + 1, 0], simulated_away[: end + 1], far) for far in SET_OFF_M]
    offsets = numpy.subtract(reached, wanted)
    error = float(numpy.hypot(SERVOS_S, offsets.std()))
    return Start(float(numpy.median(offsets)), error)


def _when(times_s: Floats, away: Floats, far: float) -> float:
    """The last time at which ``away`` rose through ``far``."""
    at = int(numpy.flatnonzero(away < far)[-1]) if (away < far).any() else 0
    if at + 1 >= len(away):
        return float(times_s[-1])
    share = (far - away[at]) / max(away[at + 1] - away[at], 1e-9)
    return float(times_s[at] + share * (times_s[at + 1] - times_s[at]))
