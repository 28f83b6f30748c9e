"""The car's pose from the four corners of its marker in one picture, with its covariance.

The unknowns are x, y, z of the car's origin, heading, pitch (nose up) and roll (left side up). The result is the most
probable pose given the corners, p = projection(pose) + noise, and how a car stands on that ground (`ground.py`).
Gauss-Newton minimises

    sum |p - projection(pose)|² / pixel² + (g - g_0)ᵀ Σ⁻¹ (g - g_0),   g = (z, pitch, roll).

A flat marker far away looks the same tilted to either side, so both poses of OpenCV's IPPE are tried. A tipped car does
not stand on its wheels: if the corners contradict the ground by more than MAX_CONTRADICTION, the ground is ignored.
"""

import math
from dataclasses import dataclass

import cv2
import numpy

from foldcar.trials.camera.detection import Floats
from foldcar.trials.camera.ground import GROUND_INDICES, Place, Stance, Standing
from foldcar.trials.camera.view import View, ideal_pixels, marker_corners

# Standard deviation of corners (pixels) if nothing is known about the picture.
PIXEL = 0.2
# If the sum of squares decreases by more than this without the ground's term, the car does not stand on the ground. By
# chance, χ² of three values exceeds 16 once in a thousand pictures.
MAX_CONTRADICTION = 30.0
ROUNDS = 8
STEP = 1e-5
# A pose and its six neighbours.
NEIGHBOURS = STEP * numpy.vstack([numpy.zeros(6), numpy.eye(6)])
# Columns: the print's right, top and front in the car's frame.
MARKER_TO_CAR = numpy.array([[0.0, 1.0, 0.0], [-1.0, 0.0, 0.0], [0.0, 0.0, 1.0]])


@dataclass(frozen=True)
class CarMarker:
    """The marker in the car's frame: how large, how far ahead, how high above the axles (m)."""

    size_m: float
    x_m: float
    z_m: float

    @property
    def corners(self) -> Floats:
        """The corners (4, 3) in the car's frame: the print's top is at the car's front, its right at the car's right."""
        flat = marker_corners(self.size_m)
        return numpy.column_stack([flat[:, 1] + self.x_m, -flat[:, 0], numpy.full(4, self.z_m)])


@dataclass(frozen=True)
class Pose:
    """x, y, z (m), heading, pitch, roll (rad), and the residuals of the corners (pixels).

    ``information`` is the corners' information matrix at a noise of one pixel. ``weights`` is the ground's, whose values
    are ``expected``. ``stands``: the ground was used.
    """

    values: Floats
    information: Floats
    weights: Floats
    expected: Floats
    residuals_px: Floats
    stands: bool

    def covariance(self, pixel: float) -> Floats:
        """Return the covariance of the values if corners have the standard deviation ``pixel`` (pixels)."""
        total_information = self.information / pixel**2 + self.weights
        return numpy.asarray(numpy.linalg.pinv(total_information, hermitian=True), float)

    def by_corners(self, pixel: float) -> tuple[Floats, Floats]:
        """Return values and covariance without the ground; at the optimum both terms' gradients balance."""
        covariance = numpy.asarray(pixel**2 * numpy.linalg.pinv(self.information, hermitian=True), float)
        return self.values + covariance @ self.weights @ (self.values - self.expected), covariance

    def freedom(self, pixel: float) -> float:
        """Return the degrees of freedom of the residuals: 8 minus the effective number of fitted values."""
        return 2.0 + float(numpy.trace(self.weights @ self.covariance(pixel)))


def rotation(heading: float, pitch: float, roll: float) -> Floats:
    """Return the rotation from the car's frame to the scene's: about z, then nose up, then left side up."""
    turn: Floats = rotations(numpy.array([[heading, pitch, roll]]))[0]
    return turn


def rotations(turns: Floats) -> Floats:
    """Return the :func:`rotation` (n, 3, 3) of each row (n, 3) of heading, pitch, roll (rad)."""
    # Cosines and sines of heading, pitch and roll; positive pitch is nose up, a negative rotation about y.
    (ch, cp, cr), (sh, sp, sr) = numpy.cos(turns).T, numpy.sin(turns * [1.0, -1.0, 1.0]).T
    rows = [
        [ch * cp, ch * sp * sr - sh * cr, ch * sp * cr + sh * sr],
        [sh * cp, sh * sp * sr + ch * cr, sh * sp * cr - ch * sr],
        [-sp, cp * sr, cp * cr],
    ]
    turned: Floats = numpy.array(rows).transpose(2, 0, 1)
    return turned


def angles(turn: Floats) -> tuple[float, float, float]:
    """Return heading, pitch and roll of a rotation."""
    return (
        math.atan2(turn[1, 0], turn[0, 0]),
        math.atan2(turn[2, 0], math.hypot(turn[2, 1], turn[2, 2])),
        math.atan2(turn[2, 1], turn[2, 2]),
    )


def find_pose(
    pixels: Floats, view: View, marker: CarMarker, ground: Standing, guess: Floats | None = None,
    pixel: float = PIXEL,
) -> Pose | None:  # fmt: skip
    """Return the pose of the car whose marker has these corners in the picture; None if no pose fits.

    ``pixels`` (4, 2) are the corners, the first two at the car's front; ``pixel`` is their standard deviation.
    ``guess`` is the car's pose shortly before. The car stands on the ground, unless the corners contradict this.
    """
    # Start with a car that stands on the ground: from far away, the tilt of the marker alone is too uncertain.
    middle_and_top = numpy.array([pixels.mean(axis=0), pixels[:2].mean(axis=0)])
    middle, front = view.on_plane(middle_and_top, ground.radius_m + marker.z_m)
    direction = front - middle
    direction = direction / max(float(numpy.hypot(*direction)), 1e-9)
    x, y = middle - marker.x_m * direction
    level_pose = numpy.array([x, y, ground.radius_m, math.atan2(direction[1], direction[0]), 0.0, 0.0])
    cost, best_pose = _pose_on_ground(level_pose, pixels, view, marker, ground, pixel)
    if cost <= MAX_CONTRADICTION:
        return best_pose
    starts = [*([] if guess is None else [guess]), *_poses_by_marker(pixels, view, marker)]
    if not starts:
        return None
    candidates = [(cost, best_pose), *(_pose_on_ground(start, pixels, view, marker, ground, pixel) for start in starts)]
    cost, best_pose = min(candidates, key=lambda candidate: candidate[0])
    cost_without_ground, best_without_ground = min(
        (_refined(start, pixels, view, marker, None, pixel) for start in starts), key=lambda candidate: candidate[0]
    )
    return best_without_ground if cost - cost_without_ground > MAX_CONTRADICTION else best_pose


def _poses_by_marker(pixels: Floats, view: View, marker: CarMarker) -> list[Floats]:
    """Return up to two poses (6,) of the car that fit the marker alone, without the ground.

    There are two, because a flat square looks nearly the same if it is tilted to the other side.
    """
    count, turns, shifts, _ = cv2.solvePnPGeneric(
        marker_corners(marker.size_m),
        ideal_pixels(view.lens, pixels),
        numpy.eye(3),
        None,
        flags=cv2.SOLVEPNP_IPPE_SQUARE,
    )
    result = []
    for k in range(count):
        # From the car's frame to the marker's, to the camera's, to the scene's.
        marker_to_camera, _ = cv2.Rodrigues(turns[k])
        turn = view.rotation.T @ marker_to_camera @ MARKER_TO_CAR.T
        # The marker's middle in the scene; from it back to the car's origin.
        middle = view.rotation.T @ (shifts[k].ravel() - view.shift_m)
        result.append(numpy.array([*(middle - turn @ (marker.x_m, 0.0, marker.z_m)), *angles(turn)]))
    return result


def _pose_on_ground(
    start: Floats, pixels: Floats, view: View, marker: CarMarker, ground: Standing, pixel: float
) -> tuple[float, Pose]:
    """Return the cost and the refined pose with the ground below it as a prior.

    It is refined twice, because the ground's values change with position and tilt.
    """
    _, first = _refined(start, pixels, view, marker, ground.stance_at(Place.of(start)), pixel)
    return _refined(first.values, pixels, view, marker, ground.stance_at(Place.of(first.values)), pixel)


def _refined(
    start: Floats, pixels: Floats, view: View, marker: CarMarker, stance: Stance | None, pixel: float
) -> tuple[float, Pose]:
    corners, observed = marker.corners, pixels.ravel()

    def projected(poses: Floats) -> Floats:
        """Return the corners (n, 8) of poses (n, 6)."""
        points = corners @ rotations(poses[:, 3:]).transpose(0, 2, 1) + poses[:, None, :3]
        return view.pixels(points.reshape(-1, 3)).reshape(len(poses), 8)

    values, weights, expected = start.copy(), numpy.zeros((6, 6)), numpy.zeros(6)
    if stance is not None:
        expected[GROUND_INDICES] = stance.values
        weights[numpy.ix_(GROUND_INDICES, GROUND_INDICES)] = numpy.linalg.inv(stance.covariance)

    def cost_of(values: Floats, projection: Floats) -> float:
        residual, ground_residual = (projection - observed) / pixel, values - expected
        return float(residual @ residual + ground_residual @ weights @ ground_residual)

    damping = 1e-6
    projections = projected(values + NEIGHBOURS)
    cost = cost_of(values, projections[0])
    for _ in range(ROUNDS):
        jacobian = (projections[1:] - projections[0]).T / (STEP * pixel)
        information = jacobian.T @ jacobian
        normal = information + weights
        gradient = jacobian.T @ ((observed - projections[0]) / pixel) + weights @ (expected - values)
        step = numpy.linalg.solve(normal + damping * numpy.diag(numpy.diag(normal)), gradient)
        new_projections = projected(values + step + NEIGHBOURS)
        new_cost = cost_of(values + step, new_projections[0])
        if new_cost <= cost:
            values, projections, damping, gain, cost = (
                values + step,
                new_projections,
                damping / 10,
                cost - new_cost,
                new_cost,
            )
            if gain < 1e-4:
                break
        else:
            damping = max(damping, 1e-4) * 10
            if damping > 1e3:
                break
    values[3:] = [math.remainder(angle, math.tau) for angle in values[3:]]
    residuals = (projections[0] - observed).reshape(4, 2)
    return cost, Pose(values, information * pixel**2, weights, expected, residuals, stance is not None)
