"""Compare an experiment with other simulations of its cars in its samples."""

from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import Any, NamedTuple

from foldcar.evidence.evidence import Evidence
from foldcar.report.page_types import OtherSimulation
from foldcar.simulation.engines import MULTIBODY, engine_title
from foldcar.simulation.results import OUTCOMES
from foldcar.statistics.words import count, percent
from foldcar.store.info import ExperimentInfo
from foldcar.store.reader import Store


def other_simulations(store: Store, evidence: Evidence, experiments: Sequence[Evidence]) -> list[OtherSimulation]:
    """Compare the runs of an experiment with the same runs in other simulations, such as another engine.

    Returns an entry for each of the ``experiments`` that has runs of the same designs in the same samples, driven in the
    same way.
    """
    own_runs = _passed_runs(evidence)
    if not own_runs:
        return []
    own_drives = _identity_of_drives(store, evidence.info)
    simulations: list[OtherSimulation] = []
    for other in experiments:
        if not other.swept or other.info.id == evidence.info.id:
            continue
        if _identity_of_drives(store, other.info) != own_drives:
            continue
        # The index that each design has in the other experiment, None if it lacks the design.
        other_indices = [other.index_of(design) for design in evidence.family]
        common = _common_runs(own_runs, _passed_runs(other), other_indices)
        if not common.number:
            continue
        # The name of a simulation says how it differs from the other one.
        name, own_name = _simulation_name(other.info, evidence.info), _simulation_name(evidence.info, other.info)
        same_runs = count(common.number, "run")
        text = f"{name}: {common.other_passed:,} of the same {same_runs} passed, {own_name}: {common.own_passed:,}"
        if other.info.under == evidence.info.under:
            text += f"; {percent(common.agreeing / common.number, 1)} of the runs have the same result in both"
        # The counts of a design that the other experiment lacks are 0.
        counts = [[0, 0] if index is None else other.run_counts[index].tolist() for index in other_indices]
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


class _CommonRuns(NamedTuple):
    """Runs of the same designs in the same samples in two simulations: how many, how many passed, how many agree."""

    number: int
    own_passed: int
    other_passed: int
    agreeing: int


def _common_runs(
    own_runs: Mapping[tuple[int, int], bool],
    other_runs: Mapping[tuple[int, int], bool],
    other_indices: Sequence[int | None],
) -> _CommonRuns:
    """Count the runs that two simulations have in common.

    ``own_runs`` and ``other_runs`` say whether each run passed, by design and sample. ``other_indices`` has the index of
    each own design among the designs of the other simulation, or None.
    """
    number = own_passed = other_passed = agreeing = 0
    for (design, sample), has_passed in own_runs.items():
        other_index = other_indices[design]
        if other_index is None or (other_index, sample) not in other_runs:
            continue
        has_passed_in_other = other_runs[other_index, sample]
        number += 1
        own_passed += has_passed
        other_passed += has_passed_in_other
        agreeing += has_passed == has_passed_in_other
    return _CommonRuns(number, own_passed, other_passed, agreeing)


def _simulation_name(info: ExperimentInfo, other: ExperimentInfo) -> str:
    """Name the simulation of an experiment by what differs from the other one: its engine, its reality, or both."""
    engine = engine_title(info.engine) or MULTIBODY
    reality = info.under or "nominal"
    if info.engine == other.engine:
        return reality
    if info.under == other.under:
        return engine
    return f"{engine} ({reality})"


def _identity_of_drives(store: Store, info: ExperimentInfo) -> tuple[Any, ...]:
    """Return a key that is equal for two experiments whose cars drive in the same environments and in the same way.

    Their runs differ only by what simulates them. So the key contains neither the engine nor the reality. It does not
    contain the designs either, because those that both experiments have can be compared.
    """
    return (
        info.listed_id,
        store.listed_environment_id(info),
        info.timeout_s,
        info.speed_m_s,
        info.yaw_rate_rad_s,
        info.vehicle_type,
        info.fixed,
        Path(info.scenic_program).name,
        info.scenic_params,
        info.seed,
        info.condition,
        info.variation,
        info.variation_seed,
        info.success_rule if info.success_defined else None,
    )


def _passed_runs(evidence: Evidence) -> dict[tuple[int, int], bool]:
    """Return whether each run that counts passed, by design and sample."""
    runs = evidence.runs.counted
    has_passed = runs.outcome == OUTCOMES.index("passed")
    designs_and_samples = zip(runs.design.tolist(), runs.sample.tolist(), strict=True)
    return dict(zip(designs_and_samples, has_passed.tolist(), strict=True))
