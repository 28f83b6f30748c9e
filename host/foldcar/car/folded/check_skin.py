"""Checks that the folded and glued faces of a body are watertight and enclose the designed volume.

Input: placed faces of one body and the car's joins. Output: findings and volumes.
"""

from collections.abc import Iterator, Mapping, Sequence

import numpy as np

from foldcar.car.folded.check_joins import CLOSURE_MM
from foldcar.car.folded.finding import Finding
from foldcar.car.folded.model import FoldedCar
from foldcar.car.folded.placed import PlacedFace

VOLUME_TOLERANCE = 1e-3


def check_skin(
    car: FoldedCar, bodies: Mapping[str, Sequence[PlacedFace]], volumes_mm3: Mapping[str, float]
) -> Iterator[Finding]:
    """Findings for each body whose skin has an open edge or, where ``volumes_mm3`` gives one, another volume."""
    for body, faces in bodies.items():
        skin = skin_of(car, faces)
        if not skin:
            yield Finding("skin", body, "has no faces that are glued to a skin")
            continue
        loose = _loose_edges(skin)
        for face, index in loose[:3]:
            more = f" (and {len(loose) - 3} more)" if len(loose) > 3 else ""
            yield Finding("skin", f"{body}: {face.title}", f"edge {index} meets no other face{more}")
        volume = volume_mm3(skin)
        expected = volumes_mm3.get(body)
        if expected is not None and abs(volume - expected) > VOLUME_TOLERANCE * expected:
            yield Finding(
                "volume",
                body,
                f"encloses {volume:.0f} mm³ instead of {expected:.0f}, the limit is {VOLUME_TOLERANCE:.1%}",
            )


def skin_of(car: FoldedCar, faces: Sequence[PlacedFace]) -> list[PlacedFace]:
    """The panels and rims of the pieces that tabs join; laminated or inserted pieces are not part of the skin."""
    tabbed = {name for join in car.joins if join.kind in ("tab", "lap", "rim") for name in (join.piece_a, join.piece_b)}
    return [face for face in faces if face.piece.name in tabbed and face.face.role != "tab"]


def volume_mm3(skin: Sequence[PlacedFace]) -> float:
    """The volume (mm³) enclosed by faces whose printed sides face inwards (divergence theorem), holes closed."""
    total = 0.0
    for face in skin:
        corners = face.corners_mm
        spokes = np.cross(corners[1:-1] - corners[0], corners[2:] - corners[0]).sum(axis=0)
        total -= float(corners[0] @ spokes) / 6
    return total


def _loose_edges(skin: Sequence[PlacedFace]) -> list[tuple[PlacedFace, int]]:
    """Edges that do not coincide with an edge of another face."""
    owners = [(face, i) for face in skin for i in range(len(face.face.outline_mm))]
    starts = np.concatenate([face.corners_mm for face in skin])
    ends = np.concatenate([np.roll(face.corners_mm, -1, axis=0) for face in skin])
    forward, backward = np.hstack([starts, ends]), np.hstack([ends, starts])
    loose = []
    for i, edge in enumerate(forward):
        near = np.abs(backward - edge).max(axis=1) <= CLOSURE_MM
        if near.sum() != 1:
            loose.append(owners[i])
    return loose
