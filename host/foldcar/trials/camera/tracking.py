"""Follows a car through a film: its pose in each frame, with covariance, on the film's clock.

Input: frames with times of a camera that stands still, course, lens or None, the car's marker, the ground. Output: a
Track. Poses of single pictures are smoothed (Rauch, Tung, Striebel). Each of the six values has a rate that is driven by
white noise of the density q (unit² / s³). Over a step dt

    F = [[1, dt], [0, 1]],   Q = q [[dt³/3, dt²/2], [dt²/2, dt]].

A pose is left out if its squared distance from the prediction (in standard deviations) exceeds GATE_CHI2: a reflection,
a wrong reading. If this lasts for MAX_LOST_S, the pose is accepted.
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
# Floor markers that move by less (pixels at a width of 1920) stand still, and so does the camera.
MAX_STILL_PX = 1.4
# Limits of the corners' error (pixels). It is never smaller, because errors repeat from frame to frame.
MIN_PIXEL, MAX_PIXEL = 0.05, 1.0
SAMPLED_FRAMES = 40
MIN_POSES = 10
# A longer gap in the path gets a remark.
GAP_S = 0.5
# q of x, y, z (m²/s³) and heading, pitch, roll (rad²/s³): an edge can stop or lift a car within 0.1 s.
DENSITY = numpy.array([2.0, 2.0, 1.0, 30.0, 30.0, 30.0])
GATE_CHI2 = 36.0
MAX_LOST_S = 0.15
FIRST_RATE = numpy.array([0.5, 0.5, 0.2, 2.0, 2.0, 2.0])


@dataclass(frozen=True)
class Track:
    """A car's path: ``times_s`` (film), ``poses`` (x, y, z in m, heading, pitch, roll in rad), ``covariances``.

    ``frame_error`` are the standard deviations of x, y (m) and heading (rad) that all rows share, from camera and
    markers. ``pixel_error`` is the corners' noise, ``seen`` the fraction of frames that show the car's marker, ``film_s``
    the film's length. ``remarks`` say what is missing or was moved.
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
class _MarkersSeen:
    """The markers that the frames show: the car's corners by frame, and the floor markers' corners by id."""

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
    """Return the path of the car. Raises FoldcarError, beginning with ``where``.

    ``marker`` returns the car's marker for the scale of the print.
    """
    seen = _find_markers(frames, {floor_marker.id for floor_marker in course.floor})
    width, height = seen.size
    lens = lens.of_size(width, height, where) if lens else None
    view, remarks = _view(seen, course, lens, where)
    readout_s = lens.readout_s if lens else READOUT_S
    car = marker(view.scale)
    car_corners = sorted(seen.car.items())
    if len(car_corners) < MIN_POSES:
        raise FoldcarError(
            f"{where}: the car's marker {CAR_ID} is seen in {len(car_corners)} of {len(seen.times_s)} frames; "
            f"{MIN_POSES} are needed"
        )

    def poses_of(corner_rows: Sequence[tuple[int, Floats]], pixel: float, ground: Standing) -> list[tuple[float, Pose]]:
        """Return time (s) and pose of the car in each frame, from its marker's corners; skip frames without a pose.

        ``pixel`` is the corners' standard deviation (pixels).
        """
        result, guess = [], None
        for frame, corners in corner_rows:
            pose = find_pose(corners, view, car, ground, guess, pixel)
            if pose is not None and numpy.isfinite(pose.values).all():
                guess = pose.values
                # The time depends on the row, because a camera reads the rows one after the other.
                result.append((seen.times_s[frame] + readout_s * float(corners[:, 1].mean()) / height, pose))
        return result

    # Estimate the corners' noise in this film from a sample of frames.
    pixel_error = PIXEL
    for _ in range(2):
        sampled = [
            pose for _, pose in poses_of(car_corners[:: max(1, len(car_corners) // SAMPLED_FRAMES)], pixel_error, ground)
        ]
        squares = [float((pose.residuals_px**2).sum()) / pose.freedom(pixel_error) for pose in sampled]
        pixel_error = float(numpy.clip(numpy.sqrt(numpy.mean(squares)), MIN_PIXEL, MAX_PIXEL))
    timed_poses = poses_of(car_corners, pixel_error, ground)
    if len(ground.factors) > 1:
        ground = fit_heights([pose for _, pose in timed_poses], ground, pixel_error)
        remarks += height_remarks(ground, where)
        timed_poses = poses_of(car_corners, pixel_error, ground)
    times, poses = [time_s for time_s, _ in timed_poses], [pose for _, pose in timed_poses]
    path, covariances, used = smooth(
        numpy.array(times), numpy.array([pose.values for pose in poses]),
        numpy.array([pose.covariance(pixel_error) for pose in poses]),
    )  # fmt: skip
    gaps = numpy.diff(times)
    if gaps.max() > GAP_S:
        gap_index = int(gaps.argmax())
        remarks.append(
            f"the car is not seen from {times[gap_index]:.1f} to {times[gap_index + 1]:.1f} s of the film: "
            "its path there is a guess"
        )
    last = seen.car[max(seen.car)]
    error = view.frame_error(last.mean(axis=0), last[:2].mean(axis=0), ground.radius_m + car.z_m)
    return Track(
        numpy.array(times)[used], path[used], covariances[used], error, pixel_error,
        len(seen.car) / len(seen.times_s), seen.times_s[-1], view, tuple(remarks),
    )  # fmt: skip


def _find_markers(frames: Iterable[tuple[float, Grey]], floor_ids: set[int]) -> _MarkersSeen:
    """Find the car's marker in all frames, and the floor markers in every CHECK_FRAMES-th frame.

    The car's marker is searched where it would be if it moved on as in the last frame. If it is lost, the whole frame is
    searched, in every SEARCH_FRAMES-th frame.
    """
    detector, seen = Detector(), _MarkersSeen()
    last_corners: Floats | None = None
    motion = numpy.zeros(2)
    frames_lost = 0
    for frame, (time_s, grey) in enumerate(frames):
        seen.times_s.append(time_s)
        seen.size = (grey.shape[1], grey.shape[0])
        car_corners = None if last_corners is None else detector.find_near(grey, last_corners + motion, CAR_ID)
        all_markers = None
        if car_corners is None and frames_lost % SEARCH_FRAMES == 0:
            all_markers = detector.find(grey)
            car_corners, last_corners = all_markers.get(CAR_ID), None
        motion = numpy.zeros(2)
        if car_corners is not None:
            if last_corners is not None:
                motion = car_corners.mean(axis=0) - last_corners.mean(axis=0)
            seen.car[frame], last_corners, frames_lost = car_corners, car_corners, 0
        else:
            frames_lost += 1
        if frame % CHECK_FRAMES == 0 or all_markers is not None:
            found_markers = all_markers or {}
            for number in floor_ids:
                corners, earlier = found_markers.get(number), seen.floor.get(number)
                if corners is None and earlier is not None:
                    corners = detector.find_near(grey, earlier[-1], number)
                if corners is not None:
                    seen.floor.setdefault(number, []).append(corners)
    return seen


def _view(seen: _MarkersSeen, course: Course, lens: Lens | None, where: str) -> tuple[View, list[str]]:
    """Return the camera's view by the floor markers' median corners, and remarks. Raises FoldcarError if it moved."""
    if not seen.times_s:
        raise FoldcarError(f"{where}: has no frames")
    median_corners = {number: numpy.median(corners, axis=0) for number, corners in seen.floor.items()}
    # If only one marker moves, it was pushed; if several do, the camera moved.
    moved_ids = []
    for number, median in median_corners.items():
        distances = numpy.abs(numpy.array(seen.floor[number]) - median).mean(axis=(1, 2))
        # The limit grows with the picture's width. A few bad frames do not count.
        if numpy.quantile(distances, 0.9) > MAX_STILL_PX * seen.size[0] / 1920:
            moved_ids.append(number)
    if len(moved_ids) > 1:
        which = f"floor markers {moved_ids[0]} and {moved_ids[1]}"
        raise FoldcarError(f"{where}: the camera moved, or {which} did: use a tripod")
    still_corners = {number: median for number, median in median_corners.items() if number not in moved_ids}
    view = find_view(still_corners, course, seen.size, lens, where)
    return view, [*view.remarks, *(f"floor marker {number} was pushed during the film: left out" for number in moved_ids)]


def smooth(times_s: Floats, poses: Floats, covariances: Floats) -> tuple[Floats, Floats, Floats]:
    """Smooth poses at ascending times by a Kalman filter and the Rauch-Tung-Striebel recursion.

    The state is a pose with its rates; accelerations are white noise. Poses that are improbable by the filter are left
    out. Returns poses (n, 6), covariances (n, 6, 6) and which were used (n). Headings are continuous and may exceed π.
    """
    poses = poses.copy()
    poses[:, 3:] = numpy.unwrap(poses[:, 3:], axis=0)
    n = len(times_s)
    states, state_covariances = numpy.zeros((n, 12)), numpy.zeros((n, 12, 12))
    predicted_states, predicted_covariances = numpy.zeros((n, 12)), numpy.zeros((n, 12, 12))
    transitions = numpy.zeros((n, 12, 12))
    is_used = numpy.zeros(n, dtype=bool)
    state = numpy.concatenate([poses[0], numpy.zeros(6)])
    covariance = numpy.zeros((12, 12))
    covariance[:6, :6], covariance[6:, 6:] = covariances[0] + 1e-12 * numpy.eye(6), numpy.diag(FIRST_RATE**2)
    last_used_s = times_s[0]
    for k in range(n):
        dt = times_s[k] - times_s[k - 1] if k else 0.0
        transition, noise = numpy.eye(12), numpy.zeros((12, 12))
        transition[:6, 6:] = dt * numpy.eye(6)
        noise[:6, :6], noise[6:, 6:] = numpy.diag(DENSITY * dt**3 / 3), numpy.diag(DENSITY * dt)
        noise[:6, 6:] = noise[6:, :6] = numpy.diag(DENSITY * dt**2 / 2)
        state, covariance = transition @ state, transition @ covariance @ transition.T + noise
        predicted_states[k], predicted_covariances[k], transitions[k] = state, covariance, transition
        innovation = poses[k] - state[:6]
        innovation[3:] = numpy.remainder(innovation[3:] + numpy.pi, 2 * numpy.pi) - numpy.pi
        inverse_covariance = numpy.linalg.inv(covariance[:6, :6] + covariances[k])
        if k == 0 or innovation @ inverse_covariance @ innovation <= GATE_CHI2 or times_s[k] - last_used_s > MAX_LOST_S:
            gain = covariance[:, :6] @ inverse_covariance if k else numpy.zeros((12, 6))
            state = state + gain @ innovation
            covariance = covariance - gain @ covariance[:6]
            covariance = (covariance + covariance.T) / 2
            is_used[k], last_used_s = True, times_s[k]
        states[k], state_covariances[k] = state, covariance
    for k in range(n - 2, -1, -1):
        inverse_predicted = numpy.linalg.pinv(predicted_covariances[k + 1], hermitian=True)
        gain = state_covariances[k] @ transitions[k + 1].T @ inverse_predicted
        states[k] += gain @ (states[k + 1] - predicted_states[k + 1])
        state_covariances[k] += gain @ (state_covariances[k + 1] - predicted_covariances[k + 1]) @ gain.T
    return states[:, :6], state_covariances[:, :6, :6], is_used
