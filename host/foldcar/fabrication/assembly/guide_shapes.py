"""The shape of the finished car.

Input: a FoldedCar. Output: a Shape in the car's frame.
"""

import numpy as np

from foldcar.car.folded.model import FoldedCar
from foldcar.fabrication.assembly.facets import Shape, film_shape, mount_shape, together
from foldcar.fabrication.assembly.guide_state import key
from foldcar.fabrication.assembly.hidden_surfaces import Camera, camera

FROM_FRONT = camera(38, 30)


def outside(shape: Shape, view: Camera) -> Shape:
    """The visible faces of closed film: those whose printed side, which is inside, faces away from the camera."""
    facets = tuple(facet for facet in shape.facets if facet.normal @ view.toward < 0)
    return Shape(facets, shape.lines, shape.materials)


def whole_car(folded: FoldedCar, view: Camera, apart_mm: float = 0.0) -> Shape:
    """The closed car from outside: film without tabs, servos; wheels moved sideways by ``apart_mm``."""
    pieces = {piece.name: piece for piece in folded.pieces}
    sides = {axle.wheel: 1.0 if axle.side == "left" else -1.0 for axle in folded.axles}
    shapes = []
    for placed in folded.placed:
        pose = np.array(placed.pose)
        pose[1, 3] += apart_mm * sides.get(placed.body, 0.0)
        film = film_shape(pieces[placed.piece], pose, 1.0, key(placed), tabs=False, creases=False)
        shapes.append(outside(film, view))
    driving = {axle.servo for axle in folded.axles}
    outer = {folded.parts.tyre.name, folded.parts.switch.name}
    shapes += [mount_shape(mount) for mount in folded.mounts if mount.name in driving or mount.part in outer]
    return together(shapes)
