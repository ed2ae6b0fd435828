"""`python -m motionary`, where the script `motionary` is not on the path."""

import os
import sys
from pathlib import Path

import motionary

# Python searches the current folder first: a `numpy.py` among recordings would be run. Where
# motionary itself lies there, nothing else is to be had.
if sys.path and not sys.flags.safe_path:
    first = Path(sys.path[0] or os.curdir).resolve()
    if first == Path.cwd().resolve() and first != Path(motionary.__file__).resolve().parents[1]:
        del sys.path[0]

from motionary.cli import main

if __name__ == "__main__":
    main()
