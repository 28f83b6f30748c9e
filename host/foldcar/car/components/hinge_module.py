"""The hinge H: a strip of film under the floors of two segments, which pitch against each other about its middle.

The strip is glued from below to the floors before and behind the gap. The front segment may pitch nose down (over a
crest) by ``fold_down``, and nose up by ``fold_up``. The meeting lids, or a stop between them, limit the latter.
"""

import math
from itertools import pairwise

from foldcar.car.components.box_beam import HEIGHT, WIDTH, cap_inset_mm, wall_distance_mm
from foldcar.car.components.component import ROUNDING, Component, Parameter, maximum_text, minimum_text
from foldcar.car.components.shape import Shape
from foldcar.car.folded.model import Pose
from foldcar.car.folded.pose import compose, rotation, translation
from foldcar.car.parts.bought import Film
from foldcar.car.parts.catalogue import Catalogue, film_of, films


def _thicknesses_mm(parts: Catalogue) -> list[float]:
    """Return the thicknesses (mm) in which the car's film is sold, from which a hinge's strip may be cut."""
    return [film.thickness_mm.value for film in films(parts.film.name)]


FOLD_DOWN_DEG = 60


def _length_mm(parts: Catalogue) -> float:
    """Return the default length (mm): 6 mm, or more if the film needs it to bend by the default angle."""
    return max(6.0, math.ceil(parts.film.least_bend_radius_mm.value * math.radians(FOLD_DOWN_DEG)))


# The stop is a square tube of film below the lids. Its length is STOP_SHARE of the body's width. Its height is that of
# its web, the face that meets the other cap. Each of the two flaps that are glued to the cap is GLUE_SHARE as high.
STOP_FROM_LID_MM = 2.0
STOP_WEB_MM = 12.0
MIN_STOP_MM = 1.0
STOP_SHARE = 1 / 3
GLUE_SHARE = 0.45


def stiffness_n_m_rad(width_mm: float, thickness_mm: float, length_mm: float, film: Film) -> float:
    """Return the rotational stiffness of the strip (N m/rad): an Euler-Bernoulli beam that is bent to a circular
    arc, E w t³ / 12 l.
    """
    second_moment_m4 = width_mm * thickness_mm**3 / 12 * 1e-12
    return film.youngs_modulus_pa.value * second_moment_m4 / (length_mm * 1e-3)


class HingeModule(Component):
    """Two half strips with a flexure between them; :meth:`join` glues the halves under the floors of two segments."""

    letter = "H"
    title = "hinge: a strip of film that lets the segments before and after it pitch against each other"
    parameters = (
        WIDTH, HEIGHT,
        Parameter(
            "length", _length_mm, 1, 60, "length of a hinge's strip, the gap between two segments",
            "a strip that bends evenly",
        ),
        Parameter(
            "thickness", lambda parts: parts.film_mm, lambda parts: min(_thicknesses_mm(parts)), 1,
            "thickness of a hinge's strip, as wide as the body: of a film of the car's material",
            "the thinnest film that is sold", sold=_thicknesses_mm,
        ),
        Parameter("fold_down", FOLD_DOWN_DEG, 0, 90, "how far the front segment may pitch nose down against the rear one",
                  "flat", "deg"),
        Parameter("fold_up", 0, 0, 90, "how far it may pitch nose up, which lets the car sag", "flat", "deg"),
    )  # fmt: skip

    def build(self, shape: Shape) -> None:
        """Add the two halves of the strip with the flexure between them, and the stop, if there is room for one.

        The halves are the faces ``front half`` and ``rear half``. In their frames x points forward and y to the left.
        Raises ComponentError if ``fold_up`` is larger than the angle at which the lids meet, or if the strip would
        have to bend too sharply.
        """
        self._check_angles()
        glue_mm, width = self.parts.assembly.hinge_glue_mm.value, wall_distance_mm(self["width"], self.parts)
        half_length = self["length"] / 2 + glue_mm
        for name in ("front half", "rear half"):
            shape.rectangle(name, half_length, width, piece="hinge strip", thickness_mm=self["thickness"])
        # The floor of a module is glued to the end of each half that is away from the flexure. A printed outline shows
        # where: it is glue_mm long and as wide as the strip.
        for name, glue_start_x in (("front half", half_length - glue_mm), ("rear half", 0.0)):
            glue_end_x = glue_start_x + glue_mm
            corners = ((glue_start_x, 0.0), (glue_end_x, 0.0), (glue_end_x, width), (glue_start_x, width))
            shape.mark(name, "floor", corners)
        limits = (-math.radians(self["fold_down"]), math.radians(self["fold_up"]))
        shape.connect("front half.rear", "rear half.front", "hinge", 0, limits_rad=limits)
        stop_fits = self._stop_mm() >= MIN_STOP_MM
        if stop_fits:
            self._add_stop(shape, width * STOP_SHARE)

    def _check_angles(self) -> None:
        """Raise ComponentError if the lids meet before the upper limit, or if the strip bends too sharply at a limit."""
        # The segments turn about the middle of the strip.
        max_fold_up_deg = math.degrees(2 * math.atan2(self["length"] / 2, wall_distance_mm(self["height"], self.parts)))
        if self["fold_up"] > max_fold_up_deg + ROUNDING:
            where = f"where the lids meet at H.length {self['length']:g} and height {self['height']:g}"
            exceeds = f"{self['fold_up']:g} is above the maximum {maximum_text(max_fold_up_deg)}"
            raise self.parameter_error("fold_up", f"{exceeds} ({where})")
        # At either limit the strip is an arc.
        film = film_of(self.parts.film, self["thickness"])
        bend_rad = math.radians(max(self["fold_down"], self["fold_up"]))
        min_length = film.least_bend_radius_mm.value * bend_rad
        if self["length"] < min_length - ROUNDING:
            reason = f"{film.title} bent by {math.degrees(bend_rad):g}° on {film.least_bend_radius_mm.value:g} mm"
            falls_short = f"{self['length']:g} is below the minimum {minimum_text(min_length)}"
            raise self.parameter_error("length", f"{falls_short} ({reason})")

    def _add_stop(self, shape: Shape, length_mm: float) -> None:
        """Add the stop, a tube that is folded from one piece and glued to a cap. It stops the other cap.

        The tube is ``length_mm`` long. Around it follow a flap that is glued to the cap, a side, the face that meets the
        other cap, the other side, and a second flap.
        """
        web_mm, depth_mm = self._web_mm(), self._stop_mm()
        flap_mm = web_mm * GLUE_SHARE
        widths_mm = {"glue 1": flap_mm, "side 1": depth_mm, "stop": web_mm, "side 2": depth_mm, "glue 2": flap_mm}
        for name, width_mm in widths_mm.items():
            shape.rectangle(name, length_mm, width_mm, piece="hinge stop")
        for name, next_name in pairwise(widths_mm):
            shape.connect(f"{name}.far", f"{next_name}.near", "fold", 90)

    def join(self, shape: Shape, hinge: str, front_module: str, rear_module: str, front_cap: str) -> None:
        """Glue the strip under the floors of the modules in front of it and behind it, and the stop onto a cap.

        ``hinge`` is the path of this component. ``front_cap`` is the cap at the rear end of the segment in front of the
        hinge. The pose of everything behind the strip follows from it.
        """
        glue_mm = self.parts.assembly.hinge_glue_mm.value
        # A floor's frame has its origin at the rear right corner, and z points up. The strip lies under the floor.
        strip_z = -(self.parts.film_mm + self["thickness"]) / 2
        front_pose = translation(-self["length"] / 2, 0, strip_z)
        shape.place(f"{hinge}.front half", f"{front_module}.beam.floor", front_pose, laminated=True)
        rear_floor_mm, _ = shape.face_size_mm(f"{rear_module}.beam.floor")
        rear_pose = translation(rear_floor_mm - glue_mm, 0, strip_z)
        shape.place(f"{hinge}.rear half", f"{rear_module}.beam.floor", rear_pose, laminated=True)
        if self._stop_mm() >= MIN_STOP_MM:
            cap_width_mm, _ = shape.face_size_mm(f"{front_cap}.cap")
            shape.place(f"{hinge}.glue 1", f"{front_cap}.cap", self._stop_pose(cap_width_mm), laminated=True)

    def _stop_pose(self, cap_width_mm: float) -> Pose:
        """Return the pose of the stop on the outer side of the front segment's rear cap, in the frame of the cap.

        In the cap's frame x points left, y up, and z into the segment. The face of the stop that is glued to the cap is
        its upper flap. It is turned over, so its own x points right, and its origin is its lower left corner. The stop
        is in the middle of the car.
        """
        half_stop_mm = cap_width_mm * STOP_SHARE / 2
        left_end_x = cap_width_mm / 2 + half_stop_mm
        stop_top_y = wall_distance_mm(self["height"], self.parts) - STOP_FROM_LID_MM - cap_inset_mm(self.parts)
        flap_height_mm = self._web_mm() * GLUE_SHARE
        origin = translation(left_end_x, stop_top_y - flap_height_mm, -self.parts.film_mm)
        return compose(origin, rotation("y", math.pi))

    def _stop_mm(self) -> float:
        """Return the depth of the stop along the car (mm).

        The stop is glued to the cap of the front segment. It is so deep that it meets the cap of the rear segment when
        the hinge is at its upper limit. A depth below MIN_STOP_MM, or a negative one, means that there is no room for a
        stop.
        """
        # Seen from the side, the origin is the middle of the hinge's strip; x points to the front and z up. The front cap
        # stands upright at x = half_strip. At the upper limit, the rear cap leans forward by that angle: it is the line
        # x = -half_strip / cos(angle) + z tan(angle).
        half_strip, angle = self["length"] / 2, math.radians(self["fold_up"])
        stop_top_z = wall_distance_mm(self["height"], self.parts) - STOP_FROM_LID_MM
        # The distance of the caps at the height of the stop's upper edge, where they are closest.
        distance_of_caps = half_strip + half_strip / math.cos(angle) - stop_top_z * math.tan(angle)
        # All these lines are middles of films. The film at each end of the stop lies beside the film of a cap, so their
        # middles are one film apart.
        return distance_of_caps - 2 * self.parts.film_mm

    def _web_mm(self) -> float:
        """Return height of the stop (mm), which ends above the slit for cables."""
        slit = self.parts.assembly.cable_slit_mm.value
        return min(STOP_WEB_MM, wall_distance_mm(self["height"], self.parts) / 2 - slit / 2 - STOP_FROM_LID_MM - 1)
