"""The data of the view page: triangulated faces, folds, flat and assembled poses, bought parts.

Input: a FoldedCar. Output: JSON in millimetres and radians; poses are 16 numbers, row-major. The page computes the
folding (docs/patterns.md).
"""

import math
from typing import Any

import numpy as np

from foldcar.car.folded.folding import edge
from foldcar.car.folded.model import FoldedCar, Piece, Pose
from foldcar.fabrication.assembly.poses import face_poses, glued_offset_mm, moved
from foldcar.fabrication.assembly.solids import mount_material
from foldcar.fabrication.assembly.triangles import face_points, face_triangles

GAP_MM = 12.0
DECIMALS = 4


def view_data(folded: FoldedCar) -> dict[str, Any]:
    """The JSON object that view.js reads."""
    # Laminated pieces lie on the printed, inner side.
    layers = {join.piece_a for join in folded.joins if join.kind == "laminate"}
    index = {piece.name: i for i, piece in enumerate(folded.pieces)}
    extents = [_flat_extent(folded.pieces[index[placed.piece]]) for placed in folded.placed]
    extents += [(-mount.size_mm[0] / 2, -mount.size_mm[1] / 2, *mount.size_mm[:2]) for mount in folded.mounts]
    places = _side_by_side(extents)
    film, bought = places[: len(folded.placed)], places[len(folded.placed) :]
    return {
        "pieces": [_piece(piece) for piece in folded.pieces],
        "placed": [
            {
                "piece": index[placed.piece],
                "body": placed.body,
                "pose": _numbers(placed.pose),
                "flat": flat,
                "layer": placed.piece in layers,
            }
            for placed, flat in zip(folded.placed, film, strict=True)
        ],
        "mounts": [
            {
                "name": mount.name,
                "part": mount.part,
                "body": mount.body,
                "material": mount_material(mount),
                "size": list(mount.size_mm),
                "pose": _numbers(mount.pose),
                "flat": flat,
            }
            for mount, flat in zip(folded.mounts, bought, strict=True)
        ],
        "ground": _ground_mm(folded),
    }


def _piece(piece: Piece) -> dict[str, Any]:
    number = {face.name: i for i, face in enumerate(piece.faces)}
    faces = {face.name: face for face in piece.faces}
    offsets = glued_offset_mm(piece)
    creases = {crease.child.face: crease for crease in piece.creases}
    described = []
    for face in piece.faces:
        points, ends = face_points(face)
        entry: dict[str, Any] = {
            "points": np.round(points, DECIMALS).ravel().tolist(),
            "rings": [int(end) for end in ends],
            "triangles": face_triangles(face).ravel().tolist(),
            "offset": round(offsets.get(face.name, 0.0), DECIMALS),
        }
        crease = creases.get(face.name)
        if crease is not None:
            entry["fold"] = {
                "parent": number[crease.parent.face],
                "on": [*edge(faces, crease.parent)[0], *edge(faces, crease.parent)[1]],
                "own": [*edge(faces, crease.child)[0], *edge(faces, crease.child)[1]],
                "edge": crease.child.index,
                "angle": crease.angle_rad,
                # A rim bends smoothly and has no folds between its facets.
                "drawn": not (face.role == "rim" and faces[crease.parent.face].role == "rim"),
            }
        described.append(entry)
    tyre = any(face.role == "rim" for face in piece.faces)
    return {"name": piece.label or piece.name, "material": "tyre" if tyre else "film", "faces": described}


def _flat_extent(piece: Piece) -> tuple[float, float, float, float]:
    """Minimum x and y, size along x and y (mm) of the flat piece in its root face's frame."""
    poses = face_poses(piece, 0.0)
    corners = np.concatenate([moved(poses[face.name], np.array(face.outline_mm)) for face in piece.faces])
    low, size = corners.min(axis=0), np.ptp(corners, axis=0)
    return float(low[0]), float(low[1]), float(size[0]), float(size[1])


def _side_by_side(extents: list[tuple[float, float, float, float]]) -> list[list[float]]:
    """Poses [x, y, turn] of the pieces' origins that arrange them without overlap in rows around the centre.

    Pieces longer along y than along x are turned by 90°, so that rows are low; the highest come first, each in the
    first row with room.
    """
    sizes = [(max(e[2], e[3]) + GAP_MM, min(e[2], e[3]) + GAP_MM) for e in extents]
    width = max(1.15 * math.sqrt(sum(a * b for a, b in sizes)), max(a for a, _ in sizes))
    rows: list[list[float]] = []  # y, height, occupied length along x
    corners = [(0.0, 0.0)] * len(extents)
    for i in sorted(range(len(extents)), key=lambda i: (-sizes[i][1], i)):
        along, across = sizes[i]
        row = next((row for row in rows if row[2] + along <= width), None)
        if row is None:
            row = [rows[-1][0] + rows[-1][1] if rows else 0.0, across, 0.0]
            rows.append(row)
        corners[i] = (row[2] - width / 2, row[0])
        row[2] += along
    middle = (rows[-1][0] + rows[-1][1]) / 2
    places = []
    for (x, y), (low_x, low_y, along, across) in zip(corners, extents, strict=True):
        # A quarter turn maps (x, y) to (-y, x).
        turned = across > along
        at = (x + low_y + across, y - low_x) if turned else (x - low_x, y - low_y)
        places.append([round(at[0], 3), round(at[1] - middle, 3), math.pi / 2 if turned else 0.0])
    return places


def _ground_mm(folded: FoldedCar) -> float:
    """z of the floor under the car (mm)."""
    return min((axle.center_mm[2] - axle.radius_mm for axle in folded.axles), default=-50.0)


def _numbers(pose: Pose) -> list[float]:
    return [round(value, 6) for row in pose for value in row]
