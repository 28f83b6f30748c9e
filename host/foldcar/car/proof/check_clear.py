"""Checks that the finished car is clear of itself: its film, its segments at the limits of hinges, its turning wheels.

Input: a car; wheels are alike, so that the first one stands for all. Output: findings. That parts do not overlap is
proved with the assembly (prove.py).
"""

import itertools
import math
from collections.abc import Iterator

import numpy as np
import shapely
from numpy.typing import NDArray

from foldcar.car.folded.model import Axle, FoldedCar, Mount
from foldcar.car.folded.placed import Bodies, Finding
from foldcar.car.folded.pose import compose, folded_back
from foldcar.car.proof.blocks import Blocks, hit, together
from foldcar.car.proof.roles import roles_of
from foldcar.car.proof.scene import Scene, Stage, title

Points = NDArray[np.float64]
# What turning points pass: least and largest distance from the axle, and outwards from the wheel's middle along it (mm).
Band = tuple[float, float, float, float]

# Least distance of what turns from what does not, less than between a servo's turret and the horn over it.
FREE_MM = 0.5
# What is as near to an axle as this is the spline that turns.
ON_AXIS_MM = 0.5


def check_film_apart(car: FoldedCar) -> Iterator[Finding]:
    """Findings where film runs into other film of its body, or of the next one at a limit of a hinge, all others flat.

    Hinge strips bend at the limits and are not checked there.
    """
    roles = roles_of(car)
    scene, stage = Scene(roles, tongues=True), Stage(roles, {name: roles.whole(name) for name in roles.pieces})
    # Beside a bend, which is modelled as an edge, thick film reaches into its neighbour.
    bends = [(piece.name, c.parent.face, c.child.face) for piece in car.pieces for c in piece.creases if c.bend]
    joined = scene.ignored(("tab", "lap")) | {(title(name, a), title(name, b)) for name, a, b in bends}

    def film(body: str, but: frozenset[str] = frozenset()) -> Blocks:
        placed = (one for one in roles.placed(body) if one.piece not in but)
        return together(scene.solid(("piece", one.piece, one.copy), stage) for one in placed)

    for body in (*roles.bodies, *roles.wheels[:1]):
        solids = film(body)
        titles = list(dict.fromkeys(solids.titles))
        for n, one in enumerate(titles, 1):
            met = hit(solids.where({one}), solids.where(set(titles[n:])), ignored=joined)
            if met is not None:
                yield Finding("crossing", one, f"runs into {met}")
    strips = frozenset(piece.name for piece in car.pieces if any(crease.flexure for crease in piece.creases))
    for hinge in car.hinges:
        front, rear = (film(body, strips) for body in (hinge.front, hinge.rear))
        for angle in (hinge.min_rad, hinge.max_rad):
            moved = rear.moved(folded_back(hinge, angle))
            for one in dict.fromkeys(moved.titles):
                met = hit(moved.where({one}), front)
                if met is not None:
                    place = f"between {hinge.front} and {hinge.rear}, folded by {math.degrees(angle):.1f} degrees"
                    yield Finding("hinge", place, f"{one} runs into {met}")


def corners_mm(mount: Mount) -> Iterator[Points]:
    """The corners of the box around each of a part's solids, (8, 3) in mm in the car."""
    signs = np.array(list(itertools.product((-0.5, 0.5), repeat=3)))
    for solid in mount.shape:
        pose = np.array(compose(mount.pose, solid.pose))
        yield signs * solid.size_mm @ pose[:3, :3].T + pose[:3, 3]


def check_turning(car: FoldedCar, bodies: Bodies) -> Iterator[Finding]:
    """Findings about wheels: something is where a wheel's film, screws or tyre pass."""
    firm = [m for m in car.mounts if m.part != car.parts.wiring.name and m.body.startswith("segment")]
    walls = [face for faces in bodies.values() for face in faces if face.body.startswith("segment")]
    still = [(face.title, face.corners_mm) for face in walls]
    still += [(mount.name, corners) for mount in firm for corners in corners_mm(mount)]
    wheel = car.axles[0]
    mounts = [list(corners_mm(mount)) for mount in car.mounts if mount.body == wheel.wheel]
    points = [face.corners_mm for face in bodies.get(wheel.wheel, ())]
    # The centre screw sits in the spline.
    points += [box for boxes in mounts if not _is_spline(np.vstack(boxes), wheel) for box in boxes]
    turning = np.array([_band(some, wheel) for some in points])
    for axle in car.axles:
        bands = [(what, _band(corners, axle)) for what, corners in still if not _is_spline(corners, axle)]
        for what in dict.fromkeys(what for what, band in bands if _meets(band, turning)):
            yield Finding("wheels", axle.wheel, f"runs into {what}")


def _meets(band: Band, others: Points) -> bool:
    """Whether a band comes closer than FREE_MM to one of others, (n, 4), across and along the axle."""
    near, far, inside, outside = others.T
    across = (band[0] < far + FREE_MM) & (near < band[1] + FREE_MM)
    return bool((across & (band[2] < outside + FREE_MM) & (inside < band[3] + FREE_MM)).any())


def _band(corners: Points, axle: Axle) -> Band:
    """The band of the convex hull of these points, (n, 3) in mm."""
    x, y, z = (corners - axle.center_mm).T
    hull = shapely.MultiPoint(np.column_stack([x, z])).convex_hull
    out = y if axle.side == "left" else -y
    ends = hull.distance(shapely.Point(0, 0)), np.hypot(x, z).max(), out.min(), out.max()
    near, far, inside, outside = (float(value) for value in ends)
    return near, far, inside, outside


def _is_spline(corners: Points, axle: Axle) -> bool:
    """Whether points lie in a slender box around the axle."""
    off = (corners.min(axis=0) + corners.max(axis=0)) / 2 - axle.center_mm
    reach = np.ptp(corners, axis=0) / 2
    return bool(np.hypot(off[0], off[2]) < ON_AXIS_MM and max(reach[0], reach[2]) < reach[1] + 1)
