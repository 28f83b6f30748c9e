"""The guide's last steps: make the wheels and mount them.

Input: a FoldedCar and one wheel's body. Output: Steps.
"""

import numpy as np

from foldcar.car.folded.model import FoldedCar, PlacedPiece
from foldcar.car.parts.catalogue import catalogue
from foldcar.fabrication.assembly.drawing import picture
from foldcar.fabrication.assembly.facets import film_shape, mount_shape, together
from foldcar.fabrication.assembly.guide_shapes import FROM_FRONT, Body, key, outside, whole_car
from foldcar.fabrication.assembly.guide_step import Picture, Step, numbers
from foldcar.fabrication.assembly.hidden_surfaces import camera

BESIDE_MM = 45.0


def wheel(folded: FoldedCar, body: Body, count: int) -> Step:
    """The step that makes ``count`` wheels, with one wheel exploded along the axle and whole."""
    axle = next(axle for axle in folded.axles if axle.wheel == body.name)
    outward = 1.0 if axle.side == "left" else -1.0
    order = sorted(body.placed, key=lambda placed: (outward * _middle_y(body, placed), placed.copy))
    view = camera(35 if outward > 0 else -35, 18)
    apart, whole = [], []
    for place, placed in enumerate(order):
        shift = np.array([0.0, outward * place * 0.5 * axle.radius_mm, 0.0])
        pose = np.array(placed.pose)
        film = film_shape(body.pieces[placed.piece], pose, 1.0, key(placed), tabs=False, creases=False)
        whole.append(outside(film, view))
        pose[:3, 3] += shift
        apart.append(film_shape(body.pieces[placed.piece], pose, 1.0, key(placed), creases=False))
    for mount in body.mounts:
        pose = np.array(mount.pose)
        pose[1, 3] -= outward * 0.5 * axle.radius_mm
        apart.append(mount_shape(mount, pose))
    names = [piece.name for piece in (body.pieces[placed.piece] for placed in order)]
    lines = []
    for kind, text in (
        ("laminate", "Glue the layers around the hub onto each other and onto the disc, holes on holes: join {}."),
        ("rim", "Glue the ring's teeth onto the discs from inside, one tooth after the other: joins {}."),
    ):
        found = sorted({join.number for join in folded.joins if join.kind == kind and join.piece_a in names})
        if found:
            lines.append(text.format(numbers(found)))
    lines.append(f"Screw the {catalogue().horn.name} to the disc with the small holes before you close the wheel.")
    pictures = (
        Picture(picture(together(apart), view, "A wheel's layers"), "the layers, horn first"),
        Picture(picture(together(whole), view, "A wheel"), "the wheel, from its outer side"),
    )
    return Step(f"Make the wheels ({count} times)", tuple(lines), pictures)


def wheels_on(folded: FoldedCar) -> Step:
    """The step that mounts the wheels on the servos."""
    shape = whole_car(folded, FROM_FRONT, BESIDE_MM)
    lines = (
        "Press each wheel's horn onto its servo and drive the servo's own screw in through the hole of the outer disc.",
        "Turn every wheel by hand: it must not touch the wall, nor its neighbour.",
    )
    return Step("Put the wheels on", lines, (Picture(picture(shape, FROM_FRONT, "Wheels beside the car"), ""),))


def _middle_y(body: Body, placed: PlacedPiece) -> float:
    shape = film_shape(body.pieces[placed.piece], np.array(placed.pose), 1.0, tabs=False)
    return float(np.concatenate([facet.rings_mm[0] for facet in shape.facets])[:, 1].mean())
