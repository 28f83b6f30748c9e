"""One run of a listing: a design of an experiment in a sample of its environment, as `run` and `link` take it."""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any

import typer

from foldcar.commands.options import design_settings
from foldcar.errors import FoldcarError
from foldcar.study.limits import MOST_ENVIRONMENTS

if TYPE_CHECKING:
    from foldcar.car.design import Design
    from foldcar.simulation.carsim import Carsim
    from foldcar.simulation.runner import Runner
    from foldcar.study.environments import Environment
    from foldcar.study.experiments import Experiment

Listing = Annotated[Path, typer.Argument(metavar="LISTING", help="Experiment listing (JSON).")]
ExperimentId = Annotated[str, typer.Option(metavar="ID", help="Experiment of the listing.")]
Sample = Annotated[
    int,
    typer.Option(metavar="K", min=0, max=MOST_ENVIRONMENTS - 1, help="Number of the sampled environment and built car."),
]


@dataclass(frozen=True)
class ListedRun:
    """``nominal`` is the body of the design, ``body`` that of the built car, which differs from it by ``variation``."""

    carsim: "Carsim"
    experiment: "Experiment"
    design: "Design"
    environment: "Environment"
    nominal: dict[str, Any]
    variation: dict[str, Any]
    body: dict[str, Any]
    scene: dict[str, Any]

    @property
    def side_view_note(self) -> str:
        """What the side view cannot know of the run's experiment, "" if nothing or in another engine."""
        from foldcar.simulation.engines import ENGINES, SIDE_VIEW
        from foldcar.store.info import unlike_sides_text
        from foldcar.study.unlike_sides import beyond_side_view

        if self.carsim.engine != ENGINES[SIDE_VIEW].title:
            return ""
        unlike = beyond_side_view(self.carsim, self.experiment, self.environment)
        return f"note: {unlike_sides_text(unlike)}" if unlike else ""

    def with_design(self, design: "Design") -> "ListedRun":
        """The run of another design in the same environment, built with the same differences."""
        from foldcar.car.body import body_json
        from foldcar.car.variation import vary_body

        nominal = body_json(design)
        body = vary_body(nominal, self.variation, self.carsim.limits().numbers) if self.variation else nominal
        return replace(self, design=design, nominal=nominal, body=body)


def listed_run(
    listing: Path, experiment: str, settings: Sequence[str] | None, sample: int, engine: str = "multibody"
) -> ListedRun:
    """The run of those options; FoldcarError if they name no single design or the program is at fault."""
    from foldcar.simulation.carsim import Carsim
    from foldcar.study.environments import Environment
    from foldcar.study.experiments import read_study

    (chosen,) = read_study(listing, experiment).experiments
    design = chosen.family.narrowed(design_settings(settings or [])).single()
    environment = Environment(chosen)
    variation, scene = environment.variation(sample), environment.sample(sample)
    return ListedRun(Carsim(engine=engine), chosen, design, environment, {}, variation, {}, scene).with_design(design)


@dataclass(frozen=True)
class SimulatedRun:
    """The parts of a run of docs/carsim.md."""

    label: str
    body: Mapping[str, Any]
    scene: Mapping[str, Any]
    settings: Mapping[str, Any]
    sample: int

    def by(self, runner: "Runner", **more: float) -> dict[str, Any]:
        """The runner's answer; ``more`` is added to the settings."""
        from foldcar.simulation.runner import RunRequest
        from foldcar.store.writer import canonical_json

        settings = canonical_json({**self.settings, **more})
        (answer,) = runner.run(
            {"car": canonical_json(self.body)},
            {"scene": canonical_json(self.scene)},
            [RunRequest("car", "scene", settings, self.label, self.sample)],
        )
        return answer

    def path(self, carsim: "Carsim", answer: Mapping[str, Any], wanted: object) -> list[list[float]]:
        """The car's path, simulated by a batch; where the Scenic program ended the run, the path ends.

        FoldcarError that names ``wanted`` if the run failed.
        """
        from foldcar.simulation.runner import PATH_INTERVAL_S

        native = {} if "error" in answer else self.by(carsim, path_interval_s=PATH_INTERVAL_S)
        if "path" not in native:
            raise FoldcarError(f"{wanted}: a failed run has no path to show")
        return [row for row in native["path"] if row[0] <= answer["elapsed_time_s"]]


def simulated_run(listed: ListedRun, sample: int) -> tuple[SimulatedRun, dict[str, Any]]:
    """The run, and its answer by the runner of its environment. FoldcarError."""
    chosen = listed.experiment
    one = SimulatedRun(
        label=f"experiment {chosen.id}, sample {sample}",
        body=listed.body,
        scene=listed.scene,
        settings=chosen.settings(listed.design, listed.nominal, listed.carsim.parameter_table()),
        sample=sample,
    )
    with listed.environment.runner(listed.carsim, listed.environment.dynamic) as runner:
        return one, one.by(runner)
