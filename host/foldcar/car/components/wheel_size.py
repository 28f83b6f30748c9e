"""Sizes of a wheel, which follow from its radius and width and from the parts of the car. Lengths in mm.

The rim is equal strips of film around two discs, which hold it in notches at the *ties*. A strip is a polygon of facets
in the model and a smooth curve when built: its facets are together as long as the circle that its middle surface bends
to.
"""

import math

from foldcar.car.folded.model import Point
from foldcar.car.parts.catalogue import Catalogue
from foldcar.car.parts.servo import Horn

# The maximum length of a rim strip, so that it fits on a sheet of A4.
MAX_STRIP_MM = 250.0
# Minimum number of ties from rim to disc. Spans shorter than the minimum do not make a disc of thin film stiffer.
MIN_TIES = 4
MIN_SPAN_MM = 65.0
# A tyre pulls with this force around the discs: a band of 12 x 1 mm² of natural rubber (1.5 MPa), stretched by a tenth.
TYRE_PULL_N = 1.8
# A disc is clamped at its hub, held inwards by the rim and outwards at the ties. It buckles above an edge load of
# CRITICAL D / span², with the bending stiffness D (Ritz solution: 22 to 33 for 4 to 6 ties and radii of 30 to 150 mm).
CRITICAL = 25.0
POISSON = 0.38
# Minimum length of a facet of the rim: the last facet has the slot for the next strip's tongue.
RIM_FACET_MM = 7.8
# The hub's walls, each an eighth of a turn wide, as seen from the axle.
WALLS = 3
WALL_RAD = math.pi / 4
# Film between a slot and another edge, and between the notches of the rim and the hub's walls.
BRIDGE_MM = 1.5
MIN_WEB_MM = 4.0
# Width of the necks of the rim's hooks.
NECK_MM = 3.0
# Play of the hub's necks towards the axle, which lets the outer disc run out of true: the repeatability of the machines.
PLAY_MM = 0.1
# Maximum deviation of the outlines of discs and layers from a circle.
EVEN_MM = 0.02


class WheelSize:
    """The sizes of a wheel, from its rolling ``radius_mm`` with tyre and its ``width_mm`` from outside to outside
    of the discs.
    """

    def __init__(self, radius_mm: float, width_mm: float, parts: Catalogue) -> None:
        """Compute all sizes, from the discs over the rim to the hub. The members' comments say what they are."""
        self.radius_mm = radius_mm
        self.width_mm = width_mm
        self.film_mm = parts.film_mm
        # Play of a hook's neck in its slot or notch, on each side.
        self.clearance_mm = parts.assembly.slot_clearance_mm.value / 2
        # Radius of the discs and of the rim's outer face, on which the tyre lies.
        self.disc_radius_mm = radius_mm - parts.tyre.thickness_mm.value
        # Width of the strips between the discs, with some play.
        self.between_mm = width_mm - 2 * (self.film_mm + self.clearance_mm)
        # Number of equal strips that the rim consists of.
        rim_length_mm = 2 * math.pi * (self.disc_radius_mm - self.film_mm / 2)
        self.strips = math.ceil(rim_length_mm / MAX_STRIP_MM)
        # Number of ties of a strip, the places at which it holds the discs. They are near enough to each other that the
        # discs do not buckle, and there are at least MIN_TIES on the wheel.
        disc_arc_mm = 2 * math.pi * self.disc_radius_mm / self.strips
        min_spans = math.ceil(disc_arc_mm / max_span_mm(self.disc_radius_mm, parts))
        self.ties = max(min_spans, math.ceil(MIN_TIES / self.strips))
        # Directions of all ties around the axle, strip after strip. They are counted from x towards z of the wheel.
        tie_count = self.strips * self.ties
        self.tie_angles_rad = [2 * math.pi * tie / tie_count for tie in range(tie_count)]
        # Number of facets from tie to tie.
        self.facets_per_tie = max(1, math.floor(rim_length_mm / (tie_count * RIM_FACET_MM)))
        facet_count = tie_count * self.facets_per_tie
        # A facet's length, its angle to the next facet, and the distance of its middle from the axle.
        self.facet_mm = rim_length_mm / facet_count
        self.turn_rad = 2 * math.pi / facet_count
        self.apothem_mm = self.facet_mm / 2 / math.tan(self.turn_rad / 2)
        # Angle between the last facet of a strip and the first facet of the next strip. Other facets meet at the angle
        # `turn`: one end of a facet is facet · sin(turn) farther in than the facet that it meets. The last facet ends one
        # film below the first one, so this distance is one film less: facet · sin(slope) = facet · sin(turn) - film.
        self.slope_rad = math.asin(math.sin(self.turn_rad) - self.film_mm / self.facet_mm)
        # Half the width of a notch in a disc, and the distance of its bottom from the axle.
        self.notch_half_mm = NECK_MM / 2 + self.clearance_mm
        self.notch_bottom_mm = self.apothem_mm - self.film_mm / 2 - self.clearance_mm
        # Distance of the hub's walls from the axle, which leaves a driver room for every screw between them.
        self.hub_mm = hub_mm(parts)
        # Height of the hub's walls, from the middle of its layer to the outer disc, with some play. The films of both
        # discs and half of the layer's film are not part of it.
        self.wall_mm = width_mm - 2.5 * self.film_mm - self.clearance_mm


def max_span_mm(disc_radius_mm: float, parts: Catalogue) -> float:
    """Return the maximum span from tie to tie (mm) with which a disc does not buckle under the pull of a tyre.

    The pull T loads the edge of each of the two discs with N = T / (2 R), where R is the disc's radius. A disc does not
    buckle up to N = CRITICAL D / span², where D is the film's bending stiffness. Spans of MIN_SPAN_MM are always allowed.
    """
    modulus_pa, thickness_m = parts.film.youngs_modulus_pa.value, parts.film_mm * 1e-3
    stiffness_n_m = modulus_pa * thickness_m**3 / 12 / (1 - POISSON**2)
    span_m = math.sqrt(CRITICAL * stiffness_n_m * 2 * (disc_radius_mm * 1e-3) / TYRE_PULL_N)
    return max(MIN_SPAN_MM, 1e3 * span_m)


def wheel_screws_mm(horn: Horn) -> tuple[Point, Point]:
    """Return the two holes that hold the wheel, which are the farthest from each other: points of the horn's frame."""
    holes = horn.wheel_screws.at_mm
    return max(((a, b) for a in holes for b in holes), key=lambda pair: (math.dist(*pair), pair[0]))


def access_radius_mm(parts: Catalogue) -> float:
    """Return radius of a hole through which a driver reaches all screws of the horn."""
    reach = max(math.hypot(*at) for at in wheel_screws_mm(parts.horn))
    play = max(0.5, parts.horn.wheel_screws.tolerance)
    return reach + max(parts.tools.driver_diameter_mm.value, parts.horn_screw.head_diameter_mm.value) / 2 + play


def hub_mm(parts: Catalogue) -> float:
    """Return the distance of the hub's walls from the axle (mm).

    It leaves film between their slots and the driver's hole.
    """
    return access_radius_mm(parts) + BRIDGE_MM + PLAY_MM + parts.film_mm / 2


def min_radius_mm(parts: Catalogue) -> float:
    """Return minimum rolling radius of a wheel: hub, film to the rim's notches, tyre; rounded up to 0.1 mm."""
    corner = hub_mm(parts) / math.cos(WALL_RAD / 2)
    least = corner + MIN_WEB_MM + 2 * parts.film_mm + parts.tyre.thickness_mm.value
    return math.ceil(10 * least - 1e-9) / 10


def arc_steps(radius_mm: float, arc_rad: float) -> int:
    """Return the number of straight steps that follow an arc within EVEN_MM."""
    # A chord over the angle 2 a is r (1 - cos a) away from its arc.
    return math.ceil(arc_rad / 2 / math.acos(1 - EVEN_MM / radius_mm))
