"""Follows a car through a film: where it was in each frame, with covariance, on the film's own clock.

Input: frames with times, course, lens if there is one, the car's marker, how it may stand. Output: a Track. The camera
may stand or move: floor markers are looked for in each tenth frame, in every frame once they move in the picture.
"""

from collections.abc import Callable, Iterable, Sequence
from dataclasses import dataclass, field, replace

import numpy

from foldcar.camera.detection import Detector, Floats, Grey
from foldcar.camera.ground import Standing
from foldcar.camera.lens import READOUT_S, Lens
from foldcar.camera.markers import CAR_ID, Course
from foldcar.camera.obstacle_heights import fit_heights, height_remarks
from foldcar.camera.poses import PIXEL, CarMarker, Pose, find_pose
from foldcar.camera.smoother import smooth
from foldcar.camera.view import View, find_view, moved_view
from foldcar.errors import FoldcarError

CHECK_FRAMES = 10
SEARCH_FRAMES = 3
# Floor markers that move by less (pixels at a width of 1920) stand still: so does the camera.
STILL_PX = 0.7
# Corners are never known better: their errors repeat from frame to frame.
LEAST_PIXEL, MOST_PIXEL = 0.05, 1.0
SOME_FRAMES = 40
LEAST_POSES = 10
# A gap that the path does not bridge.
GAP_S = 0.5


@dataclass(frozen=True)
class Track:
    """Rows of ``times_s`` (film), ``poses`` (x, y, z in m, heading, pitch, roll in rad), ``rates``, ``covariances``.

    ``frame_error`` are the standard deviations of x, y (m) and heading (rad) that all rows share: camera and markers.
    ``pixel_error`` is the corners' noise, ``seen`` the share of frames that show the car's marker, ``film_s`` the film's
    length. ``remarks`` say what is missing or was moved.
    """

    times_s: Floats
    poses: Floats
    rates: Floats
    covariances: Floats
    frame_error: Floats
    pixel_error: float
    seen: float
    film_s: float
    view: View
    remarks: tuple[str, ...]


@dataclass
class _Seen:
    """What the frames showed: the car's corners by frame, those of the floor's markers by frame."""

    times_s: list[float] = field(default_factory=list)
    car: dict[int, Floats] = field(default_factory=dict)
    floor: dict[int, dict[int, Floats]] = field(default_factory=dict)
    size: tuple[int, int] = (0, 0)


def track(
    frames: Iterable[tuple[float, Grey]],
    where: str,
    course: Course,
    lens: Lens | None,
    marker: Callable[[float], CarMarker],
    ground: Standing,
) -> Track:
    """The path of the car; FoldcarError, beginning with ``where``.

    ``marker`` gives the car's for the scale of the print.
    """
    seen = _look(frames, {one.id for one in course.floor})
    width, height = seen.size
    lens = lens.of_size(width, height, where) if lens else None
    views, remarks = _views(seen, course, lens, where)
    first = views[min(views)]
    readout_s = lens.readout_s if lens else READOUT_S
    car = marker(first.scale)
    shown = sorted(seen.car.items())
    if len(shown) < LEAST_POSES:
        raise FoldcarError(
            f"{where}: the car's marker {CAR_ID} is seen in {len(shown)} of {len(seen.times_s)} frames; {LEAST_POSES} "
            "are needed"
        )

    def poses_of(some: Sequence[tuple[int, Floats]], pixel: float, ground: Standing) -> list[tuple[float, Pose]]:
        found, guess = [], None
        for frame, corners in some:
            pose = find_pose(corners, views.get(frame, first), car, ground, guess, pixel)
            if pose is not None and numpy.isfinite(pose.values).all():
                guess = pose.values
                # The rows of a picture are read one after the other.
                found.append((seen.times_s[frame] + readout_s * float(corners[:, 1].mean()) / height, pose))
        return found

    # A first look at some frames tells how well corners are known in this film.
    pixel_error = PIXEL
    for _ in range(2):
        some = [pose for _, pose in poses_of(shown[:: max(1, len(shown) // SOME_FRAMES)], pixel_error, ground)]
        squares = [float((pose.residuals_px**2).sum()) / pose.freedom(pixel_error) for pose in some]
        pixel_error = float(numpy.clip(numpy.sqrt(numpy.mean(squares)), LEAST_PIXEL, MOST_PIXEL))
    found = poses_of(shown, pixel_error, ground)
    if len(ground.factors) > 1:
        ground = fit_heights([pose for _, pose in found], ground, pixel_error)
        remarks += height_remarks(ground)
        found = poses_of(shown, pixel_error, ground)
    times, poses = [time_s for time_s, _ in found], [pose for _, pose in found]
    path, rates, covariances, used = smooth(
        numpy.array(times), numpy.array([pose.values for pose in poses]),
        numpy.array([pose.covariance(pixel_error) for pose in poses]),
    )  # fmt: skip
    gaps = numpy.diff(times)
    if gaps.max() > GAP_S:
        at = int(gaps.argmax())
        remarks.append(
            f"the car is not seen from {times[at]:.1f} to {times[at + 1]:.1f} s of the film: its path there is a guess"
        )
    last = seen.car[max(seen.car)]
    error = first.frame_error(last.mean(axis=0), last[:2].mean(axis=0), ground.radius_m + car.z_m)
    return Track(
        numpy.array(times)[used], path[used], rates[used], covariances[used], error, pixel_error,
        len(seen.car) / len(seen.times_s), seen.times_s[-1], first, tuple(remarks),
    )  # fmt: skip


def _look(frames: Iterable[tuple[float, Grey]], floor_ids: set[int]) -> _Seen:
    """Find the markers in all frames, each near where it was."""
    detector, seen = Detector(), _Seen()
    car: Floats | None = None
    drift = numpy.zeros(2)
    floor: dict[int, Floats] = {}
    moving, lost = False, 0
    for frame, (time_s, grey) in enumerate(frames):
        seen.times_s.append(time_s)
        seen.size = (grey.shape[1], grey.shape[0])
        found = None if car is None else detector.find_near(grey, car + drift, CAR_ID)
        everywhere = None
        if found is None and lost % SEARCH_FRAMES == 0:
            everywhere = detector.find(grey)
            found, drift = everywhere.get(CAR_ID), numpy.zeros(2)
            car = None
        if found is not None:
            drift = found.mean(axis=0) - car.mean(axis=0) if car is not None else numpy.zeros(2)
            seen.car[frame], car, lost = found, found, 0
        else:
            lost += 1
            drift = numpy.zeros(2)
        if frame % CHECK_FRAMES and not moving and everywhere is None:
            continue
        now = {} if everywhere is None else {number: one for number, one in everywhere.items() if number in floor_ids}
        for number, before in floor.items():
            if number not in now and (one := detector.find_near(grey, before, number)) is not None:
                now[number] = one
        steps = [float(numpy.abs(one - floor[number]).mean()) for number, one in now.items() if number in floor]
        moving = len(steps) > 1 and float(numpy.median(steps)) > STILL_PX * seen.size[0] / 1920
        floor |= now
        seen.floor[frame] = now
    return seen


def _views(seen: _Seen, course: Course, lens: Lens | None, where: str) -> tuple[dict[int, View], list[str]]:
    """The camera by frame, one for all if it stood still; remarks."""
    if not seen.times_s:
        raise FoldcarError(f"{where}: has no frames")
    means: dict[int, Floats] = {}
    spread: dict[int, float] = {}
    for number in {number for floor in seen.floor.values() for number in floor}:
        all_of_it = numpy.array([floor[number] for floor in seen.floor.values() if number in floor])
        means[number] = numpy.median(all_of_it, axis=0)
        spread[number] = float(numpy.quantile(numpy.abs(all_of_it - means[number]).mean(axis=(1, 2)), 0.9))
    limit = STILL_PX * seen.size[0] / 1920
    shifted = [number for number, value in spread.items() if value > 2 * limit]
    if len(shifted) <= 1 and len(means) - len(shifted) >= 3:
        # One marker that moves in a still picture was pushed.
        remarks = [f"floor marker {number} was pushed during the film: left out" for number in shifted]
        still = {number: one for number, one in means.items() if number not in shifted}
        view = find_view(still, course, seen.size, lens, where)
        return {0: view}, [*view.remarks, *remarks]
    if len(means) < 3:
        find_view(means, course, seen.size, lens, where)
    best = max(seen.floor, key=lambda frame: (len(seen.floor[frame]), -frame))
    view = find_view(seen.floor[best], course, seen.size, lens, where)
    found = {frame: moved for frame, floor in seen.floor.items() if (moved := moved_view(view, floor)) is not None}
    known = numpy.array(sorted(found))
    places = numpy.array([[*found[frame].turn, *found[frame].shift_m] for frame in known])
    views = {}
    for frame in range(len(seen.times_s)):
        place = numpy.array([numpy.interp(frame, known, column) for column in places.T])
        views[frame] = replace(view, turn=place[:3], shift_m=place[3:])
    return views, [*view.remarks, "the camera moved: a tripod makes the path better"]
