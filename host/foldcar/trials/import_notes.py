"""What is odd of imported trials beside the study in their store: most often a mistyped id."""

from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import Any

from foldcar.store.reader import Store


def import_notes(store: Path, trials: Sequence[Mapping[str, Any]]) -> list[str]:
    """A sentence for each experiment, and for each sample, that the store's study has not; none without a study."""
    with Store.open(store) as opened:
        if not opened.holds_study():
            return []
        swept = opened.info().experiments
    notes = []
    for experiment in dict.fromkeys(trial["experiment"] for trial in trials):
        if experiment not in swept:
            known = ", ".join(swept)
            notes.append(f'experiment "{experiment}" was not swept in {store}, only {known}; its trials stand alone')
            continue
        most = swept[experiment].environments
        samples = {trial["sample"] for trial in trials if trial["experiment"] == experiment and "sample" in trial}
        for sample in sorted(sample for sample in samples if sample >= most):
            notes.append(f'experiment "{experiment}" was swept in samples 0 to {most - 1}; sample {sample} has no runs')
    return notes
