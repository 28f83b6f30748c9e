"""foldcar's MAVLink dialect: C headers for the firmware, a module of messages and enums for Python.

Input: foldcar.xml (foldcar's messages), standard_messages.txt (names of the standard messages in use) and pymavlink's
definitions of these. Output: one dialect without includes, that is without copies of standard messages in this project.
The module is generated once for each user. The package imports pymavlink through ``load_dialect()`` only: MAVLink 2 and
the dialect must be selected before pymavlink is first imported.

The top of this file does not import foldcar, because PlatformIO runs it with another Python.
"""

import contextlib
import hashlib
import importlib.util
import io
import os
import sys
import tempfile
from collections.abc import Iterator
from pathlib import Path
from types import ModuleType, SimpleNamespace
from xml.etree import ElementTree

HERE = Path(__file__).resolve().parent
OWN = HERE / "foldcar.xml"
LIST = HERE / "standard_messages.txt"
NAME = "foldcar"
# In order of inclusion: each one includes those before it.
DEFINITIONS = ("minimal.xml", "standard.xml", "common.xml")
PYMAVLINK = "2.4.50"
STAMP = "inputs.sha256"
MODULE = f"pymavlink.dialects.v20.{NAME}"


class DialectError(Exception):
    """standard_messages.txt is invalid, or pymavlink is missing or of another version."""


def load_dialect() -> ModuleType:
    """Return the Python module with the classes of messages and enums. It is generated if it does not exist yet.

    pymavlink's mavutil uses this dialect from then on. Raises FoldcarError if the module cannot be generated or loaded.
    """
    from foldcar.errors import FoldcarError

    if MODULE in sys.modules:
        return sys.modules[MODULE]
    os.environ |= {"MAVLINK20": "1", "MAVLINK_DIALECT": NAME}
    try:
        caches = Path(os.environ.get("XDG_CACHE_HOME") or Path.home() / ".cache")
        file = caches / "foldcar" / f"mavlink-{digest()[:16]}" / f"{NAME}.py"
        if not file.is_file():
            write_module(file)
    except (DialectError, OSError) as error:
        raise FoldcarError(f"the MAVLink dialect cannot be generated: {error}") from None
    import pymavlink.dialects.v20 as dialects

    spec = importlib.util.spec_from_file_location(MODULE, file)
    if spec is None or spec.loader is None:
        raise FoldcarError(f"the MAVLink dialect cannot be loaded: {file}")
    module = importlib.util.module_from_spec(spec)
    sys.modules[MODULE] = module
    spec.loader.exec_module(module)
    setattr(dialects, NAME, module)
    return module


def write_headers(folder: Path) -> None:
    """Generate `folder`/foldcar/mavlink.h and the headers it includes, unless they are up to date. DialectError."""
    if _read(folder / STAMP) == digest():
        return
    with _dialect_file() as xml:
        _generate(xml, "C", folder)
    (folder / STAMP).write_text(digest(), encoding="utf-8")


def write_module(file: Path) -> None:
    """Generate the Python module `file` atomically. DialectError."""
    file.parent.mkdir(parents=True, exist_ok=True)
    with _dialect_file() as xml, tempfile.TemporaryDirectory(prefix=".dialect-", dir=file.parent) as scratch:
        made = Path(scratch) / f"{NAME}.py"
        _generate(xml, "Python3", made)
        made.replace(file)


def digest() -> str:
    """SHA-256 (64 hexadecimal digits) of everything that the generated files depend on."""
    digest = hashlib.sha256(_pymavlink_version().encode())
    for file in (OWN, LIST, Path(__file__), *(_definitions() / name for name in DEFINITIONS)):
        content = file.read_bytes()
        digest.update(f"{file.name} {len(content)} ".encode() + content)
    return digest.hexdigest()


def dialect_xml() -> str:
    """The dialect as XML without includes. DialectError."""
    own = ElementTree.parse(OWN).getroot()
    wanted = _wanted()
    enums: dict[str, ElementTree.Element] = {}
    messages: dict[str, ElementTree.Element] = {}
    for name in DEFINITIONS:
        root = ElementTree.parse(_definitions() / name).getroot()
        for enum in root.iterfind("enums/enum"):
            known = enums.setdefault(enum.attrib["name"], enum)
            if known is not enum:
                known.extend(enum.findall("entry"))
        for message in root.iterfind("messages/message"):
            messages[message.attrib["name"]] = message
            if name == "minimal.xml":
                wanted["message"].add(message.attrib["name"])
    _expect(wanted["message"], messages, "message")
    _expect(wanted["enum"], enums, "enum")
    commands = {entry.attrib["name"]: entry for entry in enums.pop("MAV_CMD").iterfind("entry")}
    _expect(wanted["command"], commands, "command")

    chosen_messages = [messages[name] for name in sorted(wanted["message"])] + own.findall("messages/message")
    command_enum = ElementTree.Element("enum", name="MAV_CMD")
    own_enums = []
    for enum in own.iterfind("enums/enum"):
        if enum.attrib["name"] == "MAV_CMD":
            command_enum.extend(enum.findall("entry"))
        else:
            own_enums.append(enum)
    command_enum.extend(commands[name] for name in sorted(wanted["command"]))
    command_enum[:] = sorted(command_enum, key=lambda entry: int(entry.attrib["value"]))
    elements = (element for part in (*chosen_messages, command_enum) for element in part.iter())
    named = {element.attrib["enum"] for element in elements if "enum" in element.attrib}
    minimal = ElementTree.parse(_definitions() / "minimal.xml").getroot()
    named |= {enum.attrib["name"] for enum in minimal.iterfind("enums/enum")} | wanted["enum"]

    whole = ElementTree.Element("mavlink")
    ElementTree.SubElement(whole, "version").text = "3"
    ElementTree.SubElement(whole, "dialect").text = "0"
    standard_enums = [enums[name] for name in sorted(named) if name in enums]
    ElementTree.SubElement(whole, "enums").extend([*standard_enums, command_enum, *own_enums])
    chosen_messages.sort(key=lambda message: int(message.attrib["id"]))
    ElementTree.SubElement(whole, "messages").extend(chosen_messages)
    return ElementTree.tostring(whole, encoding="unicode")


def _wanted() -> dict[str, set[str]]:
    """Return the names of the messages, commands and enums in the list of those that foldcar uses.

    Each line of the list has a kind, a name and the reason for which foldcar needs it. Raises DialectError.
    """
    wanted: dict[str, set[str]] = {"message": set(), "command": set(), "enum": set()}
    for number, line in enumerate(LIST.read_text(encoding="utf-8").splitlines(), start=1):
        if not line or line.startswith("#"):
            continue
        kind, name, *reason = line.split()
        if kind not in wanted or not reason:
            raise DialectError(f"{LIST.name}:{number}: not a message, command or enum with its reason: {line}")
        wanted[kind].add(name)
    return wanted


def _expect(names: set[str], known: dict[str, ElementTree.Element], kind: str) -> None:
    for name in sorted(names - known.keys()):
        raise DialectError(f"{LIST.name}: pymavlink {PYMAVLINK} has no {kind} {name}")


def _definitions() -> Path:
    import pymavlink

    return Path(pymavlink.__file__).resolve().parent / "dialects" / "v20"


def _pymavlink_version() -> str:
    try:
        from importlib.metadata import version

        result = version("pymavlink")
    except ImportError:
        raise DialectError(f"pymavlink {PYMAVLINK} is not installed") from None
    if result != PYMAVLINK:
        raise DialectError(f"pymavlink {result} is installed, not {PYMAVLINK}")
    return result


@contextlib.contextmanager
def _dialect_file() -> Iterator[Path]:
    _pymavlink_version()
    with tempfile.TemporaryDirectory(prefix="foldcar-dialect-") as scratch:
        xml = Path(scratch) / f"{NAME}.xml"
        xml.write_text(dialect_xml(), encoding="utf-8")
        yield xml


def _generate(xml: Path, language: str, output: Path) -> None:
    # pymavlink reads this variable when it is first imported.
    os.environ["MAVLINK20"] = "1"
    from pymavlink.generator import mavgen, mavparse

    options = SimpleNamespace(
        output=str(output),
        wire_protocol=mavparse.PROTOCOL_2_0,
        language=language,
        validate=False,
        error_limit=1,
        strict_units=False,
    )
    log = io.StringIO()
    with contextlib.redirect_stdout(log):
        done = mavgen.mavgen(options, [str(xml)])
    if not done:
        raise DialectError(f"pymavlink cannot generate {language} from {xml.name}: {log.getvalue().strip()[-200:]}")


def _read(file: Path) -> str:
    return file.read_text(encoding="utf-8") if file.is_file() else ""
