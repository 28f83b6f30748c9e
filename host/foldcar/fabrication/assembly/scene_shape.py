"""Cars and runs for pages that show them driving: folded faces of film, bought parts as solids; a run's path.

Input: FoldedCars, bodies and scenes of docs/carsim.md, a run's result and path. Output: JSON that ``car.js`` and
``run.js`` read: outlines in tenths of a millimetre, solids and poses in millimetres, all else in SI units. Small holes
and parts, such as screws, are left out; hinges are flat.
"""

import base64
import json
from collections.abc import Mapping, Sequence
from dataclasses import replace
from typing import Any

import numpy as np

from foldcar.car.folded.model import FoldedCar, Mount, Piece, PlacedPiece, Point
from foldcar.car.folded.pose import edge
from foldcar.fabrication.assembly.faces import Matrix, face_poses, mount_material, moved
from foldcar.figures.scene_data import ground_data
from foldcar.simulation.heights import Heights

UNIT_MM = 0.1
HOLES = ("opening", "vent")
# Smaller parts, and thinner solids of parts, are not visible on a car that drives.
MIN_PART_MM = 9.0
MIN_SOLID_MM = 3.0
# A part of more solids is drawn as a ring.
MAX_SOLIDS = 12
DECIMALS = 3


def _without_small_holes(piece: Piece) -> Piece:
    """Return the piece with only those holes that can be seen on a car that drives."""
    faces = (replace(face, holes=tuple(hole for hole in face.holes if hole.kind in HOLES)) for face in piece.faces)
    return replace(piece, faces=tuple(faces))


class SceneShapes:
    """Shapes of cars that share their ``pieces``; each piece is ``{"faces"}`` or ``{"solids"}`` in its frame.

    A face is a list of rings, the outline before its holes: x, y, z of its points in sequence. A solid is
    ``{"kind", "size", "pose"}``, where a pose is the first three rows of its matrix.
    """

    def __init__(self) -> None:
        self.pieces: list[dict[str, Any]] = []
        self._index_by_text: dict[str, int] = {}
        self._film: dict[Piece, int] = {}

    def add(self, folded: FoldedCar) -> list[dict[str, Any]]:
        """Add the shapes of a car, and return its parts.

        A part is ``{"piece", "body", "pose"}``: the index of its shape in ``pieces``, the name of its body, and the 12
        numbers of its pose. A body is what moves as a whole, such as a segment. The strip of a hinge joins two bodies.
        Then the part also has ``"beyond"``: for each face that moves with the other body, its number and the body's
        name.
        """
        pieces, parts = {piece.name: piece for piece in folded.pieces}, []
        for placed in folded.placed:
            piece = pieces[placed.piece]
            part = {"piece": self._index_of_film(piece), "body": placed.body, "pose": _rows(np.array(placed.pose))}
            bodies = _beyond_hinge(folded, placed, piece)
            if bodies:
                part["beyond"] = {k: bodies[face.name] for k, face in enumerate(piece.faces) if face.name in bodies}
            parts.append(part)
        for mount in folded.mounts:
            solids = _solids(mount)
            if solids:
                index = self._index_of({"material": mount_material(mount), "solids": solids})
                parts.append({"piece": index, "body": mount.body, "pose": _rows(np.array(mount.pose))})
        return parts

    def _index_of_film(self, piece: Piece) -> int:
        """Return the index of a folded piece of film in ``pieces``, to which it is added at its first use."""
        if piece not in self._film:
            poses = face_poses(piece)
            faces = []
            for face in _without_small_holes(piece).faces:
                rings = [face.outline_mm, *(hole.outline_mm for hole in face.holes)]
                faces.append([_ring_numbers(poses[face.name], ring) for ring in rings])
            self._film[piece] = self._index_of({"faces": faces})
        return self._film[piece]

    def _index_of(self, piece: dict[str, Any]) -> int:
        """Return the index of a shape in ``pieces``, to which it is added unless an equal one is there."""
        text = json.dumps(piece)
        if text not in self._index_by_text:
            self._index_by_text[text] = len(self.pieces)
            self.pieces.append(piece)
        return self._index_by_text[text]


def _ring_numbers(pose: Matrix, ring_mm: Sequence[Point]) -> list[int]:
    """Return x, y and z of all points of a ring, one after the other, as integers in units of UNIT_MM.

    ``pose`` is the pose of the face in whose frame the ring is given.
    """
    points = moved(pose, np.array(ring_mm)) / UNIT_MM
    numbers: list[int] = np.rint(points).astype(int).ravel().tolist()
    return numbers


def _rows(pose: Any) -> list[float]:
    """Return the 12 numbers of a pose's upper three rows; the fourth is always (0, 0, 0, 1)."""
    rows: list[float] = np.round(pose[:3], DECIMALS).ravel().tolist()
    return rows


def _beyond_hinge(folded: FoldedCar, placed: PlacedPiece, piece: Piece) -> dict[str, str]:
    """Return which faces of a piece move with another body than the piece itself: the name of that body, by face.

    Only the strip of a hinge has such faces. It is taped to two segments of the car and bends between them; it belongs to
    one of these segments, and some of its faces move with the other one.
    """
    crease = next((crease for crease in piece.creases if crease.flexure), None)
    if crease is None or not folded.hinges:
        return {}
    faces = {face.name: face for face in piece.faces}
    parent_pose = np.array(placed.pose) @ face_poses(piece)[crease.parent.face]
    # The hinge of this strip is the one nearest to the middle of the crease that bends.
    middle_of_crease = np.mean(edge(faces, crease.parent), axis=0)
    (middle,) = moved(parent_pose, np.array([middle_of_crease]))
    hinge = min(folded.hinges, key=lambda hinge: float(np.linalg.norm(middle - hinge.center_mm)))
    body_of_face = {crease.child.face: hinge.rear if placed.body == hinge.front else hinge.front}
    # All faces behind this crease move with the same segment. Creases are in an order in which parents come first.
    for other in piece.creases:
        if other.parent.face in body_of_face:
            body_of_face[other.child.face] = body_of_face[other.parent.face]
    return body_of_face


def _solids(mount: Mount) -> list[dict[str, Any]]:
    """Return the solids by which a bought part is drawn.

    A small part has none. A part without solids is drawn as its box, and a part with very many, such as a tyre, as a
    ring.
    """
    if max(mount.size_mm) < MIN_PART_MM:
        return []
    shapes = [(solid.kind, solid.size_mm, np.array(solid.pose)) for solid in mount.solids]
    if not shapes or len(shapes) > MAX_SOLIDS:
        return [{"kind": "ring" if shapes else "box", "size": _rounded_sizes(mount.size_mm), "pose": _rows(np.eye(4))}]
    # A solid whose second shortest side is too short, such as a wire, cannot be seen.
    return [
        {"kind": kind, "size": _rounded_sizes(size), "pose": _rows(pose)}
        for kind, size, pose in shapes
        if sorted(size)[1] >= MIN_SOLID_MM
    ]


def _rounded_sizes(size_mm: Sequence[float]) -> list[float]:
    """Return the sizes of a solid along x, y and z (mm), rounded to hundredths."""
    return [round(float(side), 2) for side in size_mm]


def recorded_run(
    folded: FoldedCar,
    body: Mapping[str, Any],
    scene: Mapping[str, Any],
    answer: Mapping[str, Any],
    path: Sequence[Sequence[float]],
    heights: Heights,
    message: str,
) -> dict[str, Any]:
    """Return the data from which the script run.js draws a run: the car, the ground, and the path of the car.

    ``body`` and ``scene`` are the inputs of the run, and ``answer`` is its result. ``path`` is a list of states
    (docs/carsim.md). ``message`` says which run it is.
    """
    head, content = ground_data(scene, heights)
    shapes = SceneShapes()
    parts = shapes.add(folded)
    colours = "Orange: the goal."
    if any(piece["kind"] == "patch" for piece in scene["terrain"]):
        colours = "Orange: the goal; violet: a friction of its own."
    return {
        # The text below the scene.
        "told": f"{message} The wheels turn as if they did not slip: a path has no angles of wheels. {colours}",
        "outcome": answer["outcome"],
        "rows": np.round(np.asarray(path, dtype=float), 5).tolist(),
        "car": {"body": drawn_body(body), "shape": {"pieces": shapes.pieces, "parts": parts}},
        "ground": {**head, "heights": base64.b64encode(content).decode()},
    }


def drawn_body(body: Mapping[str, Any]) -> dict[str, Any]:
    """Return what is drawn of a car's body: the shapes and places of its segments, hinges and wheels.

    ``body`` is an object as in docs/carsim.md. Of each part, only the
    values that a drawing needs are kept.
    """
    return {
        "track_m": body["track_m"],
        "segments": _columns(body["segments"], "x_m", "length_m", "width_m", "height_m", "center_z_m"),
        "hinges": _columns(body["hinges"], "x_m", "z_m"),
        "wheels": _columns(body["wheels"], "channel", "segment", "side", "x_m", "radius_m", "width_m"),
    }


def _columns(rows: Sequence[Mapping[str, Any]], *names: str) -> list[dict[str, Any]]:
    """Return the rows with these columns only."""
    return [{name: row[name] for name in names} for row in rows]
