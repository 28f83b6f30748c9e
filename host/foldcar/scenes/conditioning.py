"""Conditions an environment on a scene: named parts keep their values of that scene, the rest is sampled anew.

Input: a compiled Scenic scenario and a scene of it. Output: none; later samples of the scenario are conditioned.
Scenic's `conditionOn` does not suffice: it draws the noise of mutated objects again for every sample, which also moves
the objects of the given scene; it accepts Objects only; it fixes the value beneath a converted one too; and objects
placed relative to a conditioned one do not follow it. Here frozen objects are copies without noise, Points can be
frozen, and an object's random values with it.
"""

import copy
from collections.abc import Callable, Collection, Iterator, Mapping
from typing import Any

from scenic.core.distributions import ConstantSamplable, Samplable, needsSampling
from scenic.core.object_types import Constructible, Object
from scenic.core.scenarios import Scenario, Scene

from foldcar.errors import FoldcarError
from foldcar.scenes import scenic_private
from foldcar.scenes.program import named_instances
from foldcar.shown_text import shown_value


def condition(
    scenario: Any,
    scene: Any,
    objects: Collection[str] | None = None,
    params: Collection[str] | None = None,
) -> None:
    """Freeze parts of ``scenario`` as they are in ``scene``, for all scenes that it generates from now on.

    ``objects`` are names that the program gives to objects, points or lists of them. ``params`` are names of global
    parameters. If both are None, everything is frozen. Otherwise the named parts are frozen, together with the random
    values that they depend on. Parts that are not named, but depend on a frozen one, are computed from it.

    Each random value belongs to one part: to the parameter that it is, or else to the first parameter that depends on
    it, or else to the first object or named point. A named part must not depend on a value of another part, because
    this value would then be frozen for both, or differ between them.

    ``scenario`` is changed in place, as by Scenic's `conditionOn`; ``scene`` is not changed. Raises FoldcarError if a
    name is unknown, or if a named part depends on a random value that belongs to another part.
    """
    for name, value, kind in (("scenario", scenario, Scenario), ("scene", scene, Scene)):
        if not isinstance(value, kind):
            raise FoldcarError(f"condition: {name}: {shown_value(value)} is not a {kind.__name__} of Scenic")
    for name, value in (("objects", objects), ("params", params)):
        # The letters of a string would be taken for names.
        is_names = isinstance(value, Collection) and not isinstance(value, str | bytes)
        if value is not None and not (is_names and all(isinstance(part, str) for part in value)):
            raise FoldcarError(f'condition: {name}: {shown_value(value)} is not a list of names, such as ["ego"]')
    if objects is None and params is None:
        _freeze(scenario.dependencies, scene.sample)
        return
    if not objects and not params:
        raise FoldcarError('condition: names nothing: leave "objects" and "params" out to freeze everything')
    values_by_parameter = {name: [value] for name, value in scenario.params.items()}
    frozen_parts = _named("params", values_by_parameter, params or ())
    frozen_parts += _named("objects", named_instances(scenario), objects or ())
    _refuse_shared(scenario, frozen_parts)
    _freeze(frozen_parts, scene.sample)


def _freeze(roots: Collection[Any], sample: Any) -> None:
    """Fix the random values ``roots``, and those that they depend on, at their values in ``sample``."""
    # First collect all values, because a fixed value no longer leads to those that it depends on.
    random_values: list[Any] = []
    for root in roots:
        random_values += _reachable(root)
    for random_value in random_values:
        if random_value not in sample:
            continue
        value = sample[random_value]
        constant = _without_noise(value) if isinstance(random_value, Constructible) else ConstantSamplable(value)
        # A converted value has a method of its own for this, which would also fix the value before its conversion. So
        # call the method of the base class.
        Samplable.conditionTo(random_value, constant)


def _refuse_shared(scenario: Any, frozen_parts: Collection[Any]) -> None:
    """Raise FoldcarError if one of ``frozen_parts`` depends on a random value that belongs to another part."""
    owner_by_value = _owner_by_value(scenario)
    frozen_ids = {id(part) for part in frozen_parts}
    name_by_id = _name_by_id(scenario)
    for part in frozen_parts:
        # The other parts to which random values of this part belong. Keys are ids, so that each part is named once.
        other_owners: dict[int, Any] = {}
        for random_value in _unfrozen_values(part):
            owner = owner_by_value.get(id(random_value))
            if owner is not None and id(owner) not in frozen_ids:
                other_owners[id(owner)] = owner
        if other_owners:
            labels = " and of ".join(_label(owner, name_by_id) for owner in other_owners.values())
            raise FoldcarError(
                f"condition: {_label(part, name_by_id)} depends on a random value of {labels}, which would be frozen "
                "too: name both, or neither"
            )


def _owner_by_value(scenario: Any) -> dict[int, Any]:
    """Return which part of the scene each random value belongs to, by the value's id.

    The parts of a scene are the values of its parameters, its objects and its named points, in this order. A value
    belongs to the first part that depends on it.
    """
    name_by_id = _name_by_id(scenario)
    parts = list(scenario.params.values())
    for instance in scenic_private.instances(scenario):
        if isinstance(instance, Object) or id(instance) in name_by_id:
            parts.append(instance)
    # A part is a random value itself, and belongs to itself. This comes before the loop, because an earlier part may
    # depend on it.
    owner_by_value = {id(part): part for part in parts}
    for part in list(owner_by_value.values()):
        for random_value in _unfrozen_values(part):
            owner_by_value.setdefault(id(random_value), part)
    return owner_by_value


def _unfrozen_values(root: Any) -> Iterator[Any]:
    """Yield every random value on which ``root`` depends, including itself, except those that are frozen already."""
    return _reachable(root, stop=lambda value: not needsSampling(scenic_private.conditioned(value)))


def _reachable(root: Any, stop: Callable[[Any], bool] = lambda node: False) -> Iterator[Any]:
    """Yield every random value on which ``root`` depends, and ``root`` itself if it is random. No value comes twice.

    Values for which ``stop`` is true are left out. Values on which only these depend are left out, too.
    """
    seen_ids: set[int] = set()
    waiting = [root]
    while waiting:
        value = waiting.pop()
        if id(value) in seen_ids or not isinstance(value, Samplable) or not needsSampling(value) or stop(value):
            continue
        seen_ids.add(id(value))
        # Scenic's pruning replaces a value by a narrower one, so these are the dependencies of both.
        waiting += scenic_private.dependencies(value)
        yield value


def _name_by_id(scenario: Any) -> dict[int, str]:
    """Return what messages call parameters, objects and named points, by the id of the parameter's value or object."""
    name_by_id = {}
    for name, instances in named_instances(scenario).items():
        for instance in instances:
            name_by_id[id(instance)] = f'"{name}"'
    for name, value in scenario.params.items():
        name_by_id[id(value)] = f'param "{name}"'
    return name_by_id


def _label(part: Any, name_by_id: Mapping[int, str]) -> str:
    """Return what messages call a part of a scene: its name, or its class and the line that made it."""
    if id(part) in name_by_id:
        return name_by_id[id(part)]
    _file, line = getattr(part, "creationLine", ("", 0))
    return f"the {type(part).__name__} of line {line}, which has no name"


def _without_noise(thing: Any) -> Any:
    """Return a copy of a sampled object to which Scenic's `mutate` does not add noise.

    An Object forwards assignments to its dynamic proxy, and the proxy of the copy is still the original object. So the
    attributes of the copy are set by ``object.__setattr__``.
    """
    noiseless = copy.copy(thing)
    if isinstance(thing, Object):
        # Attributes are read from the proxy, too. Outside of simulations an object is its own proxy.
        object.__setattr__(noiseless, "_dynamicProxy", noiseless)
    # Scenic samples the object to which "_conditioned" refers. In the copy this is still the original, which has noise.
    object.__setattr__(noiseless, "_conditioned", noiseless)
    object.__setattr__(noiseless, "mutationScale", 0)
    return noiseless


def _named(kind: str, things_by_name: Mapping[str, list[Any]], names: Collection[str]) -> list[Any]:
    """Return the things with these names in the program. Raises FoldcarError for unknown names."""
    for name in names:
        if name not in things_by_name:
            known_names = ", ".join(sorted(things_by_name)) or "none"
            raise FoldcarError(f'condition: {kind}: no "{name}"; the program names: {known_names}')
    return [thing for name in names for thing in things_by_name[name]]
