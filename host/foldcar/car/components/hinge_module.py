"""The hinge H: a strip of film under the floors of two segments, which pitch against each other about its middle.

The strip is glued from below to the floors before and behind the gap. The front segment may pitch nose down (over a
crest) by ``fold_down``, and nose up by ``fold_up``. The meeting lids, or a stop between them, limit the latter.
"""

import math
from itertools import pairwise

from foldcar.car.components.box_beam import HEIGHT, WIDTH, cap_inset_mm, wall_mm
from foldcar.car.components.component import ROUNDING, Component, Parameter, maximum_text, minimum_text
from foldcar.car.components.shape import Shape
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


# The stop is a square tube of film below the lids. STOP_SHARE is a fraction of the body's width, GLUE_SHARE of the web.
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
        """Add the faces ``front half`` and ``rear half`` (y to the left), the flexure at their common edge, and the stop.

        Raises ComponentError if ``fold_up`` is larger than the angle at which the lids meet, or if the strip would
        have to bend too sharply.
        """
        # The segments turn about the middle of the strip.
        max_fold_up_deg = math.degrees(2 * math.atan2(self["length"] / 2, wall_mm(self["height"], self.parts)))
        if self["fold_up"] > max_fold_up_deg + ROUNDING:
            where = f"where the lids meet at H.length {self['length']:g} and height {self['height']:g}"
            exceeds = f"{self['fold_up']:g} is above the maximum {maximum_text(max_fold_up_deg)}"
            raise self.parameter_error("fold_up", f"{exceeds} ({where})")
        # At either limit the strip is an arc.
        film = film_of(self.parts.film, self["thickness"])
        bend_rad = math.radians(max(self["fold_down"], self["fold_up"]))
        minimum = film.least_bend_radius_mm.value * bend_rad
        if self["length"] < minimum - ROUNDING:
            reason = f"{film.title} bent by {math.degrees(bend_rad):g}° on {film.least_bend_radius_mm.value:g} mm"
            falls_short = f"{self['length']:g} is below the minimum {minimum_text(minimum)}"
            raise self.parameter_error("length", f"{falls_short} ({reason})")
        glue_mm, width = self.parts.assembly.hinge_glue_mm.value, wall_mm(self["width"], self.parts)
        half_length = self["length"] / 2 + glue_mm
        for name in ("front half", "rear half"):
            shape.rectangle(name, half_length, width, piece="hinge strip", thickness_mm=self["thickness"])
        # The floors' ends lie along the marks' inner edges.
        for name, low in (("front half", half_length - glue_mm), ("rear half", 0.0)):
            shape.mark(name, "floor", ((low, 0.0), (low + glue_mm, 0.0), (low + glue_mm, width), (low, width)))
        limits = (-math.radians(self["fold_down"]), math.radians(self["fold_up"]))
        shape.connect("front half.rear", "rear half.front", "hinge", 0, limits_rad=limits)
        if self._stop_mm() >= MIN_STOP_MM:
            # The stop's tube: two flaps glued to the cap, two sides, and the face that the other cap meets.
            web, reach = self._web_mm(), self._stop_mm()
            flap = web * GLUE_SHARE
            sizes = {"glue 1": flap, "side 1": reach, "stop": web, "side 2": reach, "glue 2": flap}
            for name, size in sizes.items():
                shape.rectangle(name, width * STOP_SHARE, size, piece="hinge stop")
            for name, following in pairwise(sizes):
                shape.connect(f"{name}.far", f"{following}.near", "fold", 90)

    def join(self, shape: Shape, hinge: str, modules: tuple[str, str], caps: tuple[str, str]) -> None:
        """Glue the strip under the floors of the modules before and behind it, and the stop onto the cap before the gap.

        ``hinge`` is the path of this component. ``modules`` and ``caps`` are those in front of and behind the gap.
        The pose of everything behind the strip follows from it.
        """
        film, (front, rear) = self.parts.film_mm, modules
        strip_z_mm, glue_mm = -(film + self["thickness"]) / 2, self.parts.assembly.hinge_glue_mm.value
        front_pose = translation(-self["length"] / 2, 0, strip_z_mm)
        shape.place(f"{hinge}.front half", f"{front}.beam.floor", front_pose, laminated=True)
        length = shape.face_size_mm(f"{rear}.beam.floor")[0]
        shape.place(
            f"{hinge}.rear half", f"{rear}.beam.floor", translation(length - glue_mm, 0, strip_z_mm), laminated=True
        )
        if self._stop_mm() >= MIN_STOP_MM:
            cap_width_mm = shape.face_size_mm(f"{caps[0]}.cap")[0]
            stop_top_mm = wall_mm(self["height"], self.parts) - STOP_FROM_LID_MM - cap_inset_mm(self.parts)
            flap_mm = self._web_mm() * GLUE_SHARE
            # A cap's printed side faces inwards, and the stop stands outside: it is turned over.
            stop_pose = translation(cap_width_mm * (1 + STOP_SHARE) / 2, stop_top_mm - flap_mm, -film)
            shape.place(f"{hinge}.glue 1", f"{caps[0]}.cap", compose(stop_pose, rotation("y", math.pi)), laminated=True)

    def _stop_mm(self) -> float:
        """Return how deep (mm) the stop is.

        It stands on the cap of the front segment and meets the other cap at the upper limit.
        """
        half, up = self["length"] / 2, math.radians(self["fold_up"])
        gap = half + half / math.cos(up) - (wall_mm(self["height"], self.parts) - STOP_FROM_LID_MM) * math.tan(up)
        # Less the film: half a thickness each of cap and stop at the contact, and of cap and flap at the glued end.
        return gap - 2 * self.parts.film_mm

    def _web_mm(self) -> float:
        """Return height of the stop (mm), which ends above the slit for cables."""
        slit = self.parts.assembly.cable_slit_mm.value
        return min(STOP_WEB_MM, wall_mm(self["height"], self.parts) / 2 - slit / 2 - STOP_FROM_LID_MM - 1)
