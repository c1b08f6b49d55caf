"""One thread of linear algebra in a process, since the tests run in a process per core.

Two savings of time: the imports of the collection leave no garbage, and the grammar of addresses
in other alphabets takes two seconds.
"""

import gc
import os
import sys

# Before the import of NumPy.
os.environ.setdefault("OPENBLAS_NUM_THREADS", "1")
sys.modules["rfc3987_syntax"] = None
gc.disable()


def pytest_collection_finish():
    gc.freeze()
    gc.enable()
