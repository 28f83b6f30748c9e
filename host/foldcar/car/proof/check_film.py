"""Checks of film: flat pieces, collisions of film with film, edges that must meet, tongues that must pass their slots.

Input: a piece; a car with its placed faces. The first wheel stands for all wheels of its unit. Output: findings.
prove.py checks parts for overlaps, with the assembly.
"""

import itertools
import math
from collections import defaultdict
from collections.abc import Collection, Iterator

import numpy as np
import shapely
from shapely.affinity import affine_transform

from foldcar.car.folded.model import Face, FoldedCar, Join, Piece
from foldcar.car.folded.placed import Bodies, Finding, PlacedFace, polygon
from foldcar.car.folded.pose import edge, folded, hinge_motion
from foldcar.car.proof.blocks import Blocks, Ignored, first_obstacle, merge_blocks
from foldcar.car.proof.roles import Roles, roles_of
from foldcar.car.proof.scene import CarSolids, Stage, title
from foldcar.car.proof.step import PartKey

# Without a grid, an edge that two faces share up to rounding can make GEOS return its wrong side.
GRID_MM = 1e-6
# Overlaps up to this are rounding errors.
OVERLAP_MM2 = 1e-3


def check_flat(piece: Piece, hole_to_fold_mm: float) -> Iterator[Finding]:
    """Yield findings about the flat piece; every hole must be ``hole_to_fold_mm`` or more from every fold."""
    unsound = [finding for face in piece.faces for finding in _check_outlines(piece, face)]
    yield from unsound
    yield from _check_holes_at_folds(piece, hole_to_fold_mm)
    if not unsound:
        yield from _check_overlaps(piece)


def flat_polygons(piece: Piece) -> dict[str, shapely.Polygon]:
    """Return the faces in the flat layout (mm), by name."""
    poses = folded(piece, 0.0)
    flat = {}
    for face in piece.faces:
        # z stays 0 in the flat, so only the rows and columns of the pose for x and y count. Shapely takes the four
        # numbers of the rotation and then the two of the shift.
        x_row, y_row, *_ = poses[face.name]
        rotation_and_shift = (x_row[0], x_row[1], y_row[0], y_row[1], x_row[3], y_row[3])
        flat[face.name] = affine_transform(polygon(face), rotation_and_shift)
    return flat


def _check_outlines(piece: Piece, face: Face) -> Iterator[Finding]:
    """Yield findings on outlines that cross themselves, and on holes outside of their face or in each other."""
    place = f"{piece.name}: {face.name}"
    outline = shapely.Polygon(face.outline_mm)
    if not outline.is_valid or not shapely.is_ccw(outline.exterior):
        yield Finding("outline", place, "its outline crosses itself or runs clockwise")
        return
    occupied: shapely.Geometry = shapely.Polygon()
    for hole in face.holes:
        shape = shapely.Polygon(hole.outline_mm)
        if not shape.is_valid or shape.area <= 0:
            yield Finding("outline", f"{place}: {hole.name}", "the hole's outline crosses itself")
        elif not outline.contains(shape):
            yield Finding("outline", f"{place}: {hole.name}", "the hole is not inside its face")
        elif shape.intersects(occupied):
            yield Finding("outline", f"{place}: {hole.name}", "the hole runs into another one")
        occupied = shapely.union(occupied, shape)


def _check_holes_at_folds(piece: Piece, min_distance_mm: float) -> Iterator[Finding]:
    """Yield findings on holes that are too near to a fold."""
    faces = {face.name: face for face in piece.faces}
    refs = (ref for crease in piece.creases if not crease.bend for ref in (crease.parent, crease.child))
    lines: dict[str, list[shapely.LineString]] = defaultdict(list)
    for ref in refs:
        lines[ref.face].append(shapely.LineString(edge(faces, ref)))
    for name, folds in lines.items():
        for hole in faces[name].holes:
            nearest = min(line.distance(shapely.Polygon(hole.outline_mm)) for line in folds)
            if nearest < min_distance_mm - 1e-6:
                place = f"{piece.name}: {name}: {hole.name}"
                yield Finding("hole", place, f"is {nearest:.2f} mm from a fold, the limit is {min_distance_mm:g} mm")


def _check_overlaps(piece: Piece) -> Iterator[Finding]:
    """Yield findings on faces of a piece that overlap in the flat."""
    flat = flat_polygons(piece)
    names, shapes = list(flat), list(flat.values())
    tree = shapely.STRtree(shapes)
    for i, k in tree.query(shapes, predicate="intersects").T.tolist():
        # The query returns each pair twice, and each face with itself.
        area = shapely.intersection(shapes[i], shapes[k], grid_size=GRID_MM).area if i < k else 0.0
        if area > OVERLAP_MM2:
            yield Finding("overlap", f"{piece.name}: {names[i]}", f"overlaps {names[k]} by {area:.2f} mm² in the flat")


def check_film_apart(car: FoldedCar) -> Iterator[Finding]:
    """Yield findings where film collides with other film of its body, or of the next segment at a hinge's limit."""
    roles = roles_of(car)
    stage = Stage(roles, {name: roles.all_folded(name) for name in roles.pieces})
    scene = CarSolids(roles, tongues=True)
    yield from _check_bodies_apart(roles, scene, stage)
    yield from _check_segments_apart(roles, scene, stage)


def _film_of_body(roles: Roles, scene: CarSolids, stage: Stage, body: str, without: Collection[str] = ()) -> Blocks:
    """Return the solids of all faces of a body. Pieces named in ``without`` are left out."""
    copies = (copy for copy in roles.placed(body) if copy.piece not in without)
    return merge_blocks(scene.solid(PartKey("piece", copy.piece, copy.copy), stage) for copy in copies)


def _check_bodies_apart(roles: Roles, scene: CarSolids, stage: Stage) -> Iterator[Finding]:
    """Yield findings where film collides with other film of its segment or wheel. Equal wheels are checked once."""
    may_overlap = _faces_that_may_overlap(roles, scene)
    first_wheels = [wheels[0] for wheels in roles.wheel_units.values()]
    for body in (*roles.segments, *first_wheels):
        film = _film_of_body(roles, scene, stage, body)
        # The solids of a face have the same title. Each pair of faces is checked once.
        titles = list(dict.fromkeys(film.titles))
        for number, face_title in enumerate(titles, 1):
            later_titles = set(titles[number:])
            face, later_faces = film.with_titles({face_title}), film.with_titles(later_titles)
            obstacle = first_obstacle(face, later_faces, ignored=may_overlap)
            if obstacle is not None:
                yield Finding("crossing", face_title, f"runs into {obstacle}")


def _faces_that_may_overlap(roles: Roles, scene: CarSolids) -> Ignored:
    """Return the pairs of titles of faces that may overlap in the model: glued faces, and the two faces at a bend.

    In the car a bend is a curve. In the model it is an edge, at which the plates of the two faces overlap by their
    thickness.
    """
    pairs = set(scene.ignored(("tab", "lap")))
    for piece in roles.car.pieces:
        for crease in piece.creases:
            if crease.bend:
                pairs.add((title(piece.name, crease.parent.face), title(piece.name, crease.child.face)))
    return frozenset(pairs)


def _check_segments_apart(roles: Roles, scene: CarSolids, stage: Stage) -> Iterator[Finding]:
    """Yield a finding for each face that collides with another segment when a hinge is turned to one of its limits.

    A segment is a rigid part of the car, and a hinge connects two of them. The faces are made of plastic film. One hinge
    is turned at a time, and all others are flat. The strips of film that are the hinges themselves bend at the limits, so
    they are not checked. ``stage`` says which folds are closed.
    """
    strips = {piece.name for piece in roles.car.pieces if any(crease.flexure for crease in piece.creases)}
    for hinge in roles.car.hinges:
        front = _film_of_body(roles, scene, stage, hinge.front, without=strips)
        rear = _film_of_body(roles, scene, stage, hinge.rear, without=strips)
        for angle in (hinge.min_rad, hinge.max_rad):
            moved = rear.moved(hinge_motion(hinge, angle))
            for face_title in dict.fromkeys(moved.titles):
                obstacle = first_obstacle(moved.with_titles({face_title}), front)
                if obstacle is not None:
                    place = f"between {hinge.front} and {hinge.rear}, folded by {math.degrees(angle):.1f} degrees"
                    yield Finding("hinge", place, f"{face_title} runs into {obstacle}")


CLOSURE_MM = 0.05
# Tolerance (mm) between films that lie on or inside each other.
FIT_MM = 0.3
# The area of a tab that may lie beside its face or over a hole in it.
TAB_OVER_MM2 = 0.05
# A tongue's section may lie outside of its slot by this area, which is a rounding error.
MAX_OUTSIDE_SLOT_MM2 = 1e-6


def check_joins(car: FoldedCar, bodies: Bodies) -> Iterator[Finding]:
    """Yield what is wrong with the joins of the car's pieces.

    A join connects two faces. It is checked in each rigid body of the car that contains both of them.
    """
    checks = {"tab": _check_tab, "lap": _check_tab, "tab_slot": _check_tongue, "lock": _check_tongue}
    copies: dict[tuple[str, str], list[PlacedFace]] = defaultdict(list)
    for faces in bodies.values():
        for face in faces:
            copies[face.piece.name, face.face.name].append(face)
    for join in car.joins:
        if join.kind not in checks:
            continue
        ends = itertools.product(copies[join.piece_a, join.a.face], copies[join.piece_b, join.b.face])
        for a, b in ends:
            # A wheel's hooks are put through their slots and then turned. In the finished wheel they are beside their
            # slots, so this check does not apply to them.
            is_hook = join.kind in ("tab_slot", "lock") and a.body.startswith("wheel")
            if a.body == b.body and not is_hook:
                yield from checks[join.kind](join, a, b)


def _gap_mm(join: Join, a: PlacedFace, b: PlacedFace) -> float:
    """Return the gap (mm) between the two edges of a join, which should meet.

    For a tab, it is the larger of the distances from the two ends of its edge to the edge of the wall, both projected to
    the wall: the tab lies one film inside the wall, and may be shorter than the wall's edge. For other joins it is the
    larger of the two distances between the edges' ends.
    """
    first, second = a.edge_mm(join.a.index), b.edge_mm(join.b.index)
    if join.kind == "tab":
        # Without z, the points are projected to the plane of the wall.
        wall_edge = shapely.LineString(b.in_face(second)[:, :2])
        tab_ends = shapely.points(b.in_face(first)[:, :2])
        return float(wall_edge.distance(tab_ends).max())
    # The edges may run in the same direction or in opposite directions.
    gap_in_same_direction = np.linalg.norm(first - second, axis=1).max()
    gap_in_opposite_direction = np.linalg.norm(first - second[::-1], axis=1).max()
    return float(min(gap_in_same_direction, gap_in_opposite_direction))


def _check_tab(join: Join, a: PlacedFace, b: PlacedFace) -> Iterator[Finding]:
    """Yield findings about a tab, the face ``a``, which is glued to the face ``b``.

    There are three: its edge is away from the edge that it should meet, it is at a wrong height over the other face, or
    it lies beside that face.
    """
    place = f"join {join.number}: {a.title} on {b.title}"
    gap = _gap_mm(join, a, b)
    if gap > CLOSURE_MM:
        yield Finding("closure", place, f"the edges are {gap:.3f} mm apart, the limit is {CLOSURE_MM:g} mm")
    # How far the tab's corners are off the height over the other face at which they should be. A join of the kind "tab"
    # has its tab on the other face, so that their middles are a thickness of the film apart. Another join is a lap, which
    # the model has in the plane of the other face.
    corners_on_face = b.in_face(a.corners_mm)
    if join.kind == "tab":
        expected_mm = (a.piece.thickness_mm + b.piece.thickness_mm) / 2
        limit = FIT_MM
    else:
        expected_mm = 0.0
        limit = CLOSURE_MM
    height_error = float(np.abs(corners_on_face[:, 2] - expected_mm).max())
    if height_error > limit:
        message = f"the tab stands {height_error:.3f} mm off the face it is glued to, the limit is {limit:g} mm"
        yield Finding("tab", place, message)
        return
    # The part of the tab that is beside the face or over a hole.
    outside = shapely.Polygon(corners_on_face[:, :2]).difference(b.polygon)
    # Shrinking removes the slivers that a tab as wide as its face leaves.
    if outside.buffer(-CLOSURE_MM).area > TAB_OVER_MM2:
        yield Finding("tab", place, f"{outside.area:.2f} mm² of the tab lie beside its face or over a hole in it")


def _check_tongue(join: Join, a: PlacedFace, b: PlacedFace) -> Iterator[Finding]:
    """Yield findings about a tongue of the face ``a``, which goes through a slot of the face ``b``.

    There are three: the slot is missing, the tongue is too short to pass the film, or it does not fit the slot. The
    tongue comes from the printed side of ``b``, where z of that face's frame is positive.
    """
    place = f"join {join.number}: {a.title} through {b.title}"
    slot = next((hole for hole in b.face.holes if hole.name == join.slot), None)
    # The edge at the tongue's tip, in the frame of the slotted face.
    tip_edge = b.in_face(a.edge_mm(join.a.index))
    tip_z = float(np.max(tip_edge[:, 2]))
    lower_side_z = -b.piece.thickness_mm / 2
    if slot is None:
        yield Finding("slot", place, f'there is no slot "{join.slot}"')
    elif tip_z > lower_side_z:
        yield Finding("slot", place, f"the tongue ends {tip_z:.2f} mm inside the slot")
    else:
        # The section of the tongue is its edge, as thick as its film.
        section = shapely.LineString(tip_edge[:, :2]).buffer(a.piece.thickness_mm / 2, cap_style="flat")
        outside_mm2 = section.difference(shapely.Polygon(slot.outline_mm)).area
        if outside_mm2 > MAX_OUTSIDE_SLOT_MM2:
            yield Finding("slot", place, f"{outside_mm2:.3f} mm² of the tongue's section do not go through {slot.name}")
