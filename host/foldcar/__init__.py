"""foldcar designs folding robot cars, simulates them in sampled environments, and helps to choose which to build.

In Python (docs/python.md): ``sweep`` writes a store and ``Study`` reads it; ``design``, ``environment``, ``simulate`` and
``evaluate`` are the simulator as a black box. ``foldcar.condition`` is for scripts that use Scenic: it conditions an
environment on a scene (scenes/conditioning.py).
"""

from foldcar.version import __version__ as __version__

# Not imported from typing: this file runs before `__main__` handles signals, so it imports almost nothing.
TYPE_CHECKING = False
if TYPE_CHECKING:
    from collections.abc import Collection

    from foldcar.api.designs import design
    from foldcar.api.environment import environment
    from foldcar.api.oracle import Evaluation, SimulatedRun, evaluate, simulate
    from foldcar.api.study import Study
    from foldcar.api.sweeping import sweep
    from foldcar.car.design import Design
    from foldcar.errors import FoldcarError
    from foldcar.statistics.rate import Rate

__all__ = [
    "Design", "Evaluation", "FoldcarError", "Rate", "SimulatedRun", "Study", "condition", "design", "environment",
    "evaluate", "simulate", "sweep",
]  # fmt: skip

_MODULES = {
    "Design": "foldcar.car.design",
    "Evaluation": "foldcar.api.oracle",
    "FoldcarError": "foldcar.errors",
    "Rate": "foldcar.statistics.rate",
    "SimulatedRun": "foldcar.api.oracle",
    "Study": "foldcar.api.study",
    "design": "foldcar.api.designs",
    "environment": "foldcar.api.environment",
    "evaluate": "foldcar.api.oracle",
    "simulate": "foldcar.api.oracle",
    "sweep": "foldcar.api.sweeping",
}


if not TYPE_CHECKING:
    # Hidden from type checkers, so that they know only the names above.
    def __getattr__(name: str) -> object:
        """Import a public name when it is first used."""
        if name not in _MODULES:
            raise AttributeError(f"module 'foldcar' has no attribute {name!r}")
        from importlib import import_module

        result = globals()[name] = getattr(import_module(_MODULES[name]), name)
        return result


def __dir__() -> list[str]:
    return sorted({*globals(), *__all__})


def condition(
    scenario: object, scene: object, objects: "Collection[str] | None" = None, params: "Collection[str] | None" = None
) -> None:
    """Freeze parts of ``scenario`` as they are in ``scene``: see :func:`foldcar.scenes.conditioning.condition`.

    Scenic is imported on the first call.

    >>> import scenic
    >>> scenario = scenic.scenarioFromString("ego = new Object with width Range(1, 2)")
    >>> scene, _ = scenario.generate()
    >>> foldcar.condition(scenario, scene, objects=["ego"])
    >>> scenario.generate()[0].egoObject.width == scene.egoObject.width
    True
    """
    from foldcar.scenes.conditioning import condition as freeze

    freeze(scenario, scene, objects, params)
