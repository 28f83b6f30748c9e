"""Combines a trial with its film: when the drive began, how it ended, and what the store keeps.

Input: a store, the number of a trial, a film, course, lens, a carsim. Output: a Track record of the store.

The trial's start on the film's clock follows from the car's first movement. The simulated car has the same firmware, so
film and simulation are aligned between 3 and 40 mm from the start. An error of about 10 ms remains, because servos of one
kind differ in their delay. The attitudes in a car's log are not better: they come ten times a second and 15 to 30 ms
late. The outcome is proposed by the rules that end the simulator's runs (docs/carsim.md), as far as a film shows them; a
person decides.
"""

import json
import math
from collections.abc import Mapping
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy

from foldcar.errors import FoldcarError
from foldcar.simulation.carsim import Carsim
from foldcar.simulation.heights import carsim_heights
from foldcar.simulation.runner import RunRequest
from foldcar.store.log_files import sha256_of
from foldcar.store.reader import Store
from foldcar.store.trial_records import Track
from foldcar.store.writer import canonical_json
from foldcar.trials.camera.detection import Floats
from foldcar.trials.camera.film import read_film
from foldcar.trials.camera.ground import standing
from foldcar.trials.camera.lens import Lens
from foldcar.trials.camera.markers import Course
from foldcar.trials.camera.photo import LAID_RAD
from foldcar.trials.camera.poses import CarMarker
from foldcar.trials.camera.tracking import Track as Filmed
from foldcar.trials.camera.tracking import track

# A car that stood farther from its position in the trial gets a remark; beyond OTHER_TRIAL, the film is refused.
REMARKED_M, REMARKED_RAD = 0.015, math.radians(4)
OTHER_TRIAL_M, OTHER_TRIAL_RAD = 0.060, math.radians(20)
SET_OFF_M = numpy.linspace(0.003, 0.040, 12)
# Distances at which time scales are fitted, and the largest scale of a real car. Slow motion has scales of 2 to 32.
SCALED_M = numpy.linspace(0.003, 0.120, 24)
MAX_SCALE = 1.5
# A larger scale gets a remark: 24 or 25 frames a second saved as 30, or slow or quick servos.
REMARKED_SCALE = 1.12
# The drive to the goal may end this much later on the film than in the trial, which a person ends.
LATE_S = 0.2
SERVOS_S = 0.015
REST_S = 0.1
# The same values as in sim2d/lib/trial/ending.h.
TIPPED_UP = 0.26
STUCK_M, STUCK_RAD, STUCK_S = 0.010, 0.035, 4.0
HELD_M, HELD_S = 0.050, 8.0
# A marker that is last seen with more tilt than this, and not for UNSEEN_S, is under the tipped car.
TIPPING_UP = 0.6
UNSEEN_S = 0.7


@dataclass(frozen=True)
class Start:
    """The trial's start on the film's clock (s), and its standard deviation.

    ``scale`` is the ratio of the film's car's time to the simulated car's time over the first 120 mm.
    """

    film_s: float
    error_s: float
    scale: float

    def remarks(self) -> list[str]:
        """Return a remark if the film's car is much slower or quicker than the simulated one."""
        if 1 / REMARKED_SCALE < self.scale < REMARKED_SCALE:
            return []
        return [
            f"the car sets off {_pace(self.scale)} as in simulation: if the film was saved at another frame rate, all "
            "times are wrong by this factor; otherwise the servos are slower or quicker than in simulation"
        ]


@dataclass(frozen=True)
class Ending:
    """The end of a drive: outcome (None if the film does not show it), time in the trial, position and reason."""

    outcome: str | None
    time_s: float
    x_m: float
    y_m: float
    why: str


def car_marker(body: Mapping[str, Any], course: Course) -> CarMarker:
    """Return the marker above the lid of the segment that defines the car's pose."""
    segment = min(body["segments"], key=lambda segment: abs(segment["x_m"]))
    lid_m = segment["center_z_m"] + segment["height_m"] / 2
    return CarMarker(course.car_size_m, course.car_x_m, lid_m + course.car_height_m)


def track_trial(
    store: Store, number: int, film: Path, course: Course, lens: Lens | None, carsim: Carsim
) -> tuple[Track, tuple[str, ...]]:
    """Return the car's track in the trial by its film, and remarks on it. Raises FoldcarError."""
    drive = store.trial_drive(number)
    if drive is None:
        raise FoldcarError(f"{store.path}: trial {number} was imported without a scene, so its film cannot be tracked")
    body, settings, scene = (json.loads(text) for text in drive)
    ground = standing(scene, carsim_heights(carsim), body)
    filmed = track(
        read_film(film), str(film), course, lens, lambda scale: car_marker(body, course.printed(scale)), ground
    )
    start = find_start(filmed.times_s, filmed.poses, _simulated(body, settings, scene, carsim), str(film))
    times_s = filmed.times_s - start.film_s
    # A circle with a radius of less than 5 cm counts as turning on the spot.
    turns_on_the_spot = abs(settings["speed_m_s"]) <= 0.05 * abs(settings["yaw_rate_rad_s"])
    film_end_s = filmed.film_s - start.film_s
    ending = propose(times_s, filmed.poses, scene, settings["time_limit_s"], turns_on_the_spot, film_end_s)
    elapsed_s = store.trial(number).elapsed_time_s
    if ending.outcome in ("passed", "off_course") and elapsed_s is not None and ending.time_s > elapsed_s + LATE_S:
        raise FoldcarError(
            f"{film}: {ending.why} after {ending.time_s:.2f} s, but trial {number} ended after {elapsed_s:.2f} s: it is "
            "a film of another trial, or in slow motion"
        )
    remarks = [
        *filmed.remarks,
        *start.remarks(),
        *_position_remarks(filmed, times_s, scene["start"], f"{film}: is a film of another trial"),
    ]
    digest = sha256_of(film)
    assert digest is not None
    facts = _facts(filmed, start, ending, lens, remarks)
    record = Track(
        trial=number,
        film=film.name,
        film_sha256=digest,
        start_s=round(start.film_s, 4),
        outcome=ending.outcome,
        facts=facts,
        rows=_track_rows(times_s, filmed),
    )
    return record, tuple(remarks)


def _simulated(body: Any, settings: Any, scene: Any, carsim: Carsim) -> Floats:
    """Return time, x and y of the simulated car's first seconds in the same trial."""
    request = RunRequest("car", "scene", canonical_json({**settings, "path_interval_s": 0.01}), "film", 0)
    (answer,) = carsim.run({"car": canonical_json(body)}, {"scene": canonical_json(scene)}, [request])
    if "path" not in answer:
        raise FoldcarError(f"the trial cannot be simulated: {answer.get('error', 'no path')}")
    return numpy.array(answer["path"])[:, :3]


def _facts(filmed: Filmed, start: Start, ending: Ending, lens: Lens | None, remarks: list[str]) -> dict[str, Any]:
    """Return the facts of a track that are stored with it: its end, its errors, its camera."""
    x, y, heading = filmed.frame_error
    view = filmed.view
    return {
        "end_s": round(ending.time_s, 3), "end_x_m": round(ending.x_m, 4), "end_y_m": round(ending.y_m, 4), "why":
        ending.why, "start_error_s": round(start.error_s, 4),
        "frame_error_m": [round(float(x), 5), round(float(y), 5)],
        # Includes the error of the marker on the lid, which is glued by hand.
        "heading_error_rad": round(math.hypot(heading, LAID_RAD), 5),
        "corner_error_px": round(filmed.pixel_error, 3), "seen": round(filmed.seen, 4),
        "lens": "given" if lens else "fitted to the floor markers", "focal_px": round(view.lens.focal_px, 1),
        "camera_m": [round(float(value), 3) for value in view.place_m], "remarks": list(remarks),
    }  # fmt: skip


def _track_rows(times_s: Any, filmed: Filmed) -> list[list[float]]:
    """Return rows of time (s), pose (x, y, z, heading, pitch, roll) and the stored elements of its covariance."""
    # Rows and columns, in the pose's order: x, y and heading with each other, then z, pitch and roll each alone.
    covariance_elements = [(0, 0), (0, 1), (0, 3), (1, 1), (1, 3), (3, 3), (2, 2), (4, 4), (5, 5)]
    return [
        [
            round(float(time_s), 4),
            *(round(float(value), 5) for value in pose),
            *(float(f"{covariance[element]:.3g}") for element in covariance_elements),
        ]
        for time_s, pose, covariance in zip(times_s, filmed.poses, filmed.covariances, strict=True)
    ]


def _position_remarks(filmed: Filmed, times_s: Any, start: Mapping[str, float], refusal: str) -> list[str]:
    """Return a remark if the car stood away from its position ``start`` in the trial before it set off.

    Raises FoldcarError, beginning with ``refusal``, if it stood too far away.
    """
    poses_before = filmed.poses[times_s < 0]
    if not len(poses_before):
        return []
    x, y, _, heading, *_ = numpy.median(poses_before, axis=0)
    distance_m = math.hypot(x - start["x_m"], y - start["y_m"])
    turned_rad = math.remainder(heading - start["heading_rad"], math.tau)
    if distance_m < REMARKED_M and abs(turned_rad) < REMARKED_RAD:
        return []
    remark = (
        f"the car began {1000 * distance_m:.0f} mm and {math.degrees(turned_rad):+.1f}° from its position in the trial: "
        f"at {1000 * x:.0f}, {1000 * y:.0f} mm, {math.degrees(heading):.1f}°"
    )
    if distance_m > OTHER_TRIAL_M or abs(turned_rad) > OTHER_TRIAL_RAD:
        raise FoldcarError(f"{refusal}: {remark}; if it is a film of this trial, correct the positions by a photo")
    return [remark]


def find_start(times_s: Floats, poses: Floats, simulated: Floats, where: str) -> Start:
    """Find the start of the trial on the film's clock.

    ``poses`` (frames, 2 or more) begin with x and y; ``simulated`` (rows, 3) are the time in the trial (s), x and y (m).
    The film's car and the simulated car pass the same distances (SET_OFF_M) at their own times; the start is the median
    difference of these times. Raises FoldcarError, beginning with ``where``, if the car moves in the first frame, if it
    never moves, or if no real car has this time scale.
    """
    is_resting = times_s < times_s[0] + REST_S
    distances = numpy.linalg.norm(poses[:, :2] - numpy.median(poses[is_resting, :2], axis=0), axis=1)
    if numpy.ptp(poses[is_resting, :2], axis=0).max() > SET_OFF_M[0]:
        raise FoldcarError(f"{where}: the car moves from the first frame on: start filming before it starts")
    rows_beyond = numpy.flatnonzero(distances > SET_OFF_M[-1])
    simulated_distances = numpy.linalg.norm(simulated[:, 1:3] - simulated[0, 1:3], axis=1)
    if not len(rows_beyond) or simulated_distances.max() < SET_OFF_M[-1]:
        raise FoldcarError(
            f"{where}: the car does not move by {1000 * SET_OFF_M[-1]:.0f} mm, so that its start cannot be found"
        )
    # The search goes back from here to the last time at which the car stood still.
    first_beyond = int(rows_beyond[0])
    film_times_s = [_when(times_s[: first_beyond + 1], distances[: first_beyond + 1], distance) for distance in SET_OFF_M]
    simulated_beyond = int(numpy.argmax(simulated_distances >= SET_OFF_M[-1]))
    until = slice(simulated_beyond + 1)
    simulated_times_s = [_when(simulated[until, 0], simulated_distances[until], distance) for distance in SET_OFF_M]
    offsets = numpy.subtract(film_times_s, simulated_times_s)
    # Short distances are noisy; over long ones an obstacle may slow the car down. Use the scale that is nearer to 1.
    long_scale = _time_scale(times_s, distances, simulated, simulated_distances)
    short_scale, _ = numpy.polyfit(simulated_times_s, film_times_s, 1)
    scale = min(
        float(short_scale),
        long_scale,
        key=lambda candidate: abs(math.log(max(candidate, 1e-3))),
    )
    if not 1 / MAX_SCALE < scale < MAX_SCALE:
        raise FoldcarError(
            f"{where}: the car sets off {_pace(scale)} as in simulation: the film is in slow motion or time "
            "lapse; save it at normal speed, or film again without it"
        )
    error = float(numpy.hypot(SERVOS_S, offsets.std()))
    return Start(float(numpy.median(offsets)), error, scale)


def _pace(scale: float) -> str:
    """Return a time scale in words: "2 times as slow"."""
    return f"{scale:.2g} times as slow" if scale > 1 else f"{1 / max(scale, 1e-3):.2g} times as fast"


def _time_scale(times_s: Floats, distances_m: Floats, simulated: Floats, simulated_distances_m: Floats) -> float:
    """Return how many times longer the film's car takes for the distances of SCALED_M that both cars reach.

    It is the slope of the film's times over the simulated ones. ``simulated`` (rows, 3) is time (s), x and y (m).
    """
    farthest = min(distances_m.max(), simulated_distances_m.max())
    distances = SCALED_M[: int(numpy.searchsorted(SCALED_M, farthest, "right"))]

    def passing_times_s(row_times_s: Floats, row_distances_m: Floats) -> list[float]:
        """Return the times at which the car passes ``distances``; later rows, in which it may come back, are cut off."""
        end = int(numpy.argmax(row_distances_m >= distances[-1])) + 1
        return [_when(row_times_s[:end], row_distances_m[:end], distance) for distance in distances]

    film_times_s = passing_times_s(times_s, distances_m)
    simulated_times_s = passing_times_s(simulated[:, 0], simulated_distances_m)
    slope, _ = numpy.polyfit(simulated_times_s, film_times_s, 1)
    return float(slope)


def _when(times_s: Floats, distances_m: Floats, distance: float) -> float:
    """Return the last time at which the distance rose through ``distance``."""
    index = int(numpy.flatnonzero(distances_m < distance)[-1]) if (distances_m < distance).any() else 0
    if index + 1 >= len(distances_m):
        return float(times_s[-1])
    fraction = (distance - distances_m[index]) / max(distances_m[index + 1] - distances_m[index], 1e-9)
    return float(times_s[index] + fraction * (times_s[index + 1] - times_s[index]))


def propose(
    times_s: Floats, poses: Floats, scene: Mapping[str, Any], time_limit_s: float, turns_on_the_spot: bool,
    film_end_s: float,
) -> Ending:  # fmt: skip
    """Propose the end of the drive by its track: ``poses`` (n, 6) at ``times_s`` from the trial's start.

    ``turns_on_the_spot``: the car was commanded to turn nearly on the spot, so that it may stay at its place.
    """
    driving = numpy.flatnonzero((times_s >= 0) & (times_s <= time_limit_s))
    if not len(driving):
        return Ending(None, 0.0, float(poses[0, 0]), float(poses[0, 1]), "the film does not show the drive")
    was_before_goal = True
    still_since = held_since = int(driving[0])
    for index in driving.tolist():
        time_s, (x, y, _, heading, pitch, roll) = float(times_s[index]), poses[index]
        if math.cos(pitch) * math.cos(roll) < TIPPED_UP:
            return Ending("tipped", time_s, x, y, f"tilted by more than {math.degrees(math.acos(TIPPED_UP)):.0f}°")
        is_before_goal = _short_of_goal(scene["goal"], x, y)
        if was_before_goal and not is_before_goal:
            return _passed(times_s, poses, scene["goal"], index)
        was_before_goal = is_before_goal
        course = scene["course"]
        if not (course["x_min_m"] <= x <= course["x_max_m"] and course["y_min_m"] <= y <= course["y_max_m"]):
            return Ending("off_course", time_s, x, y, "its middle left the course")
        if math.dist((x, y), poses[held_since, :2]) > HELD_M:
            held_since = index
        elif not turns_on_the_spot and time_s - times_s[held_since] >= HELD_S:
            return Ending("stuck", time_s, x, y, f"less than {1000 * HELD_M:.0f} mm in {HELD_S:g} s")
        if math.dist((x, y), poses[still_since, :2]) > STUCK_M or abs(heading - poses[still_since, 3]) > STUCK_RAD:
            still_since = index
        elif time_s - times_s[still_since] >= STUCK_S:
            return Ending("stuck", time_s, x, y, f"less than {1000 * STUCK_M:.0f} mm in {STUCK_S:g} s")
    last = int(driving[-1])
    time_s, (x, y, _, _, pitch, roll) = float(times_s[last]), poses[last]
    end_s = min(film_end_s, time_limit_s)
    if end_s - time_s > UNSEEN_S:
        if math.cos(pitch) * math.cos(roll) < TIPPING_UP:
            return Ending("tipped", time_s, x, y, "last seen as it tipped")
        return Ending(None, time_s, x, y, "its marker is not seen any more")
    if film_end_s >= time_limit_s:
        return Ending("timeout", time_limit_s, x, y, f"the time limit of {time_limit_s:g} s")
    return Ending(None, time_s, x, y, "the film ends before the drive")


def _passed(times_s: Floats, poses: Floats, goal: Mapping[str, Any], index: int) -> Ending:
    """Return the ending of a car that reached the goal between frame ``index`` and the frame before, interpolated."""
    # Fractions of the way between the two frames.
    steps = numpy.linspace(0, 1, 21)
    previous = max(index - 1, 0)
    fraction = next(
        step
        for step in steps
        if not _short_of_goal(goal, *(poses[previous, :2] + step * (poses[index, :2] - poses[previous, :2])))
    )
    x, y = poses[previous, :2] + fraction * (poses[index, :2] - poses[previous, :2])
    time_s = times_s[previous] + fraction * (times_s[index] - times_s[previous])
    return Ending("passed", float(time_s), float(x), float(y), "its middle reached the goal")


def _short_of_goal(goal: Mapping[str, Any] | None, x: float, y: float) -> bool:
    """Whether a position is outside the goal's disc or before its line; always true without a goal."""
    if goal is None:
        return True
    dx, dy = goal["x_m"] - x, goal["y_m"] - y
    if goal["kind"] == "disc":
        return math.hypot(dx, dy) > float(goal["radius_m"])
    return bool(dx * math.cos(goal["heading_rad"]) + dy * math.sin(goal["heading_rad"]) > 0)
