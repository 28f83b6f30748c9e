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

    A program is compiled twice if it mutates Points. After the first compilation, ``mutated_points`` has the numbers of
    these Points. The second compilation gets these numbers as ``points_with_copy``: each of these Points gets a *hidden
    copy*, an object that the program does not know. Scenic adds the noise to the copy, and the Point takes its place
    from the copy.
    """

    def __init__(self, points_with_copy: Collection[int] = ()) -> None:
        self.mutated_points: set[int] = set()
        self._points_with_copy = frozenset(points_with_copy)
        # All created things, in the order of their numbers. They are kept, because an id is unique only while a thing
        # lives.
        self._created: list[Any] = []
        self._number_by_id: dict[int, int] = {}
        # The hidden copies, by the numbers of their Points.
        self._copies: dict[int, Any] = {}

    def create(self, cls: Any, specifiers: list[Any]) -> Any:
        """Create an instance of a Scenic class, like Scenic's `new`.

        For a Point that the program mutates, this first creates its hidden copy, and then the Point where the copy is.
        """
        number = len(self._created)
        # Keep a place for the thing under its number. While it is created, defaults of its properties may create others.
        self._created.append(None)
        if number in self._points_with_copy:
            copy = scenic_private.made(cls, specifiers, is_object=False)
            # The copy must be sampled even if it depends on nothing random, because it gets noise.
            scenic_private.sample_always(copy)
            self._copies[number] = copy
            specifiers = [_place_of(copy, specifiers)]
        thing = scenic_private.made(cls, specifiers)
        self._created[number] = thing
        self._number_by_id[id(thing)] = number
        return thing

    def mutate_points(self, things: Sequence[Any], scale: Any) -> list[Any]:
        """Add noise to the Points among ``things``. Return the other things, which Scenic's own `mutate` can handle.

        ``scale`` is the scale of the noise. Like Scenic's `mutate`, this raises TypeError if it is not a number.
        """
        other_things = []
        for thing in things:
            is_point = isinstance(thing, Point) and not isinstance(thing, Object)
            if not is_point:
                other_things.append(thing)
                continue
            if not isinstance(scale, int | float):
                raise TypeError('"mutate X by Y" with Y not a number')
            number = self._number_by_id.get(id(thing))
            if number is not None:
                self.mutated_points.add(number)
            if self._points_with_copy:
                if number not in self._copies:
                    raise InvalidScenarioError("the program mutates other Points whenever it is compiled")
                # The Point takes its place from the copy, so the copy gets the noise.
                self._copies[number].mutationScale = scale
        return other_things


def _place_of(copy: Any, specifiers: Sequence[Any]) -> Any:
    """Return a specifier that places a Point where its hidden ``copy`` is, including the copy's noise.

    A specifier of Scenic, such as ``at (1, 2)``, gives an object properties. ``specifiers`` are those that the program
    gives to the Point. The returned specifier replaces them, and so also sets the other properties that they set.
    """
    specified_names: set[str] = set()
    for specifier in specifiers:
        specified_names.update(specifier.priorities)
    # The copy has the noise already, so the Point must not get noise of its own.
    specified_names.discard("mutationScale")
    values = {name: getattr(copy, name) for name in copy.properties if name in specified_names}
    for name, kind in NOISY.items():
        if name in copy.properties:
            # The value of this property in each sample of the copy.
            values[name] = AttributeDistribution(name, copy, kind)
    # Scenic gives the priority 1 to a property that a program sets by `with`. These properties get it, too.
    return Specifier("mutated", dict.fromkeys(values, 1), values)
