"""Draws the runs of an experiment in other realities: which reality, design and scene a run has, by its number.

Input: the experiment's seed, numbers of runs. Output: scores of the simulator's parameters, designs and scenes. A number
always draws the same run, whatever runs are drawn with it, so that a sweep can go on where an earlier one has ended.
A search draws a reality for each sample instead, in which it simulates all its designs (random_realities.py).

Of each BLOCK of numbers, the first CHECK share reality and design, and differ in scene, car and start. The learned
success rate is compared with their rate of success.
"""

from collections.abc import Mapping
from dataclasses import dataclass

import numpy as np
from scipy.special import ndtri

from foldcar.belief.priors import MAX_SCORE, NAMES, FloatArray, ScorePrior
from foldcar.store.reality_runs import BLOCK, CHECK, IntArray

# Runs are in the first samples of an environment. More scenes than these would make a sweep with a stopping rule, which
# may need few, sample thousands.
MAX_SCENES = 200
# The columns of a run's random numbers: one for each score, then those that choose the design and the scene.
DESIGN_COLUMN = len(NAMES)
SCENE_COLUMN = DESIGN_COLUMN + 1
COLUMNS = SCENE_COLUMN + 1
# Selects the random numbers of samples among those of a seed.
SAMPLE_STREAM = 1


@dataclass(frozen=True)
class Drawn:
    """Runs: ``number`` (n,), ``scores`` (n, parameters), ``design`` (n,) by index, ``sample`` (n,)."""

    number: IntArray
    scores: FloatArray
    design: IntArray
    sample: IntArray


def draw_runs(seed: int, numbers: range, designs: int, samples: int) -> Drawn:
    """Draw runs in other realities: for each number, a reality, a design and a sample.

    ``numbers`` are the numbers of the runs, which follow each other. There are ``designs`` designs and ``samples``
    samples to choose from. Equal seeds and numbers give equal runs.

    Example: ``draw_runs(1, range(2000), 37, 100).scores.shape`` is (2000, 9).
    """
    # Some runs share the reality of the first run of their block, so begin with the first run of a block.
    first = numbers.start - numbers.start % BLOCK
    generator = np.random.PCG64(seed)
    generator.advance(first * COLUMNS)
    # Each run has a row of random numbers, which are uniform between 0 and 1.
    uniform = _uniform(generator, numbers.stop - first, COLUMNS)
    number = np.arange(first, numbers.stop)
    # The first CHECK runs of a block share the reality and the design of its first run. Other runs have their own.
    number_in_block = number % BLOCK
    first_of_block = number - number_in_block
    drawn_as = np.where(number_in_block < CHECK, first_of_block, number)
    uniform_of_reality = uniform[drawn_as - first]
    scores = _limited(ndtri(uniform_of_reality[:, :DESIGN_COLUMN]))
    design = (uniform_of_reality[:, DESIGN_COLUMN] * designs).astype(np.intp)
    sample = (uniform[:, SCENE_COLUMN] * min(samples, MAX_SCENES)).astype(np.intp)
    requested = slice(numbers.start - first, None)
    return Drawn(number[requested], scores[requested], design[requested], sample[requested])


def draw_sample_scores(seed: int, sample: int, priors: Mapping[int, ScorePrior]) -> FloatArray:
    """Draw the reality in which a search for the best design simulates a sample, and return its scores (parameters,).

    A *reality* is a set of values of the simulator's uncertain parameters, such as friction. A score is such a value as
    a number of standard deviations from the median. A score has a standard normal prior, unless ``priors`` has another
    one for the parameter's index.

    Example: ``draw_sample_scores(1, 0, built_priors("W_B_W", from_sheets=True))``
    """
    # SAMPLE_STREAM makes the random numbers other ones than those that a sweep draws with the same seed. Each sample
    # has its own part of the sequence.
    generator = np.random.PCG64([seed, SAMPLE_STREAM])
    generator.advance(sample * len(NAMES))
    scores = ndtri(_uniform(generator, 1, len(NAMES))[0])
    for index, prior in priors.items():
        scores[index] = prior.mean + prior.sd * scores[index]
    return _limited(scores)


def _uniform(generator: np.random.PCG64, rows: int, columns: int) -> FloatArray:
    """Return the generator's next numbers (rows, columns), above 0 and below 1."""
    # The raw numbers of this generator are the same in every version of numpy.
    raw = generator.random_raw(rows * columns).reshape(rows, columns)
    # The upper 53 of 64 bits, which are the digits of a double. Half a unit is added, so that 0 does not occur.
    upper_bits = (raw >> np.uint64(11)).astype(float)
    uniform: FloatArray = (upper_bits + 0.5) * 2.0**-53
    return uniform


def _limited(scores: FloatArray) -> FloatArray:
    """Return scores within the limits of the realities that are simulated."""
    # Rounded, so that a different last digit of ndtri in another version of scipy changes nothing.
    limited: FloatArray = np.clip(scores, -MAX_SCORE, MAX_SCORE).round(4)
    return limited
