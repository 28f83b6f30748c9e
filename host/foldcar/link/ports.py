"""Where a car is plugged in: serial ports with the USB bridges that Feather boards have.

Input: the machine's serial ports. Output: the one to use, or a FoldcarError that says which there are.
"""

from dataclasses import dataclass

from foldcar.errors import FoldcarError

# (vendor, product) of the bridge on the board: any revision of an ESP32 Feather, and boards like it.
BRIDGES = {
    (0x10C4, 0xEA60): "CP2104 (Feather HUZZAH32)",
    (0x1A86, 0x55D4): "CH9102F (Feather HUZZAH32 V2)",
    (0x1A86, 0x55D3): "CH343",
    (0x1A86, 0x7523): "CH340",
    (0x0403, 0x6001): "FT232R",
    (0x0403, 0x6015): "FT231X",
}


@dataclass(frozen=True, slots=True)
class FoundPort:
    """A serial port, and the bridge behind it, or what it says of itself."""

    path: str
    what: str
    likely: bool


def found_ports() -> list[FoundPort]:
    """The USB serial ports of this machine, those with a known bridge first."""
    from serial.tools.list_ports import comports

    ports = []
    for port in comports():
        if port.vid is None:
            continue
        bridge = BRIDGES.get((port.vid, port.pid))
        ports.append(FoundPort(port.device, bridge or port.description or "USB serial", bridge is not None))
    return sorted(ports, key=lambda port: (not port.likely, port.path))


def choose_port(named: str | None) -> str:
    """``named`` itself, else the only port with a known bridge; FoldcarError if there is none or a choice."""
    if named is not None:
        return named
    ports = found_ports()
    likely = [port for port in ports if port.likely]
    if len(likely) == 1:
        return likely[0].path
    if likely:
        shown = ", ".join(f"{port.path} ({port.what})" for port in likely)
        raise FoldcarError(f"several cars may be plugged in: {shown}; choose one with --port")
    if ports:
        shown = ", ".join(f"{port.path} ({port.what})" for port in ports)
        raise FoldcarError(f"no port with a Feather's USB bridge; if one of these is the car, name it: --port {shown}")
    raise FoldcarError(
        "no car is plugged in: no USB serial port found; check that the cable carries data, or name one with --port"
    )
