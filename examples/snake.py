from foldcar.car.components.component import Parameter
from foldcar.car.components.composite import Composite
from foldcar.car.components.hinge_module import HingeModule
from foldcar.car.components.module import BrainModule, WheelModule


class Snake(Composite):
    letter = "Snake"
    title = "the car of Figure 13"
    parameters = (
        Parameter("length", 80, 60, 200, "length of each wheel module", "a servo and the tabs of two caps"),
        Parameter("width", 95, 60, 200, "outer width of the body", "the boards across it"),
        Parameter("height", 50, 48, 100, "outer height of the body", "the boards over the LiPo"),
        Parameter("radius", 36, 27, 60, "wheels of car0 and car1", "2 mm under the belly"),
        Parameter("gap", 20, 6, 40, "length of both hinges", "film that bends by 60 degrees"),
    )
    root = "brain0"
    connections = (
        ("car0.rear", "brain0.front"),
        ("brain0.rear", "vhinge0.front"),
        ("vhinge0.rear", "car1.front"),
        ("car1.rear", "vhinge1.front"),
        ("vhinge1.rear", "car2.front"),
    )

    def subcomponents(self):
        return (
            self.sub("vhinge0", HingeModule, "width height", length="gap"),
            self.sub("vhinge1", HingeModule, "width height", length="gap"),
            self.sub("brain0", BrainModule, "width height"),
            self.sub("car0", WheelModule, "length width height radius"),
            self.sub("car1", WheelModule, "length width height radius", driven=False),
            self.sub("car2", WheelModule, "length width height"),
        )
