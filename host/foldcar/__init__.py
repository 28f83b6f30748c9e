"""foldcar: which folding cars to build. Design, simulate, sweep, store, report.

``foldcar.condition`` is for scripts that use Scenic: it conditions an environment on a scene (scenes/conditioning.py).
"""

from typing import Any

__version__ = "0.1.0"


def condition(scenario: Any, scene: Any, objects: Any = None, params: Any = None) -> None:
    """Call :func:`foldcar.scenes.conditioning.condition`; Scenic is imported on the first call."""
    from foldcar.scenes.conditioning import condition as freeze

    freeze(scenario, scene, objects, params)
