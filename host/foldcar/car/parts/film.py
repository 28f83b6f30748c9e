"""The film that cars are folded from, and how it is put together."""

from foldcar.car.parts.quantity import Data, PartData, Quantity


class Cutting(Data):
    """How each machine cuts a film, and who says so; None for a machine that does not."""

    silhouette: str | None
    cricut: str | None
    laser: str | None
    scissors: str | None


class Film(PartData):
    """A film of one thickness; films of one material have the same ``name``.

    Bent below ``least_bend_radius_mm`` it keeps a crease or cracks. ``friction`` is that of bare film on the ground.
    ``tape`` is what holds it, ``folding`` how its folds are made, ``hinge`` how it stands being bent in use.
    """

    sold_as: str
    cost_usd_m2: Quantity
    thickness_mm: Quantity
    density_kg_m3: Quantity
    youngs_modulus_pa: Quantity
    least_bend_radius_mm: Quantity
    friction: Quantity
    loss_factor: Quantity
    loss_frequency_hz: Quantity
    cutting: Cutting
    folding: str
    tape: str
    hinge: str

    @property
    def title(self) -> str:
        """Material and thickness."""
        return f"{self.name} {self.thickness_mm.value:g} mm"


class Assembly(PartData):
    """Clearances, laminations and contact properties of a folded car."""

    lap_flap_mm: Quantity
    fold_distance_mm: Quantity
    cut_mm: Quantity
    placement_mm: Quantity
    opening_clearance_mm: Quantity
    wheel_distance_mm: Quantity
    belly_clearance_mm: Quantity
    screw_hole_mm: Quantity
    doubler_margin_mm: Quantity
    switch_margin_mm: Quantity
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
    tape_mm: Quantity
    bridge_foot_mm: Quantity
    bridge_gap_mm: Quantity
    floor_tongue_reach_mm: Quantity
    usb_inside_mm: Quantity
    part_gap_mm: Quantity
    lead_hole_mm: Quantity
    hinge_glue_mm: Quantity
