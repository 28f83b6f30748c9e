"""Finds the port of a car: serial ports with the USB bridges of Feather boards.

Input: the machine's serial ports. Output: the port to use, or a FoldcarError that lists the ports.
"""

from dataclasses import dataclass

from foldcar.errors import FoldcarError

# USB (vendor, product) numbers of the bridges on ESP32 Feather boards of all revisions.
BRIDGES = {
    (0x10C4, 0xEA60): "CP2104 (Feather HUZZAH32)",
    (0x1A86, 0x55D4): "CH9102F (Feather HUZZAH32 V2)",
    (0x1A86, 0x55D3): "CH343",
    (0x1A86, 0x7523): "CH340",
    (0x0403, 0x6001): "FT232R",
    (0x0403, 0x6015): "FT231X",
}


# How the paths of serial ports begin, on Linux and on macOS; Windows has COM1 and so on.
SERIAL_PATHS = ("/dev/tty", "/dev/cu.")


@dataclass(frozen=True, slots=True)
class UsbPort:
    """A serial port: its path, its bridge or description, and whether that is a Feather's bridge."""

    path: str
    description: str
    is_feather: bool


def usb_ports() -> list[UsbPort]:
    """The USB serial ports of this machine, those with a Feather's bridge first."""
    from serial.tools.list_ports import comports

    ports = []
    for port in comports():
        if port.vid is None:
            continue
        bridge = BRIDGES.get((port.vid, port.pid))
        ports.append(UsbPort(port.device, bridge or port.description or "USB serial", bridge is not None))
    return sorted(ports, key=lambda port: (not port.is_feather, port.path))


def choose_port(named: str | None) -> str:
    """``named`` itself, else the only port with a Feather's bridge; FoldcarError if there are none or several."""
    if named is not None:
        return named
    ports = usb_ports()
    feathers = [port for port in ports if port.is_feather]
    if len(feathers) == 1:
        return feathers[0].path
    if feathers:
        shown = ", ".join(f"{port.path} ({port.description})" for port in feathers)
        raise FoldcarError(f"several cars may be plugged in: {shown}; choose one with --port")
    if ports:
        shown = ", ".join(f"{port.path} ({port.description})" for port in ports)
        raise FoldcarError(f"no port with a Feather's USB bridge; if one of these is the car, name it: --port {shown}")
    raise FoldcarError(
        "no car is plugged in: no USB serial port found; check that the cable carries data, or name one with --port"
    )
