"""Extensions for servos' leads that are too short.

Input: a FoldedCar. Output: the car with its extensions, and with the mass of all its wire. Lengths are in mm, in the
car's frame.
"""

from dataclasses import replace

from foldcar.car.design import DesignError
from foldcar.car.folded.model import FoldedCar, Mount, Wire
from foldcar.car.folded.pose import apply, translation
from foldcar.car.leads import Lead, extended_mm, extra_wire_m, height_mm, leads, segment_faces
from foldcar.car.parts.quantity import Bought

# Between an extension's joint and the layers of a wall (mm).
JOINT_GAP_MM = 1.0


def with_extensions(car: FoldedCar) -> FoldedCar:
    """Return the car with an extension for each servo whose lead is too short, and with the mass of all its wire.

    Each extension is the shortest that is long enough. Raises DesignError if even the longest one is too short.
    """
    mounts = {mount.name: mount for mount in car.mounts}
    car_leads = leads(car)
    servos = {axle.servo for axle in car.axles if axle.driven}
    # The mount of each extension, by the name of its servo.
    extensions: dict[str, Mount] = {}
    for lead in car_leads:
        if lead.start in servos and lead.missing_mm > 0:
            extensions[lead.start] = _extension_mount(car, mounts[lead.start], _shortest_extension(car, lead))
    # The servo driver is wired to the extension, and this to the servo.
    wires: list[Wire] = []
    for wire in car.wires:
        if wire.carries == "signal" and wire.b in extensions:
            extension_name = extensions[wire.b].name
            wires += [replace(wire, b=extension_name), Wire(extension_name, wire.b, "signal", wire.note)]
        else:
            wires.append(wire)
    wiring = car.parts.wiring
    extra_kg = extra_wire_m(car_leads, wiring) * wiring.wire_kg_m.value
    own_mounts = []
    for mount in car.mounts:
        if mount.part == wiring.name:
            own_mounts.append(replace(mount, mass_kg=mount.mass_kg + extra_kg))
        else:
            own_mounts.append(mount)
    return replace(car, mounts=(*own_mounts, *extensions.values()), wires=tuple(wires))


def _shortest_extension(car: FoldedCar, lead: Lead) -> Bought:
    """Return the shortest extension that makes a servo's lead long enough. Raises DesignError if there is none."""
    for extension in car.parts.extensions.sold:
        if extended_mm(car, lead.available_mm, extension) >= lead.needed_mm:
            return extension
    longest = car.parts.extensions.sold[-1]
    longest_mm = extended_mm(car, lead.available_mm, longest)
    is_long = f"{longest_mm:.0f} mm with the longest extension, {longest.name}"
    message = f"the lead of the {lead.start} must be {lead.needed_mm:.0f} mm long, but is {is_long}"
    raise DesignError(None, f"{message}: make the car shorter")


def _extension_mount(car: FoldedCar, servo: Mount, extension: Bought) -> Mount:
    """Return an extension as a part of the car: its socket with the plug of the servo in it.

    It lies on the floor, below the servo and beside the wall of the servo. Its lead counts as wiring.
    """
    parts, film, extensions = car.parts, car.parts.film_mm, car.parts.extensions
    length, width = extensions.joint_length_mm.value, extensions.joint_width_mm.value
    height = extensions.joint_height_mm.value
    # In the servo's frame, z points from its middle to its bottom, into the car. The undersides of its ears lie on the
    # outside of the wall. From there inwards follow the wall, its second layer of film, a gap and the joint.
    ears_z = parts.servo.depth_mm.value / 2 - parts.servo.ear_underside_mm.value
    inside_of_wall_z = ears_z + 2 * film
    x, y, _ = apply(servo.pose, 0.0, 0.0, inside_of_wall_z + JOINT_GAP_MM + width / 2)
    floor_z = height_mm(segment_faces(car)[servo.body], "floor")
    pose = translation(x, y, floor_z + film / 2 + height / 2)
    name = f"extension of {servo.name}"
    return Mount(extension.name, name, servo.body, pose, (length, width, height), extension.mass_kg.value)
