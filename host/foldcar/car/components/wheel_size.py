"""Sizes of a wheel that follow from its radius, its width and the chosen parts: discs, rim strips, hub.

A strip is a polygon of facets in the model and a smooth curve when built: its facets are together as long as the circle
that its middle surface bends to. Lengths in millimetres, angles in radians.
"""

import math
from dataclasses import dataclass
from functools import cached_property

from foldcar.car.folded.model import Point
from foldcar.car.parts.catalogue import Catalogue
from foldcar.car.parts.mechanics import Horn

# A rim strip is no longer than this, so that it fits on a sheet of A4.
LONGEST_STRIP_MM = 250.0
# The rim is tied to the discs at least so often; spans shorter than this do not make a disc of thin film stiffer.
LEAST_TIES = 4
LEAST_SPAN_MM = 65.0
# A tyre pulls with this force around the discs: a band of 12 x 1 mm² of natural rubber (1.5 MPa), stretched by a tenth.
TYRE_PULL_N = 1.8
# A disc that is clamped at its hub, held inwards by the rim and outwards at the ties stays even up to an edge load of so
# many times D / span², D its bending stiffness (Ritz solution: 22 to 33 for 4 to 6 ties and radii of 30 to 150 mm).
CRITICAL = 25.0
POISSON = 0.38
# Least length of a facet of the rim: its last one has the slot for the next strip's tongue.
RIM_FACET_MM = 7.8
# The hub's walls, each an eighth of a turn wide, as seen from the axle.
WALLS = 3
WALL_RAD = math.pi / 4
# Film between a slot and another edge, and between the notches of the rim and the hub's walls.
BRIDGE_MM = 1.5
LEAST_WEB_MM = 4.0
# Play of the hub's necks towards the axle, which lets the outer disc run out of true: as little as machines repeat.
PLAY_MM = 0.1


@dataclass(frozen=True)
class Strip:
    """A closed polygon of equal facets with the length of a circle of ``radius_mm``."""

    radius_mm: float
    facets: int

    @property
    def facet_mm(self) -> float:
        """Length of a facet."""
        return 2 * math.pi * self.radius_mm / self.facets

    @property
    def turn_rad(self) -> float:
        """Angle between two facets."""
        return 2 * math.pi / self.facets

    @property
    def apothem_mm(self) -> float:
        """Distance of a facet's middle from the axle."""
        return self.facet_mm / 2 / math.tan(self.turn_rad / 2)

    def dip_rad(self, depth_mm: float) -> float:
        """Angle by which a facet dips inwards if its end is to lie ``depth_mm`` within the facet that follows."""
        return self.turn_rad - math.asin(math.sin(self.turn_rad) - depth_mm / self.facet_mm)

    def shift_mm(self, depth_mm: float) -> float:
        """How far such a facet's end then lies beyond the start of the one that follows, along that."""
        return self.facet_mm * (math.cos(self.turn_rad - self.dip_rad(depth_mm)) - math.cos(self.turn_rad))


@dataclass(frozen=True)
class WheelSize:
    """A wheel of rolling ``radius_mm``, tyre included, ``width_mm`` from outside to outside of its discs."""

    radius_mm: float
    width_mm: float
    parts: Catalogue

    @property
    def film_mm(self) -> float:
        """Thickness of the film."""
        return self.parts.film.thickness_mm.value

    @property
    def clearance_mm(self) -> float:
        """Play of a neck in its slot or notch on each side."""
        return self.parts.assembly.slot_clearance_mm.value / 2

    @property
    def disc_radius_mm(self) -> float:
        """Radius of the discs and of the rim's outer face, on which the tyre lies."""
        return self.radius_mm - self.parts.tyre.thickness_mm.value

    @property
    def between_mm(self) -> float:
        """Width of the strips between the discs, with some play."""
        return self.width_mm - 2 * (self.film_mm + self.clearance_mm)

    @property
    def _length_mm(self) -> float:
        """Length of the rim, along the film's middle."""
        return 2 * math.pi * (self.disc_radius_mm - self.film_mm / 2)

    @property
    def strips(self) -> int:
        """Number of the equal strips that make up the rim."""
        return math.ceil(self._length_mm / LONGEST_STRIP_MM)

    @property
    def ties(self) -> int:
        """Ties of each strip to the discs, one on each edge: so many that the tyre's pull makes no disc of 0.25 mm wavy.

        The pull T loads the edge of each disc with N = T / 2 R; it stays even up to N = CRITICAL D / span².
        """
        thickness_m, modulus = self.film_mm * 1e-3, self.parts.film.youngs_modulus_pa.value
        stiffness_n_m = modulus * thickness_m**3 / 12 / (1 - POISSON**2)
        radius_m = self.disc_radius_mm * 1e-3
        span_mm = max(LEAST_SPAN_MM, 1e3 * math.sqrt(CRITICAL * stiffness_n_m * 2 * radius_m / TYRE_PULL_N))
        length_mm = 2 * math.pi * self.disc_radius_mm / self.strips
        return max(math.ceil(length_mm / span_mm), math.ceil(LEAST_TIES / self.strips))

    @property
    def facets_per_tie(self) -> int:
        """Facets of the rim from one tie to the next."""
        return max(1, math.floor(self._length_mm / (self.strips * self.ties * RIM_FACET_MM)))

    @cached_property
    def rim(self) -> Strip:
        """The rim's polygon."""
        return Strip(self.disc_radius_mm - self.film_mm / 2, self.strips * self.ties * self.facets_per_tie)

    @property
    def hub_mm(self) -> float:
        """Distance of the hub's walls from the axle: a driver reaches every screw between them."""
        return hub_mm(self.parts)

    @property
    def wall_mm(self) -> float:
        """Height of the hub's walls, from the middle of its layer on the inner disc to the outer disc, with some play."""
        return self.width_mm - 2.5 * self.film_mm - self.clearance_mm


def wheel_screws_mm(horn: Horn) -> tuple[Point, Point]:
    """The two holes of the horn, farthest from each other, that hold the wheel: points of the horn's frame."""
    holes = horn.wheel_screws.at_mm
    return max(((a, b) for a in holes for b in holes), key=lambda pair: (math.dist(*pair), pair[0]))


def access_radius_mm(parts: Catalogue) -> float:
    """Radius of a hole through which a driver reaches all screws of the horn."""
    reach = max(math.hypot(*at) for at in wheel_screws_mm(parts.horn))
    play = max(0.5, parts.horn.wheel_screws.tolerance)
    return reach + max(parts.tools.driver_diameter_mm.value, parts.horn_screw.head_diameter_mm.value) / 2 + play


def hub_mm(parts: Catalogue) -> float:
    """Distance of the hub's walls from the axle (mm): film is left between their slots and the hole for the driver."""
    return access_radius_mm(parts) + BRIDGE_MM + PLAY_MM + parts.film.thickness_mm.value / 2


def least_radius_mm(parts: Catalogue) -> float:
    """Least rolling radius of a wheel: hub, film to the rim's notches, tyre; in tenths of a millimetre."""
    corner = hub_mm(parts) / math.cos(WALL_RAD / 2)
    least = corner + LEAST_WEB_MM + 2 * parts.film.thickness_mm.value + parts.tyre.thickness_mm.value
    return math.ceil(10 * least - 1e-9) / 10
