"""The order of assembly of a folded car and the steps of its service, with the way of everything that goes in."""

from foldcar.car.assembly_order.prove import prove
from foldcar.car.assembly_order.step import AssemblyStep
from foldcar.car.folded.model import FoldedCar


def assembly_steps(car: FoldedCar) -> tuple[AssemblyStep, ...]:
    """All steps from the cut pieces to the car with its lid shut."""
    return prove(car).steps


def service_steps(car: FoldedCar) -> tuple[AssemblyStep, ...]:
    """What is done to the finished car: plugs and buttons reached, the lid opened, the battery changed."""
    return prove(car).service
