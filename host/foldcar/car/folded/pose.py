"""Poses as nested tuples (4x4 homogeneous matrices, row-major, in mm and rad); the poses of a piece's faces."""

import math
from collections.abc import Mapping, Sequence

from foldcar.car.folded.model import IDENTITY, EdgeRef, Face, HingeJoint, Piece, Point, Pose


def translation(x_mm: float, y_mm: float, z_mm: float) -> Pose:
    """Return the pose of a translation."""
    return ((1.0, 0.0, 0.0, x_mm), (0.0, 1.0, 0.0, y_mm), (0.0, 0.0, 1.0, z_mm), (0.0, 0.0, 0.0, 1.0))


def rotation(axis: str, angle_rad: float) -> Pose:
    """Return the pose of a right-handed rotation about ``axis``: x, y or z."""
    c, s = _cos_sin(angle_rad)
    if axis == "x":
        rows = ((1.0, 0.0, 0.0), (0.0, c, -s), (0.0, s, c))
    elif axis == "y":
        rows = ((c, 0.0, s), (0.0, 1.0, 0.0), (-s, 0.0, c))
    else:
        rows = ((c, -s, 0.0), (s, c, 0.0), (0.0, 0.0, 1.0))
    return (*((*row, 0.0) for row in rows), (0.0, 0.0, 0.0, 1.0))


def compose(*poses: Pose) -> Pose:
    """Return the product of the 4x4 matrices: the last pose is applied first."""
    product = poses[0]
    for pose in poses[1:]:
        (a, b, c, x), (d, e, f, y), (g, h, i, z), _ = pose
        rows = (
            (p * a + q * d + r * g, p * b + q * e + r * h, p * c + q * f + r * i, p * x + q * y + r * z + s)
            for p, q, r, s in product[:3]
        )
        product = (*rows, IDENTITY[3])
    return product


def inverse(pose: Pose) -> Pose:
    """Return the inverse of a rigid motion. The inverse of p → R p + t is p → Rᵀ p - Rᵀ t."""
    (a, b, c, x), (d, e, f, y), (g, h, i, z), _ = pose
    return (
        (a, d, g, -(a * x + d * y + g * z)),
        (b, e, h, -(b * x + e * y + h * z)),
        (c, f, i, -(c * x + f * y + i * z)),
        IDENTITY[3],
    )


def apply(pose: Pose, x_mm: float, y_mm: float, z_mm: float = 0.0) -> tuple[float, float, float]:
    """Return the image of a point (mm)."""
    x, y, z = (a * x_mm + b * y_mm + c * z_mm + d for a, b, c, d in pose[:3])
    return (x, y, z)


def across_crease(parent: tuple[Point, Point], child: tuple[Point, Point], angle_rad: float) -> Pose:
    """Return the pose of a child face in the frame of its parent, if it is folded by the angle about their common edge.

    Each edge is given by its ends (mm), in the counter-clockwise order of its own face. So the two edges run in
    opposite directions. Their midpoints coincide.
    """
    length = math.dist(*parent)
    dx, dy = (parent[1][0] - parent[0][0]) / length, (parent[1][1] - parent[0][1]) / length
    length = math.dist(*child)
    ex, ey = (child[1][0] - child[0][0]) / length, (child[1][1] - child[0][1]) / length
    c, s = _cos_sin(angle_rad)
    # d and e are the unit vectors along the parent's and the child's edge. The rotation maps e to u = -d, the child's
    # inward normal to v, the parent's outward normal turned by the fold, and the child's z to w.
    ux, uy = -dx, -dy
    vx, vy, vz = dy * c, -dx * c, s
    wx, wy, wz = -dy * s, dx * s, c
    rows = (
        (ux * ex - vx * ey, ux * ey + vx * ex, wx),
        (uy * ex - vy * ey, uy * ey + vy * ex, wy),
        (-vz * ey, vz * ex, wz),
    )
    # The translation p - R q maps the midpoint q of the child's edge to the midpoint p of the parent's; R are the rows.
    px, py = (parent[0][0] + parent[1][0]) / 2, (parent[0][1] + parent[1][1]) / 2
    qx, qy = (child[0][0] + child[1][0]) / 2, (child[0][1] + child[1][1]) / 2
    rows_with_p = zip(rows, (px, py, 0.0), strict=True)
    return (*((rx, ry, rz, p - rx * qx - ry * qy) for (rx, ry, rz), p in rows_with_p), IDENTITY[3])


def _cos_sin(angle_rad: float) -> tuple[float, float]:
    """Return cosine and sine. They are exact for quarter turns, so that coplanar faces stay exactly coplanar."""
    c, s = math.cos(angle_rad), math.sin(angle_rad)
    return (float(round(c)), float(round(s))) if abs(c * s) < 1e-12 else (c, s)


def folded(piece: Piece, fraction: float | Mapping[str, float] = 1.0) -> dict[str, Pose]:
    """Return the poses of the faces of a piece, by name, in the frame of its first face.

    ``fraction`` says how far the folds are closed, from 0 (flat) to 1 (assembled). It is one number for all creases,
    or a number by the name of the crease; creases that are not named have 0.
    """
    faces = {face.name: face for face in piece.faces}
    poses = {piece.faces[0].name: IDENTITY}
    for crease in piece.creases:
        closed_fraction = fraction.get(crease.name, 0.0) if isinstance(fraction, Mapping) else fraction
        turn = across_crease(edge(faces, crease.parent), edge(faces, crease.child), crease.angle_rad * closed_fraction)
        poses[crease.child.face] = compose(poses[crease.parent.face], turn)
    return poses


def edge(faces: Mapping[str, Face], reference: EdgeRef) -> tuple[Point, Point]:
    """Return the ends of an edge (mm) in its face's frame."""
    return side(faces[reference.face].outline_mm, reference.index)


def side(outline_mm: Sequence[Point], index: int) -> tuple[Point, Point]:
    """Return the ends of edge ``index`` of an outline (mm)."""
    return outline_mm[index], outline_mm[(index + 1) % len(outline_mm)]


def hinge_motion(hinge: HingeJoint, angle_rad: float) -> Pose:
    """Return the motion of the rear segment in the frame of the front segment (mm) if the hinge bends by an angle
    (rad).
    """
    x, y, z = hinge.center_mm
    return compose(translation(x, y, z), rotation("y", angle_rad), translation(-x, -y, -z))
