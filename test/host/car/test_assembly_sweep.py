"""Swept solids against closed forms: a box through a slot, boxes past boxes, film that nothing steps over."""

import numpy as np
import pytest
import shapely

from foldcar.car.folded.pose import translation
from foldcar.car.proof.blocks import SKIN_MM, Blocks, blocks_of, box, find_exit_path, first_obstacle, plate, prism

FILM_MM = 0.25


def slotted(width_mm: float, height_mm: float) -> Blocks:
    """A wall of film in the plane z = 0 with a rectangular slot in its middle."""
    wall = shapely.box(-50, -50, 50, 50).difference(
        shapely.box(-width_mm / 2, -height_mm / 2, width_mm / 2, height_mm / 2)
    )
    return plate(wall, FILM_MM, "wall")


@pytest.mark.parametrize(("each_side_mm", "free"), [(0.05, True), (-0.09, True), (-0.11, False)])
def test_a_box_passes_a_slot_up_to_the_tolerated_overlap_of_0_1_mm(each_side_mm: float, free: bool) -> None:
    assert pytest.approx(0.1) == 2 * SKIN_MM
    moving = blocks_of([box((20.0, 8.0, 15.0))], "box").moved(translation(0, 0, -20))

    for size in ((20 + 2 * each_side_mm, 30.0), (30.0, 8 + 2 * each_side_mm)):
        assert (first_obstacle(moving, slotted(*size), (0, 0, 40)) is None) is free


def test_film_of_any_thickness_is_not_stepped_over() -> None:
    rng = np.random.default_rng(3)
    for thickness in (0.127, 0.25):
        for _ in range(20):
            x, y, z = rng.uniform((-40, -40, 1), (40, 40, 400))
            small = blocks_of([box((0.5, 0.5, 0.5))], "grain").moved(translation(x, y, -z))
            wall = plate(shapely.box(-50, -50, 50, 50), thickness, "wall")

            assert first_obstacle(small, wall, (0, 0, 1000.0)) == "wall"
            assert first_obstacle(small, wall, (0, 0, -1000.0)) is None


def passes(low: np.ndarray, high: np.ndarray, move: np.ndarray) -> bool:
    """Whether a point that starts at 0 and moves by ``move`` stays outside a box (the slab method)."""
    first, last = 0.0, 1.0
    for a, b, d in zip(low, high, move, strict=True):
        t = sorted(((a / d), (b / d)))
        first, last = max(first, t[0]), min(last, t[1])
    return bool(first > last)


def test_boxes_past_boxes_agree_with_the_slab_method() -> None:
    # A box that moves past another one is a point that moves past the sum of both.
    rng = np.random.default_rng(5)
    free_cases = []
    for _ in range(300):
        (a, b), centre, move = rng.uniform(1, 10, (2, 3)), rng.uniform(-10, 10, 3), rng.uniform(-30, 30, 3)
        half = (a + b) / 2 - 2 * SKIN_MM
        block = blocks_of([box(tuple(a))], "one")
        other = blocks_of([box(tuple(b))], "other").moved(translation(*centre))
        free = passes(centre - half, centre + half, move)

        assert (first_obstacle(block, other, move) is None) is free
        free_cases.append(free)

    assert 60 < sum(free_cases) < 240


def test_two_moves_lead_out_of_a_hook_and_none_out_of_a_closed_box() -> None:
    sides = [((20, 1, 20), (0, y, 0)) for y in (-10, 10)] + [((1, 20, 20), (x, 0, 0)) for x in (-10, 10)]
    walls = [((20, 20, 1), (0, 0, -10)), *sides]
    cup = [box(size) + np.array(at) for size, at in walls]
    roof = box((20, 20, 1)) + np.array((0, 0, 10))
    # A roof over the left half: first to the right, then up.
    half_roof = box((10, 20, 1)) + np.array((-5, 0, 10))
    part = blocks_of([box((6, 6, 6)) + np.array((-5, 0, 0))], "part")

    assert find_exit_path(part, blocks_of([*cup, roof], "box")).moves_mm is None
    hook = find_exit_path(part, blocks_of([*cup, half_roof], "box")).moves_mm
    open_cup = find_exit_path(part, blocks_of(cup, "box")).moves_mm

    assert hook is not None and len(hook) == 2 and hook[0][0] > 0 and hook[1][2] > 0
    assert open_cup is not None and len(open_cup) == 1 and open_cup[0][2] > 0


def test_cylinders_and_boxes_have_their_sections_less_the_skin() -> None:
    corners = prism(5.0, -1.0, 1.0)

    assert shapely.MultiPoint(corners[:, :2]).convex_hull.area == pytest.approx(np.pi * 25)
    assert np.allclose(np.abs(box((2.1, 4.1, 6.1))), (1, 2, 3))
