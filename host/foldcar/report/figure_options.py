"""What the reader of a report may choose of its figures: thresholds of success, and the environment drawn by itself."""

from collections.abc import Iterable, Sequence
from dataclasses import dataclass

from foldcar.errors import FoldcarError
from foldcar.store.info import ExperimentInfo

# Of the publication's figure 6.
THRESHOLDS = (0.5, 0.75)


@dataclass(frozen=True)
class FigureOptions:
    """``chosen`` thresholds, 0 to 1; without any, each experiment has its listing's, or THRESHOLDS.

    ``sample`` is the environment whose times to cross are drawn.
    """

    chosen: tuple[float, ...] = ()
    sample: int = 0

    def check(self, infos: Iterable[ExperimentInfo]) -> None:
        """Raise FoldcarError if no experiment has the sample."""
        counts = {info.id: info.environments for info in infos}
        if counts and self.sample >= max(counts.values()):
            named = ", ".join(f"{count} of experiment {name}" for name, count in counts.items())
            raise FoldcarError(f"--sample: {self.sample} is not among the sampled environments, counted from 0: {named}")


def figure_options(thresholds: Sequence[float], sample: int) -> FigureOptions:
    """The options as typed; thresholds in any order."""
    return FigureOptions(tuple(sorted(set(thresholds))), sample)
