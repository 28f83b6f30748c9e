"""What a study is: the facts a store keeps beside its runs, as reports print them."""

import re
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import TYPE_CHECKING, Any

from foldcar.simulation.engines import ENGINES, engine_title

if TYPE_CHECKING:
    from foldcar.statistics.stopping import StoppingRule


# What an experiment may be simulated under: a calibration of its store, or the parameters of a file.
CALIBRATION_KIND, REALITY_KIND = "calibration", "reality"


# Endings of the names of an experiment's variants: in fresh environments, in another engine, under other parameters.
_TITLES = "|".join(re.escape(engine.title) for engine in ENGINES.values() if engine.title)
VARIANT = re.compile(rf" (fresh|\(({_TITLES}|(calibrated|{REALITY_KIND}) .*)\))$", re.DOTALL)


def engine_id(experiment: str, engine: str) -> str:
    """The name, in stores, of an experiment in that engine; its own in multibody, whose name is empty."""
    return f"{experiment} ({engine_title(engine)})" if engine else experiment


def listed_id(experiment: str, calibration: Mapping[str, str] | None, engine: str) -> str:
    """The name in the listing of an experiment that stores name so: a calibration or an engine changes it."""
    under = experiment if calibration is None else calibration["experiment"]
    return under.removesuffix(engine_id("", engine))


def unlike_sides_text(what: str) -> str:
    """The warning of an experiment in the side view of which that matters."""
    return f"The side view knows neither roll, yaw nor sides, which matter here: {what}. Use --engine multibody."


@dataclass(frozen=True, slots=True)
class ExperimentInfo:
    """One experiment as it was last swept.

    ``varied`` maps each design parameter that makes the family (``width_mm``) to its values in order;
    ``fixed`` holds the other ones. ``speed_m_s`` is None where every car drives at its own full speed.
    ``condition`` says what is frozen of the environment; ``variation`` maps what varies from car to car to
    its spread, drawn by ``variation_seed``, and is empty if cars are as designed. ``planned_runs`` is
    designs × environments, ``stored_runs`` how many of them have a result. Where a sweep ``until``
    enough is known has ended, no more are planned than it made; before, ``designs`` that are ``decided`` have no more
    planned than stored. ``success_rule`` says when a run has
    passed, or why that is undefined (``success_defined`` False). ``skipped`` names the cars of the family that
    cannot be built, and why. ``calibration`` is None for nominal simulations, else ``name``, ``fingerprint`` and
    ``experiment``: what it was simulated under, and the experiment of the listing; of a reality also its ``kind``. Then
    ``listed_environment`` is the fingerprint of the listing's environment.
    ``searched`` says that a search chose the designs, and how many runs each has: no more are planned; ``objectives`` are
    the names of what it went by.
    ``thresholds`` are the shares of passed runs that tell good designs from bad ones. ``engine`` is the name and version
    of what moved the cars, "" in multibody. ``unlike_sides`` says what that engine cannot know here, "" if nothing.
    ``terrain_objects`` are the name of each terrain object and its number of pieces, in the order of sample 0's terrain;
    empty if the store does not have them.
    """

    id: str
    vehicle: str
    vehicle_type: str
    environment: str
    varied: Mapping[str, tuple[float, ...]]
    fixed: Mapping[str, float]
    environments: int
    timeout_s: float
    speed_m_s: float | None
    yaw_rate_rad_s: float
    scenic_program: str
    scenic_params: Mapping[str, Any]
    seed: int
    condition: Mapping[str, Any] | None
    variation: Mapping[str, float]
    variation_seed: int
    carsim_build: str
    planned_runs: int
    stored_runs: int
    success_rule: str
    success_defined: bool
    skipped: tuple[str, ...] = ()
    calibration: Mapping[str, str] | None = None
    listed_environment: str | None = None
    thresholds: tuple[float, ...] = ()
    until: "StoppingRule | None" = None
    designs: int = 0
    decided: int = 0
    searched: bool = False
    objectives: tuple[str, ...] = ()
    engine: str = ""
    unlike_sides: str = ""
    terrain_objects: Sequence[tuple[str, int]] = ()

    @property
    def listed_id(self) -> str:
        """The experiment's name in the listing."""
        return listed_id(self.id, self.calibration, self.engine)

    @property
    def under(self) -> str | None:
        """What it was simulated under, as ``calibration NAME``; None for nominal simulations."""
        one = self.calibration
        return None if one is None else f"{one.get('kind', CALIBRATION_KIND)} {one['name']}"

    @property
    def warning(self) -> str:
        """What to say wherever its rates are shown, "" if they mean what they say."""
        return unlike_sides_text(self.unlike_sides) if self.unlike_sides else ""

    @property
    def simulation(self) -> str:
        """What sentences call its simulation: ``simulation`` in multibody, else the engine's name."""
        return engine_title(self.engine) or "simulation"


@dataclass(frozen=True, slots=True)
class StudyInfo:
    """The latest sweep into a store: who made it, from what, and how to make it again.

    ``listing_name`` is the path the user typed, ``listing_text`` the file's content; ``command`` is the
    exact command line; ``experiments`` stands in the order of the listing, over all sweeps of the store.
    """

    foldcar_version: str
    scenic_version: str
    carsim_build: str
    listing_name: str
    listing_text: str
    command: str
    created_utc: str
    experiments: Mapping[str, ExperimentInfo]
