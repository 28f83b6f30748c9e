"""`--run EXPERIMENT/SAMPLE` of `foldcar view`: a run of the listing, or another design's in its environment."""

from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING, Any

from foldcar.commands.listed_run import ListedRun, listed_run
from foldcar.commands.run_text import variation_text
from foldcar.commands.simulated_run import simulated_run
from foldcar.errors import FoldcarError
from foldcar.study.limits import MOST_ENVIRONMENTS

if TYPE_CHECKING:
    from foldcar.car.design import Design


@dataclass(frozen=True)
class ViewedRun:
    """The run, and the number of its sample."""

    listed: ListedRun
    sample: int

    @property
    def design(self) -> "Design":
        """The design that the listing and the settings name."""
        return self.listed.design

    @property
    def vehicle(self) -> str:
        """The listing's vehicle."""
        return self.listed.experiment.family.vehicle

    def of(self, design: "Design") -> dict[str, Any]:
        """What run.js replays of that design's run in this environment. FoldcarError if the run fails."""
        from foldcar.figures.ground import carsim_heights
        from foldcar.simulation.results import outcome_of
        from foldcar.view.recorded_run import recorded_run

        listed = self.listed.with_design(design)
        name = f"experiment {listed.experiment.id}, sample {self.sample}"
        one, answer = simulated_run(listed, self.sample)
        path = one.path(listed.carsim, answer, f"--run {listed.experiment.id}/{self.sample}")
        told = f"{name.capitalize()}: {outcome_of(answer).replace('_', ' ')} after {answer['elapsed_time_s']:.2f} s."
        if listed.variation:
            told += f" The car that drives differs from the design that is drawn: {variation_text(listed.variation)}."
        return recorded_run(listed.body, listed.scene, path, carsim_heights(listed.carsim), told)


def viewed_run(listing: Path, run: str, vehicle: str | None, settings: Sequence[str]) -> ViewedRun:
    """The run that the option names; FoldcarError unless it names one, of that vehicle if one is given."""
    experiment, slash, number = run.partition("/")
    sample = int(number) if number.isascii() and number.isdigit() and len(number) < 9 else None
    if not slash:
        sample = 0
    if not experiment or sample is None or sample >= MOST_ENVIRONMENTS:
        most = MOST_ENVIRONMENTS - 1
        raise FoldcarError(f"--run {run}: not EXPERIMENT/SAMPLE with a sample from 0 to {most}, as in 1/3")
    listed = listed_run(listing, experiment, settings, sample)
    its = listed.experiment.family.vehicle
    if vehicle is not None and vehicle != its:
        raise FoldcarError(f"--run {run}: experiment {experiment} is of vehicle {its}, not of {vehicle}")
    return ViewedRun(listed, sample)
