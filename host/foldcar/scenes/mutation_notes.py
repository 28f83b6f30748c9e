"""Finds what stays where it is although the object that it is placed relative to is mutated.

Input: a program. Output: a sentence for each object that `mutate` moves alone. Scenic does not keep what an object was
placed relative to: the program is compiled once more, with each mutated object as random as a mutated Point, so that
the others' dependencies show it (see mutation.py).
"""

from collections.abc import Mapping
from pathlib import Path
from typing import Any

from foldcar.errors import FoldcarError
from foldcar.scenes.program import compile_observed
from foldcar.scenes.program_files import ProgramFiles
from foldcar.scenes.program_globals import named_things


def mutation_notes(program: Path, files: ProgramFiles, params: Mapping[str, Any], scenario: Any) -> list[str]:
    """A sentence for each mutated object of ``scenario``, compiled from ``program``, whose dependents stay."""
    if not any(thing.mutationScale for thing in scenario.objects):
        return []
    mutations = compile_observed(program, files, params).mutations
    try:
        probe = compile_observed(program, files, params, mutations.points | mutations.objects)
    except FoldcarError:
        # The program depends on a place that is fixed, as in `if bump.position.x > 0`.
        return [f"{program}: `mutate` moves objects alone: what is placed relative to them stays"]
    names = {id(thing): name for name, thing in named_things(probe.scenario).items()}
    names[id(probe.scenario.egoObject)] = "ego"
    staying: dict[str, list[str]] = {}
    for moved, stays in probe.mutations.staying():
        staying.setdefault(_called(moved, names), []).append(_called(stays, names))
    return [
        f"{program}: `mutate` moves {moved} alone: {' and '.join(stay)}, placed relative to it, "
        f"stay{'s' if len(stay) == 1 else ''}; what is placed relative to a mutated Point follows"
        for moved, stay in staying.items()
    ]


def _called(thing: Any, names: Mapping[int, str]) -> str:
    line = getattr(thing, "creationLine", ("", 0))[1]
    return names.get(id(thing)) or f"{type(thing).__name__} of line {line}"
