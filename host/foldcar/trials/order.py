"""The order in which a design meets samples, so that few obstacles move between trials, and what moves.

Input: how often each sample was met, samples' lettered obstacles, where things stand. Output: the next sample, texts.
Samples come in blocks of BLOCK, and a block is driven whole before the next: an order that follows places cannot put off
those samples that are laborious to set up, and what has been driven differs from the first samples by less than a block.
"""

import itertools
import math
from collections.abc import Callable, Mapping
from dataclasses import replace
from typing import Any

from foldcar.scenes.obstacles import Obstacle
from foldcar.statistics.words import listed
from foldcar.trials.placement import Deviations, what_it_is

# All orders of a block are compared: 720.
BLOCK = 6
# What a tape does not show.
MIN_M, MIN_RAD = 0.001, math.radians(0.5)

# What stands where, by letter: its footprint and, because two samples' obstacles may differ in size, what it is.
Standing = Mapping[str, tuple[Obstacle, str]]


def standing(scene: Mapping[str, Any], things: Mapping[str, Obstacle], deviations: Deviations) -> Standing:
    """The obstacles of a scene where they were measured to stand."""
    result = {}
    for letter, thing in things.items():
        x_m, y_m, turned_rad = deviations.get(letter, (0.0, 0.0, 0.0))
        moved = replace(thing, x_m=thing.x_m + x_m, y_m=thing.y_m + y_m, heading_rad=thing.heading_rad + turned_rad)
        result[letter] = moved, what_it_is(scene, thing)
    return result


def next_sample(
    samples: int, counts: Mapping[int, int], now: Standing | None, of_sample: Callable[[int], Standing]
) -> int:
    """The sample (0 to ``samples`` - 1) to drive next, ``now`` being what stands on the floor, None if nothing is known.

    Of the first block that has samples with the fewest trials (``counts``, by sample) it is the first in the order of
    these that moves the fewest obstacles in all, and these the least far.
    """
    fewest = min(counts.get(sample, 0) for sample in range(samples))
    least = [sample for sample in range(samples) if counts.get(sample, 0) == fewest]
    block = [sample for sample in least if sample // BLOCK == least[0] // BLOCK]
    places: dict[int | None, Standing | None] = {None: now, **{sample: of_sample(sample) for sample in block}}
    costs = {pair: _cost(places[pair[0]], places[pair[1]]) for pair in itertools.permutations(places, 2)}

    def cost(order: tuple[int, ...]) -> tuple[float, ...]:
        steps = [costs[pair] for pair in itertools.pairwise((None, *order))]
        # Sums of the same distances in another order are equal.
        return sum(moved for moved, _ in steps), round(sum(far for _, far in steps), 9)

    return min(itertools.permutations(block), key=cost)[0]


def _cost(now: Standing | None, then: Standing | None) -> tuple[int, float]:
    """How many obstacles move, and how far (m) altogether."""
    if now is None or then is None:
        return 0, 0.0
    moved = [letter for letter in {**now, **then} if _move(now.get(letter), then.get(letter))]
    both = [(now[letter][0], then[letter][0]) for letter in moved if letter in now and letter in then]
    return len(moved), sum(math.hypot(b.x_m - a.x_m, b.y_m - a.y_m) for a, b in both)


def moves_text(now: Standing, then: Standing) -> str:
    """What has to be done to the obstacles, as in "A and D stay; move B 120 mm back along x; take E away"."""
    moves = {letter: _move(now.get(letter), then.get(letter)) for letter in {**now, **then}}
    stay = [letter for letter, move in moves.items() if not move]
    alike: dict[str, list[str]] = {}
    for letter, move in moves.items():
        if move:
            alike.setdefault(move, []).append(letter)
    texts = [move.format(listed(letters)) for move, letters in alike.items()]
    still = [f"{listed(stay)} {'stay' if len(stay) > 1 else 'stays'}"] if stay else []
    return "; ".join([*still, *texts]) or "nothing to move"


def _move(now: tuple[Obstacle, str] | None, then: tuple[Obstacle, str] | None) -> str:
    """What is done to one obstacle, with {} for its letter; empty if nothing."""
    if now is None:
        return "put {} down"
    if then is None:
        return "take {} away"
    (a, was), (b, is_to_be) = now, then
    if was != is_to_be:
        return "exchange {} for another size"
    x_m, y_m = b.x_m - a.x_m, b.y_m - a.y_m
    turned_rad = math.remainder(b.heading_rad - a.heading_rad, math.tau)
    ways = [
        f"{1000 * abs(by_m):.0f} mm {words[by_m < 0]}"
        for by_m, words in ((x_m, ("on along x", "back along x")), (y_m, ("to the left", "to the right")))
        if abs(by_m) >= MIN_M
    ]
    texts = [f"move {{}} {' and '.join(ways)}"] if ways else []
    if abs(turned_rad) >= MIN_RAD:
        which = "counter-clockwise" if turned_rad > 0 else "clockwise"
        texts.append(f"turn {'it' if ways else '{}'} by {math.degrees(abs(turned_rad)):.1f}° {which}")
    return ", ".join(texts)
