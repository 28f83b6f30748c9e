"""A Webots world (R2023b or later) that contains a car's PROTO, and its controller's program and drive.

Input: a body and a scene of docs/carsim.md, the grid of the scene's smooth ground. Output: the text of a world file
for the folder ``worlds/`` beside the PROTO's ``protos/`` and the controller's ``controllers/``. Friction patches are
left out: Webots assigns friction to pairs of materials, and a patch is not a body of its own.
"""

import json
import math
from collections.abc import Mapping
from pathlib import Path
from typing import Any

import numpy
from scipy.spatial.transform import Rotation

from foldcar.car.body import driven_wheels
from foldcar.errors import FoldcarError
from foldcar.models.exported_car import wheel_name
from foldcar.models.ground import HeightGrid, start_height_m
from foldcar.models.mjcf import LEVEL_SCENE
from foldcar.models.webots_car import HEADER, Node, contact_materials, node_text, placed, shape, vector
from foldcar.scenes.terrain_kinds import kind_of
from foldcar.simulation.carsim import PulseTrain

GROUND = "ground"
STEP_MS = 4
FLOOR_M = 20.0
SUNK_M = 0.1
FLOOR_COLOUR, PIECE_COLOUR = vector(0.93, 0.92, 0.88), vector(0.75, 0.6, 0.4)
EYE_M, LOOKS_AT_M = (-1.2, -1.6, 1.2), (0.6, 0.0, 0.0)
# Webots starts controllers/NAME/NAME.py.
CONTROLLER = "foldcar_pulses"


def webots_world(
    body: Mapping[str, Any],
    proto: str,
    scene: Mapping[str, Any] | None = None,
    grid: HeightGrid | None = None,
    drive: str = "",
) -> str:
    """Return the text of a Webots world with the car ``proto`` in a scene.

    Without a scene, the world has a level floor with friction 1, and the car stands at its origin. ``drive`` is the name
    of the file with the servos' movements, which the car's controller plays.
    """
    scene = scene or LEVEL_SCENE
    contacts = [_contact(name, scene["friction"] * grip) for name, grip in contact_materials(body).items()]
    blocks = [piece for piece in scene["terrain"] if kind_of(piece).form == "block"]
    place = _place(scene["start"], start_height_m(body, scene, grid))
    nodes = [
        Node("WorldInfo", {"basicTimeStep": STEP_MS, "contactProperties": contacts}),
        Node("Viewpoint", {"orientation": vector(*_looking()), "position": vector(*EYE_M)}),
        Node("Background", {"skyColor": [vector(0.7, 0.8, 0.9)]}),
        Node("DirectionalLight", {"direction": vector(0.4, 0.3, -1), "intensity": 2, "castShadows": True}),
        *_floor(grid),
        *(_block(piece, f"{piece['kind']} {index}") for index, piece in enumerate(blocks)),
        Node(proto, {**place, "controller": CONTROLLER, "controllerArgs": [drive]}),
    ]
    head = [HEADER, "", f'EXTERNPROTO "../protos/{proto}.proto"', ""]
    return "\n".join([*head, *(node_text(node) for node in nodes), ""])


def _contact(name: str, friction: float) -> Node:
    fields = {"material1": GROUND, "material2": name, "coulombFriction": [friction], "bounce": 0}
    return Node("ContactProperties", fields)


def _place(at: Mapping[str, float], z_m: float = 0) -> dict[str, Any]:
    return {"translation": vector(at["x_m"], at["y_m"], z_m), "rotation": vector(0, 0, 1, at["heading_rad"])}


def _uneven_ground(grid: HeightGrid) -> Node:
    """Return the smooth ground of a scene as a surface through the points of its grid."""
    rows, columns = grid.z_m.shape
    fields = {
        "xDimension": columns,
        "yDimension": rows,
        "xSpacing": (grid.x_max_m - grid.x_min_m) / (columns - 1),
        "ySpacing": (grid.y_max_m - grid.y_min_m) / (rows - 1),
        # A resolution of 1 µm suffices for wheels and keeps the file small.
        "height": [round(float(z), 6) for z in grid.z_m.ravel()],
    }
    surface = Node("ElevationGrid", fields)
    place = vector(grid.x_min_m, grid.y_min_m, 0)
    return _solid("uneven ground", shape(surface, FLOOR_COLOUR), surface, translation=place)


def _floor(grid: HeightGrid | None) -> list[Node]:
    """Return a flat floor or, if the scene has smooth ground, its grid and four boxes as the floor around it."""
    if grid is None:
        plane = Node("Plane", {"size": vector(FLOOR_M, FLOOR_M)})
        return [_solid("floor", shape(plane, FLOOR_COLOUR), plane)]
    solids = [_uneven_ground(grid)]
    half_floor = FLOOR_M / 2
    for name, x_min, x_max, y_min, y_max in (
        ("floor behind", -half_floor, grid.x_min_m, -half_floor, half_floor),
        ("floor ahead", grid.x_max_m, half_floor, -half_floor, half_floor),
        ("floor to the right", grid.x_min_m, grid.x_max_m, -half_floor, grid.y_min_m),
        ("floor to the left", grid.x_min_m, grid.x_max_m, grid.y_max_m, half_floor),
    ):
        box = Node("Box", {"size": vector(x_max - x_min, y_max - y_min, SUNK_M)})
        middle = vector((x_max + x_min) / 2, (y_max + y_min) / 2, -SUNK_M / 2)
        solids.append(_solid(name, shape(box, FLOOR_COLOUR), box, translation=middle))
    return solids


def _block(piece: Mapping[str, Any], name: str) -> Node:
    """Return a block as a solid. Raises FoldcarError if Webots has no shape for its kind."""
    length, width, height = piece["length_m"], piece["width_m"], piece["height_m"]
    place = _place(piece)
    # Shapes reach into the floor, so that no gap is left between them.
    if piece["kind"] == "ramp":
        wedge = _wedge(length, width, height)
        return _solid(name, shape(wedge, PIECE_COLOUR), wedge, **place)
    if piece["kind"] == "box":
        geometry = Node("Box", {"size": vector(length, width, height + SUNK_M)})
        middle, turn = (0.0, 0.0, (height - SUNK_M) / 2), (0.0, 0.0, 1.0, 0.0)
    elif piece["kind"] == "half_round":
        # The segment of a circle whose chord is the length.
        radius = ((length / 2) ** 2 + height**2) / (2 * height)
        geometry = Node("Cylinder", {"radius": radius, "height": width})
        middle, turn = (0.0, 0.0, height - radius), (1.0, 0.0, 0.0, math.pi / 2)
    else:
        raise FoldcarError(f"{name}: a {piece['kind']} cannot be written for Webots")
    visible = placed(shape(geometry, PIECE_COLOUR), middle, turn)
    return _solid(name, visible, placed(geometry, middle, turn), **place)


def _wedge(length: float, width: float, height: float) -> Node:
    """Return a ramp as a closed set of faces. It rises in the direction of x, and its underside is SUNK_M below 0."""
    x, y = length / 2, width / 2
    # The upper face has the points 0 to 3, and the underside the points 4 to 7 below them.
    points = [(-x, -y, 0), (-x, y, 0), (x, -y, height), (x, y, height)]
    points += [(px, py, -SUNK_M) for px, py, _ in points]
    # Upper face, underside, high end, low end, right side, left side: counter-clockwise seen from outside.
    faces = [(0, 2, 3, 1), (4, 5, 7, 6), (2, 6, 7, 3), (0, 1, 5, 4), (0, 4, 6, 2), (1, 3, 7, 5)]
    coordinates = Node("Coordinate", {"point": [vector(*point) for point in points]})
    indices = [index for face in faces for index in (*face, -1)]
    return Node("IndexedFaceSet", {"coord": coordinates, "coordIndex": indices})


def _solid(name: str, seen: Node, bounds: Node, **place: Any) -> Node:
    ground = {"contactMaterial": GROUND, "boundingObject": bounds}
    return Node("Solid", {**place, "name": name, "children": [seen], **ground})


def _looking() -> tuple[float, float, float, float]:
    """Return the rotation of a viewpoint at EYE_M that looks at LOOKS_AT_M: the axis x, y, z and the angle (rad).

    It turns the axes x, y, z of the world into the directions forward, left and up of the viewpoint.
    """
    forward = numpy.subtract(LOOKS_AT_M, EYE_M)
    forward = forward / numpy.linalg.norm(forward)
    left = numpy.cross((0, 0, 1), forward)
    left = left / numpy.linalg.norm(left)
    up = numpy.cross(forward, left)
    # The columns of a rotation's matrix are the turned axes. The rotation vector is the axis times the angle.
    rotation = Rotation.from_matrix(numpy.stack([forward, left, up], axis=1))
    rotation_vector = rotation.as_rotvec()
    angle = float(numpy.linalg.norm(rotation_vector))
    x, y, z = (rotation_vector / angle).tolist()
    return x, y, z, angle


def controller_program() -> str:
    """Return the controller's source, the same for every car."""
    return (Path(__file__).parent / f"{CONTROLLER}.py").read_text(encoding="utf-8")


def controller_drive(body: Mapping[str, Any], pulses: PulseTrain, settling_s: float) -> str:
    """Return the JSON text of the file that tells the controller how to drive.

    It has the names of the motors, how long the car stands before it drives (``settling_s``), and a list of changes. Each
    change is a time (s) and, from then on, the fraction of full speed of each motor; null is a motor without a pulse.
    """
    rows: list[list[float | None]] = []
    for t_s, widths_us in zip(pulses.times_s, pulses.widths_us, strict=True):
        fractions = [drive_fraction(wheel["servo"], widths_us[wheel["channel"]]) for wheel in driven_wheels(body)]
        row = [None if fraction is None else round(fraction, 6) for fraction in fractions]
        if not rows or rows[-1][1:] != row:
            rows.append([round(t_s, 6), *row])
    motors = [f"{wheel_name(wheel)} servo" for wheel in driven_wheels(body)]
    # Each change has a line of its own, so that people can read the file.
    changes = ",\n  ".join(json.dumps(row) for row in rows)
    return f'{{"settling_s": {json.dumps(settling_s)},\n "motors": {json.dumps(motors)},\n "changes": [\n  {changes}]}}\n'


def drive_fraction(servo: Mapping[str, float], pulse_us: float) -> float | None:
    """Return the fraction of full speed that a pulse gives, positive forward; None without a pulse, which gives no
    torque.
    """
    if pulse_us <= 0:
        return None
    offset_us = servo["direction"] * (pulse_us - servo["neutral_us"])
    excess_us = abs(offset_us) - servo["deadband_us"]
    if excess_us <= 0:
        return 0.0
    return math.copysign(min(1.0, excess_us / (servo["saturation_us"] - servo["deadband_us"])), offset_us)
