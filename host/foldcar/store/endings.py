"""When the sweeps of one experiment stopped, in stores that are merged: what is true of all their runs together.

Input: how each sweep ended. Output: the facts of the experiment that say so. What would be false is an error.
"""

import json
from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any

from foldcar.store.errors import StoreError

# An experiment's facts of ExperimentInfo on its end.
ENDING_FACTS = ("until", "ended_runs")


@dataclass(frozen=True)
class Ending:
    """How the sweep of an experiment ended in a store: its number of environments, and the facts, None without."""

    store: Path
    environments: int
    until: Any
    ended_runs: int | None


def merged_ending(name: str, endings: Sequence[Ending], environments: int, designs: int, runs: int) -> dict[str, Any]:
    """The facts of the experiment ``name`` with the ``runs`` of all stores, and the most ``environments``.

    If all runs of a sweep that was to make them are there, results had no say in their number: they are such a sweep's.
    Else, if sweeps stopped by a rule, they are a sweep's that stops by it, whose intervals hold at any number of runs;
    that it has ended is true only of the runs that one of them ended with. StoreError if there are several rules.
    """
    stopped = [one for one in endings if one.until is not None]
    planned = any(one.until is None and one.environments == environments for one in endings)
    if not stopped or (planned and runs == designs * environments):
        return {}
    first = stopped[0]
    for one in stopped:
        if one.until != first.until:
            raise StoreError(
                f'experiment "{name}": until is {json.dumps(one.until)} in {one.store}, {json.dumps(first.until)} in '
                f"{first.store}: no one rule says which runs there are; first sweep one of them without --until"
            )
    ended = any((one.environments, one.ended_runs) == (environments, runs) for one in stopped)
    return {"until": first.until, **({"ended_runs": runs} if ended else {})}
