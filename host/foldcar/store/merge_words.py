"""Shows rows and values of a merged store in messages, without the numbers of rows, which mean nothing to a person.

Input: a connection to the merged store, rows. Output: text.
"""

import json
from sqlite3 import Connection
from typing import Any

from foldcar.store.rows import Row
from foldcar.store.tables import BUILD, BY_NAME, RECORDED, RUN, Table

# In messages, longer values are cut, and a row is named by the first digits of its hash.
MAX_SHOWN, HASH_DIGITS = 80, 12


def key_with_values(connection: Connection, table: Table, row: Row) -> str:
    """Return the table of a row, and the values of its key. A recorded value is shown by the run that recorded it.

    Example: "run (build_id foldcar 1.2, body_id 3f1a99c20b41, …)"
    """
    shown_table = RUN if table is RECORDED else table
    values = [f"{column} {shown_value(connection, column, row.get(column))}" for column in shown_table.key]
    return f"{shown_table.name} ({', '.join(values)})"


def shown_value(connection: Connection, column: str, value: Any) -> str:
    """Return a value of a column as text for a message.

    If the column has the number of a row of another table, this row is shown: a build by its name, another row by the
    first digits of its hash. A column whose name ends with "_id" has such a number. ``unique`` is the column of a table
    with the name or hash.
    """
    referred_table = BY_NAME.get(column.removesuffix("_id")) if column.endswith("_id") else None
    if value is not None and referred_table is not None and referred_table.unique:
        length = MAX_SHOWN if referred_table is BUILD else HASH_DIGITS
        query = f"SELECT substr({referred_table.unique}, 1, ?) FROM {referred_table.name} WHERE id = ?"
        (value,) = connection.execute(query, (length, value)).fetchone()
    text = value if isinstance(value, str) else json.dumps(value)
    return text if len(text) <= MAX_SHOWN else f"{text[: MAX_SHOWN - 3]}…"
