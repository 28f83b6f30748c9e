"""The trials from which the belief learns, as arrays: grouped by car and scene."""

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any

import numpy
from numpy.typing import NDArray

from foldcar.belief.priors import FloatArray


@dataclass(frozen=True)
class Trials:
    """Completed trials. The trials of one car in one scene form a group.

    These have an entry for each group: ``car`` (groups,) is the index of its car. ``passed`` and ``counted`` (groups,)
    are its numbers of passed trials and of all trials. ``scene_ease`` (groups,) is how much easier its scene is than an
    average scene, in log-odds.

    These have an entry for each car: ``design`` (cars,) is the index of its design among those of the belief. ``names``
    is its name, None for a car without a name.
    """

    design: NDArray[Any]
    names: tuple[str | None, ...]
    car: NDArray[Any]
    passed: FloatArray
    counted: FloatArray
    scene_ease: FloatArray

    @classmethod
    def of_counts(cls, counts: Sequence[tuple[int, int, int]]) -> "Trials":
        """Return the trials of one car without a name for each tuple (design, passed, counted).

        ``design`` is the index of the car's design, ``counted`` the number of its trials, and ``passed`` of how many it
        passed. Their scenes are as difficult as the average scene, so that ``scene_ease`` is 0.
        """
        cars = len(counts)
        return cls(
            design=numpy.array([design for design, _, _ in counts], int),
            names=(None,) * cars,
            car=numpy.arange(cars),
            passed=numpy.array([passed for _, passed, _ in counts], float),
            counted=numpy.array([counted for _, _, counted in counts], float),
            scene_ease=numpy.zeros(cars),
        )

    @property
    def driven(self) -> NDArray[Any]:
        """The indices of the driven designs, ascending."""
        return numpy.unique(self.design)

    def without(self, design: int) -> "Trials":
        """Return the trials of all other designs. The remaining cars get new indices.

        The trials of a car in one scene are a group. The groups of the removed cars are removed, too.
        """
        keeps_car = self.design != design
        keeps_group = keeps_car[self.car]
        # A car's new index is the number of kept cars before it.
        new_index_of_car = numpy.cumsum(keeps_car) - 1
        return Trials(
            design=self.design[keeps_car],
            names=tuple(self.names[car] for car in numpy.flatnonzero(keeps_car)),
            car=new_index_of_car[self.car[keeps_group]],
            passed=self.passed[keeps_group],
            counted=self.counted[keeps_group],
            scene_ease=self.scene_ease[keeps_group],
        )

    def counts_of(self, design: int) -> tuple[int, int]:
        """Return how many trials of a design passed, and how many there are."""
        if not len(self.car):
            return 0, 0
        is_of_design = self.design[self.car] == design
        return int(self.passed[is_of_design].sum()), int(self.counted[is_of_design].sum())
