"""Conditions an environment on a scene: named parts keep their values of that scene, the rest is sampled anew.

Input: a compiled Scenic scenario and a scene of it. Output: none; later samples of the scenario are conditioned.
Scenic's `conditionOn` does not suffice: it draws the noise of mutated objects again for every sample, which also moves
the objects of the given scene; it accepts Objects only; it fixes the value beneath a converted one too; and objects
placed relative to a conditioned one do not follow it. Here frozen objects are copies without noise, Points can be
frozen, and an object's random values with it.
"""

import copy
from collections.abc import Collection
from typing import Any

from scenic.core.distributions import ConstantSamplable, Samplable
from scenic.core.object_types import Constructible, Object

from foldcar.errors import FoldcarError
from foldcar.scenes.dependencies import reachable
from foldcar.scenes.program_globals import named_things


def condition(
    scenario: Any,
    scene: Any,
    objects: Collection[Any] | None = None,
    params: Collection[str] | None = None,
) -> None:
    """Freeze parts of ``scenario`` as they are in ``scene``, for all scenes it generates from now on.

    ``objects`` are objects of the scene, or names that the program gives to objects, points or lists of them;
    ``params`` are names of global parameters. With neither, everything is frozen; with one of them, only what it
    names. A random value that several objects depend on belongs to a parameter that it is the value of, else to
    the object that is created first: it is frozen with that one, and the others follow.

    Changes ``scenario`` in place, like Scenic's `conditionOn`, but never ``scene``. Raises FoldcarError for unknown
    names, listing the known ones.
    """
    if objects is None and params is None:
        _freeze(scenario.dependencies, scene.sample, excluded=set())
        return
    things = _chosen_things(scenario, scene, objects or ())
    names = _chosen_params(scenario, params or ())
    owned = _ownership(scenario)
    for name in names:
        _freeze([scenario.params[name]], scene.sample, excluded=set())
    for thing in things:
        excluded = {node for node, owner in owned.items() if owner is not thing}
        _freeze([thing], scene.sample, excluded)


def _freeze(roots: Collection[Any], sample: Any, excluded: set[int]) -> None:
    """Fix the roots and what they depend on at their values in ``sample``, except nodes with an id in ``excluded``."""
    for node in [node for root in roots for node in reachable(root)]:
        if id(node) in excluded or node not in sample:
            continue
        value = sample[node]
        constant = _without_noise(value) if isinstance(node, Constructible) else ConstantSamplable(value)
        # Not the node's own method: that of a converted value would also fix the value which is converted.
        Samplable.conditionTo(node, constant)


def _ownership(scenario: Any) -> dict[int, Any]:
    """The owner of each random value, by the value's id: the first parameter or object that depends on it."""
    owners: dict[int, Any] = {}
    for owner in [*scenario.params.values(), *scenario._instances]:
        for node in reachable(owner):
            # An object owns itself, even if others are placed relative to it.
            owners.setdefault(id(node), node if isinstance(node, Constructible) else owner)
    return owners


def _without_noise(thing: Any) -> Any:
    """A copy of a sampled object on which mutation has no effect."""
    twin = copy.copy(thing)
    if isinstance(thing, Object):
        # Scenic reads an object's attributes from its dynamic proxy, which outside simulations is the object itself.
        object.__setattr__(twin, "_dynamicProxy", twin)
    object.__setattr__(twin, "_conditioned", twin)
    object.__setattr__(twin, "mutationScale", 0)
    return twin


def _chosen_things(scenario: Any, scene: Any, chosen: Collection[Any]) -> list[Any]:
    known = _named_instances(scenario)
    of_sampled = {id(scene.sample[thing]): thing for thing in scenario._instances}
    things: list[Any] = []
    for one in chosen:
        if isinstance(one, str):
            if one not in known:
                names = ", ".join(sorted(known)) or "none"
                raise FoldcarError(f'condition: objects: no "{one}"; the program names: {names}')
            things += known[one]
        elif id(one) in of_sampled:
            things.append(of_sampled[id(one)])
        else:
            raise FoldcarError(f"condition: objects: {one} is neither a name nor an object of the scene")
    return things


def _named_instances(scenario: Any) -> dict[str, list[Any]]:
    """The objects and points of the program by the names of its variables."""
    own = {id(thing) for thing in scenario._instances}
    known = {} if scenario.egoObject is None else {"ego": [scenario.egoObject]}
    for name, value in named_things(scenario).items():
        things = [_unsampled(thing) for thing in (value if isinstance(value, list | tuple) else [value])]
        if things and all(id(thing) in own for thing in things):
            known[name] = things
    return known


def _unsampled(thing: Any) -> Any:
    """The scenario's object of a sampled one, which Scenic leaves in the globals when it checks requirements."""
    while isinstance(thing, Constructible) and thing._sampleParent is not None:
        thing = thing._sampleParent
    return thing


def _chosen_params(scenario: Any, chosen: Collection[str]) -> list[str]:
    for name in chosen:
        if name not in scenario.params:
            known = ", ".join(sorted(scenario.params)) or "none"
            raise FoldcarError(f'condition: params: no "{name}"; the program\'s parameters are: {known}')
    return list(chosen)
