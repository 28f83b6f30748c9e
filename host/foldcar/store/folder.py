"""A store as a folder of files that need no foldcar: what stands in it, and how it explains itself.

| file | what |
|---|---|
| `README.txt` | every file and column explained, with units |
| `manifest.json` | version, format, rows of each table, SHA-256 of each log (null for logs that are gone), all files |
| `TABLE.csv` or `TABLE.parquet` | a table of the store, its rows in the order of their keys |
| `listing.json` | the listing as it was last swept, if any was |
| `logs/…` | logs of trials under the names that the table `trial` has for them |
"""

from foldcar.store.tables import TABLES

MANIFEST = "manifest.json"
README = "README.txt"
LISTING = "listing.json"
LOGS = "logs"
KIND = "foldcar store"

_HEAD = """A results store of foldcar: designs of folding cars, the environments they were simulated in, the results, and
trials of built cars. `foldcar import FOLDER --store FILE` makes the store again.

Names of columns end with their unit: _s seconds, _m metres, _mm millimetres, _rad radians, _j joules, _m_s metres a
second, _utc date and time in UTC. JSON texts use the same.

{notation}

The column checksum, in every table, is the CRC-32 of the table's name and the row as a JSON object: its other columns
without the empty ones, in alphabetical order, without spaces, characters beyond ASCII as \\uXXXX.

An experiment shows the runs whose build is its own, whose body and settings are those of one of its designs, whose
scene is that of one of its environment's samples below its number of environments, and whose variation is that of the
same sample of its spread.
"""
_NOTATION = {
    "csv": "Tables are CSV files in UTF-8 with a header line. Texts stand in double quotes, numbers without; an empty\n"
    "cell is a value that is not there. Texts may hold line breaks.",
    "parquet": "Tables are Parquet files. A null is a value that is not there. The columns before and after of the\n"
    "table correction hold texts or numbers, as JSON.",
}


def readme(kind: str) -> str:
    """The text of README.txt for tables of that format."""
    lines = [_HEAD.format(notation=_NOTATION[kind])]
    for table in TABLES:
        lines.append(f"{table.name}.{kind}: a row is {table.meaning}; told apart by {', '.join(table.key)}")
        for column in table.columns:
            refers = f" (id in {column.refers}.{kind})" if column.refers else ""
            choices = f": {', '.join(column.choices)}" if column.choices else ""
            json = "; JSON" if column.type == "JSON" else ""
            lines.append(f"    {column.name}: {column.meaning}{choices}{refers}{json}")
        lines.append("")
    lines.append(f"{LISTING}: the listing as it was last swept (also in study.{kind}); absent if nothing was swept")
    lines.append(f"{LOGS}/: logs of trials (MAVLink .tlog: 8 bytes of time in us since 1970, big endian, then a packet)")
    lines.append(f"{MANIFEST}: version, format, number of rows of each table, SHA-256 of each log, all files")
    return "\n".join(lines) + "\n"
