"""Makes `mutate` take Points, and what is placed relative to a mutated Point follow it.

Scenic computes an object's place when the object is created, and adds the noise of `mutate` to the named object alone
when it samples; it refuses Points. Here a mutated Point takes its place from a hidden copy of itself, to which Scenic
adds the noise, so that whatever is placed relative to the Point inherits it. `mutate` comes after the Point: a program
that mutates Points is compiled twice, the first time to learn which.

Input: the calls of `new` and `mutate` of a program that is compiled. Output: things with noise; which things do not
follow the mutated objects that they are placed relative to. Scenic does not keep what an object was placed relative to:
for that the program is compiled once more, with each mutated object as random as a mutated Point.
"""

from collections.abc import Callable, Collection, Iterator, Mapping, Sequence
from pathlib import Path
from typing import Any

from scenic.core.distributions import AttributeDistribution, Samplable, needsSampling
from scenic.core.errors import InvalidScenarioError
from scenic.core.object_types import Object, Point
from scenic.core.specifiers import Specifier
from scenic.core.vectors import Vector

from foldcar.errors import FoldcarError
from foldcar.scenes.program import compile_observed, named_things
from foldcar.scenes.program_files import ProgramFiles

# The properties that noise changes, with their types; the rest of a pose is derived from them.
NOISY = {"position": Vector, "yaw": float, "pitch": float, "roll": float}


class Mutations:
    """What one compilation creates and mutates, by number in order of creation.

    ``followed`` are the numbers of things that are to take their place from a copy.
    """

    def __init__(self, followed: Collection[int] = ()) -> None:
        self._followed = frozenset(followed)
        self._created: list[Any] = []
        self._numbers: dict[int, int] = {}  # of things by id
        self._copies: dict[int, Any] = {}
        self._mutated: dict[int, Any] = {}

    @property
    def points(self) -> set[int]:
        """The numbers of the mutated Points and OrientedPoints."""
        return {number for number, thing in self._mutated.items() if not isinstance(thing, Object)}

    @property
    def objects(self) -> set[int]:
        """The numbers of the mutated Objects."""
        return set(self._mutated) - self.points

    def create(self, cls: Any, specifiers: list[Any]) -> Any:
        """The new instance of a Scenic class."""
        number = len(self._created)
        # The number is taken first, because a property's default may create things too.
        self._created.append(None)
        if number in self._followed:
            copy = self._copies[number] = cls._withSpecifiers(specifiers, register=False)
            # As Scenic's `mutate` does: it has to be sampled even if it depends on nothing random.
            copy._needsSampling = copy._isLazy = True
            specifiers = [_place_of(copy, specifiers)]
        thing = self._created[number] = cls._withSpecifiers(specifiers)
        self._numbers[id(thing)] = number
        return thing

    def mutate_points(self, things: Sequence[Any], scale: Any) -> list[Any]:
        """Mutate the Points of ``things``; the rest, for Scenic's own `mutate`. Raises TypeError like that one."""
        points = [thing for thing in things if isinstance(thing, Point) and not isinstance(thing, Object)]
        if points and not isinstance(scale, int | float):
            raise TypeError('"mutate X by Y" with Y not a number')
        for point in points:
            self.note(point)
            if self._followed:
                number = self._numbers.get(id(point))
                if number not in self._copies:
                    raise InvalidScenarioError("the program mutates other Points whenever it is compiled")
                self._copies[number].mutationScale = scale
        return [thing for thing in things if not any(thing is point for point in points)]

    def note(self, thing: Any) -> None:
        """Remember that ``thing`` is mutated."""
        number = self._numbers.get(id(thing))
        if number is not None:
            self._mutated[number] = thing

    def staying(self) -> list[tuple[Any, Any]]:
        """Pairs of a mutated Object that takes its place from a copy, and a thing relative to it that is not mutated."""
        copies = {id(copy): self._mutated[one] for one, copy in self._copies.items() if one in self.objects}
        free = [thing for one, thing in enumerate(self._created) if thing is not None and one not in self._mutated]
        return [(copies[id(node)], thing) for thing in free for node in reachable(thing) if id(node) in copies]


def _place_of(copy: Any, specifiers: Sequence[Any]) -> Any:
    """The specifier of what ``specifiers`` specify for ``copy``, and of the place it has when noise is added."""
    specified = {name for one in specifiers for name in one.priorities} - {"mutationScale"}
    values = {name: getattr(copy, name) for name in copy.properties if name in specified}
    for name, kind in NOISY.items():
        if name in copy.properties:
            values[name] = AttributeDistribution(name, copy, kind)
    return Specifier("mutated", dict.fromkeys(values, 1), values)


def reachable(root: Any, stop: Callable[[Any], bool] = lambda node: False) -> Iterator[Any]:
    """Every random value on which ``root`` depends, itself included, each once, but for those at which to ``stop``."""
    seen: set[int] = set()
    waiting = [root]
    while waiting:
        node = waiting.pop()
        if id(node) in seen or not isinstance(node, Samplable) or not needsSampling(node) or stop(node):
            continue
        seen.add(id(node))
        # Scenic's pruning conditions distributions too, in order to narrow them.
        waiting += [*node._dependencies, *node._conditioned._dependencies]
        yield node


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
        staying.setdefault(called(moved, names), []).append(called(stays, names))
    return [
        f"{program}: `mutate` moves {moved} alone: {' and '.join(stay)}, placed relative to it, "
        f"stay{'s' if len(stay) == 1 else ''}; what is placed relative to a mutated Point follows"
        for moved, stay in staying.items()
    ]


def called(thing: Any, names: Mapping[int, str]) -> str:
    """Its name among ``names`` by ids, else what it is and where it is made."""
    line = getattr(thing, "creationLine", ("", 0))[1]
    return names.get(id(thing)) or f"{type(thing).__name__} of line {line}"
