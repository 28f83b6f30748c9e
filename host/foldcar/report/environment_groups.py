"""Experiments that differ in one number of their environment only: what one figure can show together.

Input: the experiments of a store. Output: groups by the parameter of the Scenic program in which they differ.
"""

from collections.abc import Iterable, Mapping
from dataclasses import dataclass, fields
from typing import Any

from foldcar.store.info import ExperimentInfo

# What may differ between experiments of one group, or differs with the number of their runs.
FREE = {
    "id", "vehicle", "environment", "scenic_params", "environments", "planned_runs", "stored_runs", "thresholds", "until",
    "designs", "decided", "skipped", "calibration", "listed_environment", "unlike_sides",
}  # fmt: skip


@dataclass(frozen=True)
class EnvironmentGroup:
    """Experiments with stored runs by their value of ``parameter``, ascending; ``remarks`` say which were left out."""

    parameter: str
    others: Mapping[str, Any]
    experiments: Mapping[float, ExperimentInfo]
    remarks: tuple[str, ...]


def environment_groups(infos: Iterable[ExperimentInfo]) -> list[EnvironmentGroup]:
    """The groups of at least two values, in the order in which their first experiments stand.

    Experiments of a group have the same cars, program, seed, settings and calibration; the numbers of samples may differ.
    """
    with_success = [info for info in infos if info.success_defined]
    found: dict[tuple[str, str], list[ExperimentInfo]] = {}
    for info in with_success:
        for name, value in info.scenic_params.items():
            if _number(value):
                found.setdefault((name, _rest(info, name)), []).append(info)
    groups = []
    for (name, rest), members in found.items():
        by_value: dict[float, ExperimentInfo] = {}
        # Of experiments that are alike, the one with most runs.
        for info in sorted(members, key=lambda one: -one.stored_runs):
            if info.stored_runs:
                by_value.setdefault(float(info.scenic_params[name]), info)
        if len(by_value) < 2:
            continue
        unset = [one for one in with_success if name not in one.scenic_params and _rest(one, name) == rest]
        others = {key: value for key, value in members[0].scenic_params.items() if key != name}
        kept = dict(sorted(by_value.items()))
        groups.append(EnvironmentGroup(name, others, kept, tuple(_remarks(name, members, kept, unset))))
    return groups


def _remarks(
    name: str, members: list[ExperimentInfo], kept: Mapping[float, ExperimentInfo], unset: list[ExperimentInfo]
) -> list[str]:
    said = list(dict.fromkeys(info.warning for info in kept.values() if info.warning))
    for info in members:
        if info in kept.values():
            continue
        instead = kept.get(float(info.scenic_params[name]))
        why = "has no runs yet" if instead is None else f"has the same environment as {instead.id}, which has more runs"
        said.append(f"Experiment {info.id} {why}; it is not drawn.")
    said += [
        f"Experiment {info.id} does not set {name}: the program's own value is not in the store; it is not drawn."
        for info in unset
    ]
    return said


def _number(value: Any) -> bool:
    return isinstance(value, int | float) and not isinstance(value, bool)


def _rest(info: ExperimentInfo, name: str) -> str:
    """All by which an experiment must be like another one, but the parameter ``name``, as a text to compare."""
    facts = {field.name: getattr(info, field.name) for field in fields(info) if field.name not in FREE}
    calibration = None if info.calibration is None else info.calibration["fingerprint"]
    others = {key: value for key, value in info.scenic_params.items() if key != name}
    return repr([sorted(facts.items()), calibration, sorted(others.items())])
