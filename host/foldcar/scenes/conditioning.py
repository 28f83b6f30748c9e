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

    ``scenario`` is changed in place, as by Scenic's `conditionOn`; ``scene`` is not changed. Raises FoldcarError if a
    name is unknown, or if a named part and a part that is not named share a random value.
    """
    for name, value, kind in (("scenario", scenario, Scenario), ("scene", scene, Scene)):
        if not isinstance(value, kind):
            raise FoldcarError(f"condition: {name}: {shown_value(value)} is not a {kind.__name__} of Scenic")
    _check_names("objects", objects)
    _check_names("params", params)
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
    """Fix the random values ``roots``, and those from which they are computed, at their values in ``sample``."""
    # Collect all values before the first one is fixed. A fixed value is a constant, so nothing can be reached from it.
    random_values: list[Any] = []
    for root in roots:
        random_values += _reachable(root)
    for random_value in random_values:
        if random_value not in sample:
            continue
        value = sample[random_value]
        constant = _without_noise(value) if isinstance(random_value, Constructible) else ConstantSamplable(value)
        # Some classes override conditionTo, so that it also fixes the values from which this one is computed. The method
        # of the base class fixes this value only.
        Samplable.conditionTo(random_value, constant)


def _check_names(name: str, names: Any) -> None:
    """Raise FoldcarError if an argument of ``condition`` is neither None nor a collection of texts."""
    if names is None:
        return
    # A single text is also a collection: its letters would be taken for names.
    is_collection = isinstance(names, Collection) and not isinstance(names, str | bytes)
    if not is_collection or not all(isinstance(part, str) for part in names):
        raise FoldcarError(f'condition: {name}: {shown_value(names)} is not a list of names, such as ["ego"]')


def _refuse_shared(scenario: Any, frozen_parts: Collection[Any]) -> None:
    """Raise FoldcarError if a part that is frozen uses a random value that belongs to a part that is not frozen.

    The value would have to be frozen for both parts, or differ between them. The error names both parts.
    """
    owner_by_value_id = _owner_by_value_id(scenario)
    name_by_id = _name_by_id(scenario)
    for part in frozen_parts:
        labels: list[str] = []
        for random_value in _unfrozen_values(part):
            owner = owner_by_value_id.get(id(random_value))
            is_shared = owner is not None and not any(owner is frozen for frozen in frozen_parts)
            if is_shared and _label(owner, name_by_id) not in labels:
                labels.append(_label(owner, name_by_id))
        if labels:
            raise FoldcarError(
                f"condition: {_label(part, name_by_id)} depends on a random value of {' and of '.join(labels)}, which "
                "would be frozen too: name both, or neither"
            )


def _owner_by_value_id(scenario: Any) -> dict[int, Any]:
    """Return the part of the scene to which each random value belongs. The keys are the values' ids.

    The parts of a scene are the values of its parameters, its objects and its named points, in this order. A part that is
    itself a random value belongs to itself. Any other random value belongs to the first part that uses it. Values that
    were frozen, that is set to a fixed number, are left out.
    """
    name_by_id = _name_by_id(scenario)
    parts = list(scenario.params.values())
    for instance in scenic_private.instances(scenario):
        if isinstance(instance, Object) or id(instance) in name_by_id:
            parts.append(instance)
    owner_by_value_id = {id(part): part for part in parts}
    for part in parts:
        for random_value in _unfrozen_values(part):
            owner_by_value_id.setdefault(id(random_value), part)
    return owner_by_value_id


def _unfrozen_values(root: Any) -> Iterator[Any]:
    """Yield every random value on which ``root`` depends, including itself, except those that are frozen already."""
    return _reachable(root, is_skipped=lambda value: not needsSampling(scenic_private.conditioned(value)))


def _reachable(root: Any, is_skipped: Callable[[Any], bool] = lambda value: False) -> Iterator[Any]:
    """Yield ``root``, if it is random, and then each random value that it is computed from, directly or indirectly.

    No value comes twice. A value for which ``is_skipped`` is true is not yielded, and the search does not go on from it.
    """
    seen_ids: set[int] = set()
    waiting = [root]
    while waiting:
        value = waiting.pop()
        is_random = isinstance(value, Samplable) and needsSampling(value)
        if not is_random or id(value) in seen_ids or is_skipped(value):
            continue
        seen_ids.add(id(value))
        # Scenic's pruning replaces a value by a narrower one, so these are the dependencies of both.
        waiting += scenic_private.dependencies(value)
        yield value


def _name_by_id(scenario: Any) -> dict[int, str]:
    """Return the name that messages use for each parameter, object and named point of the program.

    The keys are the ids of parameters' values, objects and points.
    """
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
    """Return a copy of a sampled object to which Scenic's `mutate` does not add noise."""
    noiseless = copy.copy(thing)
    # `noiseless.x = value` would change the original, because an object of Scenic passes it on to its proxy, and the copy
    # still has the original as its proxy.
    set_attribute = object.__setattr__
    if isinstance(thing, Object):
        # Outside of simulations, each object is its own proxy.
        set_attribute(noiseless, "_dynamicProxy", noiseless)
    # Scenic samples the object to which "_conditioned" refers. In the copy this is still the original, which has noise.
    set_attribute(noiseless, "_conditioned", noiseless)
    set_attribute(noiseless, "mutationScale", 0)
    return noiseless


def _named(kind: str, things_by_name: Mapping[str, list[Any]], names: Collection[str]) -> list[Any]:
    """Return the things with these names in the program. Raises FoldcarError for unknown names."""
    for name in names:
        if name not in things_by_name:
            known_names = ", ".join(sorted(things_by_name)) or "none"
            raise FoldcarError(f'condition: {kind}: no "{name}"; the program names: {known_names}')
    return [thing for name in names for thing in things_by_name[name]]
