"""A sweep: simulates every design of every experiment in every environment that the store lacks.

Input: a study, a store's path, a simulator. Output: rows in the store and their counts. Only the calling thread samples,
plans and writes; workers wait for simulator processes. Dynamic programs run with Scenic beside the simulation, all
others in carsim's batch.
"""

from collections.abc import Callable, Iterator, Mapping, Sequence
from dataclasses import asdict
from datetime import datetime, timezone
from pathlib import Path

from foldcar import __version__
from foldcar.analysis.stopping import StoppingRule
from foldcar.errors import FoldcarError
from foldcar.interrupts import delayed
from foldcar.scenes.fingerprint import scenic_version
from foldcar.shown_text import decoded
from foldcar.simulation.carsim import Carsim
from foldcar.simulation.engines import ENGINES, SIDE_VIEW
from foldcar.simulation.results import outcome_of
from foldcar.simulation.simulators import Simulators
from foldcar.store.info import unlike_sides_text
from foldcar.store.writer import PlannedExperiment, StoreWriter, write_store
from foldcar.study.chunks import ChunkPool, FinishedRun
from foldcar.study.environments import Environment
from foldcar.study.experiment_runs import ExperimentRuns
from foldcar.study.experiments import Experiment, Study
from foldcar.study.family import Family
from foldcar.study.planned_designs import PlannedDesigns, planned_designs
from foldcar.study.progress import Progress
from foldcar.study.stopping import design_states
from foldcar.study.unlike_sides import unlike_sides

# Cars that cannot be built: how many are announced by name.
SHOWN_SKIPPED = 5


def sweep(
    study: Study,
    store: Path,
    carsim: Carsim,
    simulators: Simulators | int,
    command: str,
    report: Callable[[Progress], None] = lambda progress: None,
    progress: Progress | None = None,
    announce: Callable[[str], None] = lambda line: None,
    environment_of: Callable[[Experiment], Environment] = Environment,
    until: Mapping[str, StoppingRule] | None = None,
    designs: Mapping[str, PlannedDesigns] | None = None,
) -> Progress:
    """Simulate the missing runs; ``report`` is called after every step; ``progress``, if given, is updated.

    ``simulators`` is where they are simulated, or how many simulators there are on this machine. ``announce``
    is given what holds for the sweep, a line at a time, before its first run. ``environment_of`` makes the environments:
    those of a calibration are others. ``until`` holds, by experiment, when a design needs no more runs; ``designs`` its
    designs, if they are known.

    Nothing is written before every design and, for a new store, every environment has been checked. FoldcarError.
    """
    table = carsim.parameter_table()
    designs = planned_designs(study, store, table) if designs is None else designs
    counts = progress if progress is not None else Progress(total=planned_total(study))
    environments = [environment_of(experiment) for experiment in study.experiments]
    if not store.exists():
        for environment in environments:
            environment.sample(0)
    if until:
        _check_success(study, environments)
    unlike = {}
    if carsim.engine == ENGINES[SIDE_VIEW].title:
        for experiment, environment in zip(study.experiments, environments, strict=True):
            unlike[experiment.id] = unlike_sides(carsim, experiment, environment)
    with write_store(store) as writer:
        writer.begin_study(study_facts(study, carsim, command), carsim.build)
        plans = [
            plan_experiment(
                experiment,
                environment,
                writer,
                designs[experiment.id],
                (until or {}).get(experiment.id),
                carsim.engine,
                unlike=unlike.get(experiment.id, ""),
            )
            for experiment, environment in zip(study.experiments, environments, strict=True)
        ]
        counts.judged = sum(
            len(experiment.family) * plan.environments
            for experiment, plan in zip(study.experiments, plans, strict=True)
            if plan.facts["success_defined"]
        )
        for line in _rules(plans):
            announce(line)
        for name, what in unlike.items():
            if what:
                announce(f"experiment {name}: {unlike_sides_text(what)}")
        for plan in plans if until and carsim.engine else ():
            if writer.multibody_counts(plan) is None:
                announce(f"experiment {plan.id}: no multibody runs in the store: designs in the listing's order")
        for experiment in study.experiments:
            for line in skipped_lines(experiment.id, experiment.family):
                announce(line)
        with ChunkPool(writer, simulators, carsim.limits().numbers) as pool:
            for experiment, plan, environment in zip(study.experiments, plans, environments, strict=True):
                dynamic = is_dynamic(plan.environment_id, environment, writer)
                rule, rejected = (until or {}).get(plan.id), counts.rejected
                with environment.runner(carsim, dynamic) as runner, pool.using(runner):
                    runs = ExperimentRuns(plan, environment, dynamic, writer, pool, counts, report)
                    for finished in runs.all() if rule is None else runs.until(rule):
                        _keep(finished, writer, counts, report)
                    if rule is not None:
                        counts.states += design_states(experiment, rule, writer.design_counts(plan))
                    if runner is not carsim:
                        # This runner is closed at the end of its experiment.
                        for finished in pool.finish():
                            _keep(finished, writer, counts, report)
                # Only a program that runs beside the simulation rejects: these runs are finished.
                if plan.facts["success_defined"]:
                    counts.judged -= counts.rejected - rejected
            for finished in pool.finish():
                _keep(finished, writer, counts, report)
    if until:
        counts.judged = counts.total - counts.rejected
    return counts


def _check_success(study: Study, environments: Sequence[Environment]) -> None:
    """FoldcarError if an experiment does not define when a run has passed."""
    for experiment, environment in zip(study.experiments, environments, strict=True):
        if not environment.success.defined:
            raise FoldcarError(f"{experiment.place}: --until has nothing to decide: {environment.success.text}")


def planned_total(study: Study) -> int:
    """The number of runs of the study, stored or not."""
    return sum(len(experiment.family) * experiment.environments for experiment in study.experiments)


def _keep(
    finished: list[FinishedRun], writer: StoreWriter, counts: Progress, report: Callable[[Progress], None]
) -> None:
    # The counts are of what is stored, also when a signal ends the sweep.
    with delayed():
        writer.add_results((one.run, one.answer) for one in finished)
        counts.new += len(finished)
        for one in finished:
            counts.count(outcome_of(one.answer), one.count)
    report(counts)


def is_dynamic(environment_id: int, environment: Environment, writer: StoreWriter) -> bool:
    """Whether the program is dynamic, from the store, or else from compiling the program."""
    dynamic = writer.is_dynamic(environment_id)
    if dynamic is None:
        dynamic = environment.dynamic
        writer.put_dynamic(environment_id, dynamic)
    return dynamic


def plan_experiment(
    experiment: Experiment,
    environment: Environment,
    writer: StoreWriter,
    designs: PlannedDesigns,
    rule: StoppingRule | None = None,
    engine: str = "",
    searched: bool = False,
    unlike: str = "",
) -> PlannedExperiment:
    """Record an experiment and its family's designs, replacing an earlier one of that id. FoldcarError.

    ``rule``, ``engine``, ``searched`` and ``unlike`` are ExperimentInfo's ``until``, ``engine``, ``searched`` and
    ``unlike_sides``.
    """
    first = next(iter(experiment.family))
    varied = experiment.family.varied
    environment.recall(writer.program_files(experiment.id), writer.knows_environment)
    environment_id = writer.environment(environment.fingerprint)
    success_rule, defined = writer.success_rule(environment_id) or (environment.success.text, environment.success.defined)
    plan = PlannedExperiment(
        id=experiment.id,
        vehicle=experiment.family.vehicle,
        environment=experiment.environment,
        environment_id=environment_id,
        spread_id=writer.spread(environment.spread_fingerprint),
        environments=experiment.environments,
        facts={
            "vehicle_type": experiment.family.vehicle_type,
            "varied": varied,
            "fixed": {column: value for column, value in first.columns.items() if column not in varied},
            "timeout_s": experiment.timeout_s,
            "speed_m_s": experiment.speed_m_s,
            "yaw_rate_rad_s": experiment.yaw_rate_rad_s,
            "scenic_program": experiment.program_name,
            "scenic_params": dict(experiment.scenic_params),
            "seed": experiment.seed,
            "condition": experiment.condition,
            "variation": dict(experiment.variation),
            "variation_seed": experiment.variation_seed,
            "skipped": experiment.family.skipped,
            "success_rule": success_rule,
            "success_defined": defined,
            "calibration": environment.calibration,
            **({"listed_environment": environment.listed_fingerprint} if environment.calibration else {}),
            "thresholds": experiment.thresholds,
            **({} if rule is None else {"until": asdict(rule)}),
            **({"searched": True} if searched else {}),
            **({"engine": engine} if engine else {}),
            **({"unlike_sides": unlike} if unlike else {}),
            # Elsewhere the others lie elsewhere.
            **({} if any(Path(name).is_absolute() for name in environment.files) else {"files": dict(environment.files)}),
        },
    )
    # A search adds designs later.
    writer.put_experiment(plan, designs, None if searched else designs.fingerprint)
    return plan


def skipped_lines(experiment: str, family: Family) -> list[str]:
    """Which cars of the family are not simulated because they cannot be built, and why; nothing if all can."""
    skipped = family.skipped
    if not skipped:
        return []
    count = len(family) + len(skipped)
    more = [f"  and {len(skipped) - SHOWN_SKIPPED} more"] if len(skipped) > SHOWN_SKIPPED else []
    head = f"experiment {experiment}: {len(skipped)} of {count} cars cannot be built and are skipped:"
    return [head, *(f"  {one}" for one in skipped[:SHOWN_SKIPPED]), *more]


def _rules(plans: Sequence[PlannedExperiment]) -> Iterator[str]:
    """When a run has passed, a line for the experiments that share the rule."""
    experiments: dict[str, list[str]] = {}
    for plan in plans:
        experiments.setdefault(plan.facts["success_rule"], []).append(plan.id)
    for rule, names in experiments.items():
        yield f"experiment{'s' if len(names) > 1 else ''} {', '.join(names)}: {rule}"


def study_facts(study: Study, carsim: Carsim, command: str) -> dict[str, str]:
    """What a store keeps of a sweep: versions, listing, command, time."""
    return {
        "foldcar_version": __version__,
        "scenic_version": scenic_version(),
        "carsim_build": carsim.build,
        "listing_name": decoded(study.listing_name),
        "listing_text": study.listing_text,
        "command": decoded(command),
        "created_utc": datetime.now(timezone.utc).isoformat(timespec="seconds"),
    }
