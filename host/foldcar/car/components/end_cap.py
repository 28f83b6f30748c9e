"""The end of a beam: a rectangle with tabs taped inside floor and walls, and a flange that the lid lies on."""

from foldcar.car.compiler.component import Component
from foldcar.car.compiler.parameter import Parameter
from foldcar.car.compiler.shape import Shape
from foldcar.car.components.box_beam import wall_mm
from foldcar.car.components.dimensions import HEIGHT, WIDTH
from foldcar.car.parts.catalogue import Catalogue

# Edge of a front cap, seen from inside, at each wall; on a rear cap left and right are exchanged.
CAP_EDGES = {"floor": "near", "right": "front", "lid": "far", "left": "rear"}
OPPOSITE = {"left": "right", "right": "left", "floor": "floor", "lid": "lid"}


def cap_inset_mm(parts: Catalogue) -> float:
    """Distance of a cap's edges from the middle surfaces of the walls (mm): one film, so that its tabs fit inside."""
    return parts.film.thickness_mm.value + parts.assembly.cap_clearance_mm.value


class EndCap(Component):
    """Faces ``cap``, with edges near (floor), front, far (lid) and rear, and ``flange``, under the lid."""

    parameters = (WIDTH, HEIGHT, Parameter("slit", 0, 0, 100, "length of a way for cables", "none", internal=True))

    def build(self, shape: Shape) -> None:
        """The cap, seen from inside: x points right on a front cap and left on a rear cap."""
        assembly, inset = self.parts.assembly, 2 * cap_inset_mm(self.parts)
        width, height = (wall_mm(self[name], self.parts) - inset for name in ("width", "height"))
        # "front cap 1" is the one of segment 1.
        shape.rectangle("cap", width, height, piece=shape.name.rpartition(" ")[0] or "end cap")
        depth = assembly.cap_tab_mm.value
        shape.face("flange", ((0.0, 0.0), (width, 0.0), (width - depth, depth), (depth, depth)))
        shape.connect("cap.far", "flange.0", "fold", 90)
        if self["slit"] > 0:
            slit = assembly.cable_slit_mm.value
            shape.rectangular_hole("cap", "slit", "slit", (width / 2, height / 2), self["slit"], slit)

    @staticmethod
    def close(shape: Shape, cap: str, end: str, module: str) -> None:
        """Tape the cap of the subcomponent ``cap`` into the ``end`` (front or rear) of the beam of ``module``."""
        parts = shape.parts
        depth, inset = parts.assembly.cap_tab_mm.value, cap_inset_mm(parts)
        for panel, edge in CAP_EDGES.items():
            wall = f"{module}.beam.{panel if end == 'front' else OPPOSITE[panel]}.{end}"
            if panel == "lid":
                shape.tuck(f"{cap}.cap.{edge}", wall)
            else:
                shape.connect(wall, f"{cap}.cap.{edge}", "tab", 90, depth_mm=depth, inset_mm=inset)
