"""The modules a car is composed of and the parameters they have: declared here once, in mm and degrees.

A shared parameter has one value for the whole car; the other ones belong to a module letter and hold for
every module of that letter. Minimums follow from the parts. In listings a parameter is found under its
module (``{"W": {"length": 60}}``) or, if shared, under ``common``; its key here is ``width`` or ``W.length``.
"""

from dataclasses import dataclass
from functools import cache

from foldcar.parts import catalogue

MODULES = {
    "W": "wheel module: one axle, two servos and their wheels",
    "B": "body module: electronics and batteries",
    "H": "hinge: a strip of film that lets the segments before and after it pitch against each other",
}
# What every car has, whatever else.
REQUIRED_MODULES = ("W", "B")


@dataclass(frozen=True, slots=True)
class Parameter:
    """One design parameter; numbers in ``unit``, mm or deg. ``modules`` are the letters that have it."""

    key: str
    modules: str
    default: float
    minimum: float
    maximum: float
    help: str
    minimum_reason: str
    unit: str = "mm"

    @property
    def shared(self) -> bool:
        """Whether the whole car has one value of it."""
        return "." not in self.key

    @property
    def name(self) -> str:
        """The parameter's name inside its module."""
        return self.key.rpartition(".")[2]

    @property
    def column(self) -> str:
        """Its name in results, with its unit."""
        return f"{self.key.replace('.', '_')}_{self.unit}"


@cache
def parameters() -> dict[str, Parameter]:
    """Every parameter by key, in the order of results' columns."""
    parts = catalogue()
    servo, film, assembly = parts.servo, parts.film, parts.assembly
    wall = film.thickness_mm.value
    edge = assembly.opening_clearance_mm.value + assembly.fold_distance_mm.value
    long_side = servo.length_mm.value - servo.axis_from_end_mm.value
    declared = (
        Parameter("width", "WBH", 95, 2 * (servo.depth_mm.value + wall), 500,
                  "outer width of the body", f"two {servo.name}s side by side and their walls"),
        Parameter("height", "WB", 50, servo.width_mm.value + 2 * edge, 200,
                  "outer height of the body", f"the opening of one {servo.name}"),
        Parameter("radius", "W", 60, 13, 150,
                  "wheel radius", "the servo's horn and a rim"),
        Parameter("W.length", "W", 60, 2 * (long_side + edge), 400,
                  "length of a wheel module, its axle in the middle", f"the opening of one {servo.name}"),
        Parameter("W.tire_thickness", "W", 12, 1, 40,
                  "axial width of a tyre", "a rim strip that can be folded"),
        Parameter("B.length", "B", 80, 10, 400,
                  "length of a body module", "a strip that can be folded"),
        Parameter("H.length", "H", 6, 1, 60,
                  "length of a hinge's strip, the gap between two segments", "a strip that bends evenly"),
        Parameter("H.thickness", "H", wall, 0.05, 1,
                  "thickness of a hinge's strip, as wide as the body", "the thinnest film there is"),
        Parameter("H.fold_down", "H", 60, 0, 90,
                  "how far the front segment may pitch nose down against the rear one", "flat", "deg"),
        Parameter("H.fold_up", "H", 0, 0, 90,
                  "how far it may pitch nose up, which lets the car sag", "flat", "deg"),
    )  # fmt: skip
    return {parameter.key: parameter for parameter in declared}


def find_parameter(group: str, name: str) -> Parameter | None:
    """The parameter that ``{group: {name: …}}`` of a listing means; ``group`` is ``common`` or a letter."""
    for parameter in parameters().values():
        if parameter.name != name:
            continue
        if parameter.shared and (group == "common" or group in parameter.modules):
            return parameter
        if parameter.key == f"{group}.{name}":
            return parameter
    return None


def names_in(group: str) -> list[str]:
    """The parameter names that ``group`` (``common`` or a module letter) may set."""
    return sorted({p.name for p in parameters().values() if find_parameter(group, p.name) is not None})
