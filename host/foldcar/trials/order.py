"""Orders the samples for a design's trials so that few obstacles move between trials, and says what to move.

Input: the number of trials in each sample, samples' lettered obstacles, where they stand now. Output: the next sample,
text. Samples are driven in blocks of BLOCK. A block is finished before the next one begins, so that samples that are
laborious to set up cannot be put off for long.
"""

import itertools
import math
from collections.abc import Callable, Mapping
from dataclasses import replace
from typing import Any

from foldcar.scenes.obstacles import Obstacle
from foldcar.statistics.words import listed
from foldcar.trials.placement import Deviations, what_it_is

# All 720 orders of a block are compared.
BLOCK = 6
# Smaller moves cannot be measured with a tape.
MIN_M, MIN_RAD = 0.001, math.radians(0.5)

# The obstacles on the floor by letter: an obstacle at its pose, and its description. The same letter may mean an obstacle
# of another size in another sample.
Standing = Mapping[str, tuple[Obstacle, str]]


def standing(scene: Mapping[str, Any], obstacles: Mapping[str, Obstacle], deviations: Deviations) -> Standing:
    """Return the obstacles of a scene at their measured poses, each with what it is, by letter."""
    result = {}
    for letter, planned in obstacles.items():
        x_m, y_m, turned_rad = deviations.get(letter, (0.0, 0.0, 0.0))
        heading_rad = planned.heading_rad + turned_rad
        measured = replace(planned, x_m=planned.x_m + x_m, y_m=planned.y_m + y_m, heading_rad=heading_rad)
        result[letter] = measured, what_it_is(scene, planned)
    return result


def next_sample(
    samples: int, counts: Mapping[int, int], current: Standing | None, standing_in_sample: Callable[[int], Standing]
) -> int:
    """Return the sample (0 to ``samples`` - 1) to drive next.

    ``counts`` is the number of trials in each sample. ``current`` are the obstacles on the floor, None if unknown.

    The candidates are the samples with the fewest trials. Those of the first block that contains a candidate are put into
    the order that moves the fewest obstacles; of equal orders, into the one that moves them the shortest distance. The
    result is the first sample in that order.
    """
    min_count = min(counts.get(sample, 0) for sample in range(samples))
    candidates = [sample for sample in range(samples) if counts.get(sample, 0) == min_count]
    block = [sample for sample in candidates if sample // BLOCK == candidates[0] // BLOCK]
    standing_by_sample: dict[int | None, Standing | None] = {sample: standing_in_sample(sample) for sample in block}
    # None stands for the floor as it is now.
    standing_by_sample[None] = current
    cost_of_step = {}
    for before, after in itertools.permutations(standing_by_sample, 2):
        cost_of_step[before, after] = _cost(standing_by_sample[before], standing_by_sample[after])

    def cost(order: tuple[int, ...]) -> tuple[float, ...]:
        """Return how many obstacles an order of samples moves in all, and their total distance (m)."""
        steps = [cost_of_step[pair] for pair in itertools.pairwise((None, *order))]
        total_count = sum(moved_count for moved_count, _ in steps)
        # Rounding makes sums of the same distances in different orders equal.
        total_m = round(sum(distance_m for _, distance_m in steps), 9)
        return total_count, total_m

    first_sample, *_ = min(itertools.permutations(block), key=cost)
    return first_sample


def _cost(current: Standing | None, next_standing: Standing | None) -> tuple[int, float]:
    """Return how many obstacles move from one arrangement to the next, and their total distance (m).

    Both are 0 if an arrangement is unknown: then the order does not matter.
    """
    if current is None or next_standing is None:
        return 0, 0.0
    pairs = [(current.get(letter), next_standing.get(letter)) for letter in {**current, **next_standing}]
    moves = [(old, new) for old, new in pairs if _move(old, new)]
    # Obstacles that are put down or taken away have no distance. An arrangement has (obstacle, what it is) pairs.
    distances_m = []
    for old, new in moves:
        if old is not None and new is not None:
            (old_obstacle, _), (new_obstacle, _) = old, new
            distances_m.append(math.hypot(new_obstacle.x_m - old_obstacle.x_m, new_obstacle.y_m - old_obstacle.y_m))
    return len(moves), sum(distances_m)


def moves_text(current: Standing, next_standing: Standing) -> str:
    """Return how to move the obstacles, such as "A and D stay; move B 120 mm back along x; take E away"."""
    staying: list[str] = []
    letters_by_move: dict[str, list[str]] = {}
    for letter in {**current, **next_standing}:
        move = _move(current.get(letter), next_standing.get(letter))
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


def _move(current: tuple[Obstacle, str] | None, next_standing: tuple[Obstacle, str] | None) -> str:
    """Return how to move one obstacle, with {} for its letter; "" if it stays."""
    if current is None:
        return "put {} down"
    if next_standing is None:
        return "take {} away"
    (old, old_text), (new, new_text) = current, next_standing
    if old_text != new_text:
        return "exchange {} for another size"
    x_m, y_m = new.x_m - old.x_m, new.y_m - old.y_m
    turned_rad = math.remainder(new.heading_rad - old.heading_rad, math.tau)
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
