"""All names of Scenic 3.1 that are not public and that foldcar uses, with what each stands for.

A new version of Scenic that changes one of them fails here, and in the tests of this file, and nowhere else. What is
changed in Scenic's compiler, by public names of its modules, is in scenic_hooks.
"""

import math
from collections.abc import Iterable, Mapping, Sequence
from typing import Any


def defaults(cls: Any) -> Mapping[str, Any]:
    """The properties of a class of objects, inherited ones among them, with their default values."""
    known: Mapping[str, Any] = cls._defaults
    return known


def final_properties(cls: Any) -> frozenset[str]:
    """The properties of a class that follow from others, and cannot be specified."""
    return frozenset(cls._finalProperties)


def sources_of(cls: Any, name: str) -> list[str]:
    """The properties of a class from which the default of another one is computed."""
    return sorted(cls._defaults[name].requiredProperties)


def made(cls: Any, specifiers: Sequence[Any], is_object: bool = True) -> Any:
    """An instance of a class of objects, as `new` makes it; without ``is_object`` one that is no part of the scenario."""
    return cls._withSpecifiers(specifiers) if is_object else cls._withSpecifiers(specifiers, register=False)


def sample_always(thing: Any) -> None:
    """Have an object sampled even if it depends on nothing random."""
    thing._needsSampling = thing._isLazy = True


def instances(scenario: Any) -> Iterable[Any]:
    """All objects, points and oriented points that a compiled program has created."""
    created: Iterable[Any] = scenario._instances
    return created


def dependencies(node: Any) -> list[Any]:
    """The values on which a value depends, and those on which what it is conditioned to depends."""
    return [*node._dependencies, *node._conditioned._dependencies]


def conditioned(node: Any) -> Any:
    """What a value is conditioned to: itself unless somebody has."""
    return node._conditioned


def unsampled(thing: Any) -> Any:
    """The object of the program of which ``thing`` is a sample, through all copies."""
    from scenic.core.object_types import Constructible

    # A distribution has every attribute, as another distribution.
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
    """The objects with behaviors."""
    known: Sequence[Any] = dynamic._agents
    return known


def is_limited(dynamic: Any) -> bool:
    """Whether a scenario has a `terminate after`."""
    return dynamic._timeLimit is not None


def time_limit_s(dynamic: Any, timestep: float) -> float:
    """The `terminate after` of a scenario, whose looks are ``timestep`` (s) apart; infinity without one."""
    if dynamic._timeLimit is None:
        return math.inf
    return float(dynamic._timeLimit * (1.0 if dynamic._timeLimitIsInSeconds else timestep))


def round_time_limit(dynamic: Any) -> None:
    """Have a started scenario's limit a whole number of looks where rounding alone has made it none.

    1.1 s in steps of 0.1 s is a little more than 11 steps in floating-point numbers.
    """
    if dynamic._timeLimitInSteps is not None:
        dynamic._timeLimitInSteps = round(dynamic._timeLimitInSteps, 9)


def defer_time_limit(dynamic: Any) -> None:
    """Have a scenario's limit come after its conditions at the next look, which Scenic counts like a whole step."""
    if dynamic._timeLimitInSteps is not None:
        dynamic._timeLimitInSteps = max(dynamic._timeLimitInSteps, dynamic._elapsedTime + 1)


def names(dynamic: Any) -> dict[str, Any]:
    """The variables of a compiled program by name: its globals and, in a modular scenario, those of its `setup`."""
    modular: dict[str, Any] = {}
    namespace = dynamic._dummyNamespace
    if namespace is None:
        namespace = (dynamic._setup or dynamic._compose).__globals__
        modular = {name: dynamic.__dict__[name] for name in dynamic._locals if name in dynamic.__dict__}
    return {name: value for name, value in namespace.items() if not name.startswith("_")} | modular


def file_of(dynamic: Any) -> str | None:
    """The file of a program of plain statements."""
    return (dynamic._dummyNamespace or {}).get("__file__")


def forget_last_simulation(dynamic: Any) -> None:
    """Put a scenario back that was ended from outside or by a precondition: Scenic leaves it as it was then."""
    dynamic._subScenarios = []
    dynamic._isRunning = False


def endings(dynamic: Any) -> list[Any]:
    """The conditions of a scenario with its sampled values: `terminate when`, then `terminate simulation when`."""
    return [*dynamic._terminationConditions, *dynamic._terminateSimulationConditions]


def end_simulation_when(dynamic: Any, ending: Any) -> None:
    """Add a condition of that kind to a scenario, for the simulation that begins."""
    dynamic._terminateSimulationConditions = (*dynamic._terminateSimulationConditions, ending)


def requirement_monitors(dynamic: Any) -> Iterable[Any]:
    """The temporal requirements of a started scenario."""
    known: Iterable[Any] = dynamic._requirementMonitors
    return known


def recorded(dynamic: Any, kind: Any, steps: float) -> Mapping[str, Any]:
    """The values by name that a scenario records at a look: ``kind`` is one of RequirementType."""
    values: Mapping[str, Any] = dynamic._evaluateRecordedExprs(kind, steps)
    return values


def invoked(dynamic: Any) -> Iterable[Any]:
    """The scenarios that a running one has invoked."""
    known: Iterable[Any] = dynamic._subScenarios
    return known


def temporal_requirements(dynamic: Any) -> Iterable[Any]:
    """The requirements of a running scenario, among which Scenic 3.1 has records and endings of an invoked one."""
    known: Iterable[Any] = dynamic._temporalRequirements
    return known


def running_generator(behavior: Any) -> Any:
    """The generator that a behavior is, while it runs."""
    return behavior._runningIterator


def shown_copy(thing: Any) -> Any:
    """The copy that represents an object during a simulation; writing its dictionary bypasses Scenic's proxy."""
    return object.__getattribute__(thing, "_dynamicProxy")


def caches(cls: Any) -> set[str]:
    """The attributes in which an object of a class keeps what it has computed from its pose."""
    return {f"_cached_{name}" for name in cls._cache_clearers}


def derived_while_driving(cls: Any) -> set[str]:
    """The properties of a class that Scenic computes anew from others during a simulation."""
    return set(cls._dynamicFinalProperties)


def derive_again(thing: Any) -> None:
    """Compute these properties of an object."""
    thing._recomputeDynamicFinals()
