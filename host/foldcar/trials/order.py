"""Orders the samples for a design's trials so that few obstacles move between trials, and says what to move.

Input: the number of trials in each sample, samples' lettered obstacles, where they stand now. Output: the next sample,
text. Samples are driven in blocks of BLOCK. A block is finished before the next one begins, so that samples that are
laborious to set up cannot be put off for long.
"""

import itertools
import math
from collections.abc import Callable, Mapping
from dataclasses import replace
from typing import Any, NamedTuple

from foldcar.scenes.obstacles import Obstacle
from foldcar.statistics.words import listed
from foldcar.trials.placement import Deviations, what_it_is

# All 720 orders of a block are compared.
BLOCK = 6
# Smaller moves cannot be measured with a tape.
MIN_M, MIN_RAD = 0.001, math.radians(0.5)


class PlacedObstacle(NamedTuple):
    """An obstacle at its pose on the floor, and a description of its kind and size."""

    obstacle: Obstacle
    description: str


# The obstacles on the floor by letter. The same letter may mean an obstacle of another size in another sample.
Arrangement = Mapping[str, PlacedObstacle]


def arrangement_of(scene: Mapping[str, Any], obstacles: Mapping[str, Obstacle], deviations: Deviations) -> Arrangement:
    """Return how the obstacles of a scene really stand: at their planned poses, changed by the measured deviations."""
    arrangement = {}
    for letter, planned in obstacles.items():
        x_m, y_m, turned_rad = deviations.get(letter, (0.0, 0.0, 0.0))
        heading_rad = planned.heading_rad + turned_rad
        measured = replace(planned, x_m=planned.x_m + x_m, y_m=planned.y_m + y_m, heading_rad=heading_rad)
        arrangement[letter] = PlacedObstacle(measured, what_it_is(scene, planned))
    return arrangement


def next_sample(
    samples: int,
    counts: Mapping[int, int],
    current: Arrangement | None,
    arrangement_in_sample: Callable[[int], Arrangement],
) -> int:
    """Return the sample (0 to ``samples`` - 1) to drive next.

    ``counts`` is the number of trials in each sample. ``current`` are the obstacles as they stand now, None if unknown.

    The candidates are the samples with the fewest trials. Only the candidates of one block are considered: that of the
    first candidate. All orders of these are compared. The best order moves the fewest obstacles; of equally good orders,
    the best one moves them the shortest distance. The result is the first sample in the best order.
    """
    min_count = min(counts.get(sample, 0) for sample in range(samples))
    candidates = [sample for sample in range(samples) if counts.get(sample, 0) == min_count]
    block = [sample for sample in candidates if sample // BLOCK == candidates[0] // BLOCK]
    arrangements: dict[int | None, Arrangement | None] = {sample: arrangement_in_sample(sample) for sample in block}
    # The key None is the floor as it is now.
    arrangements[None] = current
    cost_of_step = {}
    for before, after in itertools.permutations(arrangements, 2):
        cost_of_step[before, after] = _cost(arrangements[before], arrangements[after])

    def cost(order: tuple[int, ...]) -> tuple[float, ...]:
        """Return how many obstacles an order of samples moves in all, and their total distance (m)."""
        steps = [cost_of_step[pair] for pair in itertools.pairwise((None, *order))]
        total_count = sum(moved_count for moved_count, _ in steps)
        # Rounding makes sums of the same distances in different orders equal.
        total_m = round(sum(distance_m for _, distance_m in steps), 9)
        return total_count, total_m

    first_sample, *_ = min(itertools.permutations(block), key=cost)
    return first_sample


def _cost(before: Arrangement | None, after: Arrangement | None) -> tuple[int, float]:
    """Return how many obstacles a person moves between two arrangements, and their total distance (m).

    Both are 0 if an arrangement is unknown, because then the order does not matter. Obstacles that are put down or taken
    away have no distance.
    """
    if before is None or after is None:
        return 0, 0.0
    moved_count, distance_m = 0, 0.0
    for letter in {**before, **after}:
        old, new = before.get(letter), after.get(letter)
        stays = _move_text(old, new) == ""
        if stays:
            continue
        moved_count += 1
        if old is not None and new is not None:
            distance_m += math.hypot(new.obstacle.x_m - old.obstacle.x_m, new.obstacle.y_m - old.obstacle.y_m)
    return moved_count, distance_m


def moves_text(current: Arrangement, next_arrangement: Arrangement) -> str:
    """Return how to move the obstacles, such as "A and D stay; move B 120 mm back along x; take E away"."""
    staying: list[str] = []
    letters_by_move: dict[str, list[str]] = {}
    for letter in {**current, **next_arrangement}:
        move = _move_text(current.get(letter), next_arrangement.get(letter))
        if move:
            letters_by_move.setdefault(move, []).append(letter)
        else:
            staying.append(letter)
    texts = []
    if staying:
        verb = "stay" if len(staying) > 1 else "stays"
        texts.append(f"{listed(staying)} {verb}")
    for move, letters in letters_by_move.items():
        texts.append(move.format(listed(letters)))
    return "; ".join(texts) or "nothing to move"


def _move_text(old: PlacedObstacle | None, new: PlacedObstacle | None) -> str:
    """Return how to move one obstacle, with {} in place of its letter, or "" if it stays where it is.

    ``old`` is None if the obstacle is put down, and ``new`` is None if it is taken away.
    """
    if old is None:
        return "put {} down"
    if new is None:
        return "take {} away"
    if old.description != new.description:
        return "exchange {} for another size"
    x_m, y_m = new.obstacle.x_m - old.obstacle.x_m, new.obstacle.y_m - old.obstacle.y_m
    turned_rad = math.remainder(new.obstacle.heading_rad - old.obstacle.heading_rad, math.tau)
    shifts = []
    if abs(x_m) >= MIN_M:
        direction = "on along x" if x_m > 0 else "back along x"
        shifts.append(f"{1000 * abs(x_m):.0f} mm {direction}")
    if abs(y_m) >= MIN_M:
        direction = "to the left" if y_m > 0 else "to the right"
        shifts.append(f"{1000 * abs(y_m):.0f} mm {direction}")
    texts = []
    if shifts:
        texts.append("move {} " + " and ".join(shifts))
    if abs(turned_rad) >= MIN_RAD:
        obstacle_text = "it" if shifts else "{}"
        direction = "counter-clockwise" if turned_rad > 0 else "clockwise"
        texts.append(f"turn {obstacle_text} by {math.degrees(abs(turned_rad)):.1f}° {direction}")
    return ", ".join(texts)
