"""The dialect: unchanged standard messages, foldcar's own messages, C and Python from one source."""

import re
from pathlib import Path

import pytest

from foldcar.link import dialect

mavlink = dialect.load_dialect()


def listed(kind: str) -> list[str]:
    """The names of that kind in standard_messages.txt."""
    lines = dialect.LIST.read_text(encoding="utf-8").splitlines()
    return [line.split()[1] for line in lines if line.startswith(f"{kind} ")]


def test_standard_messages_are_those_of_every_ground_station() -> None:
    from pymavlink.dialects.v20 import ardupilotmega

    ours = {kind.msgname: kind for kind in mavlink.mavlink_map.values()}
    by_name = {kind.msgname: kind for kind in ardupilotmega.mavlink_map.values()}
    standard = [name for name in ours if not name.startswith("FOLDCAR_")]
    assert set(listed("message")) | {"HEARTBEAT"} <= set(standard)
    for name in standard:
        assert (ours[name].id, ours[name].crc_extra) == (by_name[name].id, by_name[name].crc_extra), name
        assert ours[name].fieldnames == by_name[name].fieldnames, name
    for name in listed("command"):
        assert getattr(mavlink, name) == getattr(ardupilotmega, name)


def test_our_messages_and_commands_collide_with_nobodys() -> None:
    from pymavlink.dialects.v20 import all as everybody

    own = [kind for kind in mavlink.mavlink_map.values() if kind.msgname.startswith("FOLDCAR_")]
    assert len(own) == 7
    assert not {kind.id for kind in own} & set(everybody.mavlink_map)


def test_the_c_headers_agree_with_python_and_are_made_again_only_when_something_changes(tmp_path: Path) -> None:
    dialect.write_headers(tmp_path)
    header = tmp_path / "foldcar" / "foldcar.h"
    table = re.search(r"#define MAVLINK_MESSAGE_CRCS \{(.*)\}", header.read_text())
    assert table is not None
    in_c = {int(number): int(crc) for number, crc in re.findall(r"\{(\d+), (\d+),", table.group(1))}
    assert in_c == {number: kind.crc_extra for number, kind in mavlink.mavlink_map.items()}
    first = header.stat().st_mtime_ns
    dialect.write_headers(tmp_path)
    assert header.stat().st_mtime_ns == first
    (tmp_path / dialect.STAMP).write_text("of other inputs")
    dialect.write_headers(tmp_path)
    assert header.stat().st_mtime_ns > first


@pytest.mark.parametrize(
    ("line", "problem"),
    [
        ("message NO_SUCH  why", "has no message NO_SUCH"),
        ("command MAV_CMD_NO_SUCH  why", "has no command MAV_CMD_NO_SUCH"),
        ("message HEARTBEAT", ":1: not a message, command or enum with its reason"),
    ],
)
def test_a_list_that_asks_for_what_is_not_there_is_refused(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, line: str, problem: str
) -> None:
    wrong = tmp_path / "standard_messages.txt"
    wrong.write_text(line + "\n")
    monkeypatch.setattr(dialect, "LIST", wrong)
    with pytest.raises(dialect.DialectError, match=re.escape(problem)):
        dialect.dialect_xml()


def test_the_pinned_version_is_the_one_that_is_required() -> None:
    requirements = (Path(__file__).resolve().parents[3] / "pyproject.toml").read_text(encoding="utf-8")
    assert f'"pymavlink=={dialect.PYMAVLINK}"' in requirements
