"""What holds for every test and for what it starts: Ctrl-C arrives, and compiled code stays out of the user's cache."""

from __future__ import annotations

import os
import signal
from pathlib import Path

# A CI runner or `nohup ... &` may have it ignored, which processes inherit: a test of interrupts would wait in vain.
if signal.getsignal(signal.SIGINT) is signal.SIG_IGN:
    signal.signal(signal.SIGINT, signal.default_int_handler)

# The mutants alone leave hundreds of integrators, and every process that compiles reads through all that is there:
# 0.08 s with 240 MB. heyoka looks for its cache here when it is first imported.
os.environ["XDG_CACHE_HOME"] = str(Path(__file__).parents[1] / ".pytest_cache" / "compiled")
