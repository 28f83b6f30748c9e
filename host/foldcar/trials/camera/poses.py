"""The car's pose from the four corners of its marker in one picture, with its covariance.

Sought are x, y, z of the car's origin, heading, pitch (nose up), roll (left side up), most probable given the corners,
p = projection(pose) + noise, and how a car stands on that ground (`ground.py`): Gauss-Newton on

    sum |p - projection(pose)|² / pixel² + (g - g_0)ᵀ Σ⁻¹ (g - g_0),   g = (z, pitch, roll).

A flat marker far away looks the same tilted to either side: both poses of OpenCV's IPPE are tried. A car that has tipped
does not stand as the ground says: where the corners contradict that by more than SURPRISE, they alone count.
"""

import math
from dataclasses import dataclass

import cv2
import numpy

from foldcar.trials.camera.detection import Floats
from foldcar.trials.camera.ground import GROUND, Place, Stance, Standing
from foldcar.trials.camera.view import View, ideal_pixels, marker_corners

# What corners are known to where nothing is known of the picture.
PIXEL = 0.2
# How much the sum may fall without what the ground says; χ² of three unknowns reaches 16 once in a thousand pictures.
SURPRISE = 30.0
ROUNDS = 8
STEP = 1e-5
# A pose and its six neighbours.
STEPS = STEP * numpy.vstack([numpy.zeros(6), numpy.eye(6)])
# The print's right, top and front in the car's frame.
PRINTED = numpy.array([[0.0, 1.0, 0.0], [-1.0, 0.0, 0.0], [0.0, 0.0, 1.0]])


@dataclass(frozen=True)
class CarMarker:
    """The marker in the car's frame: how large, how far ahead, how high above the axles (m)."""

    size_m: float
    x_m: float
    z_m: float

    @property
    def corners(self) -> Floats:
        """In the car's frame: the top of the print is at the front, its right on the car's right."""
        flat = marker_corners(self.size_m)
        return numpy.column_stack([flat[:, 1] + self.x_m, -flat[:, 0], numpy.full(4, self.z_m)])


@dataclass(frozen=True)
class Pose:
    """x, y, z (m), heading, pitch, roll (rad), and what the corners are off by (pixels).

    ``information`` is that of the corners at a noise of one pixel, ``weights`` that of the ground, which has
    ``expected``; ``stands``: as the ground says.
    """

    values: Floats
    information: Floats
    weights: Floats
    expected: Floats
    residuals_px: Floats
    stands: bool

    def covariance(self, pixel: float) -> Floats:
        """The covariance of the values where corners have that noise (pixels)."""
        whole = self.information / pixel**2 + self.weights
        return numpy.asarray(numpy.linalg.pinv(whole, hermitian=True), float)

    def by_corners(self, pixel: float) -> tuple[Floats, Floats]:
        """Values and covariance by the corners alone: at the optimum what pulls at the corners balances the ground."""
        spread = numpy.asarray(pixel**2 * numpy.linalg.pinv(self.information, hermitian=True), float)
        return self.values + spread @ self.weights @ (self.values - self.expected), spread

    def freedom(self, pixel: float) -> float:
        """Of how many numbers the residuals tell the noise: 8 less what the values took."""
        return 2.0 + float(numpy.trace(self.weights @ self.covariance(pixel)))


def rotation(heading: float, pitch: float, roll: float) -> Floats:
    """From the car's frame to the scene's: about z, then nose up, then left side up."""
    turn: Floats = rotations(numpy.array([[heading, pitch, roll]]))[0]
    return turn


def rotations(turns: Floats) -> Floats:
    """The :func:`rotation` (n, 3, 3) of each row (n, 3)."""
    (ch, cp, cr), (sh, sp, sr) = numpy.cos(turns).T, numpy.sin(turns * [1.0, -1.0, 1.0]).T
    rows = [
        [ch * cp, ch * sp * sr - sh * cr, ch * sp * cr + sh * sr],
        [sh * cp, sh * sp * sr + ch * cr, sh * sp * cr - ch * sr],
        [-sp, cp * sr, cp * cr],
    ]
    turned: Floats = numpy.array(rows).transpose(2, 0, 1)
    return turned


def angles(turn: Floats) -> tuple[float, float, float]:
    """Heading, pitch and roll of a rotation."""
    return (
        math.atan2(turn[1, 0], turn[0, 0]),
        math.atan2(turn[2, 0], math.hypot(turn[2, 1], turn[2, 2])),
        math.atan2(turn[2, 1], turn[2, 2]),
    )


def find_pose(
    pixels: Floats, view: View, marker: CarMarker, ground: Standing, guess: Floats | None = None,
    pixel: float = PIXEL,
) -> Pose | None:  # fmt: skip
    """The pose whose marker has these corners, known to ``pixel``; None if no pose fits.

    ``guess`` is where the car was shortly before.
    """
    # A car that stands does as the ground says: from far away the marker's own tilt is too vague to begin with.
    shown = numpy.array([pixels.mean(axis=0), pixels[:2].mean(axis=0)])
    middle, front = view.on_plane(shown, ground.radius_m + marker.z_m)
    ahead = front - middle
    ahead = ahead / max(float(numpy.hypot(*ahead)), 1e-9)
    x, y = middle - marker.x_m * ahead
    level = numpy.array([x, y, ground.radius_m, math.atan2(ahead[1], ahead[0]), 0.0, 0.0])
    cost, best = _standing(level, pixels, view, marker, ground, pixel)
    if cost <= SURPRISE:
        return best
    starts = [*([] if guess is None else [guess]), *_by_itself(pixels, view, marker)]
    if not starts:
        return None
    standing = [(cost, best), *(_standing(start, pixels, view, marker, ground, pixel) for start in starts)]
    cost, best = min(standing, key=lambda one: one[0])
    free_cost, free = min(
        (_refined(start, pixels, view, marker, None, pixel) for start in starts), key=lambda one: one[0]
    )
    return free if cost - free_cost > SURPRISE else best


def _by_itself(pixels: Floats, view: View, marker: CarMarker) -> list[Floats]:
    """The two poses that the marker alone may have."""
    count, turns, shifts, _ = cv2.solvePnPGeneric(
        marker_corners(marker.size_m),
        ideal_pixels(view.lens, pixels),
        numpy.eye(3),
        None,
        flags=cv2.SOLVEPNP_IPPE_SQUARE,
    )
    result = []
    for k in range(count):
        turn = view.rotation.T @ cv2.Rodrigues(turns[k])[0] @ PRINTED.T
        middle = view.rotation.T @ (shifts[k].ravel() - view.shift_m)
        result.append(numpy.array([*(middle - turn @ (marker.x_m, 0.0, marker.z_m)), *angles(turn)]))
    return result


def _standing(
    start: Floats, pixels: Floats, view: View, marker: CarMarker, ground: Standing, pixel: float
) -> tuple[float, Pose]:
    """As the ground says where the car then is: twice, because that changes with place and tilt."""
    first = _refined(start, pixels, view, marker, ground.at(Place.of(start)), pixel)[1].values
    return _refined(first, pixels, view, marker, ground.at(Place.of(first)), pixel)


def _refined(
    start: Floats, pixels: Floats, view: View, marker: CarMarker, stands: Stance | None, pixel: float
) -> tuple[float, Pose]:
    corners, wanted = marker.corners, pixels.ravel()

    def projected(poses: Floats) -> Floats:
        """The corners (n, 8) of poses (n, 6)."""
        points = corners @ rotations(poses[:, 3:]).transpose(0, 2, 1) + poses[:, None, :3]
        return view.pixels(points.reshape(-1, 3)).reshape(len(poses), 8)

    values, weights, expected = start.copy(), numpy.zeros((6, 6)), numpy.zeros(6)
    if stands is not None:
        expected[GROUND] = stands.values
        weights[numpy.ix_(GROUND, GROUND)] = numpy.linalg.inv(stands.covariance)

    def cost_of(values: Floats, at: Floats) -> float:
        off, against = (at - wanted) / pixel, values - expected
        return float(off @ off + against @ weights @ against)

    damping = 1e-6
    shown = projected(values + STEPS)
    cost = cost_of(values, shown[0])
    for _ in range(ROUNDS):
        jacobian = (shown[1:] - shown[0]).T / (STEP * pixel)
        information = jacobian.T @ jacobian
        normal = information + weights
        gradient = jacobian.T @ ((wanted - shown[0]) / pixel) + weights @ (expected - values)
        step = numpy.linalg.solve(normal + damping * numpy.diag(numpy.diag(normal)), gradient)
        there = projected(values + step + STEPS)
        new = cost_of(values + step, there[0])
        if new <= cost:
            values, shown, damping, gained, cost = values + step, there, damping / 10, cost - new, new
            if gained < 1e-4:
                break
        else:
            damping = max(damping, 1e-4) * 10
            if damping > 1e3:
                break
    values[3:] = [math.remainder(angle, math.tau) for angle in values[3:]]
    residuals = (shown[0] - wanted).reshape(4, 2)
    return cost, Pose(values, information * pixel**2, weights, expected, residuals, stands is not None)
