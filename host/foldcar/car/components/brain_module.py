"""The body module B; the first B of a car carries the electronics.

The LiPo lies on the floor under a deck, the board stack stands on the deck. The servos' battery hangs under the lid,
where its cells can be changed; where the car is too low for that, it lies on the floor behind the boards.
"""

from collections.abc import Sequence

from foldcar.car.compiler.component import Sub
from foldcar.car.compiler.parameter import Parameter
from foldcar.car.compiler.shape import Shape
from foldcar.car.components.box_beam import wall_mm
from foldcar.car.components.deck import Deck
from foldcar.car.components.dimensions import HEIGHT, WIDTH
from foldcar.car.components.module import Module
from foldcar.car.folded.model import Wire
from foldcar.car.parts.catalogue import catalogue

LENGTH = Parameter("length", 80, 10, 400, "length of a body module", "a strip that can be folded")


class BrainModule(Module):
    """A beam; :class:`ElectronicsModule` is the one with boards and batteries in it."""

    letter = "B"
    title = "body module: electronics and batteries"
    parameters = (WIDTH, HEIGHT, LENGTH)


class ElectronicsModule(BrainModule):
    """The body module that carries boards and batteries on a deck."""

    def subcomponents(self) -> Sequence[Sub]:
        """The beam, and a deck as long as the boards."""
        return (
            *super().subcomponents(),
            Sub("deck", Deck, inherit=("width",), settings={"length": lambda _: stack_length_mm()}),
        )

    def build(self, shape: Shape) -> None:
        """Place the parts in the floor's frame: x from the rear, y from the right wall, z from the middle surface."""
        parts = catalogue()
        film, assembly = parts.film.thickness_mm.value, parts.assembly
        room, across = self["length"], wall_mm(self["width"])
        battery_x, stack_x, under_lid, turned = self._arrange()
        middle = across / 2
        bottom = film / 2
        shape.part(parts.lipo, parts.lipo.name, "beam.floor", (stack_x, middle, bottom + parts.lipo.height_mm.value / 2))
        shelf_z = bottom + parts.lipo.height_mm.value + assembly.shelf_clearance_mm.value + film / 2
        deck = self.children["deck"]
        assert isinstance(deck, Deck)
        deck.insert(shape, "deck", "beam.floor", ("beam.left", "beam.right"), stack_x - stack_length_mm() / 2, shelf_z)
        shelf_middle = (stack_length_mm() / 2, middle - deck.gap_mm)
        holes = self._board_holes(shape, shelf_middle)
        height = film / 2
        for board in (parts.feather, parts.featherwing):
            at = (*shelf_middle, height + board.height_mm.value / 2)
            shape.part(board, board.name, "deck.shelf", at, holes=holes if board is parts.feather else ())
            height += board.height_mm.value
        half = parts.battery.height_mm.value / 2
        z = wall_mm(self["height"]) - film / 2 - half if under_lid else film / 2 + half
        shape.part(parts.battery, parts.battery.name, "beam.floor", (battery_x, middle, z), turned=turned)
        wires_z = wall_mm(self["height"]) / 2
        shape.part(parts.wiring, parts.wiring.name, "beam.floor", (room / 2, middle, wires_z))
        shape.graph.wires += _power_wires()

    def _board_holes(self, shape: Shape, middle: tuple[float, float]) -> list[str]:
        feather = catalogue().feather
        a, b = feather.hole_spacing_length_mm.value / 2, feather.hole_spacing_width_mm.value / 2
        return [
            shape.round_hole("deck.shelf", f"board screw {i + 1}", "screw", (middle[0] + x, middle[1] + y),
                             feather.hole_mm.value)
            for i, (x, y) in enumerate(((-a, -b), (a, -b), (a, b), (-a, b)))
        ]  # fmt: skip

    def _arrange(self) -> tuple[float, float, bool, bool]:
        """x of battery and boards from the rear (mm), whether the battery hangs from the lid, whether it is turned.

        ComponentError if the module is too short or too low for them.
        """
        parts = catalogue()
        film = parts.film.thickness_mm.value
        battery = parts.battery
        room, width = self["length"], self["width"]
        inside, stack, length = self["height"] - 2 * film, stack_height_mm(), stack_length_mm()
        under_lid = stack + battery.height_mm.value <= inside
        for_battery = room if under_lid else room - length
        turned = battery.length_mm.value > for_battery
        along, across = battery.length_mm.value, battery.width_mm.value
        if turned:
            along, across = across, along
        if inside < stack:
            raise self.misfit("height", _too_small(self["height"], stack + 2 * film, "the board stack"))
        if for_battery < along or room < length:
            needed = max(length, along) if under_lid else length + along
            what = "the batteries and boards"
            if not under_lid:
                what = f"the battery behind the boards at height {self['height']:g}"
            raise self.misfit("length", _too_small(room, needed, what))
        if width - 2 * film < across:
            what = f"the {battery.name} at B.length {room:g}"
            raise self.misfit("width", _too_small(width, across + 2 * film, what))
        if under_lid:
            return room / 2, room / 2, True, turned
        return along / 2, room - length / 2, False, turned


def stack_length_mm() -> float:
    """Length of the stack (mm): that of its longest part."""
    parts = catalogue()
    return max(part.length_mm.value for part in (parts.lipo, parts.feather, parts.featherwing))


def stack_height_mm() -> float:
    """Height of the stack (mm): LiPo, nuts, deck and boards."""
    parts = catalogue()
    boards = parts.feather.height_mm.value + parts.featherwing.height_mm.value
    under = parts.lipo.height_mm.value + parts.assembly.shelf_clearance_mm.value
    return under + parts.film.thickness_mm.value + boards


def _power_wires() -> list[Wire]:
    parts = catalogue()
    feather, wing = parts.feather.name, parts.featherwing.name
    return [
        Wire(f"{feather} headers", f"{wing} headers", "stack", "the wing sits on the Feather: I2C on SDA 23 and SCL 22"),
        Wire(f"{parts.lipo.name}", f"{feather} JST", "supply", "3.7 V for the processor"),
        Wire(
            f"{parts.battery.name} +",
            f"{wing} terminal +",
            "supply",
            f"{parts.battery.supply_v.value:g} V for the servos",
        ),
        Wire(f"{parts.battery.name} -", f"{wing} terminal -", "supply", "ground"),
        Wire(f"{feather} USB", "computer", "usb", "to flash, and for trials by cable"),
    ]


def _too_small(value: float, needed: float, what: str) -> str:
    return f"{value:g} is below the minimum {needed:g} ({what})"
