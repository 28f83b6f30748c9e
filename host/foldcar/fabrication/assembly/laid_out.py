"""Rectangles laid out beside each other in rows, as the pieces of a car on a table."""

import math

GAP_MM = 12.0


def laid_out(extents: list[tuple[float, float, float, float]]) -> list[list[float]]:
    """Poses [x, y, turn] of origins that arrange rectangles without overlap in rows around the centre.

    A rectangle is minimum x and y, size along x and y (mm). Those longer along y than along x are turned by 90°, so that
    rows are low; the highest come first, each in the first row with room.
    """
    sizes = [(max(e[2], e[3]) + GAP_MM, min(e[2], e[3]) + GAP_MM) for e in extents]
    width = max(1.15 * math.sqrt(sum(a * b for a, b in sizes)), max(a for a, _ in sizes))
    rows: list[list[float]] = []  # y, height, occupied length along x
    corners = [(0.0, 0.0)] * len(extents)
    for i in sorted(range(len(extents)), key=lambda i: (-sizes[i][1], i)):
        along, across = sizes[i]
        row = next((row for row in rows if row[2] + along <= width), None)
        if row is None:
            row = [rows[-1][0] + rows[-1][1] if rows else 0.0, across, 0.0]
            rows.append(row)
        corners[i] = (row[2] - width / 2, row[0])
        row[2] += along
    middle = (rows[-1][0] + rows[-1][1]) / 2
    places = []
    for (x, y), (low_x, low_y, along, across) in zip(corners, extents, strict=True):
        # A quarter turn maps (x, y) to (-y, x).
        turned = across > along
        at = (x + low_y + across, y - low_x) if turned else (x - low_x, y - low_y)
        places.append([round(at[0], 3), round(at[1] - middle, 3), math.pi / 2 if turned else 0.0])
    return places
