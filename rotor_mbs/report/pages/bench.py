"""The pages on error against run time: one for each scene, an index, and their numbers as CSV."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import replace

from markupsafe import Markup

from rotor_mbs.analysis.rehydrate import scene_of
from rotor_mbs.analysis.work_precision import by_scene, left_out
from rotor_mbs.errors import MethodRefusal
from rotor_mbs.methods.catalogue import find_method, ladders
from rotor_mbs.report.core.elements import Section
from rotor_mbs.report.core.files import Site, page_names, render
from rotor_mbs.report.core.looks import label_of, with_capital
from rotor_mbs.report.core.svg import picture
from rotor_mbs.report.pages import cost
from rotor_mbs.report.pages.index import versions
from rotor_mbs.report.plots.work_precision import diagram
from rotor_mbs.scenario.catalogue import natural_order
from rotor_mbs.store.read import OpenResults, StoredScene
from rotor_mbs.store.records import COST_SCALING, Record, read_records

Curves = Sequence[Record]


def bench_pages(results: OpenResults, main: str, site: Site) -> dict[str, str]:
    """By file name, the pages on the curves of `results`, and CSV; `main`: the file of the one over all scenes."""
    grouped, made_with = by_scene(read_records(results.path, "bench")), versions(results.attributes)
    scaling = {name: curves for name, curves in grouped.items() if name.startswith(f"{COST_SCALING}/")}
    scenes = {name: grouped[name] for name in natural_order(grouped) if name not in scaling}
    files = {name: f"bench-{file}" for name, file in page_names(scenes).items()}
    pages = {main: render("bench", _index(scenes, scaling, files, made_with), site, main)}
    pages["bench.csv"] = cost.csv_text([curve for curves in scenes.values() for curve in curves])
    for name, curves in scenes.items():
        csv = files[name].removesuffix(".html") + ".csv"
        pages[files[name]] = render("bench_scene", _scene(name, results.scenes.get(name), curves, csv), site)
        pages[csv] = cost.csv_text(curves)
    return pages


def _scene(name: str, stored: StoredScene | None, curves: Curves, csv: str) -> dict[str, object]:
    captions = {
        False: "Integration alone: its run time over the whole scene; marks on the left failed.",
        True: "The cost of one run: also building the model, compiling everything anew, and reading out samples.",
    }
    pictures = [
        picture(diagram(curves, with_setup=setup), f"bench-{int(setup)}", caption, f"{name}: {caption}")
        for setup, caption in captions.items()
        if not (setup and "is_short" in curves[0].attributes)  # workers there keep what runs before have compiled
    ]
    return {
        "scene": name,
        "summary": [cost.cheapest(curves), *omissions(curves), *refusals(stored)],
        "facts": curves[0].attributes,
        "diagram": Section(pictures, cost.cost_legend(curves)),
        "reach": Section(tables=[cost.reach_table(curves)]),
        "order": Section(tables=[cost.order_table(curves)]),
        "failures": Section(tables=[cost.failure_table(curves)]),
        "points": Section(tables=[cost.point_table(curves)]),
        "csv": csv,
    }


def _index(
    scenes: Mapping[str, Curves], scaling: Mapping[str, Curves], files: Mapping[str, str],
    made_with: Sequence[tuple[str, str]],
) -> dict[str, object]:  # fmt: skip
    pictures = []
    for i, (name, curves) in enumerate(scenes.items()):
        link = Markup('<a href="{}">{}</a>').format(files[name], name)
        panels = diagram(curves, height=2.6, small=True)
        shown = picture(panels, f"bench-s{i}", name, f"Error against run time, {name}")
        pictures.append(replace(shown, caption=link))
    one_of_each = {curve.name: curve for curves in scenes.values() for curve in curves}
    return {
        "summary": omissions([curve for curves in scenes.values() for curve in curves]),
        "fastest": Section(tables=[cost.overview_table(scenes, files)]),
        "scenes": Section(pictures, cost.cost_legend(list(one_of_each.values()))),
        "scaling": [
            (name.rpartition("/")[2], Section(tables=[cost.scaling_table(curves)])) for name, curves in scaling.items()
        ],
        "csv": "bench.csv",
        "versions": made_with,
    }


def omissions(curves: Curves) -> list[str]:
    """A sentence on the settings that the time budget left out, where there are any."""
    count, total = sum(map(left_out, curves)), sum(len(curve.statuses) for curve in curves)
    if not count:
        return []
    return [
        f"The budget left out {count} of {total} settings, always the finest of their ladders: what they would reach "
        "is given as not measured."
    ]


def refusals(stored: StoredScene | None) -> list[str]:
    """A sentence for each method with a ladder that cannot represent the scene."""
    scene, found = None if stored is None else scene_of(stored), []
    if scene is None:
        return []
    for name in dict.fromkeys(ladder.method for ladder in ladders()):
        try:
            find_method(name).items(scene)
        except MethodRefusal as exc:
            found.append(f"{with_capital(label_of(name))} is left out: {exc}.")
    return found
