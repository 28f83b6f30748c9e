"""What is odd of imported trials beside the study in their store: most often a mistyped id."""

from collections import Counter
from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import Any

from foldcar.store.info import ExperimentInfo
from foldcar.store.reader import Store

# Cars that are named.
SHOWN = 5


def swept_experiments(store: Path) -> dict[str, ExperimentInfo]:
    """The experiments of a store by their names in the listing; none if it holds no study, or is not there yet."""
    if not store.exists():
        return {}
    with Store.open(store) as opened:
        if not opened.holds_study():
            return {}
        infos = opened.info().experiments.values()
    return {**{info.listed_id: info for info in infos}, **{info.id: info for info in infos}}


def import_notes(store: Path, trials: Sequence[Mapping[str, Any]]) -> list[str]:
    """A sentence for each experiment, sample and car that the store's study has not."""
    swept = swept_experiments(store)
    notes = []
    for experiment in dict.fromkeys(trial["experiment"] for trial in trials):
        if experiment not in swept:
            if swept:
                known = ", ".join(swept)
                notes.append(f'experiment "{experiment}" was not swept in {store}, only {known}; its trials stand alone')
            if any(trial["experiment"] == experiment and "sample" in trial for trial in trials):
                notes.append(
                    f'experiment "{experiment}" was not swept yet: of which environment its samples are is not known, so '
                    "that no run is ever paired with them; to pair them, sweep first and import then"
                )
            continue
        notes += _unknown_cars(store, swept[experiment], trials)
        most = swept[experiment].environments
        samples = {trial["sample"] for trial in trials if trial["experiment"] == experiment and "sample" in trial}
        for sample in sorted(sample for sample in samples if sample >= most):
            notes.append(f'experiment "{experiment}" was swept in samples 0 to {most - 1}; sample {sample} has no runs')
    return notes


def _unknown_cars(store: Path, info: ExperimentInfo, trials: Sequence[Mapping[str, Any]]) -> list[str]:
    """A sentence for each car that is no design of the experiment, up to SHOWN."""
    with Store.open(store) as opened:
        known = {frozenset(design.items()) for design in opened.designs(info.id).values()}
    counts: Counter[str] = Counter()
    for trial in trials:
        design = trial["design"]
        if trial["experiment"] not in (info.id, info.listed_id):
            continue
        if trial["vehicle_type"] != info.vehicle_type:
            counts[f"a {trial['vehicle_type']}"] += 1
        elif frozenset(design.items()) not in known:
            told = (f"{name} {value:g}" for name, value in design.items() if info.fixed.get(name) != value)
            counts[f"a car of {', '.join(told)}"] += 1
    more = [f"and {len(counts) - SHOWN} other cars that experiment \"{info.id}\" has not"] if len(counts) > SHOWN else []
    return [
        f'experiment "{info.id}" was swept without {car}; it has {number} trial{"" if number == 1 else "s"}'
        for car, number in list(counts.items())[:SHOWN]
    ] + more
