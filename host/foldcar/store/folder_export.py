"""Writes a whole store into a folder of files that need no foldcar (:mod:`foldcar.store.folder`), whole or not at all."""

import json
import shutil
from collections.abc import Iterator
from pathlib import Path
from typing import Any

from foldcar.atomic_folder import atomic_folder
from foldcar.store.folder import KIND, LISTING, LOGS, MANIFEST, README, readme
from foldcar.store.folder_tables import write_table
from foldcar.store.log_files import log_file, sha256_of
from foldcar.store.migrations import VERSION
from foldcar.store.reader import Store
from foldcar.store.tables import STUDY, TABLES, TRIAL


def export_folder(store: Store, folder: Path, kind: str) -> dict[str, Any]:
    """Write ``folder``, tables as ``csv`` or ``parquet``; gives its manifest.

    FoldcarError if the folder holds anything but an earlier export, cannot be written, or if a row is damaged. Logs
    that are gone are null in the manifest's ``logs``; the others are copied as they are.
    """
    with atomic_folder(folder, MANIFEST) as target:
        rows = {}
        for table in TABLES:
            name = f"{table.name}.{kind}"
            order = f"ORDER BY {', '.join(table.key)}"
            rows[table.name] = write_table(table, store.rows(table, order), target / name, kind)
        logs = {log: _copy_log(store, log, target) for log in _logs(store)}
        files = [MANIFEST, README, *(f"{table.name}.{kind}" for table in TABLES)]
        files += [f"{LOGS}/{log}" for log, digest in logs.items() if digest is not None]
        (target / README).write_text(readme(kind), encoding="utf-8")
        listing = next((row["value"] for row in store.rows(STUDY) if row["key"] == "listing_text"), None)
        if listing is not None:
            (target / LISTING).write_text(listing, encoding="utf-8", newline="")
            files.append(LISTING)
        manifest = {
            "kind": KIND,
            "version": VERSION,
            "format": kind,
            "rows": rows,
            "logs": logs,
            "files": sorted(files),
        }
        (target / MANIFEST).write_text(json.dumps(manifest, indent=1) + "\n", encoding="utf-8")
    return manifest


def _logs(store: Store) -> Iterator[str]:
    """The logs that trials name, each once, in the order of trials."""
    return iter(dict.fromkeys(row["log"] for row in store.rows(TRIAL, "WHERE log IS NOT NULL ORDER BY id")))


def _copy_log(store: Store, log: str, target: Path) -> str | None:
    """Copy a log into the folder; its SHA-256, None if it is gone."""
    source = log_file(store.path, log)
    if not source.is_file():
        return None
    copy = target / LOGS / log
    copy.parent.mkdir(parents=True, exist_ok=True)
    shutil.copyfile(source, copy)
    return sha256_of(copy)
