"""Python started with this folder on its path imports the module PLANTED_MODULE from the file PLANTED_FILE."""

import importlib.machinery
import os
import sys
from pathlib import Path


class _Loader(importlib.machinery.SourceFileLoader):
    def get_code(self, fullname):
        # As the module's own file, and without its cache.
        return compile(Path(os.environ["PLANTED_FILE"]).read_text(encoding="utf-8"), self.path, "exec", dont_inherit=True)


class _Finder:
    @staticmethod
    def find_spec(fullname, path=None, target=None):
        if fullname != os.environ.get("PLANTED_MODULE"):
            return None
        spec = importlib.machinery.PathFinder.find_spec(fullname, path)
        spec.loader = _Loader(fullname, spec.origin)
        return spec


sys.meta_path.insert(0, _Finder)
