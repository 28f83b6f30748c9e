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
    """Return the pose that applies ``poses`` one after the other, the last one first.

    It is the product of their 4x4 matrices.
    """
    product = poses[0]
    for pose in poses[1:]:
        product = _product(product, pose)
    return product


def _product(first: Pose, second: Pose) -> Pose:
    """Return the product of two 4x4 matrices. The last row of a pose is always that of the identity."""
    x_row, y_row, z_row, _ = second
    rows = [
        (
            x * x_row[0] + y * y_row[0] + z * z_row[0],
            x * x_row[1] + y * y_row[1] + z * z_row[1],
            x * x_row[2] + y * y_row[2] + z * z_row[2],
            x * x_row[3] + y * y_row[3] + z * z_row[3] + shift,
        )
        for x, y, z, shift in first[:3]
    ]
    return (*rows, IDENTITY[3])


def inverse(pose: Pose) -> Pose:
    """Return the inverse of a rigid motion. The inverse of p → R p + t is p → Rᵀ p - Rᵀ t."""
    (xx, xy, xz, shift_x), (yx, yy, yz, shift_y), (zx, zy, zz, shift_z), _ = pose
    return (
        (xx, yx, zx, -(xx * shift_x + yx * shift_y + zx * shift_z)),
        (xy, yy, zy, -(xy * shift_x + yy * shift_y + zy * shift_z)),
        (xz, yz, zz, -(xz * shift_x + yz * shift_y + zz * shift_z)),
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
    parent_x, parent_y = _direction(parent)
    child_x, child_y = _direction(child)
    cos, sin = _cos_sin(angle_rad)
    # Three unit vectors of the child, given in the parent's frame. The first runs along the child's edge, so it is
    # opposite to the direction of the parent's edge.
    along_x, along_y = -parent_x, -parent_y
    # The second is across the edge and points into the child. In the flat it points out of the parent, and the fold turns
    # it up.
    inwards_x, inwards_y, inwards_z = parent_y * cos, -parent_x * cos, sin
    # The third is the child's z.
    up_x, up_y, up_z = -parent_y * sin, parent_x * sin, cos
    # In the child's own frame, the three are (child_x, child_y, 0), (-child_y, child_x, 0) and (0, 0, 1). The rotation
    # takes a point (x, y, z) of the child to x · column 1 + y · column 2 + z · column 3. So column 1 is what becomes of
    # (1, 0, 0) = child_x · along - child_y · inwards, and column 2 of (0, 1, 0) = child_y · along + child_x · inwards.
    rotation_rows = (
        (along_x * child_x - inwards_x * child_y, along_x * child_y + inwards_x * child_x, up_x),
        (along_y * child_x - inwards_y * child_y, along_y * child_y + inwards_y * child_x, up_y),
        (-inwards_z * child_y, inwards_z * child_x, up_z),
    )
    # The translation takes the middle of the child's edge, after the rotation, to the middle of the parent's edge.
    parent_middle = (*_middle(parent), 0.0)
    middle_x, middle_y = _middle(child)
    rows = []
    for (x, y, z), target in zip(rotation_rows, parent_middle, strict=True):
        rows.append((x, y, z, target - x * middle_x - y * middle_y))
    return (*rows, IDENTITY[3])


def _direction(edge: tuple[Point, Point]) -> Point:
    """Return the unit vector from the start of an edge to its end."""
    (x0, y0), (x1, y1) = edge
    length = math.dist(*edge)
    return (x1 - x0) / length, (y1 - y0) / length


def _middle(edge: tuple[Point, Point]) -> Point:
    """Return the middle of an edge."""
    (x0, y0), (x1, y1) = edge
    return (x0 + x1) / 2, (y0 + y1) / 2


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
