"""The picture of the finished car, closed, from the front: in the guide, and in the report until the car drives there."""

import numpy as np

from foldcar.car.folded.model import FoldedCar
from foldcar.fabrication.assembly.drawing import Drawing
from foldcar.fabrication.assembly.facets import PictureContent, film_shape, merge_shapes, mount_shape
from foldcar.fabrication.assembly.guide_state import facet_key_prefix
from foldcar.fabrication.assembly.hidden_surfaces import Camera, camera

FROM_FRONT = camera(38, 30)


def finished_car(folded: FoldedCar, title: str) -> Drawing:
    """Return the picture of the car from the front, with this title."""
    return Drawing(_closed_shape(folded, FROM_FRONT), FROM_FRONT, title, caption="the finished car")


def _closed_shape(folded: FoldedCar, view: Camera) -> PictureContent:
    """Return the shape of the closed car from outside: film without tabs, servos, and parts that stick out.

    Film is left out where its printed side faces the camera, because that side is inside the car.
    """
    pieces = {piece.name: piece for piece in folded.pieces}
    shapes = []
    for placed in folded.placed:
        prefix = facet_key_prefix(placed)
        film = film_shape(pieces[placed.piece], np.array(placed.pose), 1.0, prefix, tabs=False, creases=False)
        facets = tuple(facet for facet in film.facets if facet.normal @ view.toward < 0)
        shapes.append(PictureContent(facets, film.lines))
    driving = {axle.servo for axle in folded.axles if axle.driven}
    parts = folded.parts
    outer = {part.name for part in (parts.tyre, parts.switch, parts.axle_rod, parts.axle_tube, parts.axle_cap)}
    shapes += [mount_shape(mount) for mount in folded.mounts if mount.name in driving or mount.part in outer]
    return merge_shapes(shapes)
