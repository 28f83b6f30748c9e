"""The film, screws, tyres, boards, batteries, switch and plugs, as their data files describe them.

A board's frame: the middle of its outline on its underside; x away from the Feather's USB socket, y towards its shorter
row of pins, z up.
"""

import math
from typing import Literal

from foldcar.car.parts.quantity import Bought, Box, BoxPart, Data, Holes, PartData, Places, Quantity


class Cutting(Data):
    """How each machine cuts a film, with the source; None for a machine that does not cut it."""

    silhouette: str | None
    cricut: str | None
    laser: str | None
    scissors: str | None


class Film(PartData):
    """A film of one thickness; films of one material have the same ``name``.

    Bent below ``least_bend_radius_mm`` it keeps a crease or cracks. ``friction`` is that of bare film on the ground.
    ``tape`` says what tape holds it, ``folding`` how its folds are made, ``hinge`` how it endures bending in use.
    """

    sold_as: str
    cutting: Cutting
    folding: str
    tape: str
    hinge: str

    @property
    def title(self) -> str:
        """Material and thickness."""
        return f"{self.name} {self.thickness_mm.value:g} mm"


class Screw(Bought):
    """A screw, ``length_mm`` below the head, with its nut, if it has one."""

    nut_width_mm: Quantity | None
    nut_height_mm: Quantity | None


class Spacer(Bought):
    """A round spacer around a screw."""


class Tools(PartData):
    """The space that a screwdriver, a finger, and a nut before its screw need."""

    @property
    def finger_mm(self) -> tuple[float, float]:
        """Diameter and length of the largest finger (mm)."""
        return self.finger_diameter_mm.max_value, self.finger_length_mm.max_value

    @property
    def driver_mm(self) -> tuple[float, float]:
        """Diameter and length of the largest screwdriver's shaft (mm)."""
        return self.driver_diameter_mm.max_value, self.driver_length_mm.max_value


class Cells(Bought):
    """The four cells in the battery's holder: their voltage without load; their resistance with holder, leads and switch.

    ``fresh_v`` is the voltage when fresh, ``cell`` what to buy. Their mass is included in the battery's.
    """

    cell: str
    supply_v: Quantity
    supply_resistance_ohm: Quantity


class Tyre(Bought):
    """A wheel's tyre; without a ``width_mm`` of its own it is cut to the rim's width. Its cost is a wheel's.

    It is a band or a strip, or a tube that shrinks. Without a ``friction`` of its own it has the film's. A band can be
    put on closed: ``stretch`` is the fraction by which it is then longer on its rim than before. A tyre with
    ``stretch`` None is no band. ``inside_mm`` is the length around the inside of a band that is sold in one size only.
    With None, a band of any size can be bought.
    """

    form: Literal["strip", "tube"]
    width_mm: Quantity | None
    stretch: Quantity | None
    inside_mm: Quantity | None
    friction: Quantity | None
    note: str

    def running_width_mm(self, rim_width_mm: float) -> float:
        """Return the width that touches the ground (mm), on a rim of that width."""
        return rim_width_mm if self.width_mm is None else min(self.width_mm.value, rim_width_mm)

    def sizes(self, radius_mm: float, rim_width_mm: float) -> tuple[str, ...]:
        """Return what to take or to cut for the tyre of a wheel, in words, one text for each possible way.

        ``radius_mm`` is the outer radius of the wheel with its tyre, and ``rim_width_mm`` the width of its rim.
        """
        width = self.running_width_mm(rim_width_mm)
        rim_diameter_mm = 2 * (radius_mm - self.thickness_mm.value)
        # A tube that shrinks onto the rim. Laid flat, it is half as wide as its circumference.
        if self.form == "tube":
            flat = math.ceil(math.pi * rim_diameter_mm / 2)
            wide_enough = f"wider than {rim_diameter_mm:g} mm before it shrinks ({flat} mm flat)"
            return (f"{width:g} mm of a tube that is {wide_enough}",)
        stretch = self.closed_stretch(radius_mm)
        if stretch is None:
            return (self._strip_text(rim_diameter_mm, width),)
        on_rim = f"on the rim it is stretched by {100 * stretch:.0f} %"
        if self.inside_mm is not None:
            return (f"one closed band as it is: {on_rim}",)
        # A band that can be bought in any size, or a strip instead of it.
        return (f"{self._band_text(rim_diameter_mm, width, stretch)}: {on_rim}", self._strip_text(rim_diameter_mm, width))

    def _strip_text(self, rim_diameter_mm: float, width_mm: float) -> str:
        """Describe the strip that is laid around a rim, and the bands that it is cut from, if it is cut from bands."""
        # The strip is as long as the circle through the middle of the tyre's thickness.
        length_mm = math.pi * (rim_diameter_mm + self.thickness_mm.value)
        strip = f"a strip of {round(length_mm)} x {width_mm:g} mm"
        # Bands that are sold in one size only are cut open. ``inside_mm`` is the length around the inside of a band.
        if self.inside_mm is None:
            return strip
        bands = math.ceil(length_mm / self.inside_mm.value)
        source = "one band, cut open" if bands == 1 else f"{bands} bands, cut open and laid end to end"
        return f"{strip}, of {source}"

    def _band_text(self, rim_diameter_mm: float, width_mm: float, stretch: float) -> str:
        """Describe the closed band to buy that is longer by the fraction ``stretch`` when it is on a rim."""
        length_round_inside_mm = math.pi * rim_diameter_mm / (1 + stretch)
        diameter_mm, flat_mm = length_round_inside_mm / math.pi, length_round_inside_mm / 2
        lying_flat = f"({flat_mm:.0f} mm long when it lies flat)"
        cross_section = f"{width_mm:g} mm wide, {self.thickness_mm.value:g} mm thick"
        return f"a closed band {diameter_mm:.0f} mm in inside diameter {lying_flat}, {cross_section}"

    def closed_stretch(self, radius_mm: float) -> float | None:
        """Return the stretch of a closed band on a wheel of that outer radius, as a fraction of the band's length.

        None means that the tyre cannot be put on as a closed band: it is no band, or the one size in which the band is
        sold would be stretched too little or too much.
        """
        if self.stretch is None:
            return None
        if self.inside_mm is None:
            return self.stretch.value
        rim_length_mm = 2 * math.pi * (radius_mm - self.thickness_mm.value)
        stretch_on_rim = rim_length_mm / self.inside_mm.value - 1
        is_allowed = self.stretch.min_value <= stretch_on_rim <= self.stretch.max_value
        return stretch_on_rim if is_allowed else None

    def taped_mm(self, radius_mm: float) -> float:
        """Return the length of tape (mm) that holds the tyre on a wheel of that outer radius.

        A rubber band that is too small is cut open, and tape holds it all around the rim. The same is true for a strip
        that takes the place of a band. Nothing else needs tape: a closed band is stretched, a tube shrinks, and other
        strips have an adhesive of their own.
        """
        is_band = self.stretch is not None
        fits_closed_as_sold = self.inside_mm is not None and self.closed_stretch(radius_mm) is not None
        if not is_band or fits_closed_as_sold:
            return 0.0
        return 2 * math.pi * (radius_mm - self.thickness_mm.value)

    def mass_kg(self, radius_mm: float, rim_width_mm: float) -> float:
        """Return the mass of a ring of that outer radius (kg)."""
        area_mm2 = math.pi * (radius_mm**2 - (radius_mm - self.thickness_mm.value) ** 2)
        width_mm = rim_width_mm if self.width_mm is None else self.width_mm.value
        return area_mm2 * width_mm * 1e-9 * self.density_kg_m3.value


class Headers(Bought):
    """The Feather's female headers; their legs are ``leg_mm`` long below the sockets' bodies."""


class Pins(Data):
    """The names of a board's pins, from the side of USB on: those of the long row and those of the short row."""

    long_row: tuple[str, ...]
    short_row: tuple[str, ...]
    source: str

    def place_of(self, name: str) -> str:
        """Return a pin's name with its place: ``32 (number 9 of the 12)``."""
        return f"{name} (number {self.number_of(name)} of the {len(self._row_of(name))})"

    def number_of(self, name: str) -> int:
        """Return a pin's number in its row, counted from the side of USB, from 1."""
        return self._row_of(name).index(name) + 1

    def _row_of(self, name: str) -> tuple[str, ...]:
        return next(row for row in (self.long_row, self.short_row) if name in row)


class Feather(BoxPart):
    """The processor's board with female headers on it; ``small`` are parts at its holes."""

    small: tuple[Box, ...]
    headers: tuple[Box, Box]
    holes: tuple[Holes, Holes]
    usb: Box
    battery_socket: Box
    reset: Box
    antenna: Box
    pins: Pins

    def pin_mm(self, name: str) -> tuple[float, float]:
        """Return x and y (mm) of a pin in the board's frame. Raises KeyError if there is no pin of this name.

        The pins of a row are evenly spaced along x below the row's header.
        """
        long_header, short_header = self.headers
        for header, row in ((long_header, self.pins.long_row), (short_header, self.pins.short_row)):
            if name in row:
                middle_x, row_y, _ = header.at_mm
                length, _, _ = header.size_mm
                pitch = length / len(row)
                # The first pin is half a pitch from the end of the header.
                return middle_x - length / 2 + (row.index(name) + 0.5) * pitch, row_y
        raise KeyError(name)

    @property
    def standing(self) -> tuple[Box, ...]:
        """Everything that stands on the board."""
        return (*self.headers, *self.small, self.usb, self.battery_socket, self.antenna, self.reset)

    def joints(self, headers: Headers) -> tuple[Box, ...]:
        """Return the soldered ends of the headers' legs, which stand out below the board, as a box for each header."""
        length_mm = headers.leg_mm.value - self.board_mm.value
        width_mm = headers.joint_width_mm.value
        joints = []
        for header in self.headers:
            x_mm, y_mm, _ = header.at_mm
            size_mm = (header.size_mm[0], width_mm, length_mm)
            # The board's lower side is at height 0, and a box is placed by its centre.
            joints.append(header.model_copy(update={"at_mm": (x_mm, y_mm, -length_mm / 2), "size_mm": size_mm}))
        return tuple(joints)

    def free_holes(self, screw: Screw) -> list[tuple[float, float]]:
        """Return the centres (x, y) of the holes at which a screw's nut can be turned without meeting other parts."""
        # Half of a hexagonal nut's width across corners. Without a nut, the screw's own radius counts.
        radius_mm = screw.nut_width_mm.value / math.sqrt(3) if screw.nut_width_mm else screw.diameter_mm.value / 2
        centers = [center for pattern in self.holes for center in pattern.at_mm]
        return [center for center in centers if all(_distance_mm(center, box) > radius_mm for box in self.standing)]


def _distance_mm(point: tuple[float, float], box: Box) -> float:
    """Return the distance of a point from a box, seen from above (mm); 0 if the point is in it."""
    (x, y), (box_x, box_y, _), (length, width, _) = point, box.at_mm, box.size_mm
    beside_x, beside_y = abs(x - box_x) - length / 2, abs(y - box_y) - width / 2
    return math.hypot(max(0.0, beside_x), max(0.0, beside_y))


class FeatherWing(BoxPart):
    """The servo driver, plugged onto the Feather: ``gap_mm`` is between the two boards, ``headers`` are below it.

    ``pins`` are the ends of soldered pins below it; those of its male headers are inside the Feather's sockets.

    ``plug_top_mm`` is the height of an upright servo plug's top over this board's underside, ``plug_bend_mm`` what its
    leads need above it. ``outputs`` are the middles of the outputs' pins, from output 0 on. ``output_enable`` are the
    pads of the net #OE on the board: the end of the resistor ``pull_down`` that is not at ground, and the pin of the
    ``driver_chip``. ``chip_capacitor`` stands beside that resistor and looks alike.
    """

    headers: tuple[Box, Box]
    holes: tuple[Holes]
    servo_headers: tuple[Box, Box]
    pins: tuple[Box, ...]
    outputs: Places
    terminal_block: Box
    driver_chip: Box
    pull_down: Box
    chip_capacitor: Box
    output_enable: Places
    reset: Box


class Gauge(Data):
    """A gauge of wire, and the current it bears in a device."""

    awg: int
    area_mm2: float
    current_a: float
    ohm_m: float
    source: str


class Wiring(BoxPart):
    """The wires as a part; ``gauges``, the thinnest first."""

    gauges: tuple[Gauge, ...]


class Plugs(PartData):
    """The computer's, the servos' and the LiPo's plugs with their housings, which need clearance.

    ``inserted_mm`` is the length of a plug inside its socket.
    """

    usb: PartData
    servo: PartData
    battery: PartData


class Extensions(PartData):
    """Servo extensions as they are sold, the shortest first; ``joint`` is a plug in an extension's socket.

    One is a lead with a socket at one end and a plug at the other, ``length_mm`` long.
    """

    sold: tuple[Bought, ...]
