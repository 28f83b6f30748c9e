"""The steps of a plan as they are appended: which joins each of them makes, which tools it needs.

Input: pieces, mounts, units and folds of a step. Output: AssemblySteps.
"""

from collections.abc import Iterable, Mapping, Sequence

from foldcar.car.assembly_order.roles import Roles
from foldcar.car.assembly_order.step import Added, AssemblyStep, Reach
from foldcar.car.folded.model import Mount, PlacedPiece


class Building:
    """The steps so far, what is there and which joins are made."""

    def __init__(self, roles: Roles) -> None:
        self.roles = roles
        self.steps: list[AssemblyStep] = []
        self.parts: set[str] = set()
        self._there: set[tuple[str, int]] = set()
        self._shaped = {piece.name for piece in roles.car.pieces if not piece.creases}
        self._made: set[int] = set()
        self._apart: set[str] = set()
        # Joins that shut a lid are made last.
        self._last = {number for lid in roles.lids.values() for number in lid.joins}

    def step(
        self,
        title: str,
        pieces: Iterable[PlacedPiece] = (),
        mounts: Iterable[Mount] = (),
        units: Iterable[Added] = (),
        folds: Mapping[str, Mapping[str, float]] | None = None,
        unit: str = "",
        flat: bool = False,
    ) -> None:
        """Append a step; pieces come in folded, unless it is ``flat``. A step that does nothing is left out."""
        pieces, mounts, units, closed = list(pieces), list(mounts), list(units), dict(folds or {})
        for one in pieces:
            creases = self.roles.pieces[one.piece].creases
            if not flat and creases:
                closed.setdefault(one.piece, {crease.name: 1.0 for crease in creases})
        self._there |= {(one.piece, one.copy) for one in pieces}
        self.parts |= {mount.name for mount in mounts}
        self._shaped |= {name for name, fractions in closed.items() if any(fractions.values())}
        if unit:
            self._apart |= {one.piece for one in pieces}
        for came in units:
            members = {added.name for step in self.steps if step.unit == came.name for added in step.adds}
            self._apart -= members
        joins = self._joins(flat, unit)
        adds = (
            *(Added("piece", one.piece, one.copy, one.body) for one in pieces),
            *units,
            *(Added("mount", mount.name, 0, mount.body) for mount in mounts),
        )
        reaches = tuple(
            Reach(mount.name, i)
            for mount in mounts
            if self.roles.is_fastener(mount)
            for i, access in enumerate(mount.accesses)
            if access.tool == "driver"
        )
        if adds or joins or closed:
            self.steps.append(AssemblyStep(title, closed, adds, joins, reaches, unit))

    def shut(self, title: str, folds: Mapping[str, Mapping[str, float]]) -> None:
        """Append the step that shuts the lids."""
        self.steps.append(AssemblyStep(title, folds, (), tuple(sorted(self._last))))

    def with_screws(self, mounts: Sequence[Mount]) -> list[Mount]:
        """The mounts that are not in yet, each screw after the last one of them that it holds."""
        left = [mount for mount in mounts if mount.name not in self.parts]
        screws: dict[str, list[Mount]] = {}
        for screw in (m for m in self.roles.car.mounts if self.roles.is_fastener(m) and m.name not in self.parts):
            held = [m for m in left if m.body == screw.body and m in self.roles.held_by(screw)]
            if held:
                screws.setdefault(held[-1].name, []).append(screw)
        return [one for mount in left for one in (mount, *screws.get(mount.name, ()))]

    def _joins(self, flat: bool, unit: str) -> tuple[int, ...]:
        """The joins that can be made now: all copies of both pieces are there, not apart and, but for layers, folded."""
        pieces = self.roles.car.pieces
        whole = {piece.name for piece in pieces if all((piece.name, i) in self._there for i in range(piece.count))}
        found = set()
        for join in self.roles.car.joins:
            ends = {join.piece_a, join.piece_b}
            shaped = ends <= self._shaped or (join.kind == "laminate" and flat)
            together = ends <= self._apart if unit else not ends & self._apart
            if join.number not in self._made | self._last and ends <= whole and shaped and together:
                found.add(join.number)
        self._made |= found
        return tuple(sorted(found))
