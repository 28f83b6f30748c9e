"""Finds what a command's options name in a listing: designs of a vehicle, or a run of an experiment in a sample."""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field
from pathlib import Path
from typing import TYPE_CHECKING, Any

from foldcar.commands.options import design_settings, print_note
from foldcar.errors import FoldcarError
from foldcar.typed import did_you_mean

if TYPE_CHECKING:
    from foldcar.car.design import Design
    from foldcar.simulation.carsim import Carsim
    from foldcar.simulation.runner import Runner
    from foldcar.study.environments import ExperimentEnvironment
    from foldcar.study.experiments import Experiment
    from foldcar.study.family import Family
    from foldcar.study.listing import Listing


@dataclass(frozen=True)
class ListedRun:
    """A run that a command's options name: a design in a sample of an experiment's environment.

    ``body`` is the car's for the simulator. ``variation`` is how the sample's built car differs from the design.
    """

    carsim: "Carsim"
    experiment: "Experiment"
    design: "Design"
    environment: "ExperimentEnvironment"
    body: dict[str, Any]
    variation: dict[str, Any]
    scene: dict[str, Any]
    sample: int

    @property
    def name(self) -> str:
        """The run's name in messages."""
        return f"experiment {self.experiment.id}, sample {self.sample}"

    @property
    def side_view_note(self) -> str:
        """A note on what the side-view engine cannot simulate of the run.

        It is "" if this engine can simulate everything that matters, or if another engine simulates the run.
        """
        from foldcar.simulation.engines import ENGINES, SIDE_VIEW
        from foldcar.store.info import side_view_warning
        from foldcar.study.side_view_check import side_view_limits

        if self.carsim.engine != ENGINES[SIDE_VIEW].title:
            return ""
        difference = side_view_limits(self.carsim, self.experiment, self.environment)
        return f"note: {side_view_warning(difference)}" if difference else ""

    def variation_in(self, sample: int, car: str | None = None) -> dict[str, Any]:
        """Return how the car in another sample differs from its design.

        ``car`` is the name of a built car; None stands for the sample's own car.
        """
        from foldcar.car.variation import draw, named_car

        experiment = self.experiment
        if car is None or not experiment.variation:
            return self.environment.variation(sample)
        return draw(experiment.variation, experiment.variation_seed, named_car(car))


def listed_run(
    listing: Path, experiment: str, settings: Sequence[str] | None, sample: int, engine: str = "multibody"
) -> ListedRun:
    """Return the run that a command's options name: sample the scene and start the simulator.

    ``settings`` (NAME=VALUE) choose one of the designs of the experiment's family. Raises FoldcarError if they leave
    several designs, or if the Scenic program has an error.
    """
    from foldcar.car.body import body_json
    from foldcar.simulation.carsim import Carsim
    from foldcar.study.environments import ExperimentEnvironment
    from foldcar.study.experiments import read_study

    (listed_experiment,) = read_study(listing, experiment).experiments
    chosen = design_settings(settings)
    design = listed_experiment.family.narrowed(chosen).single()
    for text in listed_experiment.family.outside(chosen):
        print_note(text)
    environment = ExperimentEnvironment(listed_experiment)
    # The scene is sampled before the simulator starts, so that an error of the program is reported first.
    variation, scene = environment.variation(sample), environment.sample(sample)
    return ListedRun(
        carsim=Carsim(engine=engine),
        experiment=listed_experiment,
        design=design,
        environment=environment,
        body=body_json(design),
        variation=variation,
        scene=scene,
        sample=sample,
    )


@dataclass(frozen=True)
class RunInput:
    """The input of a run, as docs/carsim.md describes it. ``label`` names the run in messages."""

    label: str
    body: Mapping[str, Any]
    scene: Mapping[str, Any]
    settings: Mapping[str, Any]
    sample: int
    reality: Mapping[str, Any] = field(default_factory=dict)

    def simulate(self, runner: "Runner", **extra_settings: float) -> dict[str, Any]:
        """Simulate the run and return the runner's answer; ``extra_settings`` are added to the run's settings."""
        from foldcar.simulation.runner import RunRequest
        from foldcar.store.writer import canonical_json

        settings = canonical_json({**self.settings, **extra_settings})
        # "car" and "scene" are the names by which the request refers to the two texts.
        request = RunRequest(
            body="car",
            scene="scene",
            settings=settings,
            label=self.label,
            sample=self.sample,
            reality=canonical_json(self.reality),
        )
        bodies, scenes = {"car": canonical_json(self.body)}, {"scene": canonical_json(self.scene)}
        (answer,) = runner.run(bodies, scenes, [request])
        return answer

    def path(self, carsim: "Carsim", answer: Mapping[str, Any], label: object) -> list[list[float]]:
        """Simulate the run again, this time with its path, and return the path's rows; each begins with its time (s).

        ``answer`` is the result of the run. A Scenic program may have ended the run early; the path ends then, too.
        Raises FoldcarError, which starts with ``label``, if the run failed with an error.
        """
        from foldcar.simulation.runner import PATH_INTERVAL_S

        answer_with_path = {} if "error" in answer else self.simulate(carsim, path_interval_s=PATH_INTERVAL_S)
        if "path" not in answer_with_path:
            raise FoldcarError(f"{label}: a failed run has no path to show")
        rows = []
        for row in answer_with_path["path"]:
            time_s = row[0]
            if time_s <= answer["elapsed_time_s"]:
                rows.append(row)
        return rows


def simulated_run(listed: ListedRun) -> tuple[RunInput, dict[str, Any]]:
    """Simulate a listed run; return its input and the runner's answer. Raises FoldcarError."""
    settings = listed.experiment.settings(listed.design, listed.body, listed.carsim.parameter_table())
    run = RunInput(
        label=listed.name,
        body=listed.body,
        scene=listed.scene,
        settings=settings,
        sample=listed.sample,
        reality=listed.variation,
    )
    with listed.environment.runner(listed.carsim, listed.environment.dynamic) as runner:
        return run, run.simulate(runner)


def listed_families(
    listing: Path, vehicle: str | None, settings: Sequence[str] | None, every: bool = True
) -> "tuple[Listing, list[Family]]":
    """Return the data of a listing, and a family for each chosen vehicle: all designs of the vehicle.

    ``vehicle`` is the name of the chosen vehicle. If it is None and ``every`` is True, all vehicles of the listing are
    chosen. If ``every`` is False, the listing must have a single vehicle, which is chosen. ``settings`` (NAME=MM) fix
    parameters of the families. Raises FoldcarError if the vehicle or a setting does not exist, or if the listing has
    several vehicles where one must be chosen.
    """
    from foldcar.study.family import read_family
    from foldcar.study.listing_file import read_listing

    listing_data, _ = read_listing(listing)
    all_vehicles = list(listing_data.vehicles)
    if vehicle is None:
        chosen_vehicles = all_vehicles
        if not every and len(all_vehicles) != 1:
            raise FoldcarError(f"{listing}: has several vehicles; choose one with --vehicle: {', '.join(all_vehicles)}")
    else:
        chosen_vehicles = [vehicle]
        if vehicle not in all_vehicles:
            close = did_you_mean(vehicle, all_vehicles)
            raise FoldcarError(f'{listing}: has no vehicle "{vehicle}"; known: {", ".join(all_vehicles)}{close}')
    chosen_settings = design_settings(settings)
    families = []
    for name in chosen_vehicles:
        family = read_family(listing, name, listing_data.vehicles[name])
        families.append(family.narrowed(chosen_settings))
    return listing_data, families


def listed_family(listing: Path, vehicle: str | None, settings: Sequence[str] | None) -> "tuple[Listing, Family]":
    """Return the listing and the family of ``vehicle``; None stands for the listing's only vehicle."""
    listing_data, (family,) = listed_families(listing, vehicle, settings, every=False)
    return listing_data, family
