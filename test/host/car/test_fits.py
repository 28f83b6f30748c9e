"""The worst case of every fit: tolerances are absorbed, and fits that are too tight are found, by the drawing itself."""

import itertools
import math
from collections.abc import Callable
from dataclasses import replace

import pytest
import shapely
from shapely.affinity import translate

from foldcar.car.components.shape import rectangle_around
from foldcar.car.design import DesignError, compose
from foldcar.car.fits import check_fits, fits_of
from foldcar.car.folded.model import FoldedCar, Hole
from foldcar.car.folded.pose import compose as chain
from foldcar.car.folded.pose import translation
from foldcar.car.folded_car import folded_car
from foldcar.car.parts.catalogue import OPTIONS
from foldcar.fabrication.assembly.parts_list import parts_list_text
from spoiled_car import with_holes

# Edges of cuts are off by so much.
CUT_MM = 0.1


def study_car() -> FoldedCar:
    return folded_car(compose("W_B_W", {}))


def holes(car: FoldedCar, *ends: str) -> list[Hole]:
    return [hole for piece in car.pieces for face in piece.faces for hole in face.holes if hole.name.endswith(ends)]


def least(hole: Hole) -> shapely.Polygon:
    """The smallest that a hole is cut."""
    if hole.diameter_mm and hole.center_mm:
        return shapely.Point(hole.center_mm).buffer(hole.diameter_mm / 2 - CUT_MM, quad_segs=512)
    return shapely.Polygon(hole.outline_mm).buffer(-CUT_MM, join_style="mitre")


def resized(car: FoldedCar, chosen: Callable[[str], bool], size: tuple[float, float]) -> FoldedCar:
    """The car with some holes as rectangles of another size about their middles."""

    def changed(hole: Hole) -> Hole:
        if not chosen(hole.name):
            return hole
        x, y = shapely.Polygon(hole.outline_mm).centroid.coords[0]
        return replace(hole, outline_mm=rectangle_around((x, y), *size), diameter_mm=None)

    return with_holes(car, changed)


@pytest.mark.parametrize(
    "parts", [*(f"film={f}+battery={b}" for f in OPTIONS["film"] for b in OPTIONS["battery"]),
              *(f"horn={horn}" for horn in OPTIONS["horn"])],
)  # fmt: skip
def test_all_parts_fit_in_the_worst_case(parts: str) -> None:
    car = folded_car(compose(f"W_B_W+{parts}", {"width": 95, "B.length": 120}))

    assert [str(fit) for fit in check_fits(car)] == []
    assert all(fit.parts_mm >= 0 and fit.cutter_mm >= 0 for fit in fits_of(car))


def test_the_largest_servo_and_its_screws_pass_the_smallest_openings() -> None:
    car = study_car()
    # 23.2 x 12.5 mm in the data sheet; ears whose holes are 27 to 28 mm apart and, slotted outwards, 2 mm wide.
    body, screw = shapely.box(-11.6, -6.25, 11.6, 6.25), 1.99 / 2
    openings = holes(car, "wall opening")

    assert len(openings) == 4
    for opening in openings:
        x, y = shapely.Polygon(opening.outline_mm).centroid.coords[0]
        free = least(opening).buffer(1e-2)
        assert free.covers(translate(body, x, y))
        for side, spacing in itertools.product((-1, 1), (27.0, 28.0)):
            # In the narrowest ear a screw has no play inwards, and all that the ear is open outwards.
            reach = [0.0] if spacing > 27.5 else [0.0, 0.5]
            ends = [translate(shapely.Point(0, 0).buffer(screw), x + side * (spacing / 2 + more), y) for more in reach]
            assert any(free.covers(end) for end in ends), (opening.name, spacing)
        # Film on both sides holds the screw against the servo's torque.
        for side, off in itertools.product((-1, 1), (-0.4, 0.4)):
            assert not free.covers(translate(shapely.Point(0, 0).buffer(screw), x + side * 13.75, y + off))


def test_wheel_screws_find_the_horns_holes_wherever_they_are() -> None:
    car = study_car()
    slots = [hole for hole in holes(car, "horn screw 1", "horn screw 2") if "inner" in hole.name]

    assert len(slots) == 2
    for slot, off in itertools.product(slots, (-0.5, 0.0, 0.5)):
        x, y = slot.center_mm or (math.nan, math.nan)
        share = 1 + off / math.hypot(x, y)
        assert least(slot).buffer(1e-2).covers(shapely.Point(x * share, y * share).buffer(1.75 / 2))
    assert {tuple(round(abs(c), 6) for c in slot.center_mm or ()) for slot in slots} == {(9.8, 0.0)}


def test_the_largest_usb_plug_passes_however_high_its_socket_is() -> None:
    (hole,) = holes(study_car(), "USB")
    x, y = hole.center_mm or (math.nan, math.nan)
    # At most 10.6 x 8.5 mm; the socket is off by 0.3 mm, the spacers by 0.1 mm, the bridge's legs by a cut.
    plug = shapely.box(-5.3, -4.25, 5.3, 4.25)

    for angle in range(0, 360, 15):
        off = 0.3 + 0.1 + CUT_MM
        moved = translate(plug, x + off * math.cos(math.radians(angle)), y + off * math.sin(math.radians(angle)))
        assert least(hole).covers(moved), angle


@pytest.mark.parametrize(
    ("chosen", "size", "name", "lacks"),
    [
        # Holes of 1.9 mm: 0.2 of room, horns take 2 x 0.5, screws 0.05, the cutter 2 x 0.1.
        (lambda name: "horn screw" in name, (1.9, 1.9), "wheel's screws along their slots", 1.05),
        # A hole of 13.3 mm: plugs are up to 13.59 across, sockets off by 0.4, twice in a diameter, cuts 0.4.
        (lambda name: name.endswith("USB"), (13.3, 13.3), "USB plug in its hole", 1.49),
    ],
)
def test_openings_without_room_for_tolerances_are_found(
    chosen: Callable[[str], bool], size: tuple[float, float], name: str, lacks: float
) -> None:
    findings = [str(fit) for fit in check_fits(resized(study_car(), chosen, size))]

    assert any(finding.startswith(f"fit: {name}: lacks {lacks:.2f} mm in the worst case") for finding in findings), (
        findings
    )


def test_barbs_in_too_few_layers_and_a_lipo_close_to_the_flange_are_found() -> None:
    car = study_car()
    pieces = tuple(replace(p, count=1) if p.name == "switch doubler" else p for p in car.pieces)
    thin = [str(fit) for fit in check_fits(replace(car, pieces=pieces))]
    # Two films of 0.23 mm, and 0.05 mm of tape between them, behind a switch for panels of 1 mm.
    assert [
        finding for finding in thin if finding.startswith("fit: switch's barbs behind layers of film: lacks 0.49 mm")
    ], thin

    # The flange is the bridge's edge at the battery.
    lipo, battery = (next(m for m in car.mounts if m.part == part.name) for part in (car.parts.lipo, car.parts.battery))
    near = chain(translation(math.copysign(1.5, battery.pose[0][3] - lipo.pose[0][3]), 0, 0), lipo.pose)
    mounts = tuple(replace(m, pose=near) if m is lipo else m for m in car.mounts)
    (finding,) = map(str, check_fits(replace(car, mounts=mounts)))
    assert finding.startswith("fit: LiPo beside the bridge's flange: lacks 1.30 mm"), finding


def test_the_room_over_the_servo_leads_ends_at_the_lid_not_at_the_latch_levers() -> None:
    car = study_car()
    (bend,) = [fit for fit in fits_of(car) if fit.name == "servo leads' bend under the lid"]

    # The lid's underside lies 49.625 mm over the floor's middle surface, the tops of the plugs at 43.365 mm.
    assert bend.nominal_mm == pytest.approx(6.26, abs=0.005)


def test_the_parts_list_has_every_fit() -> None:
    text = parts_list_text(study_car(), "a car")

    assert all(f"| {fit.name} |" in text for fit in fits_of(study_car()))
    assert "| USB plug in its hole | 2.33 | 1.93 | 0.40 | 0.00 |" in text


def test_a_body_as_narrow_as_its_battery_allows_takes_the_largest_one() -> None:
    values = {"width": 55.0, "B.length": 200.0}
    with pytest.raises(DesignError, match=r"width: 55 is below the minimum ([0-9.]+) \(flat 4xAA holder\)") as refused:
        folded_car(compose("W_B_W+battery=4xaa_flat", values))

    least_mm = float(str(refused.value).partition("minimum ")[2].split()[0])
    assert list(check_fits(folded_car(compose("W_B_W+battery=4xaa_flat", {**values, "width": least_mm})))) == []
