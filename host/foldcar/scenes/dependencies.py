"""What a random value of a compiled Scenic program depends on."""

from collections.abc import Iterator
from typing import Any

from scenic.core.distributions import Samplable, needsSampling


def reachable(root: Any) -> Iterator[Any]:
    """Every random value on which ``root`` depends, itself included, each once."""
    seen: set[int] = set()
    waiting = [root]
    while waiting:
        node = waiting.pop()
        if id(node) in seen or not isinstance(node, Samplable) or not needsSampling(node):
            continue
        seen.add(id(node))
        # Scenic's pruning conditions distributions too, in order to narrow them.
        waiting += [*node._dependencies, *node._conditioned._dependencies]
        yield node
