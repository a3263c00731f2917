"""Draw the picture of the README.

python docs/_ext/draw_rotor_angle.py RESULTS.h5

RESULTS.h5: of `rotor-mbs reproduce`, or of `rotor-mbs run paper/fig11`.
"""

from __future__ import annotations

import sys
from pathlib import Path

import numpy as np

from rotor_mbs.report import canvas
from rotor_mbs.report.looks import INK, PALETTE, VERMILLION, Look
from rotor_mbs.runs.read import open_results

TARGET = Path(__file__).parents[1] / "rotor-angle.svg"
TREE = "exudyn_tree/rk67"


def draw(results: Path) -> None:
    """Draw the rotor angle of Fig. 11 as printed, corrected and by Exudyn, and the differences from
    the reference."""
    with open_results(results) as opened:
        scene = opened.scenes["paper/fig11"]
        runs = {name: scene.runs[name] for name in ("reference", "printed/ode45", TREE)}
        time = runs["reference"].array("time")
        angles = {name: run.array("angles") for name, run in runs.items()}
    panels = canvas.panels((2.1, 1.3), canvas.TIME_AXIS)
    above, below = panels.axes
    printed = Look(INK, "-", "", "equations as printed")
    tree = Look(VERMILLION, "--", "", "Exudyn")
    # The corrected equations as a wide band, so that a curve upon it can be seen.
    band = Look(PALETTE["reference"][0], "-", "", "corrected equations")
    canvas.curve(above, time, angles["reference"][:, 0], band, 5.0)
    canvas.curve(above, time, angles[TREE][:, 0], tree, 1.4)
    canvas.curve(above, time, angles["printed/ode45"][:, 0], printed, 1.4)
    above.set_ylabel("rotor angle (rad)")
    above.legend(loc="upper left", frameon=False, fontsize=9.0)
    shown = []
    for name, look in (("printed/ode45", printed), (TREE, tree)):
        gap = np.abs(angles[name] - angles["reference"]).max(axis=1)
        gap[gap == 0.0] = np.nan
        canvas.curve(below, time, gap, look, 1.4)
        shown += gap[np.isfinite(gap)].tolist()
    canvas.log_axis(below, min(shown), max(shown))
    below.set_ylabel("difference (rad)")
    title = (
        "Rotor angle in Fig. 11: the printed equations depart; corrected ones and Exudyn coincide"
    )
    description = (
        "Above: rotor angle over time. Below: largest difference of an angle from the corrected "
        "equations."
    )
    TARGET.write_bytes(canvas.encoded(panels.figure, "svg", title=title, description=description))


if __name__ == "__main__":
    draw(Path(sys.argv[1]))
