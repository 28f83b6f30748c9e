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
from foldcar.trials.placement import NO_DEVIATION, Deviations, what_it_is

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
        deviation = deviations.get(letter, NO_DEVIATION)
        measured = replace(
            planned,
            x_m=planned.x_m + deviation.x_m,
            y_m=planned.y_m + deviation.y_m,
            heading_rad=planned.heading_rad + deviation.turned_rad,
        )
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

    A sample with the fewest trials is driven next. To choose one, the person's work is compared for all orders in which
    such samples of one block can be driven. The least work is that in which the fewest obstacles are moved; if two
    orders are equal in this, they are moved the shorter distance. The result is the first sample of the best order.
    """
    min_count = min(counts.get(sample, 0) for sample in range(samples))
    candidates = [sample for sample in range(samples) if counts.get(sample, 0) == min_count]
    first_block = candidates[0] // BLOCK
    candidates_in_block = [sample for sample in candidates if sample // BLOCK == first_block]
    arrangements = {sample: arrangement_in_sample(sample) for sample in candidates_in_block}
    work_at_start = {sample: _work(current, arrangements[sample]) for sample in candidates_in_block}
    work_between: dict[tuple[int, int], Work] = {}
    for before, after in itertools.permutations(candidates_in_block, 2):
        work_between[before, after] = _work(arrangements[before], arrangements[after])

    def total_work(order: tuple[int, ...]) -> Work:
        """Return the work of a person who drives the samples in this order."""
        works = [work_at_start[order[0]]]
        works += [work_between[pair] for pair in itertools.pairwise(order)]
        return Work(
            moved_count=sum(work.moved_count for work in works),
            # Rounding makes sums of the same distances in different orders equal.
            distance_m=round(sum(work.distance_m for work in works), 9),
        )

    best_order = min(itertools.permutations(candidates_in_block), key=total_work)
    return best_order[0]


class Work(NamedTuple):
    """How many obstacles a person moves, and by which total distance."""

    moved_count: int
    distance_m: float


def _work(before: Arrangement | None, after: Arrangement) -> Work:
    """Return the work of changing one arrangement of obstacles into another one.

    An arrangement has the obstacles by their letters. If ``before`` is None, the arrangement is not known, and the work
    is 0. The distance has no part for obstacles that are put down or taken away.
    """
    if before is None:
        return Work(moved_count=0, distance_m=0.0)
    moved_count, distance_m = 0, 0.0
    for letter in {**before, **after}:
        old, new = before.get(letter), after.get(letter)
        stays_in_place = _move_text(old, new) == ""
        if stays_in_place:
            continue
        moved_count += 1
        if old is not None and new is not None:
            distance_m += math.hypot(new.obstacle.x_m - old.obstacle.x_m, new.obstacle.y_m - old.obstacle.y_m)
    return Work(moved_count, distance_m)


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
