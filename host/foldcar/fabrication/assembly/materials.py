"""The amounts of what is sold by length: double-sided tape, heat-shrink tube and solder; rows of the parts list.

Input: a FoldedCar, and the CutCar of its sheets, because pieces that were split are joined with tape. Output: amounts,
computed from joins and soldered joints. A tab takes one strip of tape along its edge, a layer as many as cover it.
"""

import math
from collections.abc import Iterator

import shapely

from foldcar.car.components.bridge import option_resistors
from foldcar.car.folded.model import Face, FoldedCar, Join
from foldcar.fabrication.assembly.operations import joints, joints_at_wires, repetitions
from foldcar.fabrication.assembly.row import Row
from foldcar.fabrication.patterns.sheets import CutCar
from foldcar.statistics.words import count

IN_WIRES = "in the wires' mass and cost"


def material_rows(car: FoldedCar, cut: CutCar | None = None) -> Iterator[Row]:
    """Yield the rows of tape, heat-shrink tube, sleeve and solder that the car needs."""
    yield _tape_row(car, cut)
    if joints(car):
        yield from _solder_rows(car)


def _tape_row(car: FoldedCar, cut: CutCar | None) -> Row:
    """Return the row of double-sided tape."""
    tabs_mm, layers_mm = tape_mm(car, cut)
    lipos_mm = sum(max(mount.size_mm[:2]) for mount in car.mounts if mount.part == car.parts.lipo.name)
    note = f"{_metres(tabs_mm)} along tabs, {_metres(layers_mm)} below layers"
    if lipos_mm:
        note += f", {_metres(lipos_mm)} below the LiPo"
    # A tyre that is cut from a strip needs tape, too. The length of the row does not include it, because a band that was
    # bought needs none.
    strips_mm = sum(car.parts.tyre.taped_mm(axle.radius_mm) for axle in car.axles)
    if strips_mm:
        note += f"; {_metres(strips_mm)} more below tyres that are cut from a strip"
    length_m = math.ceil((tabs_mm + layers_mm + lipos_mm) / 100) / 10
    note += "; its mass and cost are not counted"
    return Row("double-sided tape", length_m, unit="m", mass_kg=0.0, cost_usd=None, note=note, search=car.parts.film.tape)


def tape_mm(car: FoldedCar, cut: CutCar | None = None) -> tuple[float, float]:
    """Return the length of tape (mm) that is needed along tabs, and the length that is needed below layers.

    A tab joins two edges, and a layer is a piece that is laminated onto the face of another one. Strips of the
    narrowest tape, side by side, cover the whole area of a layer. If ``cut`` is given, the tabs at which split pieces
    are joined are included.
    """
    width_mm = car.parts.assembly.tape_width_mm.min_value
    faces = {(piece.name, face.name): face for piece in car.pieces for face in piece.faces}
    # Each join, as often as it is made: a join of a wheel once for each wheel.
    joins: list[Join] = []
    for join in car.joins:
        joins += [join] * repetitions(car, join)
    if cut is not None:
        numbers_without_split = {join.number for join in car.joins}
        for join in cut.car.joins:
            if join.number not in numbers_without_split:
                joins += [join] * repetitions(cut.car, join)
    tabs_mm = sum(join.length_mm for join in joins if join.kind in ("tab", "lap"))
    layers = [faces[join.piece_a, join.a.face] for join in joins if join.kind == "laminate"]
    return tabs_mm, sum(_area_mm2(face) for face in layers) / width_mm


def _area_mm2(face: Face) -> float:
    return float(shapely.Polygon(face.outline_mm, [hole.outline_mm for hole in face.holes]).area)


def _solder_rows(car: FoldedCar) -> Iterator[Row]:
    """Yield the rows of heat-shrink tube, of sleeve for resistors, and of solder."""
    wiring = car.parts.wiring
    tube_mm = wiring.joint_mm.value + 2 * wiring.tube_over_mm.value
    tubes = joints_at_wires(car)
    if tubes:
        yield _tube_row(wiring.tube_diameter_mm.value, tubes, tube_mm, "over each joint of a wire")
    # A resistor has two leads.
    sleeves = 2 * len(option_resistors(car.parts))
    if sleeves:
        yield _tube_row(wiring.sleeve_diameter_mm.value, sleeves, wiring.sleeve_mm.value, "over each lead of a resistor")
    thick_mm = wiring.solder_diameter_mm.value
    volume_mm3 = joints(car) * wiring.solder_mm3.max_value
    length_mm = volume_mm3 / (math.pi / 4 * thick_mm**2)
    note = f"{thick_mm:g} mm thick, for {count(joints(car), 'joint')}; {IN_WIRES}"
    search = f"solder wire {thick_mm:g} mm with flux core"
    length_m = math.ceil(length_mm / 100) / 10
    yield Row("solder wire", length_m, unit="m", mass_kg=0.0, cost_usd=0.0, note=note, search=search)


def _tube_row(diameter_mm: float, pieces: int, length_mm: float, place: str) -> Row:
    """Return the row of heat-shrink tube of one diameter."""
    note = f"{count(pieces, 'piece')} of {length_mm:g} mm, one {place}; {IN_WIRES}"
    name = f"heat-shrink tube, {diameter_mm:g} mm"
    return Row(name, pieces * length_mm / 1000, "m", 0.0, 0.0, note, search=f"heat-shrink tube {diameter_mm:g} mm 2:1")


def _metres(length_mm: float) -> str:
    return f"{length_mm / 1000:.2f} m"
