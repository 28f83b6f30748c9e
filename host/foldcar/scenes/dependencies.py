"""What a random value of a compiled Scenic program depends on."""

from collections.abc import Callable, Iterator
from typing import Any

from scenic.core.distributions import Samplable, needsSampling


def reachable(root: Any, stop: Callable[[Any], bool] = lambda node: False) -> Iterator[Any]:
    """Every random value on which ``root`` depends, itself included, each once, but for those at which to ``stop``."""
    seen: set[int] = set()
    waiting = [root]
    while waiting:
        node = waiting.pop()
        if id(node) in seen or not isinstance(node, Samplable) or not needsSampling(node) or stop(node):
            continue
        seen.add(id(node))
        # Scenic's pruning conditions distributions too, in order to narrow them.
        waiting += [*node._dependencies, *node._conditioned._dependencies]
        yield node
