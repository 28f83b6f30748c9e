"""Which sample comes next, so that few obstacles move between trials, and what a person is told to move."""

import itertools
import math
from dataclasses import replace

import numpy

from foldcar.scenes.obstacles import Obstacle
from foldcar.trials.order import BLOCK, Arrangement, PlacedObstacle, moves_text, next_sample

BOX = Obstacle("Box", (0,), 0.4, 0.1, 0.0, 0.2, 0.1)


def arranged(**places: tuple[float, float]) -> Arrangement:
    return {letter: PlacedObstacle(replace(BOX, x_m=x_m, y_m=y_m), "box") for letter, (x_m, y_m) in places.items()}


def test_fewest_trials_come_before_short_ways_and_a_block_is_driven_whole() -> None:
    places = [arranged(A=(k, 0)) for k in range(3 * BLOCK)]

    assert next_sample(3, {0: 2, 1: 1, 2: 2, 7: 0}, places[0], places.__getitem__) == 1
    assert next_sample(3, {0: 1, 1: 1}, places[0], places.__getitem__) == 2
    # The next block's first sample is where A stands, but two of this block are left.
    met = dict.fromkeys([*range(4)], 1)
    assert next_sample(3 * BLOCK, met, places[BLOCK], places.__getitem__) == BLOCK - 1


def test_the_order_moves_the_fewest_obstacles_of_all_orders() -> None:
    rng = numpy.random.default_rng(3)
    for _ in range(8):
        # Few places, so that some obstacles stay.
        drawn = rng.integers([3, 2], size=(5, 3, 2)).astype(float)
        places = [
            arranged(**{name: (x, y) for name, (x, y) in zip("ABC", variation, strict=True)})
            for variation in drawn.tolist()
        ]
        now, met = places[0], {0: 1}
        driven: list[int] = []
        for _ in range(4):
            driven.append(next_sample(5, met, now, places.__getitem__))
            met[driven[-1]], now = 1, places[driven[-1]]

        def total(order: tuple[int, ...]) -> tuple[int, float]:
            steps = list(itertools.pairwise(places[k] for k in (0, *order)))  # noqa: B023
            ways = [
                math.dist((a[name][0].x_m, a[name][0].y_m), (b[name][0].x_m, b[name][0].y_m))
                for a, b in steps for name in "ABC"
            ]  # fmt: skip
            return sum(way > 0 for way in ways), round(sum(ways), 9)

        assert total(tuple(driven)) == min(map(total, itertools.permutations(range(1, 5))))


def test_what_moves_is_said_letter_by_letter() -> None:
    now = arranged(A=(0.4, 0.1), B=(0.5, 0.0), D=(1.0, 0.0))
    ramp = PlacedObstacle(replace(BOX, x_m=1.0, y_m=0.0), "ramp")
    then = {**arranged(A=(0.4, 0.1), B=(0.62, -0.03), E=(0.2, 0.0)), "D": ramp}
    turned = {"F": PlacedObstacle(replace(BOX, heading_rad=math.radians(170)), "box")}
    on = {"F": PlacedObstacle(replace(BOX, heading_rad=math.radians(-175)), "box")}

    assert moves_text(now, then) == (
        "A stays; move B 120 mm on along x and 30 mm to the right; exchange D for another size; put E down"
    )
    assert "take E away" in moves_text(then, now)
    assert moves_text(turned, on) == "turn F by 15.0° counter-clockwise"
    assert moves_text({}, {}) == "nothing to move"
    # What a tape does not show stays.
    for by_mm, text in ((0.4, "A stays"), (2.0, "move A 2 mm on along x")):
        assert moves_text(arranged(A=(0.4, 0.1)), arranged(A=(0.4 + by_mm / 1000, 0.1))) == text
