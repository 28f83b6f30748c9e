"""Names of the report's files: one of its own for every experiment, on file systems that ignore case too."""

import hashlib
import re

# What any file system keeps as it is; capitals are not, as some ignore case.
PLAIN = re.compile(r"[a-z0-9-]+(_[a-z0-9-]+)*")
HASHED = re.compile(r"(.*_)?[0-9a-f]{8}")
LONGEST = 40


def file_name_part(name: str) -> str:
    """``name`` itself if it is short and plain, else what is plain of it and eight digits of its SHA-256."""
    if len(name) <= LONGEST and PLAIN.fullmatch(name) and not HASHED.fullmatch(name):
        return name
    plain = re.sub("[^a-z0-9-]+", "_", name.lower())[:LONGEST].strip("_")
    digest = hashlib.sha256(name.encode("utf-8", "surrogatepass")).hexdigest()[:8]
    return f"{plain}_{digest}" if plain else digest
