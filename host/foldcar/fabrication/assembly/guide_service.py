"""The guide's text on the finished car: how to open, charge and reset it, load the firmware and drive a metre.

Input: a FoldedCar and its proved service steps. Output: lines of text.
"""

import shlex
from collections.abc import Iterator, Sequence
from dataclasses import dataclass

from foldcar.car.components.mounts import BOARD_SWITCH, SERVO_SWITCH
from foldcar.car.folded.model import FoldedCar, Mount
from foldcar.car.parts.catalogue import Catalogue
from foldcar.car.proof.step import AssemblyStep
from foldcar.fabrication.assembly.guide_words import insert_cells_line
from foldcar.fabrication.assembly.insertion_words import join_words, number_ranges
from foldcar.shown_text import decoded


@dataclass(frozen=True, slots=True)
class ListedCar:
    """Where a car is listed: the file name of its listing, an experiment that drives it, and the options that choose it.

    ``listing`` and ``experiment`` are "" if they are not known.
    """

    listing: str = ""
    experiment: str = ""
    options: tuple[str, ...] = ()

    @property
    def flash_command(self) -> str:
        """The command that loads firmware and design onto the car's board."""
        words = ["foldcar", "flash", self.listing or "LISTING", "--experiment", self.experiment or "ID", *self.options]
        return decoded(shlex.join(words))

    @property
    def explanation(self) -> str:
        """Where to run the command, and what to write in place of LISTING and ID if they are not known."""
        folder = "Run it in the folder of the listing."
        if not self.listing:
            return f"LISTING is the file in which this car is listed, ID one of its experiments that drives it. {folder}"
        if not self.experiment:
            return (
                f"ID is the name of an experiment that drives this car. {self.listing} has none yet: add one, as "
                f"docs/listing.md says. {folder}"
            )
        return folder


def service_lines(car: FoldedCar, steps: Sequence[AssemblyStep]) -> tuple[str, ...]:
    """Return the lines that say how the finished car is opened, charged, switched off and reset.

    ``steps`` are the steps of this service: which plugs and fingers reach what, and when the lid is opened.
    """
    parts = car.parts
    mounts = {mount.name: mount for mount in car.mounts}
    # What plugs and fingers reach while the lid is shut, and while it is open.
    reached_shut: list[str] = []
    reached_open: list[str] = []
    is_open = False
    for step in steps:
        for use in step.tool_uses:
            if use.piece:
                continue
            reached = reached_open if is_open else reached_shut
            part = reached_part(car, mounts[use.name], use.index)
            if part not in reached:
                reached.append(part)
        # A step that folds something opens the lid, for the steps after it.
        is_open = is_open or bool(step.folds)
    lids = {name for step in steps for name in step.folds}
    locks = {join.number for join in car.joins if join.kind == "lock" and {join.piece_a, join.piece_b} & lids}
    lines = []
    if reached_shut:
        lines.append(f"Reached from outside{', the lid shut' if lids else ''}: {join_words(reached_shut)}.")
    if lids:
        lines.append(
            "To open the lid, one latch after the other: with a fingertip on the lid push the lever, "
            f"which stands at the right wall, outwards; that draws the tongue below it, join {number_ranges(locks)}, out "
            "of its slot. Then lift the lid by its pull tab."
        )
    if reached_open:
        lines.append(f"Reached with the lid open: {join_words(reached_open)}.")
    holders = {mounts[added.name].part for step in steps for added in step.adds}
    return (
        *lines,
        *(_change_cells_line(parts, holder) for holder in sorted(holders)),
        f"Charge the {parts.lipo.name} in the car: the {parts.feather.name} charges it from USB. Stay beside it, and "
        "never charge a cell that is swollen or dented.",
        f"After use turn off both switches: the {SERVO_SWITCH} turns off the servos, the {BOARD_SWITCH} the board. "
        f"Before the car is put away for weeks, unplug the {parts.lipo.name}.",
        f"Reset: press the {parts.featherwing.name}'s button with the tip of a screwdriver"
        f"{', the lid open' if lids else ''}; the servos stop, and the car waits to be told to go.",
    )


def _change_cells_line(parts: Catalogue, holder: str) -> str:
    """Return how the cells of that holder are changed."""
    where = "off, as far as its leads reach" if parts.battery_place == "roof" else "out"
    return f"Change cells: switch off, take the {holder} {where}, and charge its cells in their own charger."


def driving_steps(car: FoldedCar, listed: ListedCar) -> Iterator[tuple[str, tuple[str, ...]]]:
    """Yield titles and lines of the steps after the assembly: firmware, neutrals, one metre."""
    feather = car.parts.feather.name
    yield (
        "Load the firmware",
        (
            *([insert_cells_line(car.parts)] if car.parts.battery_place == "roof" else []),
            f"Open the {BOARD_SWITCH}. Leave the {SERVO_SWITCH} off. Connect the {feather} to the computer with a USB "
            "cable that carries data.",
            f"Run `{listed.flash_command}`. It loads the firmware and the car's design. {listed.explanation}",
            "If no board is found, try another cable, and open the board switch; `foldcar doctor` says what is missing.",
            *_cable_lines(),
        ),
    )
    yield (
        "Find the neutrals",
        (
            "Stand the car on a box so that no wheel touches anything, and turn the servo switch on. A light on the wing "
            "shows that + and - are right; it bears exchanged ones, and stays dark.",
            "Run `foldcar calibrate-servos`. It asks how each wheel turns, about nine times for each servo, and saves "
            "each servo's neutral and dead band in the board.",
            "A wheel turns backwards: look whether its plug is on the output that its lead is marked with. If it is, "
            "answer `y` when the command asks whether the servo shall be reversed. The board keeps this as CHn_REVERSED.",
            "A wheel does not turn: is the servo switch on, are the cells charged, is the plug's brown lead at GND?",
        ),
    )
    yield (
        "Drive a metre",
        (
            "Put the car on a smooth floor with 2 m free in front of it, and keep a finger near the servo switch.",
            'Describe one metre of floor as the tutorial "A first car" does (docs/first_car.md), and run `foldcar log '
            "metre.json --experiment metre --store study.db --car NAME`: it checks the car, counts down and drives. NAME "
            "is a name that you give to this car.",
            "The car turns aside: repeat `foldcar calibrate-servos`, look for a wheel that rubs. It stops at once: the "
            "cells are empty or the log's last line says why.",
            "Without a cable: add `--untethered`. foldcar says when to pull the cable; the board's red light, seen "
            "through the small hole beside USB, flickers, and the wheels start 8 s later."
            + (" Add `--button` to start, and to stop, with the button." if car.parts.button == "fitted" else ""),
            "When it has driven its metre, it is ready for trials.",
        ),
    )


def _cable_lines() -> Iterator[str]:
    """Yield how to lead the USB cable, so that it touches no wheel."""
    yield (
        "The cable leaves between two wheels. Lead it up along the left wall and over the roof, with a loop at the "
        "plug that does not pull. Hold it with the cable tie in the two slots above USB. Do not pull the "
        "tie tight: the cable must be able to slide out. A plug that is angled upwards stays clear of the wheels; with a "
        "straight one, turn every wheel by hand, and see that none touches it."
    )


def reached_part(car: FoldedCar, mount: Mount, index: int) -> str:
    """Return the name of what a plug, a finger or a screwdriver reaches at a part.

    A part has a clearance, a place that must be free, for each tool that reaches it. ``index`` is the index of the tool's
    clearance. The Feather has a clearance for USB first, and then one for the plug of the LiPo battery.
    """
    parts, tool = car.parts, mount.clearances[index].tool
    if mount.part == parts.switch.name:
        return mount.name
    if tool in ("finger", "driver"):
        return "reset button" if mount.part in (parts.feather.name, parts.featherwing.name) else mount.name
    if mount.part == parts.feather.name:
        return "USB" if index == 0 else "LiPo's plug"
    return "servos' plugs" if mount.part == parts.featherwing.name else f"plug of {mount.name}"
