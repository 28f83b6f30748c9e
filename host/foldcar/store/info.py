"""What a store keeps of a study and its experiments besides the runs."""

import re
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING, Any

from foldcar.simulation.engines import ENGINES, engine_title

if TYPE_CHECKING:
    from foldcar.statistics.stopping import StoppingRule


# The name of the realities of an experiment whose samples each have a random reality of their own.
RANDOM_REALITIES = "random realities"
# Suffixes of the names of an experiment's variants: new environments, another engine, a reality, random realities.
_TITLES = "|".join(re.escape(engine.title) for engine in ENGINES.values() if engine.title)
VARIANT = re.compile(rf" (fresh|\(({_TITLES}|reality .*|realities)\))$", re.DOTALL)


def engine_id(experiment: str, engine: str) -> str:
    """Return an experiment's name in stores if ``engine`` simulates it: "width (MuJoCo)"; "" is the default engine."""
    return f"{experiment} ({engine_title(engine)})" if engine else experiment


def listed_id(experiment: str, reality: Mapping[str, str] | None, engine: str) -> str:
    """Return an experiment's name in the listing: its name in the store without reality and engine."""
    listed_name = experiment if reality is None else reality["experiment"]
    return listed_name.removesuffix(engine_id("", engine))


def unlike_sides_text(difference: str) -> str:
    """Return the warning that the side view does not simulate ``difference``, which matters for the experiment."""
    return (
        f"The side view simulates neither roll, yaw nor sides, which matter here: {difference}. Use --engine multibody."
    )


def is_same_program(program: str | None, other: str) -> bool:
    """Return whether two listings may name the same Scenic program; an unknown one may be any.

    A listing may name it by its absolute or by its relative path, so only the file's name counts.
    """
    return program is None or Path(program).name == Path(other).name


@dataclass(frozen=True, slots=True)
class ExperimentInfo:
    """One experiment as it was last swept.

    ``varied`` maps each design parameter that varies (``width_mm``) to its values in order; ``fixed`` has the others.
    ``speed_m_s`` is None if every car drives at its own full speed. ``condition`` says which parts of the environment are
    fixed. ``variation`` maps what varies between cars to its spread, drawn by ``variation_seed``; it is empty if all cars
    are as designed. ``planned_runs`` is designs × environments, ``stored_runs`` the number with a result.
    With a stopping rule ``until``, ``decided`` ones of the ``designs`` need no more runs, and after the sweep's end no
    more runs are planned. ``success_rule`` says when a run has passed, or why that is undefined (``success_defined`` is
    False). ``skipped`` names the cars that cannot be built, with reasons.
    ``reality`` is None for nominal simulations, else ``name`` and ``fingerprint`` of a file's reality, and the listing's
    ``experiment``; then ``listed_environment`` is the fingerprint of the listing's environment. Its ``name`` is
    RANDOM_REALITIES if each sample has a reality of its own; then trials have no environment in common with it.
    ``searched``: a search chose designs and numbers of runs by its ``objectives``, and no more runs are planned.
    ``thresholds`` are success rates that good designs reach. ``engine`` is the engine's name and version, "" for
    multibody. ``unlike_sides`` says what that engine cannot simulate here, "" if nothing. ``terrain_objects`` are the
    name and number of pieces of each terrain object, in the order of sample 0's terrain; empty if they are not stored.
    ``realities`` is the planned number of runs in other realities, ``reality_spread`` the fingerprint of what these are
    drawn from; ``no_realities`` says in a sentence why there are none.
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
        return RANDOM_REALITIES if self.is_over_realities else f"reality {self.reality['name']}"

    @property
    def is_over_realities(self) -> bool:
        """Whether each sample has a random reality of its own, so that rates are expected over realities."""
        return self.reality is not None and self.reality["name"] == RANDOM_REALITIES

    @property
    def warning(self) -> str:
        """A warning to print wherever its rates are shown; "" if the engine is valid for it."""
        return unlike_sides_text(self.unlike_sides) if self.unlike_sides else ""

    @property
    def simulation(self) -> str:
        """The name of its simulation in sentences: ``simulation`` for multibody, else the engine's name.

        It is RANDOM_REALITIES if each sample has one of its own.
        """
        return RANDOM_REALITIES if self.is_over_realities else engine_title(self.engine) or "simulation"


@dataclass(frozen=True, slots=True)
class StudyInfo:
    """The latest sweep into a store: versions, listing and command.

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
