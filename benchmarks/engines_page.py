"""Write reports/engines.html, the page of docs/engines.md, from stored measurements.

    python benchmarks/engines_page.py [CSV [HTML]]

CSV: the points of a bench, by default reports/engines.csv. They were measured on 2026-11-23 with
the commands and engines that docs/engines.md names, which need a free core for half an hour and
five more packages; this only draws them, by the code that draws the page of any bench. What the
file of that bench knew beside its points is below.
"""

from __future__ import annotations

import csv
import json
import sys
import tempfile
from collections.abc import Sequence
from dataclasses import replace
from pathlib import Path

from markupsafe import Markup

import rotor_mbs as rm
from rotor_mbs.report.elements import Fact, PageContent
from rotor_mbs.report.files import render
from rotor_mbs.report.pages.bench import bench_page
from rotor_mbs.runs.design import COLUMNS, RunRequest
from rotor_mbs.runs.merge import fit_file_to_request
from rotor_mbs.runs.read import open_results, points_table
from rotor_mbs.studies.run import run_scenes

REPORTS = Path(__file__).resolve().parent.parent / "reports"
DATE = "2026-11-23"
BUDGET_S = 240.0
PROCESSOR = "AMD EPYC, 2 cores, one of them for the bench alone"
VERSIONS = {"python": "3.11.7", "numpy": "2.4.6", "scipy": "1.17.1"}
# by model: the package with its version, lines of its file in examples/engines, linearization
ENGINES = {
    "lagrange": ("heyoka", "7.13.2", 0, True),
    "exudyn_tree": ("exudyn", "1.13.6", 0, True),
    "exudyn_chain": ("exudyn", "1.13.6", 0, True),
    "mujoco": ("mujoco", "4.0.0", 0, True),
    "pinocchio": ("pin", "4.1.0", 99, False),
    "drake": ("drake", "1.51.1", 100, False),
    "dart": ("dartpy", "6.20.0", 99, False),
    "kane": ("sympy", "1.14.0", 94, False),
    "newton": ("newton", "1.8.0", 76, False),
}
# Curves of other settings than the default ones have the name of the method with a suffix.
CHAIN = "exudyn_chain/generalized_alpha"


def main(source: Path, target: Path) -> None:
    """Write the page of the points in `source`."""
    with source.open(newline="", encoding="utf-8") as file:
        rows = list(csv.DictReader(file))
    with tempfile.TemporaryDirectory() as folder:
        results = Path(folder) / "engines.h5"
        store(results, rows)
        with open_results(results) as opened:
            page = engines_page(bench_page(opened))
    made = [*VERSIONS.items(), ("measured", DATE), ("cpu", PROCESSOR)]
    made += dict.fromkeys((package, version) for package, version, *_ in ENGINES.values())
    target.write_text(render(page, made), encoding="utf-8")


def engines_page(page: PageContent) -> PageContent:
    """Return the page of the bench with when and where its points were measured."""
    measured = Fact("Measured", DATE, PROCESSOR)
    return replace(
        page,
        title="Engines: error and run time",
        about=Markup('<a href="engines.csv">engines.csv</a>, measured as docs/engines.md says'),
        facts=[*page.facts[:3], measured],
    )


def store(results: Path, rows: Sequence[dict[str, str]]) -> None:
    """Write the points into a results file, with the references of their scenes.

    Parameters
    ----------
    results : the file, which is made.
    rows : the points: texts by the name of the column, curve after curve.
    """
    scenes = {name: rm.scene(name) for name in dict.fromkeys(row["scene"] for row in rows)}
    none: dict[str, list[str]] = {name: [] for name in scenes}
    run_scenes([*scenes.values()], none, results, workers=1, timeout_s=60.0)
    known = []
    for row in rows:
        scene, curve = scenes[row["scene"]], row["method"]
        method = CHAIN if curve.startswith(CHAIN) else curve
        package, version, lines, linearizes = ENGINES[method.partition("/")[0]]
        options = {
            "budget_s": BUDGET_S,
            "duration_s": scene.duration,
            "linearizes": linearizes,
            "lines": lines,
        }
        numbers = {name: float(row[name]) for name in ("step", "tolerance", "order_expected")}
        known.append(
            {
                **RunRequest(scene, "reference").known,
                **numbers,
                "run": f"{scene.name}/{curve} {row['setting']}",
                "method_name": method,
                "settings": "{}",
                "versions": json.dumps({**VERSIONS, package: version}),
                "curve": curve,
                "setting_kind": row["setting_kind"],
                "options": json.dumps(options),
            }
        )
    file = fit_file_to_request(results, [points_table("bench", known)])
    for row, point in zip(rows, known, strict=True):
        place = file.place(str(point["run"]), "bench")
        place.write(place.encode(values_of(row)))


def values_of(row: dict[str, str]) -> dict[str, float | int | str]:
    """Return the computed columns of a point."""
    values: dict[str, float | int | str] = {"status": row["status"], "message": row["message"]}
    for name, column in COLUMNS.items():
        if name in row and name not in (*values, "crc32"):
            values[name] = float(row[name]) if column.kind == "<f8" else int(row[name])
    return values


if __name__ == "__main__":
    defaults = [REPORTS / "engines.csv", REPORTS / "engines.html"]
    paths = [Path(argument) for argument in sys.argv[1:]]
    main(*paths, *defaults[len(paths) :])
