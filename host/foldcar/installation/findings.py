"""All findings, in the order in which they depend on each other."""

from collections.abc import Iterator

from foldcar.installation.board import platformio, serial_ports, toolchain
from foldcar.installation.finding import Finding
from foldcar.installation.machine import browser, writing
from foldcar.installation.platformio_project import read_project
from foldcar.installation.python_packages import foldcar_itself, mavproxy, packages, scenic
from foldcar.installation.simulator import simulator, simulator_with_mujoco
from foldcar.source_tree import source_tree


def findings() -> Iterator[Finding]:
    """Look for everything. Nothing is changed, fetched or driven; each step takes at most a few seconds."""
    checkout = source_tree()
    yield foldcar_itself(checkout)
    yield packages()
    yield scenic()
    project = read_project(checkout) if checkout is not None else None
    yield simulator(checkout, project)
    yield from writing()
    yield platformio(checkout, project)
    if project is not None:
        yield toolchain(project)
    yield serial_ports()
    yield simulator_with_mujoco(checkout, project)
    yield mavproxy()
    yield browser()
