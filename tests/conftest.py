"""One BLAS thread in every test, as in the command: two gain nothing and sometimes cost dearly."""

import os

# Before numpy is first imported, and inherited by the commands that tests start.
for name in ("OMP_NUM_THREADS", "OPENBLAS_NUM_THREADS", "MKL_NUM_THREADS"):
    os.environ.setdefault(name, "1")
