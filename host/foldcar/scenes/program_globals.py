"""The global variables of a compiled Scenic program: the objects they name.

Input: a compiled scenario. Output: its names and their values.
"""

from typing import Any


def namespace(scenario: Any) -> dict[str, Any]:
    """The globals of the module of a compiled scenario."""
    dynamic = scenario.dynamicScenario
    block = dynamic._setup or dynamic._compose
    found: dict[str, Any] = block.__globals__ if dynamic._dummyNamespace is None else dynamic._dummyNamespace
    return found


def named_things(scenario: Any) -> dict[str, Any]:
    """The program's variables by name: its globals and, in a modular scenario, the names of its `setup`."""
    dynamic = scenario.dynamicScenario
    names = {name: value for name, value in namespace(scenario).items() if not name.startswith("_")}
    if dynamic._dummyNamespace is None:
        names.update({name: dynamic.__dict__[name] for name in dynamic._locals if name in dynamic.__dict__})
    return names
