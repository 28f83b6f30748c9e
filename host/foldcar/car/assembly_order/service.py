"""The service of a finished car: USB and switch with the lid shut, plugs and reset with it open, the battery changed.

Input: a FoldedCar. Output: steps; they start at the finished car and end with its lid open.
"""

from functools import lru_cache

from foldcar.car.assembly_order.roles import roles_of
from foldcar.car.assembly_order.step import Added, AssemblyStep, Reach
from foldcar.car.folded.model import FoldedCar

OPEN = "Push the levers outwards and lift the lid by its pull tab"
USES = {"plug": "Plug a cable into", "finger": "Press", "driver": "Press, with a screwdriver,"}


@lru_cache(maxsize=16)
def service(car: FoldedCar) -> tuple[AssemblyStep, ...]:
    """The steps, in order; ``adds`` are what is taken out, with empty ways."""
    roles = roles_of(car)
    steps: list[AssemblyStep] = []
    shut: list[tuple[str, Reach]] = []
    opened: list[tuple[str, Reach]] = []
    for mount in (m for m in car.mounts if not roles.is_fastener(m)):
        for i, access in enumerate(mount.accesses):
            what = f"{USES[access.tool]} {mount.name}"
            (shut if roles.from_outside(mount, access) else opened).append((what, Reach(mount.name, i)))
    for what, reach in shut:
        steps.append(AssemblyStep(f"{what}, the lid shut", {}, (), (), (reach,)))
    folds = {name: dict.fromkeys(lid.creases, 0.0) for name, lid in sorted(roles.lids.items()) if lid.creases}
    batteries = [Added("mount", m.name, 0, m.body) for m in car.mounts if m.part == car.parts.battery.name]
    on_lid = [m.name for m in car.mounts if roles.is_on_lid(m)]
    for battery in (one for one in batteries if one.name in on_lid):
        steps.append(AssemblyStep(f"Take {battery.name} off", {}, (battery,), ()))
    grips = [Reach(face.name, i, name) for name in sorted(folds) for face in roles.lids[name].gripped
             for i in range(len(face.accesses))]  # fmt: skip
    if folds:
        steps.append(AssemblyStep(OPEN, folds, (), (), tuple(grips)))
    for what, reach in opened:
        steps.append(AssemblyStep(f"{what}, the lid open", {}, (), (), (reach,)))
    for battery in (one for one in batteries if one.name not in on_lid):
        steps.append(AssemblyStep(f"Take {battery.name} out", {}, (battery,), ()))
    return tuple(steps)
