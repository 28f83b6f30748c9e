"""All private names of Scenic 3.1 that foldcar uses, each behind a function.

A new version of Scenic that changes one of them fails here and in the tests of this file only. Changes to Scenic's
compiler, by public names of its modules, are in scenic_hooks.
"""

import math
from collections.abc import Iterable, Mapping, Sequence
from typing import Any


def defaults(cls: Any) -> Mapping[str, Any]:
    """Return the properties of a class of objects, including inherited ones, with their default values."""
    properties: Mapping[str, Any] = cls._defaults
    return properties


def own_properties(cls: Any) -> list[str]:
    """Return the properties that a class itself declares, without inherited ones."""
    return list(cls.__dict__.get("_scenic_properties", ()))


def final_properties(cls: Any) -> frozenset[str]:
    """Return the properties of a class that follow from others and cannot be specified."""
    return frozenset(cls._finalProperties)


def sources_of(cls: Any, name: str) -> list[str]:
    """Return the properties from which a class computes the default of the property ``name``."""
    return sorted(cls._defaults[name].requiredProperties)


def made(cls: Any, specifiers: Sequence[Any], is_object: bool = True) -> Any:
    """Make an instance of a class like `new`; without ``is_object`` it is not part of the scenario."""
    return cls._withSpecifiers(specifiers) if is_object else cls._withSpecifiers(specifiers, register=False)


def sample_always(thing: Any) -> None:
    """Make Scenic sample an object even if it depends on nothing random."""
    thing._needsSampling = thing._isLazy = True


def instances(scenario: Any) -> Iterable[Any]:
    """Return all objects, points and oriented points that a compiled program has created."""
    created: Iterable[Any] = scenario._instances
    return created


def dependencies(node: Any) -> list[Any]:
    """Return the values on which a value, or the value that it is conditioned to, depends."""
    return [*node._dependencies, *node._conditioned._dependencies]


def conditioned(node: Any) -> Any:
    """Return the value that a value is conditioned to; by default itself."""
    return node._conditioned


def unsampled(thing: Any) -> Any:
    """Return the program's object of which ``thing`` is a sample, through all copies."""
    from scenic.core.object_types import Constructible

    # Only objects are followed: a distribution has every attribute, each of which is a distribution again.
    while isinstance(thing, Constructible) and thing._sampleParent is not None:
        thing = thing._sampleParent
    return thing


def is_modular(dynamic: Any) -> bool:
    """Whether a program is a `scenario` with blocks, not plain statements."""
    return dynamic._dummyNamespace is None


def has_compose(dynamic: Any) -> bool:
    """Whether a scenario has a `compose` block."""
    return dynamic._compose is not None


def agents(dynamic: Any) -> Sequence[Any]:
    """Return the objects with behaviors."""
    objects: Sequence[Any] = dynamic._agents
    return objects


def is_limited(dynamic: Any) -> bool:
    """Whether a scenario has a `terminate after`."""
    return dynamic._timeLimit is not None


def time_limit_s(dynamic: Any, timestep: float) -> float:
    """Return the limit (s) of `terminate after`, infinity without it; ``timestep`` (s) is between Scenic's looks."""
    if dynamic._timeLimit is None:
        return math.inf
    return float(dynamic._timeLimit * (1.0 if dynamic._timeLimitIsInSeconds else timestep))


def round_time_limit(dynamic: Any) -> None:
    """Make a started scenario's limit an integer number of looks, if it is one up to rounding errors.

    1.1 s in steps of 0.1 s is a little more than 11 steps in floating-point numbers.
    """
    if dynamic._timeLimitInSteps is not None:
        dynamic._timeLimitInSteps = round(dynamic._timeLimitInSteps, 9)


def defer_time_limit(dynamic: Any) -> None:
    """Let a scenario's limit apply after its conditions at the next look, which Scenic counts as a full step."""
    if dynamic._timeLimitInSteps is not None:
        dynamic._timeLimitInSteps = max(dynamic._timeLimitInSteps, dynamic._elapsedTime + 1)


def names(dynamic: Any) -> dict[str, Any]:
    """Return the variables of a compiled program by name. ``dynamic`` is Scenic's DynamicScenario of the program."""
    # A program without `scenario` statements has a namespace of its own.
    namespace = dynamic._dummyNamespace
    own_variables: dict[str, Any] = {}
    if namespace is None:
        # This is a `scenario` of the program. It has the program's global variables, and those of its `setup` block.
        block = dynamic._setup or dynamic._compose
        namespace = block.__globals__
        own_variables = {name: dynamic.__dict__[name] for name in dynamic._locals if name in dynamic.__dict__}
    global_variables = {name: value for name, value in namespace.items() if not name.startswith("_")}
    return {**global_variables, **own_variables}


def file_of(dynamic: Any) -> str | None:
    """Return the file of a program of plain statements, or None."""
    return (dynamic._dummyNamespace or {}).get("__file__")


def forget_last_simulation(dynamic: Any) -> None:
    """Reset a scenario that was ended from outside or by a precondition, because Scenic leaves it running."""
    dynamic._subScenarios = []
    dynamic._isRunning = False


def endings(dynamic: Any) -> list[Any]:
    """Return a scenario's conditions with its sampled values: `terminate when`, then `terminate simulation when`."""
    return [*dynamic._terminationConditions, *dynamic._terminateSimulationConditions]


def end_simulation_when(dynamic: Any, ending: Any) -> None:
    """Add a condition `terminate simulation when` to a scenario, for the simulation that begins."""
    dynamic._terminateSimulationConditions = (*dynamic._terminateSimulationConditions, ending)


def requirement_monitors(dynamic: Any) -> Iterable[Any]:
    """Return the temporal requirements of a started scenario."""
    monitors: Iterable[Any] = dynamic._requirementMonitors
    return monitors


def recorded(dynamic: Any, kind: Any, steps: float) -> Mapping[str, Any]:
    """Return the values by name that a scenario records at a look; ``kind`` is a RequirementType."""
    values: Mapping[str, Any] = dynamic._evaluateRecordedExprs(kind, steps)
    return values


def invoked(dynamic: Any) -> Iterable[Any]:
    """Return the scenarios that a running scenario has invoked."""
    scenarios: Iterable[Any] = dynamic._subScenarios
    return scenarios


def temporal_requirements(dynamic: Any) -> Iterable[Any]:
    """Return a running scenario's requirements; in Scenic 3.1 these include records and endings of invoked ones."""
    requirements: Iterable[Any] = dynamic._temporalRequirements
    return requirements


def running_generator(behavior: Any) -> Any:
    """Return the generator of a running behavior."""
    return behavior._runningIterator


def shown_copy(thing: Any) -> Any:
    """Return the copy that represents an object in a simulation; writing its dictionary bypasses Scenic's proxy."""
    return object.__getattribute__(thing, "_dynamicProxy")


def caches(cls: Any) -> set[str]:
    """Return the attributes in which an object of a class caches values computed from its pose."""
    return {f"_cached_{name}" for name in cls._cache_clearers}


def derived_while_driving(cls: Any) -> set[str]:
    """Return the properties of a class that Scenic recomputes from others during a simulation."""
    return set(cls._dynamicFinalProperties)


def derive_again(thing: Any) -> None:
    """Recompute the properties of an object that follow from others."""
    thing._recomputeDynamicFinals()
