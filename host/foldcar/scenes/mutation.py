"""Lets `mutate` accept Points, and lets objects that are placed relative to a mutated Point follow it.

Scenic computes an object's place when the object is created, and adds the noise of `mutate` to the named object alone
when it samples; it refuses Points. Here a mutated Point takes its place from a hidden copy of itself, to which Scenic
adds the noise. Objects that are placed relative to the Point inherit it. `mutate` comes after the Point, so a program
that mutates Points is compiled twice, the first time to find these Points.

Input: the calls of `new` and `mutate` of a program that is compiled. Output: things with noise.
"""

from collections.abc import Collection, Sequence
from typing import Any

from scenic.core.distributions import AttributeDistribution
from scenic.core.errors import InvalidScenarioError
from scenic.core.object_types import Object, Point
from scenic.core.specifiers import Specifier
from scenic.core.vectors import Vector

from foldcar.scenes import scenic_private

# The properties that noise changes, with their types; the rest of a pose is derived from them.
NOISY = {"position": Vector, "yaw": float, "pitch": float, "roll": float}


class Mutations:
    """The objects that one compilation of a program creates, numbered in the order of creation.

    ``points`` are the numbers of the Points that the program mutates. ``followed`` are those of the Points that take
    their place from a hidden copy (see the head of this file).
    """

    def __init__(self, followed: Collection[int] = ()) -> None:
        self.points: set[int] = set()
        self._followed = frozenset(followed)
        # All created things, in the order of their numbers. They are kept, because an id is unique only while a thing
        # lives.
        self._created: list[Any] = []
        self._number_by_id: dict[int, int] = {}
        # The hidden copies, by the numbers of their Points.
        self._copies: dict[int, Any] = {}

    def create(self, cls: Any, specifiers: list[Any]) -> Any:
        """Create an instance of a Scenic class, like Scenic's `new`.

        Some Points are mutated by the program. For such a Point two things are created: first a hidden copy, to which
        Scenic will add noise, and then the Point itself, which is placed where the copy is.
        """
        number = len(self._created)
        # Take the number first: computing the default of a property may create further things.
        self._created.append(None)
        if number in self._followed:
            copy = self._copies[number] = scenic_private.made(cls, specifiers, is_object=False)
            # The copy must be sampled even if it depends on nothing random, because it gets noise.
            scenic_private.sample_always(copy)
            specifiers = [_place_of(copy, specifiers)]
        thing = self._created[number] = scenic_private.made(cls, specifiers)
        self._number_by_id[id(thing)] = number
        return thing

    def mutate_points(self, things: Sequence[Any], scale: Any) -> list[Any]:
        """Add noise to the Points among ``things``. Return the other things, which Scenic's own `mutate` can handle.

        ``scale`` is the scale of the noise. Like Scenic's `mutate`, this raises TypeError if it is not a number.
        """
        points = [thing for thing in things if isinstance(thing, Point) and not isinstance(thing, Object)]
        if points and not isinstance(scale, int | float):
            raise TypeError('"mutate X by Y" with Y not a number')
        for point in points:
            number = self._number_by_id.get(id(point))
            if number is not None:
                self.points.add(number)
            if self._followed:
                # The Point takes its place from its hidden copy, so the copy gets the noise.
                if number not in self._copies:
                    raise InvalidScenarioError("the program mutates other Points whenever it is compiled")
                self._copies[number].mutationScale = scale
        return [thing for thing in things if not any(thing is point for point in points)]


def _place_of(copy: Any, specifiers: Sequence[Any]) -> Any:
    """Return a specifier that places a Point where its hidden ``copy`` is, including the copy's noise.

    ``specifiers`` are those that the program gives to the Point. The properties that they set are taken from the copy,
    too.
    """
    # The copy has the noise already, so the Point must not have a "mutationScale" of its own.
    specified = {name for specifier in specifiers for name in specifier.priorities} - {"mutationScale"}
    values = {name: getattr(copy, name) for name in copy.properties if name in specified}
    for name, kind in NOISY.items():
        if name in copy.properties:
            values[name] = AttributeDistribution(name, copy, kind)
    # Scenic gives the priority 1 to a property that a program sets by `with`. These properties get it, too.
    return Specifier("mutated", dict.fromkeys(values, 1), values)
