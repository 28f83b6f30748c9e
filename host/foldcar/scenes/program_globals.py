"""The global variables of a compiled Scenic program: the objects they name, and their values before a run.

Input: a compiled scenario. Output: its names, and a snapshot to restore. A program's monitors and functions may change
globals during a simulation; each run starts with the values after compiling, so that it does not depend on earlier runs.
"""

from typing import Any


class ProgramGlobals:
    """A snapshot of a program's globals; lists, dicts and sets are copied."""

    def __init__(self, scenario: Any) -> None:
        self._namespace = namespace(scenario)
        self._values = dict(self._namespace)
        # `__builtins__` and similar names belong to the interpreter and are shared by all modules.
        own = (value for name, value in self._values.items() if not name.startswith("__"))
        self._contents = [(value, value.copy()) for value in own if type(value) in (list, dict, set)]

    def restore(self) -> None:
        """Restore the globals to the snapshot."""
        self._namespace.clear()
        self._namespace.update(self._values)
        for container, content in self._contents:
            container.clear()
            if isinstance(container, list):
                container.extend(content)
            else:
                container.update(content)


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
