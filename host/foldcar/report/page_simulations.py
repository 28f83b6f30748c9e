"""Compare an experiment with other simulations of its cars in its samples."""

from collections.abc import Sequence
from pathlib import Path
from typing import Any

from foldcar.evidence.evidence import Evidence
from foldcar.report.page_types import OtherSimulation
from foldcar.simulation.engines import MULTIBODY, engine_title
from foldcar.simulation.results import OUTCOMES
from foldcar.statistics.words import count, percent
from foldcar.store.info import ExperimentInfo


def other_simulations(evidence: Evidence, experiments: Sequence[Evidence]) -> list[OtherSimulation]:
    """Return an entry for each other simulation that has runs in common with this one."""
    own_runs = _passed_runs(evidence)
    simulations: list[OtherSimulation] = []
    for other in experiments:
        if other.info.id == evidence.info.id or _samples(other.info) != _samples(evidence.info):
            continue
        indices = [other.index_of(design) for design in evidence.family]
        other_runs = _passed_runs(other)
        pairs = [
            (passed, other_runs[index, sample])
            for (design, sample), passed in own_runs.items()
            if (index := indices[design]) is not None and (index, sample) in other_runs
        ]
        if not pairs:
            continue
        # Each is named by its difference from the other.
        name, own_name = _simulation_name(other.info, evidence.info), _simulation_name(evidence.info, other.info)
        own_passed, passed = (sum(side) for side in zip(*pairs, strict=True))
        text = f"{name}: {passed:,} of the same {count(len(pairs), 'run')} passed, {own_name}: {own_passed:,}"
        if other.info.under == evidence.info.under:
            agreement = percent(sum(own == others for own, others in pairs) / len(pairs), 1)
            text += f"; {agreement} of the runs have the same result in both"
        counts = [(0, 0) if index is None else tuple(other.run_counts[index].tolist()) for index in indices]
        simulations.append(
            {
                "id": other.info.id,
                "name": name,
                "passed": [passed for passed, _ in counts],
                "runs": [runs for _, runs in counts],
                "text": f"{text}.",
            }
        )
    return simulations


def _simulation_name(info: ExperimentInfo, other: ExperimentInfo) -> str:
    """Name an experiment's simulation by its difference from the other's: its engine, or its reality."""
    if info.engine != other.engine:
        return engine_title(info.engine) or MULTIBODY
    return info.under or "nominal"


def _samples(info: ExperimentInfo) -> tuple[Any, ...]:
    """Return a key that is equal for two experiments with the same cars and samples."""
    program = Path(info.scenic_program).name
    shared = (info.listed_id, info.vehicle_type, info.fixed, program, info.scenic_params, info.seed)
    return *shared, info.condition, info.variation, info.variation_seed, info.success_defined and info.success_rule


def _passed_runs(evidence: Evidence) -> dict[tuple[int, int], bool]:
    """Return whether each run that counts passed, by design and sample."""
    runs = evidence.runs.counted
    passed = runs.outcome == OUTCOMES.index("passed")
    return dict(zip(zip(runs.design.tolist(), runs.sample.tolist(), strict=True), passed.tolist(), strict=True))
