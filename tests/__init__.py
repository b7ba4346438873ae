"""Tests of the package."""

import os

# Each worker has a core: more threads would wait for one another. NumPy reads this when it is imported.
os.environ.setdefault("OPENBLAS_NUM_THREADS", "1")
