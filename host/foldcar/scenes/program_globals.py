"""The global variables of a compiled Scenic program: which objects they name, and their values before a run.

Monitors and functions of a program may change globals while a simulation runs. Results must not depend on what ran
before, so each run is given the values that compiling left.
"""

from typing import Any


class ProgramGlobals:
    """Remembers a program's globals as they are now; lists, dicts and sets by their content."""

    def __init__(self, scenario: Any) -> None:
        self._namespace = namespace(scenario)
        self._values = dict(self._namespace)
        # `__builtins__` and its like are the interpreter's, which every module of the process shares.
        own = (value for name, value in self._values.items() if not name.startswith("__"))
        self._contents = [(value, value.copy()) for value in own if type(value) in (list, dict, set)]

    def restore(self) -> None:
        """Make them again what they were."""
        self._namespace.clear()
        self._namespace.update(self._values)
        for container, content in self._contents:
            container.clear()
            if isinstance(container, list):
                container.extend(content)
            else:
                container.update(content)


def namespace(scenario: Any) -> dict[str, Any]:
    """The globals of the module that a compiled scenario stands in."""
    dynamic = scenario.dynamicScenario
    block = dynamic._setup or dynamic._compose
    found: dict[str, Any] = block.__globals__ if dynamic._dummyNamespace is None else dynamic._dummyNamespace
    return found


def named_things(scenario: Any) -> dict[str, Any]:
    """What the program's names stand for: its globals and, of a modular scenario, the names in its `setup`."""
    dynamic = scenario.dynamicScenario
    names = {name: value for name, value in namespace(scenario).items() if not name.startswith("_")}
    if dynamic._dummyNamespace is None:
        names.update({name: dynamic.__dict__[name] for name in dynamic._locals if name in dynamic.__dict__})
    return names
