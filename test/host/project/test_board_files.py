"""The board's partition table and build flags, against Arduino-ESP32's default.csv and ESP-IDF's rules for tables."""

import configparser
from pathlib import Path

ROOT = Path(__file__).resolve().parents[3]

# Offset and size of Arduino-ESP32 2.0.17's default.csv, with `logs` in place of `app1` and without `coredump`.
DEFAULT = {
    "nvs": (0x9000, 0x5000),
    "otadata": (0xE000, 0x2000),
    "app0": (0x10000, 0x140000),
    "logs": (0x150000, 0x140000),
    "spiffs": (0x290000, 0x160000),
}
FLASH_BYTES = 4 * 1024 * 1024


def test_the_partition_table_keeps_designs_logs_and_parameters_and_has_no_core_dump() -> None:
    settings = configparser.ConfigParser(interpolation=None)
    settings.read(ROOT / "platformio.ini", encoding="utf-8")
    board = settings["env:featheresp32"]
    assert "-DCORE_DEBUG_LEVEL=0" in board["build_flags"].split()
    text = (ROOT / board["board_build.partitions"]).read_text(encoding="ascii")
    rows = [[field.strip() for field in line.split(",")] for line in text.splitlines() if not line.startswith("#")]
    table = {row[0]: (int(row[3], 16), int(row[4], 16)) for row in rows}
    assert table == DEFAULT and all(row[2] != "coredump" for row in rows)
    end = 0x9000  # behind the table itself, at 0x8000
    for name, kind, _, offset, size, flags in rows:
        start = int(offset, 16)
        assert start >= end and start % (0x10000 if kind == "app" else 0x1000) == 0, name
        assert flags == ""
        end = start + int(size, 16)
    assert end <= FLASH_BYTES
