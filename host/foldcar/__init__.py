"""foldcar: which folding cars to build. Design, simulate, sweep, store, report.

``foldcar.condition`` is for scripts that use Scenic: it conditions an environment on a scene (scenes/conditioning.py).
"""

# Not typing's: this file comes before `__main__` handles signals, and so imports nothing.
TYPE_CHECKING = False
if TYPE_CHECKING:
    from collections.abc import Collection

__version__ = "0.1.0"


def condition(
    scenario: object, scene: object, objects: "Collection[object] | None" = None, params: "Collection[str] | None" = None
) -> None:
    """Call :func:`foldcar.scenes.conditioning.condition`; Scenic is imported on the first call."""
    from foldcar.scenes.conditioning import condition as freeze

    freeze(scenario, scene, objects, params)
