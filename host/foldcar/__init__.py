"""foldcar: which folding cars to build. Design, simulate, sweep, store, report.

For people who script with Scenic, ``foldcar.condition`` freezes parts of an environment (see conditioning).
"""

from typing import Any

__version__ = "0.1.0"


def condition(scenario: Any, scene: Any, objects: Any = None, params: Any = None) -> None:
    """:func:`foldcar.scenes.conditioning.condition`, which needs Scenic: it is imported when first called."""
    from foldcar.scenes.conditioning import condition as freeze

    freeze(scenario, scene, objects, params)
