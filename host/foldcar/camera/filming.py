"""A trial's film and photo put together with the trial: what the store keeps of them.

Input: a store, the number of a trial, a film or a photo, course, lens, a carsim. Output: a Track record of the store,
or the deviations of car and obstacles. FoldcarError of one line.
"""

import json
import math
from collections.abc import Mapping
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy

from foldcar.camera.clock import Start, find_start
from foldcar.camera.ending import Ending, propose
from foldcar.camera.film import read_film
from foldcar.camera.ground import Standing, standing
from foldcar.camera.lens import Lens
from foldcar.camera.markers import Course
from foldcar.camera.photo import LAID_RAD
from foldcar.camera.poses import CarMarker
from foldcar.camera.tracking import Track as Filmed
from foldcar.camera.tracking import track
from foldcar.errors import FoldcarError
from foldcar.simulation.carsim import Carsim
from foldcar.simulation.heights import carsim_heights
from foldcar.simulation.runner import RunRequest
from foldcar.store.log_files import sha256_of
from foldcar.store.reader import Store
from foldcar.store.trial_records import Track
from foldcar.store.writer import canonical_json

SETTING_OFF_S = 0.01
# A car that stood farther from where the trial has it (m, rad) is told.
ELSEWHERE_M, ELSEWHERE_RAD = 0.015, math.radians(4)


@dataclass(frozen=True)
class Drive:
    """A trial's body, settings and scene as placed, and how its car stands and carries its marker."""

    body: Mapping[str, Any]
    settings: Mapping[str, Any]
    scene: Mapping[str, Any]
    ground: Standing
    marker: CarMarker

    def printed(self, scale: float) -> CarMarker:
        """The marker from a printer whose prints are larger by this factor."""
        return CarMarker(self.marker.size_m * scale, self.marker.x_m, self.marker.z_m)


def trial_drive(store: Store, number: int, course: Course, carsim: Carsim) -> Drive:
    """The drive of a trial; FoldcarError if it was imported without a scene."""
    store.trial(number)
    texts = store.trial_drive(number)
    if texts is None:
        raise FoldcarError(f"{store.path}: trial {number} was imported without a scene: it cannot be filmed")
    body, settings, scene = (json.loads(text) for text in texts)
    return Drive(body, settings, scene, standing(scene, carsim_heights(carsim), body), car_marker(body, course))


def car_marker(body: Mapping[str, Any], course: Course) -> CarMarker:
    """The marker above the lid of the segment whose pose is the car's."""
    segment = min(body["segments"], key=lambda one: abs(one["x_m"]))
    lid_m = segment["center_z_m"] + segment["height_m"] / 2
    return CarMarker(course.car_size_m, course.car_x_m, lid_m + course.car_height_m)


def track_trial(
    store: Store, number: int, film: Path, course: Course, lens: Lens | None, carsim: Carsim
) -> tuple[Track, tuple[str, ...]]:
    """Where the car was in the trial by its film, and what to say of it."""
    drive = trial_drive(store, number, course, carsim)
    filmed = track(read_film(film), str(film), course, lens, drive.printed, drive.ground)
    start = find_start(filmed.times_s, filmed.poses, _simulated(drive, carsim), str(film))
    times_s = filmed.times_s - start.film_s
    settings = drive.settings
    turns = abs(settings["speed_m_s"]) <= 0.05 * abs(settings["yaw_rate_rad_s"])
    ending = propose(times_s, filmed.poses, drive.scene, settings["time_limit_s"], turns, filmed.film_s - start.film_s)
    remarks = [*filmed.remarks, *_elsewhere(filmed, times_s, drive.scene["start"])]
    digest = sha256_of(film)
    assert digest is not None
    facts = _facts(filmed, start, ending, lens, remarks)
    record = Track(number, film.name, digest, round(start.film_s, 4), ending.outcome, facts, _rows(times_s, filmed))
    return record, tuple(remarks)


def _facts(filmed: Filmed, start: Start, ending: Ending, lens: Lens | None, remarks: list[str]) -> dict[str, Any]:
    x, y, heading = filmed.frame_error
    view = filmed.view
    return {
        "end_s": round(ending.time_s, 3), "end_x_m": round(ending.x_m, 4), "end_y_m": round(ending.y_m, 4), "why":
        ending.why, "start_error_s": round(start.error_s, 4),
        "frame_error_m": [round(float(x), 5), round(float(y), 5)],
        # The marker on the lid is glued by hand.
        "heading_error_rad": round(math.hypot(heading, LAID_RAD), 5),
        "corner_error_px": round(filmed.pixel_error, 3), "seen": round(filmed.seen, 4),
        "lens": "given" if lens else "fitted to the floor markers", "focal_px": round(view.lens.focal_px, 1),
        "camera_m": [round(float(value), 3) for value in view.place_m], "remarks": list(remarks),
    }  # fmt: skip


def _rows(times_s: Any, filmed: Filmed) -> list[list[float]]:
    upper = [(0, 0), (0, 1), (0, 3), (1, 1), (1, 3), (3, 3), (2, 2), (4, 4), (5, 5)]
    return [
        [
            round(float(time_s), 4),
            *(round(float(value), 5) for value in pose),
            *(float(f"{spread[k]:.3g}") for k in upper),
        ]
        for time_s, pose, spread in zip(times_s, filmed.poses, filmed.covariances, strict=True)
    ]


def _simulated(drive: Drive, carsim: Carsim) -> Any:
    """Time, x and y of the simulated car's first seconds in the same trial."""
    settings = canonical_json({**drive.settings, "path_interval_s": SETTING_OFF_S})
    request = RunRequest("car", "scene", settings, "film", 0)
    texts = canonical_json(drive.body), canonical_json(drive.scene)
    (answer,) = carsim.run({"car": texts[0]}, {"scene": texts[1]}, [request])
    if "path" not in answer:
        raise FoldcarError(f"the trial cannot be simulated: {answer.get('error', 'no path')}")
    return numpy.array(answer["path"])[:, :3]


def _elsewhere(filmed: Filmed, times_s: Any, start: Mapping[str, float]) -> list[str]:
    """A remark if the car stood elsewhere than the trial says."""
    before = filmed.poses[times_s < 0]
    if not len(before):
        return []
    x, y, _, heading, *_ = numpy.median(before, axis=0)
    away_m = math.hypot(x - start["x_m"], y - start["y_m"])
    turned = math.remainder(heading - start["heading_rad"], math.tau)
    if away_m < ELSEWHERE_M and abs(turned) < ELSEWHERE_RAD:
        return []
    return [
        f"the car began {1000 * away_m:.0f} mm and {math.degrees(turned):+.1f}° from where the trial has it: at "
        f"{1000 * x:.0f}, {1000 * y:.0f} mm, {math.degrees(heading):.1f}°"
    ]
