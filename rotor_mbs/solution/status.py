"""How a run ended: the one list of statuses, and their integer codes. Files have CF's `flag_values` and
`flag_meanings`, so that the order of the list may differ between files."""

from __future__ import annotations

# Those that a run's state can have ("unchecked": complete, with nothing to judge it by; "completed": the printed
# equations at their end, of which nothing is claimed), a point of which no run was made, and a run whose process died.
# Codes are places in this list: new ones go to its end.
STATUSES = (
    "ok", "inaccurate", "diverged", "singular", "solver_failed", "timed_out", "left_out", "worker_died", "unchecked",
    "completed",
)  # fmt: skip
# Those of runs that reached the end.
COMPLETE = ("ok", "inaccurate", "unchecked", "completed")

# In place of a status: the run was not made, as its method cannot represent the scene. Nothing is stored.
REFUSED = "refused"

# Those that nobody has to look at: "ok" may be acted on, and of a "completed" run no more is asked.
GOOD = ("ok", "completed")


def code_of(status: str) -> int:
    return STATUSES.index(status)
