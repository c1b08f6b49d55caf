"""One thread of linear algebra in a process, since the tests run in a process per core."""

import os

# Before the import of NumPy.
os.environ.setdefault("OPENBLAS_NUM_THREADS", "1")
