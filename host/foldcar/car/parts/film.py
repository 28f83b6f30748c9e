"""The film that cars are folded from, and how it is put together."""

from foldcar.car.parts.quantity import PartData, Quantity


class Film(PartData):
    """A film of one thickness; ``cutting`` says how craft cutters and lasers cope with it, and who says so."""

    sold_as: str
    cost_usd_m2: Quantity
    thickness_mm: Quantity
    density_kg_m3: Quantity
    youngs_modulus_pa: Quantity
    loss_factor: Quantity
    loss_frequency_hz: Quantity
    cutting: str


class Assembly(PartData):
    """Clearances, laminations and contact properties of a folded car."""

    lap_flap_mm: Quantity
    fold_distance_mm: Quantity
    cut_mm: Quantity
    placement_mm: Quantity
    opening_clearance_mm: Quantity
    wheel_distance_mm: Quantity
    belly_clearance_mm: Quantity
    hub_layers: Quantity
    screw_hole_mm: Quantity
    doubler_margin_mm: Quantity
    cap_tab_mm: Quantity
    cable_slit_mm: Quantity
    cable_slit_length_mm: Quantity
    shelf_clearance_mm: Quantity
    tongue_mm: Quantity
    slot_clearance_mm: Quantity
    flap_mm: Quantity
    flap_gap_mm: Quantity
    lock_mm: Quantity
    lock_reach_mm: Quantity
    lock_distance_mm: Quantity
    grip_mm: Quantity
    grip_gap_mm: Quantity
    cap_clearance_mm: Quantity
    bridge_foot_mm: Quantity
    bridge_gap_mm: Quantity
    floor_tongue_reach_mm: Quantity
    usb_inside_mm: Quantity
    part_gap_mm: Quantity
    lead_hole_mm: Quantity
    hinge_glue_mm: Quantity
    belly_friction: Quantity
