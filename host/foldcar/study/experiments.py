"""A listing's experiments with all that a simulation needs: families, programs, set-points, time limits.

Input: a listing file and the options of a command. Output: experiments with checked designs.
"""

from collections.abc import Mapping
from dataclasses import dataclass, replace
from pathlib import Path
from typing import TYPE_CHECKING, Any

from foldcar.car.body import TableRow, check_parameters, firmware_parameters, full_speed_m_s
from foldcar.car.design import Design
from foldcar.car.variation import spread_named
from foldcar.store.info import VARIANT, engine_id
from foldcar.study.family import Family, read_family
from foldcar.study.listing import Listing, ListingError
from foldcar.study.listing_file import read_listing
from foldcar.typed import did_you_mean

if TYPE_CHECKING:
    from foldcar.simulation.carsim import Carsim

TRIAL_LIMIT = "TRIAL_MAX_S"


@dataclass(frozen=True)
class Experiment:
    """One experiment: each design of the family in each of ``environments`` samples of the program.

    ``thresholds`` are success rates, 0 to 1, in ascending order, that good designs reach. ``condition`` is the listing's
    (see open_environment). ``variation`` maps the names of spreads to standard deviations; it is empty if all cars are
    as designed.
    """

    id: str
    family: Family
    environment: str
    program: Path
    program_name: str
    scenic_params: Mapping[str, Any]
    seed: int
    condition: Mapping[str, Any] | None
    environments: int
    timeout_s: float
    speed_m_s: float | None
    yaw_rate_rad_s: float
    variation: Mapping[str, float]
    variation_seed: int
    place: str
    thresholds: tuple[float, ...] = ()

    def settings(self, design: Design, body: Mapping[str, Any], table: Mapping[str, TableRow]) -> dict[str, Any]:
        """Return the settings of a design's runs: the ``run`` object of docs/carsim.md without ids.

        Raises FoldcarError if a value is outside the limits of the firmware's parameter table ``table``, or the car is
        slower than the commanded speed.
        """
        return run_settings(design, body, table, self.timeout_s, self.speed_m_s, self.yaw_rate_rad_s, self.place)


@dataclass(frozen=True)
class ListedStudy:
    """A listing file: its name as typed, its text, and the selected experiments."""

    listing_name: str
    listing_text: str
    experiments: tuple[Experiment, ...]


def read_study(file: Path, experiment: str | None = None, environments: int | None = None) -> ListedStudy:
    """Read the study of a listing, or one experiment of it; ``environments`` overrides the number of samples.

    Raises ListingError with all mistakes of the listing, also in parts that were not chosen.
    """
    listing, text = read_listing(file, programs=True)
    if not listing.experiments:
        raise ListingError(file, "experiments: is missing")
    if experiment is not None and experiment not in listing.experiments:
        listed_names = list(listing.experiments)
        suggestion = did_you_mean(experiment, listed_names)
        raise ListingError(file, f'experiments: has no "{experiment}"; known: {", ".join(listed_names)}{suggestion}')
    for name in listing.experiments:
        if name != name.strip():
            raise ListingError(file, f'experiments: "{name}": begins or ends with a blank, which tables do not keep')
        if VARIANT.search(name):
            reason = "ends like the names that foldcar gives to variants of experiments; choose another name"
            raise ListingError(file, f'experiments: "{name}": {reason}')
    names = list(listing.experiments) if experiment is None else [experiment]
    experiments = tuple(_experiment(file, listing, name, environments) for name in names)
    return ListedStudy(str(file), text, experiments)


def _experiment(file: Path, listing: Listing, name: str, environments: int | None) -> Experiment:
    """Return the experiment called ``name``; ``environments`` overrides the number of samples. Raises ListingError."""
    listed = listing.experiments[name]
    environment = listing.environments[listed.env_id]
    params = listed.params
    place = f"{file}: experiments.{name}"
    condition = None
    if environment.condition is not None:
        condition = environment.condition.model_dump(exclude_none=True)
    variation: Mapping[str, float] = {}
    if params.variation is not None:
        variation = spread_named(params.variation, f"{place}.params.variation")
    return Experiment(
        id=name,
        family=read_family(file, listed.veh_id, listing.vehicles[listed.veh_id]),
        environment=listed.env_id,
        program=file.parent / environment.scenic_filename,
        program_name=environment.scenic_filename,
        scenic_params=environment.scenic_params,
        seed=environment.seed,
        condition=condition,
        environments=params.environments if environments is None else environments,
        timeout_s=params.timeout,
        speed_m_s=params.speed,
        yaw_rate_rad_s=params.yaw_rate,
        variation=variation,
        variation_seed=environment.seed if params.variation_seed is None else params.variation_seed,
        place=place,
        thresholds=params.threshold,
    )


def run_settings(
    design: Design,
    body: Mapping[str, Any],
    table: Mapping[str, TableRow],
    timeout_s: float,
    speed_m_s: float | None,
    yaw_rate_rad_s: float,
    place: str,
) -> dict[str, Any]:
    """Return the settings of a design's runs, as :meth:`Experiment.settings`; ``place`` names the experiment in errors.

    ``speed_m_s`` None stands for the car's full speed. A time limit above the firmware's default also raises the
    firmware's limit.
    """
    parameters = firmware_parameters(design, body)
    trial_limit = table.get(TRIAL_LIMIT)
    if trial_limit is not None and timeout_s > trial_limit.default:
        if timeout_s > trial_limit.maximum:
            reason = f"{timeout_s:g} is above the maximum {trial_limit.maximum:g} s"
            raise ListingError(f"{place}.params.timeout", f"{reason} (the firmware's {TRIAL_LIMIT})")
        parameters[TRIAL_LIMIT] = timeout_s
    check_parameters(parameters, table)
    full_m_s = full_speed_m_s(design)
    if speed_m_s is not None and speed_m_s > full_m_s:
        reason = f"{speed_m_s:g} is above {full_m_s:.3g} m/s, the full speed of {design.title}"
        raise ListingError(f"{place}.params.speed", reason)
    return {
        "speed_m_s": full_m_s if speed_m_s is None else speed_m_s,
        "yaw_rate_rad_s": yaw_rate_rad_s,
        "time_limit_s": timeout_s,
        "parameters": parameters,
    }


def engine_study(study: ListedStudy, carsim: "Carsim") -> ListedStudy:
    """Return the study with the simulator's engine added to the names of its experiments."""
    renamed = []
    for experiment in study.experiments:
        renamed.append(replace(experiment, id=engine_id(experiment.id, carsim.engine)))
    return replace(study, experiments=tuple(renamed))
