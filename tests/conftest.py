"""What holds for every test: Ctrl-C reaches what they start, also where they were themselves started to ignore it."""

from __future__ import annotations

import signal

# A CI runner or `nohup ... &` may have it ignored, which processes inherit: a test of interrupts would wait in vain.
if signal.getsignal(signal.SIGINT) is signal.SIG_IGN:
    signal.signal(signal.SIGINT, signal.default_int_handler)
