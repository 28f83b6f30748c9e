"""The view page: one HTML file with a model of the car during its assembly, without network access.

Input: a FoldedCar; for a car that drives, its run. Output: the page's text with its script, three.js
(tools/web_bundles.py) and the scripts' data: triangulated faces, folds, parts with their poses, the order of assembly.
Units are millimetres and radians, poses are 16 numbers, row-major. The page computes the folding.
"""

import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import Any, NamedTuple

import numpy as np

from foldcar.car.folded.model import Crease, EdgeRef, Face, FoldedCar, Mount, Piece, Point, Pose
from foldcar.car.folded.pose import edge
from foldcar.fabrication.assembly.faces import (
    face_points,
    face_poses,
    face_triangles,
    mount_material,
    moved,
    piece_area_mm2,
)
from foldcar.fabrication.assembly.facets import NUT_OF, shank_and_nut
from foldcar.fabrication.assembly.parts_list import parts_list, total_cost_usd, total_mass_kg
from foldcar.fabrication.assembly.view_steps import NUT, Part, ViewSteps, view_steps
from foldcar.fabrication.patterns.drawing import Sheet
from foldcar.figures.page import web_page

PACKAGE = "foldcar.fabrication.assembly"
DECIMALS = 4
GAP_MM = 12.0
# How much wider the rows of flat pieces are than a square with the area of all pieces.
WIDER = 1.15


def view_page(folded: FoldedCar, title: str, run: Mapping[str, Any] | None = None) -> str:
    """Return the page as text. ``run`` is the object that run.js reads."""
    data = {"car": view_data(folded), "run": run}
    return web_page(PACKAGE, "view", title=title, facts=facts(folded), run=run, data=data)


def facts(folded: FoldedCar, sheets: Sequence[Sheet] = ()) -> str:
    """Return mass, film, wheels and cost of the car in one line; without sheets the cost excludes the film's waste."""
    rows = parts_list(folded, sheets)
    waste = "" if sheets else ", without the film's waste"
    count = sum(piece.count for piece in folded.pieces)
    area_cm2 = sum(piece.count * piece_area_mm2(piece) for piece in folded.pieces) / 100
    return (
        f"{total_mass_kg(rows) * 1e3:.0f} g, {count} pieces of film with {area_cm2:.0f} cm², "
        f"{sum(axle.driven for axle in folded.axles)} driven wheels, about {total_cost_usd(rows):.0f} USD of parts{waste}"
    )


def view_data(folded: FoldedCar) -> dict[str, Any]:
    """Return the object of a car that the page's scripts read."""
    steps = view_steps(folded)
    # Laminated pieces lie on the printed, inner side.
    layers = {join.piece_a for join in folded.joins if join.kind == "laminate"}
    glued = {(join.piece_a, join.a.face) for join in folded.joins if join.kind in ("tab", "lap", "rim")}
    pieces = {piece.name: piece for piece in folded.pieces}
    piece_index = {piece.name: i for i, piece in enumerate(folded.pieces)}
    placed_index = {("piece", item.piece, item.copy): i for i, item in enumerate(folded.placed)}
    mounts: list[tuple[Mount, str]] = []
    for mount in folded.mounts:
        nutted = (NUT, mount.name, 0) in steps.ways
        mounts += zip(shank_and_nut(mount), ("mount", NUT), strict=True) if nutted else [(mount, "mount")]
    extents = [_flat_extent(pieces[placed.piece]) for placed in folded.placed]
    for mount, _ in mounts:
        length, width, _ = mount.size_mm
        extents.append(Extent(-length / 2, -width / 2, length, width))
    parts = []
    for placed in folded.placed:
        piece = pieces[placed.piece]
        parts.append({
            "piece": piece_index[placed.piece],
            "name": (piece.label or piece.name) + (f" {placed.copy + 1}" if piece.count > 1 else ""),
            "layer": placed.piece in layers,
            **_part(placed.body, placed.pose, steps, ("piece", placed.piece, placed.copy)),
        })  # fmt: skip
    for mount, kind in mounts:
        parts.append({
            "name": mount.name if mount.name == mount.part else f"{mount.name} ({mount.part})",
            "material": mount_material(mount),
            "solids": [{"kind": item.kind, "size": item.size_mm, "pose": _numbers(item.pose)} for item in mount.shape],
            **_part(mount.body, mount.pose, steps, (kind, mount.name.removeprefix(NUT_OF), 0)),
        })  # fmt: skip
    for part, flat_pose in zip(parts, arrange_in_rows(extents), strict=True):
        part["flat"] = flat_pose
        if part["rides"] is not None:
            host, face = part["rides"]
            faces = [item.name for item in pieces[host[1]].faces]
            part["rides"] = [placed_index[host], faces.index(face)]
    return {
        "pieces": [_piece(piece, steps, glued) for piece in folded.pieces],
        "parts": parts,
        "steps": steps.titles,
        "lid": {piece_index[name]: _children(pieces[name], creases) for name, creases in steps.lids.items() if creases},
        "ground": _ground_mm(folded),
    }


def _part(body: str, pose: Pose, steps: ViewSteps, key: Part) -> dict[str, Any]:
    """Return what the page needs of a part: its body, its pose, and how it moves in the steps and in the exploded view.

    ``ways`` are its moves: the number of the step, the vectors of the move, and when the move begins and ends in the
    step, from 0 to 1. ``rides`` names the part that it moves with.
    """
    # If no step adds the part, it is in the car from the first step on, and does not move.
    in_place_from_first_step = (1, (), 0.0, 1.0)
    ways = steps.ways.get(key, [in_place_from_first_step])
    exploded = steps.exploded.get(key, (0.0, 0.0, 0.0))
    return {"body": body, "pose": _numbers(pose), "ways": ways, "exploded": exploded, "rides": steps.rides.get(key)}


def _piece(piece: Piece, steps: ViewSteps, glued: set[tuple[str, str]]) -> dict[str, Any]:
    """Return a piece for the page: for each face its triangles, its smooth and uncut edges, and its fold, if it has one.

    ``glued`` has the (piece, face) of the tabs. The page lifts a tab off the face that it is taped to.
    """
    face_index = {face.name: i for i, face in enumerate(piece.faces)}
    faces = {face.name: face for face in piece.faces}
    creases = {crease.child.face: crease for crease in piece.creases}
    shared = _shared_edges(piece, faces)
    face_entries = []
    for face in piece.faces:
        points, ends = face_points(face)
        entry: dict[str, Any] = {
            # x, y, x, y, … in the face's frame (mm), and the end index of the outline's points and of each hole's.
            "points": np.round(points, DECIMALS).ravel().tolist(),
            "rings": [int(end) for end in ends],
            # Three indices of points for each triangle.
            "triangles": face_triangles(face).ravel().tolist(),
            # Indices of edges of the outline that a neighbour shares, so that no cut is drawn.
            "uncut": sorted(shared.uncut[face.name]),
            # Points shared with a face beyond a smooth bend, each with the index of that face.
            "smooth": [
                [shared_point.point, face_index[shared_point.other_face]] for shared_point in shared.smooth[face.name]
            ],
        }
        crease = creases.get(face.name)
        if crease is not None:
            side = 1 if crease.angle_rad > 0 else -1
            # To which side of the face a taped tab is lifted: 1, -1, or 0 for other faces.
            entry["lifted"] = side if (piece.name, face.name) in glued else 0
            # Both ends of the fold: `on` the parent's edge in the parent's frame, on the face's `own` edge in its frame.
            # Then the index of the own edge, the angle of the closed fold (rad), whether the fold is drawn as a line,
            # and (step, fraction of the angle) pairs.
            entry["fold"] = {
                "parent": face_index[crease.parent.face],
                "on": [*edge(faces, crease.parent)[0], *edge(faces, crease.parent)[1]],
                "own": [*edge(faces, crease.child)[0], *edge(faces, crease.child)[1]],
                "edge": crease.child.index,
                "angle": crease.angle_rad,
                "drawn": not _is_smooth(crease, faces),
                "closing": steps.closing[piece.name, crease.name],
            }
        face_entries.append(entry)
    return {"name": piece.label or piece.name, "material": "film", "faces": face_entries}


def _is_smooth(crease: Crease, faces: dict[str, Face]) -> bool:
    """Return whether the crease is invisible: a rim bends smoothly between its facets."""
    return crease.bend or (faces[crease.parent.face].role == "rim" and faces[crease.child.face].role == "rim")


class _SharedPoint(NamedTuple):
    """A point of a face's outline that the face shares with a face beyond a smooth bend.

    ``point`` is its index in the outline, and ``other_face`` the name of that face. Both faces have the same
    normal at this point, so that the bend looks smooth.
    """

    point: int
    other_face: str


class _SharedEdges(NamedTuple):
    """What the faces of a piece share with their neighbours, by the name of the face.

    ``uncut`` are the indices of the edges at which the face is not cut. ``smooth`` are the points at smooth bends.
    """

    uncut: dict[str, set[int]]
    smooth: dict[str, list[_SharedPoint]]


def _shared_edges(piece: Piece, faces: dict[str, Face]) -> _SharedEdges:
    """Return what the faces of a piece share with their neighbours.

    At a fold, the edges of both faces may differ in length. A part of the longer edge is then cut, so it does not count
    as uncut.
    """
    shared = _SharedEdges({name: set() for name in faces}, {name: [] for name in faces})
    for crease in piece.creases:
        parent, child = crease.parent, crease.child
        shared.uncut[child.face].add(child.index)
        if _same_length(faces, parent, child):
            shared.uncut[parent.face].add(parent.index)
        if _is_smooth(crease, faces):
            shared.smooth[parent.face] += _ends_of_edge(faces, parent, other_face=child.face)
            shared.smooth[child.face] += _ends_of_edge(faces, child, other_face=parent.face)
    return shared


def _ends_of_edge(faces: dict[str, Face], edge_ref: EdgeRef, other_face: str) -> list[_SharedPoint]:
    """Return the start and the end of an edge as points that its face shares with another one."""
    point_count = len(faces[edge_ref.face].outline_mm)
    next_index = (edge_ref.index + 1) % point_count
    return [_SharedPoint(edge_ref.index, other_face), _SharedPoint(next_index, other_face)]


def _same_length(faces: dict[str, Face], a: EdgeRef, b: EdgeRef) -> bool:
    lengths = [float(np.linalg.norm(np.subtract(*edge(faces, end)))) for end in (a, b)]
    return abs(lengths[0] - lengths[1]) < 1e-3


def _children(piece: Piece, creases: tuple[str, ...]) -> list[int]:
    """Return the indices of the faces that turn about the creases with these names."""
    face_index = {face.name: i for i, face in enumerate(piece.faces)}
    return [face_index[crease.child.face] for crease in piece.creases if crease.name in creases]


class Extent(NamedTuple):
    """A rectangle around a flat part, in the part's own frame (mm)."""

    min_x: float
    min_y: float
    size_x: float
    size_y: float

    @property
    def is_turned(self) -> bool:
        """Whether it is turned by a quarter turn, because it is longer along y. Then rows are low."""
        return self.size_y > self.size_x

    @property
    def room_along_mm(self) -> float:
        """The length that it takes in its row, with a gap."""
        return max(self.size_x, self.size_y) + GAP_MM

    @property
    def room_across_mm(self) -> float:
        """The height that it takes in its row, with a gap."""
        return min(self.size_x, self.size_y) + GAP_MM


def _flat_extent(piece: Piece) -> Extent:
    """Return the rectangle around the flat piece in its root face's frame (mm)."""
    poses = face_poses(piece, 0.0)
    corners = np.concatenate([moved(poses[face.name], np.array(face.outline_mm)) for face in piece.faces])
    low, size = corners.min(axis=0), np.ptp(corners, axis=0)
    return Extent(float(low[0]), float(low[1]), float(size[0]), float(size[1]))


def _ground_mm(folded: FoldedCar) -> float:
    """Return z of the floor under the car (mm)."""
    return min((axle.center_mm[2] - axle.radius_mm for axle in folded.axles), default=-50.0)


def _numbers(pose: Pose) -> list[float]:
    return [round(value, 6) for row in pose for value in row]


@dataclass
class _Row:
    """A row of rectangles along x. The first ``occupied_mm`` of the row are taken."""

    low_y_mm: float
    height_mm: float
    occupied_mm: float = 0.0

    @property
    def high_y_mm(self) -> float:
        """y at which the next row begins."""
        return self.low_y_mm + self.height_mm


def arrange_in_rows(extents: Sequence[Extent]) -> list[list[float]]:
    """Arrange rectangles in rows around the centre, without overlap. Return the poses [x, y, turn] of their frames.

    A turn is an angle in rad. The highest rectangles are placed first, each in the first row with room.
    """
    # All rows together should be about square. They cannot be filled completely, so they are wider than a square with the
    # area of all rectangles.
    area_mm2 = sum(extent.room_along_mm * extent.room_across_mm for extent in extents)
    longest_mm = max(extent.room_along_mm for extent in extents)
    width = max(WIDER * math.sqrt(area_mm2), longest_mm)
    rows: list[_Row] = []
    # The corner of each rectangle with the smallest x and y, after it is turned; x is counted from the middle of the
    # rows.
    corners: dict[int, Point] = {}
    for index in sorted(range(len(extents)), key=lambda index: (-extents[index].room_across_mm, index)):
        extent = extents[index]
        row = next((row for row in rows if row.occupied_mm + extent.room_along_mm <= width), None)
        if row is None:
            row = _Row(low_y_mm=rows[-1].high_y_mm if rows else 0.0, height_mm=extent.room_across_mm)
            rows.append(row)
        corners[index] = (row.occupied_mm - width / 2, row.low_y_mm)
        row.occupied_mm += extent.room_along_mm
    middle_y = rows[-1].high_y_mm / 2
    places = []
    for index, extent in enumerate(extents):
        x, y = _origin(extent, corners[index])
        turn_rad = math.pi / 2 if extent.is_turned else 0.0
        places.append([round(x, 3), round(y - middle_y, 3), turn_rad])
    return places


def _origin(extent: Extent, corner: Point) -> Point:
    """Return the origin of a part's frame if the rectangle around it, turned if needed, has its lowest corner there."""
    x, y = corner
    if extent.is_turned:
        # A quarter turn maps (x, y) to (-y, x), so the side with the largest y becomes the one with the smallest x.
        return (x + extent.min_y + extent.size_y, y - extent.min_x)
    return (x - extent.min_x, y - extent.min_y)
