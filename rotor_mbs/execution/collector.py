"""How often a process of ours looks for garbage in cycles."""

import gc

# New objects between two looks; Python's own 700 make it look through what is being loaded again and again, which is a
# tenth of the time that loading takes.
_SELDOM = 50_000


def collect_seldom() -> None:
    """From now on, in this process; `gc.set_threshold` undoes it."""
    gc.set_threshold(_SELDOM)
