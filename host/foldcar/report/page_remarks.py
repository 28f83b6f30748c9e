"""What a reader must know of an experiment's numbers beside the numbers: what is missing, left out or of another kind."""

import shlex
from collections.abc import Sequence
from typing import TYPE_CHECKING, Any

from foldcar.advice.design_evidence import in_family
from foldcar.advice.evidence import Evidence
from foldcar.analysis.stopping import LEAST_CHANCE
from foldcar.analysis.words import count
from foldcar.simulation.engines import MULTIBODY, engine_title
from foldcar.simulation.results import OUTCOMES
from foldcar.store.calibrations import calibrations
from foldcar.store.info import ExperimentInfo
from foldcar.store.reader import Store

if TYPE_CHECKING:
    from foldcar.report.page_data import Experiment

# Different messages of failed runs, and skipped cars, that are shown.
SHOWN = 3


def remarks(store: Store, one: "Experiment") -> list[str]:
    """Return the remarks on an experiment. Raises StoreError."""
    info, evidence = one.info, one.evidence
    ends = dict(zip(OUTCOMES, evidence.outcome_counts.sum(axis=0).tolist(), strict=True))
    found = stopped_remarks(info)
    if ends["terminated"] and info.success_defined:
        found.append(
            f"The program itself ended {ends['terminated']:,} of {info.stored_runs:,} runs; they count as not passed."
        )
    if info.skipped:
        more = f"; and {len(info.skipped) - SHOWN} more" if len(info.skipped) > SHOWN else ""
        shown = "; ".join(info.skipped[:SHOWN]) + more
        found.append(f"{count(len(info.skipped), 'car')} of the family cannot be built: {shown}.")
    strange = sum(not in_family(info, trial.vehicle_type, trial.design) for trial in one.trials)
    if strange:
        found.append(f"{count(strange, 'trial')} of cars that do not belong to this family count in no rate here.")
    passed, number = one.columns.simulated_trial_counts.sum(axis=0).tolist()
    if number:
        found.append(f"SIMULATED trials, which count in no rate: {passed} of {number} of simulated cars passed.")
    for calibration in calibrations(store):
        if calibration.experiment == info.id:
            findings = " ".join(calibration.summary["findings"])
            found.append(f"Calibration {calibration.name} ({calibration.created_utc}, UTC): {findings}")
    return [*one.selection.remarks, *found, *_failures(store, info, ends["failed"])]


def _failures(store: Store, info: ExperimentInfo, failed: int) -> list[str]:
    if not failed:
        return []
    messages = store.failures([info.id])
    shown = "; ".join(f"{number} x {message}" for message, number in messages[:SHOWN])
    more = f"; and {len(messages) - SHOWN} other messages" if len(messages) > SHOWN else ""
    command = shlex.join(["foldcar", "export", str(store.path), "--failed", "--csv", "-"])
    counted = ", and count as not passed" if info.success_defined else ""
    return [f"{failed:,} of {info.stored_runs:,} runs failed{counted}: {shown}{more}. List them: {command}"]


def stopped_remarks(info: ExperimentInfo) -> list[str]:
    """How many designs are decided, and how to read their rates; nothing after a sweep of all runs."""
    if info.searched:
        early = (
            " It left designs early that did worse than the best: of those that would have ended as good, at most 10 %."
        )
        return [
            "A search chose these designs, so rates of its best are too good as a rule: believe those in fresh "
            "environments." + (early if len(info.objectives) == 1 else "")
        ]
    if info.until is None:
        return []
    undecided = info.designs - info.decided
    rest = ""
    if undecided:
        left = f", or left before when those would decide with a chance below {100 * LEAST_CHANCE:g} %"
        why = left if info.until.thresholds else ""
        rest = f"; {undecided} are undecided, simulated in all {info.environments} environments{why}"
    if info.stored_runs < info.planned_runs:
        rest = f"; {undecided} are not yet" if undecided else ""
    away = "the thresholds" if info.until.thresholds else "50 %"
    most = info.designs * info.environments
    return [
        f"The sweep stopped simulating a design when {info.until.text}: {info.decided} of {info.designs} designs are "
        f"decided{rest}. {info.stored_runs} of at most {most} runs were made.",
        "Intervals are anytime-valid (Beta-binomial mixture): each holds for its design at whatever number of runs it "
        "stopped, by itself and not for all designs together. Rates of designs that stopped early lie on average "
        f"somewhat too far from {away}. Rates over several designs count each design alike.",
    ]


def other_simulations(evidence: Evidence, experiments: Sequence[Evidence]) -> list[dict[str, Any]]:
    """For each other engine or calibration of the same cars in the same samples, what page_data.py calls ``engines``.

    Without runs that both judged there is no entry.
    """
    own_runs, found = _passed_runs(evidence), []
    for other in experiments:
        if other.info.id == evidence.info.id or _samples(other.info) != _samples(evidence.info):
            continue
        places = {tuple(sorted(one.design.items())): at for at, one in enumerate(other.family)}
        place = [places.get(tuple(sorted(one.design.items()))) for one in evidence.family]
        other_runs = _passed_runs(other)
        pairs = [
            (passed, other_runs[at, sample])
            for (design, sample), passed in own_runs.items()
            if (at := place[design]) is not None and (at, sample) in other_runs
        ]
        if not pairs:
            continue
        name, own_name = _simulation(other.info, evidence.info), _simulation(evidence.info, other.info)
        own_passed, passed = (sum(side) for side in zip(*pairs, strict=True))
        text = f"{name}: {passed:,} of the same {len(pairs):,} runs passed, {own_name}: {own_passed:,}"
        if other.info.under == evidence.info.under:
            alike = 100 * sum(own == others for own, others in pairs) / len(pairs)
            text += f"; {alike:.1f} % of the runs have the same result in both"
        counts = [(0, 0) if at is None else tuple(other.run_counts[at].tolist()) for at in place]
        columns = {key: [count[k] for count in counts] for k, key in enumerate(("passed", "runs"))}
        found.append({"id": other.info.id, "name": name, **columns, "text": f"{text}."})
    return found


def _simulation(info: ExperimentInfo, other: ExperimentInfo) -> str:
    """What tells an experiment's simulation apart from the other's: its engine, or what it was simulated under."""
    if info.engine != other.engine:
        return engine_title(info.engine) or MULTIBODY
    return info.under or "nominal"


def _samples(info: ExperimentInfo) -> tuple[Any, ...]:
    """What two experiments have in common whose cars and samples are the same."""
    what = (info.listed_id, info.vehicle_type, info.fixed, info.scenic_program, info.scenic_params, info.seed)
    return *what, info.condition, info.variation, info.variation_seed, info.success_defined and info.success_rule


def _passed_runs(evidence: Evidence) -> dict[tuple[int, int], bool]:
    """Whether each run that counts passed, by its design and sample."""
    runs = evidence.runs.counted
    passed = runs.outcome == OUTCOMES.index("passed")
    return dict(zip(zip(runs.design.tolist(), runs.sample.tolist(), strict=True), passed.tolist(), strict=True))
