"""Plans an experiment: stores what it is, and which designs it has, before its first run.

Input: an experiment of a listing, its environment and designs. Output: rows in the store, and a PlannedExperiment. Its
facts are the fields of ExperimentInfo that have no column of their own.
"""

from collections.abc import Mapping, Sequence
from dataclasses import asdict, dataclass
from datetime import datetime, timezone
from pathlib import Path
from typing import Any

from foldcar.scenes.fingerprint import scenic_version
from foldcar.scenes.success import SuccessRule
from foldcar.shown_text import decoded
from foldcar.simulation.carsim import Carsim
from foldcar.statistics.stopping import StoppingRule
from foldcar.store.writer import PlannedExperiment, StoreWriter
from foldcar.study.environments import ExperimentEnvironment
from foldcar.study.experiments import Experiment, ListedStudy
from foldcar.study.planned_designs import PlannedDesigns
from foldcar.study.reality_runs import realities_fingerprint, reality_facts, why_no_realities
from foldcar.version import __version__


@dataclass(frozen=True)
class SweepOptions:
    """How a sweep simulates an experiment.

    ``engine`` is the engine's name, "" for multibody. ``side_view_limits`` says what the side view cannot simulate here;
    it is "" if there is nothing. ``rule`` stops designs early. ``realities`` is the requested number of runs in other
    realities; None lets the learning's error decide.
    """

    engine: str = ""
    side_view_limits: str = ""
    rule: StoppingRule | None = None
    realities: int | None = None


@dataclass(frozen=True)
class SearchOptions:
    """How a search simulates an experiment.

    ``objectives`` are the names of what it optimises. They are empty when it tests its best designs in new environments.
    """

    objectives: Sequence[str]


def plan_experiment(
    experiment: Experiment,
    environment: ExperimentEnvironment,
    writer: StoreWriter,
    designs: PlannedDesigns,
    options: SweepOptions | SearchOptions,
) -> PlannedExperiment:
    """Store an experiment and its designs, in place of an earlier experiment with the same id. Raises FoldcarError."""
    # If the program's files have not changed since an earlier sweep, the environment need not compile it again.
    environment.recall(writer.program_files(experiment.id), writer.knows_environment)
    environment_id = writer.environment(environment.fingerprint)
    program_facts = _program_facts(environment, writer, environment_id)
    facts = {
        **_listed_facts(experiment),
        **program_facts,
        **_environment_facts(environment),
        **_reality_facts(experiment, environment, writer, environment_id, program_facts, options),
        **_option_facts(options),
    }
    plan = PlannedExperiment(
        id=experiment.id,
        vehicle=experiment.family.vehicle,
        environment=experiment.environment,
        environment_id=environment_id,
        spread_id=writer.spread(environment.spread_fingerprint),
        environments=experiment.environments,
        facts=facts,
    )
    # With their fingerprint, a later sweep recognises that the store has all these designs. A search adds its designs one
    # by one later. So its experiment does not have all of them, and is stored without the fingerprint.
    adds_designs_later = isinstance(options, SearchOptions) and bool(options.objectives)
    fingerprint = None if adds_designs_later else designs.fingerprint
    writer.put_experiment(plan, designs, fingerprint)
    return plan


def _listed_facts(experiment: Experiment) -> dict[str, Any]:
    """Return what the listing says about an experiment."""
    family = experiment.family
    first_design = next(iter(family))
    return {
        "vehicle_type": family.vehicle_type,
        "varied": family.varied,
        "fixed": {column: value for column, value in first_design.columns.items() if column not in family.varied},
        "skipped": family.skipped,
        "timeout_s": experiment.timeout_s,
        "speed_m_s": experiment.speed_m_s,
        "yaw_rate_rad_s": experiment.yaw_rate_rad_s,
        "scenic_program": experiment.program_name,
        "scenic_params": dict(experiment.scenic_params),
        "seed": experiment.seed,
        "condition": experiment.condition,
        "variation": dict(experiment.variation),
        "variation_seed": experiment.variation_seed,
        "thresholds": experiment.thresholds,
    }


def _program_facts(environment: ExperimentEnvironment, writer: StoreWriter, environment_id: int) -> dict[str, Any]:
    """Return what the Scenic program says: when a run has passed, and which terrain objects there are."""
    stored = writer.environment_facts(environment_id)
    # An earlier sweep has stored these facts, so that the program need not be compiled for them.
    if "terrain_objects" in stored:
        return {name: stored[name] for name in ("success_rule", "success_defined", "terrain_objects")}
    return {
        "success_rule": environment.success.text,
        "success_defined": environment.success.defined,
        "terrain_objects": environment.terrain_objects,
    }


def _environment_facts(environment: ExperimentEnvironment) -> dict[str, Any]:
    """Return the environment's reality and the files of its program.

    The *reality* has the values of what the simulator cannot know, such as friction; it is None for the nominal values.
    """
    facts: dict[str, Any] = {"reality": environment.reality}
    if environment.reality:
        facts["listed_environment"] = environment.nominal_fingerprint
    # Absolute paths may differ on other machines, so files are stored only if all paths are relative.
    if not any(Path(name).is_absolute() for name in environment.files):
        facts["files"] = dict(environment.files)
    return facts


def _reality_facts(
    experiment: Experiment,
    environment: ExperimentEnvironment,
    writer: StoreWriter,
    environment_id: int,
    program_facts: Mapping[str, Any],
    options: SweepOptions | SearchOptions,
) -> dict[str, Any]:
    """Return the facts about runs in other realities: how many are planned for an experiment, or why there are none.

    Such runs are simulated with other values of friction, servos and obstacles than the listing has. foldcar learns from
    them how real cars may behave.
    """
    stored = writer.experiment_facts(experiment.id)
    if isinstance(options, SearchOptions):
        return _reality_facts_of_search(experiment, stored)
    is_dynamic = writer.is_dynamic(environment_id, lambda: environment.dynamic)
    success = SuccessRule(defined=program_facts["success_defined"], text=program_facts["success_rule"])
    reason = why_no_realities(experiment, environment, options.realities, is_dynamic, success)
    if reason is not None:
        return {"no_realities": reason}
    return reality_facts(experiment, options.realities, stored)


def _reality_facts_of_search(experiment: Experiment, stored: Mapping[str, Any]) -> dict[str, Any]:
    """Return the facts about runs in other realities for a search, which simulates none itself.

    ``stored`` are the facts of the stored experiment. If an earlier sweep has simulated such runs, they are kept.
    """
    if stored.get("reality_spread") == realities_fingerprint(experiment):
        return {"realities": stored["realities"], "reality_spread": stored["reality_spread"]}
    if "no_realities" in stored:
        return {"no_realities": stored["no_realities"]}
    return {"no_realities": "a search chose the designs; `foldcar sweep` simulates them in other realities"}


def _option_facts(options: SweepOptions | SearchOptions) -> dict[str, Any]:
    """Return the facts of an experiment that follow from the options of its sweep or its search.

    An option that was not used gives no fact.
    """
    if isinstance(options, SearchOptions):
        return {"searched": True, "objectives": list(options.objectives)} if options.objectives else {}
    facts: dict[str, Any] = {}
    if options.rule is not None:
        facts["until"] = asdict(options.rule)
    if options.engine:
        facts["engine"] = options.engine
    if options.side_view_limits:
        # The side view simulates both sides of a car as alike.
        facts["unlike_sides"] = options.side_view_limits
    return facts


def study_facts(study: ListedStudy, carsim: Carsim, command: str) -> dict[str, str]:
    """Return what a store keeps of a sweep as a whole: versions, listing, command and time."""
    return {
        "foldcar_version": __version__,
        "scenic_version": scenic_version(),
        "carsim_build": carsim.build,
        "listing_name": decoded(study.listing_name),
        "listing_text": study.listing_text,
        "command": decoded(command),
        "created_utc": datetime.now(timezone.utc).isoformat(timespec="seconds"),
    }
