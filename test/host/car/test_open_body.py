"""The body as it is built and opened, computed anew from faces and parts: caps fit inside, plugs pass, masses balance."""

import itertools
import math
import re

import numpy as np
import pytest

from foldcar.car.body import body_json
from foldcar.car.design import DesignError, compose
from foldcar.car.folded.model import FoldedCar
from foldcar.car.folded.pose import apply, folded
from foldcar.car.folded.pose import compose as chain
from foldcar.car.folded_car import folded_car
from foldcar.car.parts.catalogue import PartChoices
from foldcar.car.verify import verify

SIX = ("W_B_W_W", {"radius": 40.0, "W.length": 90.0})
HINGED = ("W_B_H_W_H_W", {"radius": 40.0, "W.length": 90.0})


def corners(car: FoldedCar, piece: str, face: str) -> list[tuple[float, float, float]]:
    """The outline of a face of the first copy of a piece, in the car (mm)."""
    shape = next(candidate for candidate in car.pieces if candidate.name == piece)
    placed = next(candidate for candidate in car.placed if candidate.piece == piece)
    pose = chain(placed.pose, folded(shape)[face])
    return [
        apply(pose, *point) for shape_face in shape.faces if shape_face.name == face for point in shape_face.outline_mm
    ]


@pytest.mark.parametrize(("film", "t"), [("0.127", 0.127), ("card_300", 0.38), ("pp_0.8", 0.8)])
def test_caps_fit_inside_the_walls(film: str, t: float) -> None:
    car = folded_car(compose("W_B_W", {}, PartChoices(film=film)))
    tabs = [f"cap tab to {wall}" for wall in ("floor", "left", "right")]

    points = np.array([point for face in ("cap", "flange", *tabs) for point in corners(car, "front cap", face)])

    # Film is as thick on both sides of its middle surface; walls are as far apart, outside, as the design says.
    outer = np.ptp(points, axis=0)[1:] + t
    assert (outer < np.array([95, 50]) - 2 * t).all() and (outer > np.array([95, 50]) - 2 * t - 0.5).all()
    # The lid's flap ends before the cap's tab.
    reach = min(x for x, _, _ in corners(car, "front cap", "cap tab to right"))
    assert max(x for x, _, _ in corners(car, "beam", "flap")) < reach
    slots = [hole for face in car.pieces[0].faces for hole in face.holes if hole.kind == "slot"]
    assert all(np.ptp(np.array(slot.outline_mm), axis=0).min() == pytest.approx(t + 0.3) for slot in slots)


def usb(car: FoldedCar) -> tuple[tuple[float, float, float], float]:
    """The middle of the USB socket's mouth (mm) and the diameter that its plug needs."""
    feather = next(mount for mount in car.mounts if mount.part == car.parts.feather.name)
    way = feather.clearances[0]
    return apply(chain(feather.pose, way.pose), 0, 0), way.diameter_mm


@pytest.mark.parametrize("car", [("W_B_W", {"width": 65}), SIX, HINGED, ("W_B", {"B.length": 120})])
def test_a_usb_plug_passes_the_wall_and_the_tyres(car: tuple[str, dict[str, float]]) -> None:
    built = folded_car(compose(*car))
    (x, y, z), diameter = usb(built)
    holes = [(piece, hole) for piece in built.pieces for face in piece.faces for hole in face.holes]
    beam, hole = next(pair for pair in holes if pair[1].name.endswith("USB"))

    # Half of the width and the film is the wall's inside.
    width = compose(*car).values["width"]
    assert width / 2 - 0.25 - y == pytest.approx(1.5)
    # The overmould is at most 10.6 x 8.5 mm.
    assert diameter == pytest.approx(math.hypot(10.6, 8.5)) and hole.diameter_mm == pytest.approx(diameter + 1.2)
    for axle in built.axles:
        cx, _, cz = axle.center_mm
        assert math.hypot(x - cx, z - cz) >= axle.radius_mm + diameter / 2 - 1e-6
    wall = np.array(corners(built, beam.name, "left"))
    assert wall[:, 0].min() < x < wall[:, 0].max()


def test_where_a_usb_plug_does_not_pass_the_design_is_refused_with_what_would_do() -> None:
    values = {"radius": 66.0, "B.length": 76.0}
    with pytest.raises(DesignError, match=r"^B.length: 76 is below the minimum .* USB plug clear of the tyres") as caught:
        folded_car(compose("W_B_W", values))

    least = float(re.findall(r"minimum ([0-9.]+)", str(caught.value))[0])
    (x, _, z), diameter = usb(folded_car(compose("W_B_W", values | {"B.length": least})))
    gap = min(math.hypot(x - side * (30 + least / 2), z) for side in (-1, 1)) - 66 - diameter / 2
    # The plug keeps the gap that parts keep.
    assert 1 <= gap < 1.1
    # Behind the last axle there is no such limit.
    assert folded_car(compose("W_B", {"radius": 66.0, "B.length": 100.0}))


@pytest.mark.parametrize("film", ["0.127", "pp_0.8"])
def test_the_least_body_is_one_that_can_be_built(film: str) -> None:
    choices = PartChoices(film=film)
    least = {}
    for key in ("width", "height"):
        with pytest.raises(DesignError) as caught:
            compose("W_B_W", {key: 40.0}, choices)
        least[key] = float(re.findall(r"minimum ([0-9.]+)", str(caught.value))[0]) + 0.01

    assert verify(compose("W_B_W", {**least, "B.length": 100, "radius": 30}, choices)).findings == ()


def test_the_battery_balances_the_boards_across_the_car() -> None:
    for width, place in itertools.product((65, 245), ("floor", "roof")):
        design = compose("W_B_W", {"width": width}, PartChoices(battery_place=place))
        segment = body_json(design)["segments"][0]
        # Servos on the right of a wide car have extensions, whose mass is at their joints.
        mounts = (m for m in folded_car(design).mounts if m.name.startswith("extension of "))
        extensions = sum(m.mass_kg * m.pose[1][3] / 1000 for m in mounts) / segment["mass_kg"]
        # The wall around USB's hole and the bridge are lighter or heavier than their opposites.
        assert abs(segment["com_y_m"] - extensions) < 0.001
        assert (segment["com_z_m"] > 0.015) == (place == "roof")
