"""Follows a car through a film: where it was in each frame, with covariance, on the film's own clock.

Input: frames with times of a camera that stands still, course, lens if there is one, the car's marker, how it may stand.
Output: a Track. Poses of single pictures are smoothed (Rauch, Tung, Striebel): each of the six values has a rate that
changes by white noise of the density q (unit² / s³): over a step dt

    F = [[1, dt], [0, 1]],   Q = q [[dt³/3, dt²/2], [dt²/2, dt]].

A pose that is farther from where the path was going than GATE standard deviations is left out: a reflection, a wrong
reading. If that goes on for LOST_S, the car did go there.
"""

from collections.abc import Callable, Iterable, Sequence
from dataclasses import dataclass, field

import numpy

from foldcar.errors import FoldcarError
from foldcar.trials.camera.detection import Detector, Floats, Grey
from foldcar.trials.camera.ground import Standing, fit_heights, height_remarks
from foldcar.trials.camera.lens import READOUT_S, Lens
from foldcar.trials.camera.markers import CAR_ID, Course
from foldcar.trials.camera.poses import PIXEL, CarMarker, Pose, find_pose
from foldcar.trials.camera.view import View, find_view

CHECK_FRAMES = 10
SEARCH_FRAMES = 3
# Floor markers that move by less (pixels at a width of 1920) stand still: so does the camera.
STILL_PX = 1.4
# Corners are never known better: their errors repeat from frame to frame.
MIN_PIXEL, MAX_PIXEL = 0.05, 1.0
SOME_FRAMES = 40
MIN_POSES = 10
# A gap that the path does not bridge.
GAP_S = 0.5
# Of x, y, z (m²/s³) and heading, pitch, roll (rad²/s³): a wheel against an edge stops or lifts a car within 0.1 s.
DENSITY = numpy.array([2.0, 2.0, 1.0, 30.0, 30.0, 30.0])
GATE = 36.0
LOST_S = 0.15
FIRST_RATE = numpy.array([0.5, 0.5, 0.2, 2.0, 2.0, 2.0])


@dataclass(frozen=True)
class Track:
    """Rows of ``times_s`` (film), ``poses`` (x, y, z in m, heading, pitch, roll in rad), ``covariances``.

    ``frame_error`` are the standard deviations of x, y (m) and heading (rad) that all rows share: camera and markers.
    ``pixel_error`` is the corners' noise, ``seen`` the share of frames that show the car's marker, ``film_s`` the film's
    length. ``remarks`` say what is missing or was moved.
    """

    times_s: Floats
    poses: Floats
    covariances: Floats
    frame_error: Floats
    pixel_error: float
    seen: float
    film_s: float
    view: View
    remarks: tuple[str, ...]


@dataclass
class _Seen:
    """What the frames showed: the car's corners by frame, those of the floor's markers by id."""

    times_s: list[float] = field(default_factory=list)
    car: dict[int, Floats] = field(default_factory=dict)
    floor: dict[int, list[Floats]] = field(default_factory=dict)
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
    view, remarks = _view(seen, course, lens, where)
    readout_s = lens.readout_s if lens else READOUT_S
    car = marker(view.scale)
    shown = sorted(seen.car.items())
    if len(shown) < MIN_POSES:
        raise FoldcarError(
            f"{where}: the car's marker {CAR_ID} is seen in {len(shown)} of {len(seen.times_s)} frames; {MIN_POSES} "
            "are needed"
        )

    def poses_of(some: Sequence[tuple[int, Floats]], pixel: float, ground: Standing) -> list[tuple[float, Pose]]:
        result, guess = [], None
        for frame, corners in some:
            pose = find_pose(corners, view, car, ground, guess, pixel)
            if pose is not None and numpy.isfinite(pose.values).all():
                guess = pose.values
                # The rows of a picture are read one after the other.
                result.append((seen.times_s[frame] + readout_s * float(corners[:, 1].mean()) / height, pose))
        return result

    # A first look at some frames tells how well corners are known in this film.
    pixel_error = PIXEL
    for _ in range(2):
        some = [pose for _, pose in poses_of(shown[:: max(1, len(shown) // SOME_FRAMES)], pixel_error, ground)]
        squares = [float((pose.residuals_px**2).sum()) / pose.freedom(pixel_error) for pose in some]
        pixel_error = float(numpy.clip(numpy.sqrt(numpy.mean(squares)), MIN_PIXEL, MAX_PIXEL))
    found = poses_of(shown, pixel_error, ground)
    if len(ground.factors) > 1:
        ground = fit_heights([pose for _, pose in found], ground, pixel_error)
        remarks += height_remarks(ground, where)
        found = poses_of(shown, pixel_error, ground)
    times, poses = [time_s for time_s, _ in found], [pose for _, pose in found]
    path, covariances, used = smooth(
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
    error = view.frame_error(last.mean(axis=0), last[:2].mean(axis=0), ground.radius_m + car.z_m)
    return Track(
        numpy.array(times)[used], path[used], covariances[used], error, pixel_error,
        len(seen.car) / len(seen.times_s), seen.times_s[-1], view, tuple(remarks),
    )  # fmt: skip


def _look(frames: Iterable[tuple[float, Grey]], floor_ids: set[int]) -> _Seen:
    """Find the car's marker in all frames, near where it was, the floor's in each CHECK_FRAMES-th."""
    detector, seen = Detector(), _Seen()
    car: Floats | None = None
    drift = numpy.zeros(2)
    lost = 0
    for frame, (time_s, grey) in enumerate(frames):
        seen.times_s.append(time_s)
        seen.size = (grey.shape[1], grey.shape[0])
        found = None if car is None else detector.find_near(grey, car + drift, CAR_ID)
        everywhere = None
        if found is None and lost % SEARCH_FRAMES == 0:
            everywhere = detector.find(grey)
            found, car = everywhere.get(CAR_ID), None
        drift = numpy.zeros(2)
        if found is not None:
            if car is not None:
                drift = found.mean(axis=0) - car.mean(axis=0)
            seen.car[frame], car, lost = found, found, 0
        else:
            lost += 1
        if frame % CHECK_FRAMES == 0 or everywhere is not None:
            known = everywhere or {}
            for number in floor_ids:
                corners, before = known.get(number), seen.floor.get(number)
                if corners is None and before is not None:
                    corners = detector.find_near(grey, before[-1], number)
                if corners is not None:
                    seen.floor.setdefault(number, []).append(corners)
    return seen


def _view(seen: _Seen, course: Course, lens: Lens | None, where: str) -> tuple[View, list[str]]:
    """The camera, and remarks; FoldcarError if it moved."""
    if not seen.times_s:
        raise FoldcarError(f"{where}: has no frames")
    means = {number: numpy.median(corners, axis=0) for number, corners in seen.floor.items()}
    # One marker that moves in a still picture was pushed.
    pushed = []
    for number, mean in means.items():
        away = numpy.abs(numpy.array(seen.floor[number]) - mean).mean(axis=(1, 2))
        if numpy.quantile(away, 0.9) > STILL_PX * seen.size[0] / 1920:
            pushed.append(number)
    if len(pushed) > 1:
        raise FoldcarError(f"{where}: the camera moved, or floor markers {pushed[0]} and {pushed[1]} did: use a tripod")
    view = find_view({k: mean for k, mean in means.items() if k not in pushed}, course, seen.size, lens, where)
    return view, [*view.remarks, *(f"floor marker {number} was pushed during the film: left out" for number in pushed)]


def smooth(times_s: Floats, poses: Floats, covariances: Floats) -> tuple[Floats, Floats, Floats]:
    """Poses (n, 6) and covariances (n, 6, 6) at ascending times, and which were used (n); headings go on beyond π."""
    poses = poses.copy()
    poses[:, 3:] = numpy.unwrap(poses[:, 3:], axis=0)
    n = len(times_s)
    states, spreads = numpy.zeros((n, 12)), numpy.zeros((n, 12, 12))
    before, before_spreads = numpy.zeros((n, 12)), numpy.zeros((n, 12, 12))
    moves = numpy.zeros((n, 12, 12))
    used = numpy.zeros(n, dtype=bool)
    state = numpy.concatenate([poses[0], numpy.zeros(6)])
    spread = numpy.zeros((12, 12))
    spread[:6, :6], spread[6:, 6:] = covariances[0] + 1e-12 * numpy.eye(6), numpy.diag(FIRST_RATE**2)
    last_used_s = times_s[0]
    for k in range(n):
        dt = times_s[k] - times_s[k - 1] if k else 0.0
        move, noise = numpy.eye(12), numpy.zeros((12, 12))
        move[:6, 6:] = dt * numpy.eye(6)
        noise[:6, :6], noise[6:, 6:] = numpy.diag(DENSITY * dt**3 / 3), numpy.diag(DENSITY * dt)
        noise[:6, 6:] = noise[6:, :6] = numpy.diag(DENSITY * dt**2 / 2)
        state, spread = move @ state, move @ spread @ move.T + noise
        before[k], before_spreads[k], moves[k] = state, spread, move
        innovation = poses[k] - state[:6]
        innovation[3:] = numpy.remainder(innovation[3:] + numpy.pi, 2 * numpy.pi) - numpy.pi
        weight = numpy.linalg.inv(spread[:6, :6] + covariances[k])
        if k == 0 or innovation @ weight @ innovation <= GATE or times_s[k] - last_used_s > LOST_S:
            gain = spread[:, :6] @ weight if k else numpy.zeros((12, 6))
            state = state + gain @ innovation
            spread = spread - gain @ spread[:6]
            spread = (spread + spread.T) / 2
            used[k], last_used_s = True, times_s[k]
        states[k], spreads[k] = state, spread
    for k in range(n - 2, -1, -1):
        gain = spreads[k] @ moves[k + 1].T @ numpy.linalg.pinv(before_spreads[k + 1], hermitian=True)
        states[k] += gain @ (states[k + 1] - before[k + 1])
        spreads[k] += gain @ (spreads[k + 1] - before_spreads[k + 1]) @ gain.T
    return states[:, :6], spreads[:, :6, :6], used
