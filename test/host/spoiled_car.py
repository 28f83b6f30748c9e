"""Cars with some of their faces, holes or parts changed, and blocks that are in the way."""

from collections.abc import Callable
from dataclasses import replace

from foldcar.car.folded.model import Face, FoldedCar, Hole, Mount, Pose
from foldcar.car.folded.pose import compose, translation


def with_faces(car: FoldedCar, changed: Callable[[Face], Face], piece: str = "") -> FoldedCar:
    """The car with the faces of all pieces, or of one, as ``changed`` makes them."""
    assert not piece or any(candidate.name == piece for candidate in car.pieces)
    pieces = (
        replace(candidate, faces=tuple(map(changed, candidate.faces))) if piece in ("", candidate.name) else candidate
        for candidate in car.pieces
    )
    return replace(car, pieces=tuple(pieces))


def with_holes(car: FoldedCar, changed: Callable[[Hole], Hole | None], piece: str = "", face: str = "") -> FoldedCar:
    """The car with the holes of all faces, or of one, as ``changed`` makes them; None takes one out."""

    def on(change_named: Face) -> Face:
        if face not in ("", change_named.name):
            return change_named
        return replace(change_named, holes=tuple(hole for hole in map(changed, change_named.holes) if hole is not None))

    return with_faces(car, on, piece)


def with_mounts(car: FoldedCar, part: str, changed: Callable[[Mount], Mount]) -> FoldedCar:
    """The car with the parts of that name, or kind, as ``changed`` makes them."""
    return replace(car, mounts=tuple(changed(m) if part in (m.part, m.name) else m for m in car.mounts))


def moved(mount: Mount, x_mm: float, y_mm: float, z_mm: float) -> Mount:
    """The part shifted along the car's axes."""
    return replace(mount, pose=compose(translation(x_mm, y_mm, z_mm), mount.pose))


def with_block(car: FoldedCar, *poses: Pose, size_mm: tuple[float, float, float] = (2.0, 2.0, 2.0)) -> FoldedCar:
    """The car with blocks, which belong to no face, whose middles are at these poses."""
    blocks = (Mount("block", f"block {i}", "segment0", pose, size_mm, 0.001) for i, pose in enumerate(poses))
    return replace(car, mounts=(*car.mounts, *blocks))
