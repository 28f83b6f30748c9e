"""One run of a listing, simulated: its answer, and the car's path."""

from collections.abc import Mapping
from dataclasses import dataclass
from typing import TYPE_CHECKING, Any

from foldcar.commands.listed_run import ListedRun
from foldcar.errors import FoldcarError

if TYPE_CHECKING:
    from foldcar.simulation.carsim import Carsim
    from foldcar.simulation.runner import Runner


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
