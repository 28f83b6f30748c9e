"""Draws the runs of an experiment in other realities: which reality, design and scene a run has, by its number.

Input: the experiment's seed, numbers of runs. Output: scores of the simulator's parameters, designs and scenes. A number
always draws the same run, whatever runs are drawn with it, so that a sweep can go on where an earlier one has ended.

Of each BLOCK of numbers, the first CHECK share reality and design, and differ in scene, car and start. The learned
success rate is compared with their rate of success.
"""

from dataclasses import dataclass

import numpy as np
from scipy.special import ndtri

from foldcar.belief.priors import MAX_SCORE, NAMES, FloatArray
from foldcar.store.reality_runs import BLOCK, CHECK, IntArray

# Runs are in the first samples of an environment. More scenes than these would make a sweep with a stopping rule, which
# may need few, sample thousands.
MAX_SCENES = 200
# The random numbers of a run: scores, design, scene.
COLUMNS = len(NAMES) + 2


@dataclass(frozen=True)
class Drawn:
    """Runs: ``number`` (n,), ``scores`` (n, parameters), ``design`` (n,) by index, ``sample`` (n,)."""

    number: IntArray
    scores: FloatArray
    design: IntArray
    sample: IntArray


def draw_runs(seed: int, numbers: range, designs: int, samples: int) -> Drawn:
    """Return the runs of consecutive ``numbers``, each with one of ``designs`` designs and of ``samples`` samples.

    Example: ``draw_runs(1, range(2000), 37, 100).scores.shape`` is (2000, 9).
    """
    # Check groups need the first number of their block.
    first = numbers.start - numbers.start % BLOCK
    generator = np.random.PCG64(seed)
    generator.advance(first * COLUMNS)
    # The raw numbers of this generator are the same in every version of numpy. The upper 53 bits give a number above 0
    # and below 1.
    raw = generator.random_raw((numbers.stop - first) * COLUMNS).reshape(-1, COLUMNS)
    uniform = ((raw >> np.uint64(11)).astype(float) + 0.5) * 2.0**-53
    number = np.arange(first, numbers.stop)
    # The row that draws reality and design.
    source = np.where(number % BLOCK < CHECK, number - number % BLOCK, number) - first
    # Rounded, so that a different last digit of ndtri in another version of scipy changes nothing.
    scores = np.clip(ndtri(uniform[source, : len(NAMES)]), -MAX_SCORE, MAX_SCORE).round(4)
    design = (uniform[source, len(NAMES)] * designs).astype(np.intp)
    sample = (uniform[:, len(NAMES) + 1] * min(samples, MAX_SCENES)).astype(np.intp)
    kept = slice(numbers.start - first, None)
    return Drawn(number[kept], scores[kept], design[kept], sample[kept])
