"""What a store keeps of a study and its experiments besides the runs."""

import re
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING, Any

from foldcar.simulation.engines import ENGINES, engine_title

if TYPE_CHECKING:
    from foldcar.statistics.stopping import StoppingRule


# A reality is a set of values of the simulator's parameters, such as friction, that could be true. If each sample of an
# experiment has a random reality of its own, this is the name of its realities.
RANDOM_REALITIES = "random realities"
# A variant of an experiment is the same experiment in new environments ("fresh"), with another engine, in a reality or
# in random realities. The end of its name says which.
_TITLES = "|".join(re.escape(engine.title) for engine in ENGINES.values() if engine.title)
VARIANT = re.compile(rf" (fresh|\(({_TITLES}|reality .*|realities)\))$", re.DOTALL)


def engine_id(experiment: str, engine: str) -> str:
    """Return the name in stores of an experiment that ``engine`` simulates, such as "width (MuJoCo)".

    With the default engine, whose name is "", the experiment keeps its name.
    """
    return f"{experiment} ({engine_title(engine)})" if engine else experiment


def listed_id(experiment: str, reality: Mapping[str, str] | None, engine: str) -> str:
    """Return an experiment's name in the listing: its name in the store without reality and engine."""
    name_without_reality = experiment if reality is None else reality["experiment"]
    engine_suffix = engine_id("", engine)
    return name_without_reality.removesuffix(engine_suffix)


def side_view_warning(difference: str) -> str:
    """Return a warning that the results of the side view may be wrong.

    The side view is an engine that simulates the car in a vertical plane, as if its left and its right side were alike.
    ``difference`` says what differs between the sides.
    """
    return (
        f"The side view simulates neither roll, yaw nor sides, which matter here: {difference}. Use --engine multibody."
    )


def is_same_program(program: str | None, other: str) -> bool:
    """Return whether two names may be of the same Scenic program: True if ``program`` is unknown (None).

    One listing may name it by its absolute path, another by a relative path, so only the file's name counts.
    """
    return program is None or Path(program).name == Path(other).name


@dataclass(frozen=True, slots=True)
class ExperimentInfo:
    """One experiment as it was last swept.

    Cars: ``varied`` maps each design parameter that varies (``width_mm``) to its values in order; ``fixed`` has the other
    parameters. ``speed_m_s`` is None if every car drives at its own full speed. ``variation`` maps what differs between
    built cars of one design to its spread; the differences are drawn with ``variation_seed``. It is empty if all cars are
    as designed. ``skipped`` names the cars that cannot be built, with reasons.

    Environment: ``condition`` says which parts of the environment are fixed. ``terrain_objects`` has the name and the
    number of pieces of each terrain object, in the order of sample 0's terrain; it is empty if they are not stored.
    ``engine`` is the engine's name and version, "" for multibody. ``unlike_sides`` says what that engine cannot simulate
    here, and is "" if it can simulate everything.

    Runs: ``planned_runs`` is designs × environments, ``stored_runs`` the number of runs with a result. If there is a
    stopping rule ``until``, ``decided`` of the ``designs`` need no more runs, and after the sweep's end no more runs are
    planned. If ``searched``, a search chose the designs and their numbers of runs by its ``objectives``, and no more runs
    are planned. ``success_rule`` says when a run has passed; if ``success_defined`` is False, it says why that is
    undefined. ``thresholds`` are the success rates that good designs reach.

    Realities: ``reality`` is None for nominal simulations. Otherwise it has the ``name`` and ``fingerprint`` of a file's
    reality, and the name of the listing's ``experiment``; ``listed_environment`` is then the fingerprint of the listing's
    environment. The ``name`` is RANDOM_REALITIES if each sample has a reality of its own; then trials have no environment
    in common with the experiment. ``realities`` is the planned number of runs in other realities; ``reality_spread`` is
    the fingerprint of what these realities are drawn from. ``no_realities`` is a sentence that says why there are none.
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
    reality: Mapping[str, str] | None = None
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
    realities: int = 0
    no_realities: str = ""
    reality_spread: str = ""

    @property
    def listed_id(self) -> str:
        """The experiment's name in the listing."""
        return listed_id(self.id, self.reality, self.engine)

    @property
    def under(self) -> str | None:
        """The reality that it was simulated in, as ``reality NAME`` or RANDOM_REALITIES; None for nominal simulations."""
        if self.reality is None:
            return None
        if self.is_over_realities:
            return RANDOM_REALITIES
        return f"reality {self.reality['name']}"

    @property
    def is_over_realities(self) -> bool:
        """Whether each sample has a random reality of its own, so that rates are expected over realities."""
        return self.reality is not None and self.reality["name"] == RANDOM_REALITIES

    @property
    def warning(self) -> str:
        """A warning to print wherever its rates are shown; "" if the engine can simulate all that matters."""
        return side_view_warning(self.unlike_sides) if self.unlike_sides else ""

    @property
    def simulation(self) -> str:
        """The name of its simulation in sentences.

        It is RANDOM_REALITIES if each sample has a reality of its own, ``simulation`` for the engine multibody, and
        otherwise the engine's name.
        """
        if self.is_over_realities:
            return RANDOM_REALITIES
        return engine_title(self.engine) or "simulation"


@dataclass(frozen=True, slots=True)
class StudyInfo:
    """The latest sweep into a store: versions, listing and command.

    ``listing_name`` is the path that the user typed, ``listing_text`` the file's content, ``command`` the exact command
    line. ``experiments`` are those of all sweeps into the store, in the order of the listing.
    """

    foldcar_version: str
    scenic_version: str
    carsim_build: str
    listing_name: str
    listing_text: str
    command: str
    created_utc: str
    experiments: Mapping[str, ExperimentInfo]
