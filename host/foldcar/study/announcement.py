"""What a sweep says before its first run: when a run passes, what is odd about an environment, which cars are skipped."""

from collections import defaultdict
from collections.abc import Iterator, Mapping, Sequence

from foldcar.statistics.words import count
from foldcar.store.info import side_view_warning
from foldcar.store.writer import PlannedExperiment
from foldcar.study.environments import ExperimentEnvironment
from foldcar.study.experiments import Experiment

# Number of cars that cannot be built and are announced by name.
SHOWN_SKIPPED = 5


def success_lines(plans: Sequence[PlannedExperiment]) -> Iterator[str]:
    """Yield a line for each rule of success, with the experiments that have this rule."""
    experiments_by_rule: dict[str, list[str]] = defaultdict(list)
    for plan in plans:
        experiments_by_rule[plan.facts["success_rule"]].append(plan.id)
    for rule, names in experiments_by_rule.items():
        noun = "experiment" if len(names) == 1 else "experiments"
        yield f"{noun} {', '.join(names)}: {rule}"


def environment_lines(experiment: Experiment, environment: ExperimentEnvironment) -> Iterator[str]:
    """Yield a line for each remark on an environment."""
    for note in environment.notes():
        yield f"experiment {experiment.id}: {note}"


def engine_lines(limits_by_experiment: Mapping[str, str]) -> Iterator[str]:
    """Yield a line for each experiment that the side view cannot simulate as it is.

    ``limits_by_experiment`` says by the experiment's id what the side view leaves out.
    """
    for experiment_id, reason in limits_by_experiment.items():
        if reason:
            yield f"experiment {experiment_id}: {side_view_warning(reason)}"


def skipped_lines(experiment: Experiment) -> Iterator[str]:
    """Yield lines about the cars of an experiment that cannot be built; none if all can."""
    skipped = experiment.family.skipped
    if not skipped:
        return
    cars = count(len(experiment.family) + len(skipped), "car")
    verb = "is" if len(skipped) == 1 else "are"
    yield f"experiment {experiment.id}: {len(skipped)} of {cars} cannot be built and {verb} skipped:"
    for car in skipped[:SHOWN_SKIPPED]:
        yield f"  {car}"
    if len(skipped) > SHOWN_SKIPPED:
        yield f"  and {len(skipped) - SHOWN_SKIPPED} more, which `foldcar sweep --dry-run` lists"
