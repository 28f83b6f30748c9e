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
    """Freeze parts of ``scenario`` as they are in ``scene``, for all scenes it generates from now on.

    ``objects`` are names that the program gives to objects, points or lists of them; ``params`` are names of global
    parameters. With neither, everything is frozen. With one of them, only the named parts are frozen, with the random
    values that they depend on; other parts that depend on these follow. A random value that is a parameter belongs to it.
    A shared value belongs to the first parameter that depends on it, else to the first object or named point.

    Changes ``scenario`` in place, like Scenic's `conditionOn`, but never ``scene``. Raises FoldcarError for unknown
    names, with the known ones, and if a named part depends on a random value that belongs to another part: this value
    would be frozen for both parts, or differ between them.
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
    values = {name: [value] for name, value in scenario.params.items()}
    frozen_parts = [*_named("params", values, params or ()), *_named("objects", named_instances(scenario), objects or ())]
    _refuse_shared(scenario, frozen_parts)
    _freeze(frozen_parts, scene.sample)


def _freeze(roots: Collection[Any], sample: Any) -> None:
    """Fix the roots, and the values that they depend on, at their values in ``sample``."""
    # The list is complete before a value is fixed, because fixing changes what can be reached.
    for value_node in [value_node for root in roots for value_node in _reachable(root)]:
        if value_node not in sample:
            continue
        value = sample[value_node]
        constant = _without_noise(value) if isinstance(value_node, Constructible) else ConstantSamplable(value)
        # Not the node's own method: a converted value's method would also fix the value before conversion.
        Samplable.conditionTo(value_node, constant)


def _refuse_shared(scenario: Any, frozen_parts: Collection[Any]) -> None:
    """Raise FoldcarError if one of ``frozen_parts`` depends on a random value that belongs to another part."""
    owners = _ownership(scenario)
    frozen_ids = {id(thing) for thing in frozen_parts}
    names = _names(scenario)
    for thing in frozen_parts:
        needed = [owners[id(node)] for node in _random_now(thing) if id(node) in owners]
        others = {id(owner): owner for owner in needed if id(owner) not in frozen_ids}
        if others:
            labels = " and of ".join(_label(owner, names) for owner in others.values())
            raise FoldcarError(
                f"condition: {_label(thing, names)} depends on a random value of {labels}, which would be frozen too: "
                "name it as well, or leave both"
            )


def _ownership(scenario: Any) -> dict[int, Any]:
    """Return the owner of each random value, by the value's id: the first part of the scene that depends on it."""
    names = _names(scenario)
    instances = scenic_private.instances(scenario)
    owning_instances = [instance for instance in instances if isinstance(instance, Object) or id(instance) in names]
    parts = [*scenario.params.values(), *owning_instances]
    # A parameter's value, an object or a named point owns itself, even if a part before it depends on it.
    owners = {id(part): part for part in parts}
    for part in list(owners.values()):
        for value in _random_now(part):
            owners.setdefault(id(value), part)
    return owners


def _random_now(root: Any) -> Iterator[Any]:
    """Yield every random value on which ``root`` depends, including itself, except frozen ones."""
    return _reachable(root, stop=lambda node: not needsSampling(scenic_private.conditioned(node)))


def _reachable(root: Any, stop: Callable[[Any], bool] = lambda node: False) -> Iterator[Any]:
    """Yield once every random value on which ``root`` depends, including itself.

    Values for which ``stop`` is true are left out, with those that only they depend on.
    """
    seen: set[int] = set()
    waiting = [root]
    while waiting:
        node = waiting.pop()
        if id(node) in seen or not isinstance(node, Samplable) or not needsSampling(node) or stop(node):
            continue
        seen.add(id(node))
        # Scenic's pruning also conditions distributions, in order to narrow them.
        waiting += scenic_private.dependencies(node)
        yield node


def _names(scenario: Any) -> dict[int, str]:
    """Return the names of parameters and objects in messages, by their ids."""
    object_names = {id(thing): f'"{name}"' for name, things in named_instances(scenario).items() for thing in things}
    return {**object_names, **{id(value): f'param "{name}"' for name, value in scenario.params.items()}}


def _label(thing: Any, names: Mapping[int, str]) -> str:
    line = getattr(thing, "creationLine", ("", 0))[1]
    return names.get(id(thing)) or f"the {type(thing).__name__} of line {line}, which has no name"


def _without_noise(thing: Any) -> Any:
    """Return a copy of a sampled object to which Scenic's `mutate` does not add noise.

    An Object forwards assignments to its dynamic proxy, which is still the original in a copy. So the copy's attributes
    are set by ``object``.
    """
    noiseless = copy.copy(thing)
    if isinstance(thing, Object):
        # Attributes are also read from the proxy, which outside simulations is the object itself.
        object.__setattr__(noiseless, "_dynamicProxy", noiseless)
    # The copy still refers to the original here, and would be sampled as that: with noise.
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
