"""The parts catalogue: bought parts, the film and the dimensions of assembly, from data/*.json.

Every number has a tolerance (half-width of its expected range) and a source. Lengths are in millimetres, as on data
sheets, everything else in SI units unless its name says otherwise.
"""

import math
from functools import cache
from importlib.resources import files

from pydantic import BaseModel, ConfigDict

STANDARD_GRAVITY_M_S2 = 9.80665


class Quantity(BaseModel):
    """A number, its tolerance (half-width) and its source."""

    model_config = ConfigDict(extra="forbid", frozen=True)

    value: float
    tolerance: float
    source: str


class PartData(BaseModel):
    """The base of all data files."""

    model_config = ConfigDict(extra="forbid", frozen=True)

    name: str


class BoxPart(PartData):
    """A part modelled as a box: length along the car unless turned, width across, height up."""

    cost_usd: Quantity
    mass_kg: Quantity
    length_mm: Quantity
    width_mm: Quantity
    height_mm: Quantity


class Board(BoxPart):
    """A board with four holes at the corners of a rectangle."""

    hole_spacing_length_mm: Quantity
    hole_spacing_width_mm: Quantity
    hole_mm: Quantity


class Caster(BoxPart):
    """A ball caster: a ball under a flange with two screws."""

    hole_spacing_mm: Quantity


class Battery(BoxPart):
    """The servos' supply and its voltage under light load."""

    supply_v: Quantity


class OperatingPoint(BaseModel):
    """A servo's data-sheet values at one voltage."""

    model_config = ConfigDict(extra="forbid", frozen=True)

    voltage_v: float
    no_load_speed_rpm: Quantity
    stall_torque_kgf_cm: Quantity
    no_load_current_a: Quantity
    stall_current_a: Quantity


class ServoLine(BaseModel):
    """A servo's torque-speed line and currents at one voltage, in SI units."""

    model_config = ConfigDict(frozen=True)

    no_load_speed_rad_s: float
    stall_torque_n_m: float
    no_load_current_a: float
    stall_current_a: float


class Servo(PartData):
    """A wheel servo: length along the car, width up, depth across; its ears are ``ear_underside_mm`` above its bottom."""

    cost_usd: Quantity
    mass_kg: Quantity
    length_mm: Quantity
    width_mm: Quantity
    depth_mm: Quantity
    axis_from_end_mm: Quantity
    ear_underside_mm: Quantity
    screw_spacing_mm: Quantity
    operating_points: tuple[OperatingPoint, OperatingPoint]
    rotor_inertia_kg_m2: Quantity
    neutral_us: Quantity
    deadband_us: Quantity
    saturation_us: Quantity

    def at_voltage(self, voltage_v: float) -> ServoLine:
        """Linear interpolation (or extrapolation) of the two data-sheet points at ``voltage_v``, in SI units."""
        low, high = self.operating_points
        share = (voltage_v - low.voltage_v) / (high.voltage_v - low.voltage_v)

        def between(quantity: str) -> float:
            low_value: float = getattr(low, quantity).value
            high_value: float = getattr(high, quantity).value
            return low_value + share * (high_value - low_value)

        return ServoLine(
            no_load_speed_rad_s=between("no_load_speed_rpm") * 2 * math.pi / 60,
            stall_torque_n_m=between("stall_torque_kgf_cm") * STANDARD_GRAVITY_M_S2 / 100,
            no_load_current_a=between("no_load_current_a"),
            stall_current_a=between("stall_current_a"),
        )


class Horn(PartData):
    """The servo horn that turns a wheel; it comes with the servo, and its mass counts to the wheel's."""

    length_mm: Quantity
    hub_diameter_mm: Quantity
    thickness_mm: Quantity


class Screw(PartData):
    """A screw and its nut, ``length_mm`` below the head; their mass counts to the wiring's."""

    cost_usd: Quantity
    mass_kg: Quantity
    diameter_mm: Quantity
    length_mm: Quantity


class Film(PartData):
    """The film that cars are folded from."""

    cost_usd_m2: Quantity

    thickness_mm: Quantity
    density_kg_m3: Quantity
    youngs_modulus_pa: Quantity
    loss_factor: Quantity
    loss_frequency_hz: Quantity


class Assembly(PartData):
    """Clearances, laminations and contact properties of a folded car."""

    lap_flap_mm: Quantity
    fold_distance_mm: Quantity
    opening_clearance_mm: Quantity
    tyre_gap_mm: Quantity
    wheel_distance_mm: Quantity
    belly_clearance_mm: Quantity
    hub_layers: Quantity
    hub_radius_share: Quantity
    horn_mass_kg: Quantity
    hub_hole_mm: Quantity
    horn_hole_mm: Quantity
    horn_screw_radius_mm: Quantity
    screw_hole_mm: Quantity
    doubler_margin_mm: Quantity
    cap_tab_mm: Quantity
    cable_slit_mm: Quantity
    cable_slit_length_mm: Quantity
    shelf_clearance_mm: Quantity
    flange_mm: Quantity
    tongue_mm: Quantity
    tongue_reach_mm: Quantity
    slot_clearance_mm: Quantity
    hinge_glue_mm: Quantity
    tyre_grip: Quantity
    belly_friction: Quantity
    tyre_friction: Quantity


class Catalogue(BaseModel):
    """All parts of the car kit."""

    model_config = ConfigDict(extra="forbid", frozen=True)

    servo: Servo
    feather: Board
    horn: Horn
    screw: Screw
    caster: Caster
    featherwing: BoxPart
    lipo: BoxPart
    battery: Battery
    wiring: BoxPart
    film: Film
    assembly: Assembly


@cache
def catalogue() -> Catalogue:
    """The catalogue that the package contains, read once."""

    def text(name: str) -> str:
        return files("foldcar.car.parts").joinpath("data").joinpath(name).read_text(encoding="utf-8")

    return Catalogue(
        servo=Servo.model_validate_json(text("fs90r.json")),
        feather=Board.model_validate_json(text("feather_huzzah32.json")),
        horn=Horn.model_validate_json(text("horn.json")),
        screw=Screw.model_validate_json(text("screw_m2.json")),
        caster=Caster.model_validate_json(text("caster.json")),
        featherwing=BoxPart.model_validate_json(text("servo_featherwing.json")),
        lipo=BoxPart.model_validate_json(text("lipo_500mah.json")),
        battery=Battery.model_validate_json(text("battery_4xaa.json")),
        wiring=BoxPart.model_validate_json(text("wiring.json")),
        film=Film.model_validate_json(text("film.json")),
        assembly=Assembly.model_validate_json(text("assembly.json")),
    )
