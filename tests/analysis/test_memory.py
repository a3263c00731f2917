"""A run of a million samples is judged within 1 GB of memory.

python -m pytest -m nightly -s tests/analysis/test_memory.py
"""

from __future__ import annotations

import subprocess
import sys

import pytest

pytestmark = [
    pytest.mark.nightly,
    pytest.mark.skipif(sys.platform != "linux", reason="ru_maxrss has this unit on Linux"),
]

CODE = """
import resource
import rotor_mbs as rm
scene = rm.scene("{name}").replace(samples=1_000_001, gravity=9.7)
run = rm.run(scene, "lagrange/taylor")
print(run.status, resource.getrusage(resource.RUSAGE_SELF).ru_maxrss)
"""


@pytest.mark.parametrize("name", ["paper/fig08", "paper/fig11"])
def test_a_run_of_a_million_samples_is_judged_in_a_gigabyte(name: str) -> None:
    """Its state has 8 numbers: 64 MB for each array of that size, 512 MB for all transition
    matrices."""
    pytest.importorskip("heyoka")
    code = CODE.format(name=name)
    done = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True, check=True)
    status, most_kB = done.stdout.split()
    print(f"\n{name}: {int(most_kB) / 1000:.0f} MB")
    assert status == "ok"
    assert int(most_kB) / 1000 < 1000.0
