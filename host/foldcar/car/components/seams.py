"""Finds the seams of a component: the pairs of edges of its fused faces that are joined to each other."""

import math
from collections.abc import Iterator
from typing import NamedTuple

from foldcar.car.components.component import ComponentError
from foldcar.car.components.fuse import Fused
from foldcar.car.components.shape import Edge, EdgeJoin, Graph
from foldcar.car.folded.pose import side

# Tolerance (mm) on the equality of the lengths of two joined edges, after their faces were fused.
LENGTH_TOLERANCE_MM = 1e-4


class Seam(NamedTuple):
    """Two edges of fused faces that meet, the link that joins them, and the length of edge ``b``.

    An edge names its fused face by the path of the first component's face in it.
    """

    link: EdgeJoin
    a: Edge
    b: Edge
    length_mm: float


def seams_of(graph: Graph, fused: dict[str, Fused], fused_path: dict[str, str]) -> Iterator[Seam]:
    """Yield the seams between fused faces. A *seam* is a pair of edges that are joined, by a fold or by a tab.

    A *fused face* is made of components' faces that are rigidly linked. ``fused`` has the fused faces by path, and
    ``fused_path`` has, for each component's face, the path of the fused face that contains it. If several links of the
    graph join the same two edges, only the first one makes a seam. Raises ComponentError if the lengths of the two edges
    do not match.
    """

    def fused_edge(edge: Edge) -> Edge:
        """Return the edge of a fused face in which the edge of a component's face lies."""
        path = fused_path[edge.face]
        edge_index = fused[path].edges[edge]
        return Edge(path, edge_index)

    def length_mm(edge: Edge) -> float:
        """Return the length of an edge of a fused face."""
        return math.dist(*side(fused[edge.face].face.outline_mm, edge.index))

    yielded = set()
    for link in graph.links:
        if link.kind == "rigid":
            continue
        edge_a, edge_b = fused_edge(link.a), fused_edge(link.b)
        if (edge_a, edge_b) in yielded:
            continue
        yielded.add((edge_a, edge_b))
        length_a_mm, length_b_mm = length_mm(edge_a), length_mm(edge_b)
        # A tab is folded from edge b and glued to edge a, which is longer than the tab by the inset at both ends. Other
        # links have an inset of 0, so their edges are equally long.
        expected_a_mm = length_b_mm + 2 * link.inset_mm
        if abs(length_a_mm - expected_a_mm) > LENGTH_TOLERANCE_MM:
            message = f"meets {link.b.face} in edges of {length_a_mm:g} and {length_b_mm:g} mm once they are fused"
            raise ComponentError(link.a.face, message)
        yield Seam(link, edge_a, edge_b, length_b_mm)
