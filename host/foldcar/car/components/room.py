"""Where boards and battery lie along a body module: a search over the places that USB and the floor leave.

Lengths in mm, x from the module's rear; the floor may reach into the neighbouring modules.
"""

from collections.abc import Iterator
from dataclasses import dataclass

from foldcar.car.compiler.parameter import ROUNDING
from foldcar.car.components.bridge import half_width_mm
from foldcar.car.parts.catalogue import Catalogue
from foldcar.car.parts.quantity import Quantity


@dataclass(frozen=True)
class Span:
    """From ``low`` to ``high`` along x (mm)."""

    low: float
    high: float


@dataclass(frozen=True)
class Layout:
    """Boards with LiPo and battery beside each other on the floor.

    The boards' middle may be anywhere in ``boards``, if that is not empty. ``behind`` tells on which side of them the
    battery is, ``turned`` that its length lies across the car; without ``along_mm`` it is not on the floor.
    """

    parts: Catalogue
    boards: Span
    along_mm: float
    behind: bool
    turned: bool

    @property
    def missing_mm(self) -> float:
        """How much longer the module must be for it, not above 0 if it fits."""
        return self.boards.low - self.boards.high

    @property
    def side(self) -> int:
        """The bridge's edge with the flange, at the battery: 1 the front one, -1 the rear one."""
        return -1 if self.behind else 1

    def boards_mm(self, wanted_mm: float) -> float:
        """The possible middle of the boards next to ``wanted_mm``."""
        return min(max(wanted_mm, self.boards.low), self.boards.high)

    def lipo_mm(self, boards_mm: float) -> float:
        """The middle of the LiPo under boards at ``boards_mm``."""
        return boards_mm - self.side * (lipo_reach_mm(self.parts) - self.parts.lipo.width_mm.value / 2)

    def battery_mm(self, boards_mm: float) -> float:
        """The middle of the battery beside boards at ``boards_mm``."""
        rear, front = _reaches(self.parts, self.along_mm, self.behind)
        return boards_mm - rear + self.along_mm / 2 if self.behind else boards_mm + front - self.along_mm / 2


def layouts(parts: Catalogue, floor: Span, usb: Span, across_mm: float) -> Iterator[Layout]:
    """All layouts of a floor that is ``across_mm`` wide, possible or not; none if the battery is too wide for it."""
    if parts.battery_place == "roof":
        yield _layout(parts, floor, usb, 0.0, behind=True, turned=True)
        return
    length, width = parts.battery.length_mm, parts.battery.width_mm
    for along, across in ((width, length), (length, width)):
        if across_least_mm(parts, across) <= across_mm + ROUNDING:
            for behind in (True, False):
                yield _layout(parts, floor, usb, along.value, behind, turned=across is length)


def across_least_mm(parts: Catalogue, size: Quantity) -> float:
    """Width of the floor (mm) that takes a battery of that size across the car in the worst case of it and the cuts."""
    return size.value + size.tolerance + 2 * parts.assembly.cut_mm.value


def _layout(parts: Catalogue, floor: Span, usb: Span, along: float, behind: bool, turned: bool) -> Layout:
    rear, front = _reaches(parts, along, behind)
    boards = Span(max(floor.low + rear, usb.low), min(floor.high - front, usb.high))
    return Layout(parts, boards, along, behind, turned)


def lipo_reach_mm(parts: Catalogue) -> float:
    """From the boards' middle to the far side of the LiPo (mm), whose near side lies at the bridge's flange."""
    film, width, assembly = parts.film.thickness_mm.value, parts.lipo.width_mm, parts.assembly
    # The flange comes down beside it, wherever in its outline it lies.
    gap = assembly.placement_mm.value + width.tolerance / 2 + assembly.slot_clearance_mm.value
    return film / 2 + gap + width.value - half_width_mm(parts)


def _reaches(parts: Catalogue, along_mm: float, behind: bool) -> tuple[float, float]:
    """From the boards' middle to the rear and to the front end of the layout (mm)."""
    near, far = half_width_mm(parts) + parts.film.thickness_mm.value, lipo_reach_mm(parts)
    if along_mm == 0:
        return near, far
    # The LiPo's lead leaves the Feather at the front.
    gap = parts.assembly.part_gap_mm.value if behind else parts.plugs.battery.length_mm.value
    near += gap + along_mm
    return (near, far) if behind else (far, near)
