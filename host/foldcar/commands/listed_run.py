"""What commands name of a listing: designs of a vehicle, or one run of an experiment in a sample of its environment."""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from pathlib import Path
from typing import TYPE_CHECKING, Any

from foldcar.commands.options import design_settings
from foldcar.errors import FoldcarError
from foldcar.typed import did_you_mean

if TYPE_CHECKING:
    from foldcar.car.design import Design
    from foldcar.simulation.carsim import Carsim
    from foldcar.simulation.runner import Runner
    from foldcar.study.environments import Environment
    from foldcar.study.experiments import Experiment
    from foldcar.study.family import Family
    from foldcar.study.listing import Listing

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
    sample: int

    @property
    def name(self) -> str:
        """What messages call it."""
        return f"experiment {self.experiment.id}, sample {self.sample}"

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
    listing: Path, experiment: str, settings: Sequence[str] | None, sample: int, engine: str = "multibody",
    car: str | None = None,
) -> ListedRun:  # fmt: skip
    """The run of those options; FoldcarError if they name no single design or the program is at fault.

    Without the name of a ``car`` it is that of the sample.
    """
    from foldcar.car.variation import draw, named_car
    from foldcar.simulation.carsim import Carsim
    from foldcar.study.environments import Environment
    from foldcar.study.experiments import read_study

    (chosen,) = read_study(listing, experiment).experiments
    design = chosen.family.narrowed(design_settings(settings)).single()
    environment = Environment(chosen)
    variation, scene = environment.variation(sample), environment.sample(sample)
    if car is not None and chosen.variation:
        variation = draw(chosen.variation, chosen.variation_seed, named_car(car))
    carsim = Carsim(engine=engine)
    return ListedRun(carsim, chosen, design, environment, {}, variation, {}, scene, sample).with_design(design)


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


def simulated_run(listed: ListedRun) -> tuple[SimulatedRun, dict[str, Any]]:
    """The run, and its answer by the runner of its environment. FoldcarError."""
    settings = listed.experiment.settings(listed.design, listed.nominal, listed.carsim.parameter_table())
    one = SimulatedRun(listed.name, listed.body, listed.scene, settings, listed.sample)
    with listed.environment.runner(listed.carsim, listed.environment.dynamic) as runner:
        return one, one.by(runner)


def listed_families(
    listing: Path, vehicle: str | None, settings: Sequence[str] | None, every: bool = True
) -> "tuple[Listing, list[Family]]":
    """The listing, and those designs of the vehicle that have the settings (NAME=MM).

    Without ``vehicle`` those of ``every`` one, or of the only one. FoldcarError if there is no such vehicle or value.
    """
    from foldcar.study.family import read_family
    from foldcar.study.listing_file import read_listing

    listed, _ = read_listing(listing)
    known = ", ".join(listed.vehicles)
    if vehicle is None and not every and len(listed.vehicles) != 1:
        raise FoldcarError(f"{listing}: vehicles: has several; choose one with --vehicle: {known}")
    if vehicle is not None and vehicle not in listed.vehicles:
        close = did_you_mean(vehicle, listed.vehicles)
        raise FoldcarError(f'{listing}: vehicles: has no "{vehicle}"; known: {known}{close}')
    chosen = design_settings(settings)
    names = list(listed.vehicles) if vehicle is None else [vehicle]
    return listed, [read_family(listing, name, listed.vehicles[name]).narrowed(chosen) for name in names]


def listed_family(listing: Path, vehicle: str | None, settings: Sequence[str] | None) -> "tuple[Listing, Family]":
    """The same of one vehicle, which may be None if the listing has only one."""
    listed, (family,) = listed_families(listing, vehicle, settings, every=False)
    return listed, family
