"""The objects of a simulation besides the ego: markers, terrain, and whatever a program has put in the scene.

The simulator moves none of them, but a program may: Scenic recomputes what it derives from a changed property, such as
`orientation` and `left`, at every look. Doing that for all objects would take longer than the simulation, so they are
watched, and only those that have changed are updated.
"""

import functools
from collections.abc import Callable
from operator import is_not, itemgetter
from typing import Any

from foldcar.simulation.scenic_ego import DERIVED

# Properties that nobody sets; of Scenic's own, a copy needs anew only what its sensors observe.
SENSED = "observations"


class WatchedThing:
    """An object that has its dynamic copy."""

    def __init__(self, thing: Any) -> None:
        self.object = thing
        own: Any = type(thing)
        self._attributes = object.__getattribute__(thing, "_dynamicProxy").__dict__
        self._watched = _watched(own)
        # A property that the program derives can depend on anything.
        self._derives_more = not set(own._dynamicFinalProperties) <= DERIVED
        self.settle()

    @property
    def position(self) -> Any:
        """Its current position as a Scenic vector (m)."""
        return self._attributes["position"]

    @property
    def changed(self) -> bool:
        """Whether it has other values of dynamic properties than when it was settled, or has cached some result."""
        return (
            self._derives_more
            or len(self._attributes) != self._size
            or any(map(is_not, self._watched(self._attributes), self._values))
        )

    def settle(self) -> None:
        """Take its state for the one that later ones are compared with."""
        self._size = len(self._attributes)
        self._values = self._watched(self._attributes)


def dynamic_copy(thing: Any) -> Any:
    """The copy of an object that takes its place during a simulation, equal to the one that Scenic would make.

    Scenic resolves all specifiers for it, which takes ten times as long.
    """
    own = type(thing)
    if not own._finalProperties <= DERIVED | {SENSED}:
        return thing._copyWith()
    copy = own({**thing._allProperties(), SENSED: {}}, constProps=thing._constProps, _internal=True)
    if thing._sampleParent is None:
        # The program itself created this object and may have changed it since.
        for name in own._simulatorProvidedProperties:
            own._specify(copy, name, getattr(thing, name))
        copy._recomputeDynamicFinals()
    return copy


@functools.lru_cache(maxsize=64)
def _watched(own: Any) -> Callable[[dict[str, Any]], tuple[Any, ...]]:
    return itemgetter(*own._simulatorProvidedProperties, *DERIVED)
