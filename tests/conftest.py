"""One BLAS thread in every test, as in the command: two gain nothing and sometimes cost dearly.

Ctrl-C works in every test, also where the suite runs in the background of a shell, which makes its
children ignore it.

Property tests try 25 examples each; ``make bench ONLY=properties`` tries 200, with the profile that
``HYPOTHESIS_PROFILE`` names.
"""

import os
import signal

if signal.getsignal(signal.SIGINT) is signal.SIG_IGN:
    signal.signal(signal.SIGINT, signal.default_int_handler)
# Before numpy is first imported, and inherited by the commands that tests start.
for name in ("OMP_NUM_THREADS", "OPENBLAS_NUM_THREADS", "MKL_NUM_THREADS"):
    os.environ.setdefault(name, "1")

from hypothesis import settings  # noqa: E402

settings.register_profile("suite", max_examples=25, deadline=None)
settings.register_profile("full", max_examples=200, deadline=None)
settings.load_profile(os.environ.get("HYPOTHESIS_PROFILE", "suite"))
