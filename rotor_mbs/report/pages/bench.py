"""The pages on error against run time: one for each scene, an index, and their numbers as CSV."""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from dataclasses import replace

from markupsafe import Markup

from rotor_mbs.analysis.work_precision import TARGETS_RAD, by_scene, fastest, left_out
from rotor_mbs.methods.catalogue import model_label
from rotor_mbs.report.core.elements import Section
from rotor_mbs.report.core.files import Site, page_names, render
from rotor_mbs.report.core.looks import label_of
from rotor_mbs.report.core.numbers import number, prefixed
from rotor_mbs.report.core.svg import picture
from rotor_mbs.report.pages import bench_tables as tables
from rotor_mbs.report.pages.bench_tables import target_text
from rotor_mbs.report.pages.cost import cost_legend
from rotor_mbs.report.pages.index import versions
from rotor_mbs.report.plots.work_precision import diagram
from rotor_mbs.scenario.catalogue import natural_order
from rotor_mbs.store.read import OpenResults
from rotor_mbs.store.records import COST_SCALING, Record, read_records

Curves = Sequence[Record]


def bench_pages(results: OpenResults, main: str, site: Site) -> dict[str, str]:
    """By file name, the pages on the curves of `results`, and CSV; `main`: the file of the one over all scenes."""
    grouped, made_with = by_scene(read_records(results.path, "bench")), versions(results.attributes)
    scaling = {name: curves for name, curves in grouped.items() if name.startswith(f"{COST_SCALING}/")}
    scenes = {name: grouped[name] for name in natural_order(grouped) if name not in scaling}
    files = dict(zip(scenes, page_names(f"bench/{name}" for name in scenes).values(), strict=True))
    pages = {main: render("bench", _index(scenes, scaling, files, made_with), site, main)}
    pages["bench.csv"] = tables.csv_text([curve for curves in scenes.values() for curve in curves])
    for name, curves in scenes.items():
        csv = files[name].removesuffix(".html") + ".csv"
        pages[files[name]] = render("bench_scene", _scene(name, curves, csv), site)
        pages[csv] = tables.csv_text(curves)
    return pages


def _scene(name: str, curves: Curves, csv: str) -> dict[str, object]:
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
        "summary": summary(name, curves),
        "facts": curves[0].attributes,
        "diagram": Section(pictures, cost_legend(curves)),
        "reach": Section(tables=[tables.reach_table(curves)]),
        "order": Section(tables=[tables.order_table(curves)]),
        "failures": Section(tables=[tables.failure_table(curves)]),
        "points": Section(tables=[tables.point_table(curves)]),
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
        "summary": overview(scenes),
        "fastest": Section(tables=[tables.overview_table(scenes, files)]),
        "scenes": Section(pictures, cost_legend(list(one_of_each.values()))),
        "scaling": [
            (name.rpartition("/")[2], Section(tables=[tables.scaling_table(curves)]))
            for name, curves in scaling.items()
        ],
        "csv": "bench.csv",
        "versions": made_with,
    }


def summary(scene: str, curves: Curves) -> list[str]:
    """For each target accuracy each model's fastest method, by increasing time: "paper/fig11, 10⁻⁹ rad: closed form,
    Taylor 4 ms; Exudyn tree, RK67 50 ms (13 times)."."""
    sentences = []
    for target in TARGETS_RAD:
        best: dict[str, tuple[str, float]] = {}
        for curve, reach in fastest(curves, target):
            best.setdefault(curve.name.partition("/")[0], (label_of(curve.name), reach.seconds))
        ranked = sorted(best.values(), key=lambda item: item[1])
        parts = [
            f"{label} {prefixed(time, 's', 2)}"
            + (f" ({number(time / ranked[0][1])} times)" if time > ranked[0][1] else "")
            for label, time in ranked
        ]
        reached = "; ".join(parts) or "reached by no method within the budget"
        sentences.append(f"{scene}, {target_text(target)}: {reached}.")
    return [*sentences, *omissions(curves)]


def overview(scenes: Mapping[str, Curves]) -> list[str]:
    """For each target accuracy the fastest methods over all scenes, and how much longer the other models take."""
    sentences = [_overview(list(scenes.values()), target) for target in TARGETS_RAD]
    return [*filter(None, sentences), *omissions([curve for curves in scenes.values() for curve in curves])]


def _overview(scenes: Sequence[Curves], target: float) -> str:
    wins: dict[str, list[float]] = {}
    ratios: dict[str, list[float]] = {}
    for curves in scenes:
        best: dict[str, float] = {}
        for place, (curve, reach) in enumerate(fastest(curves, target)):
            if not place:
                wins.setdefault(label_of(curve.name), []).append(reach.seconds)
            best.setdefault(curve.name.partition("/")[0], reach.ratio)
        for model, ratio in best.items():
            if ratio > 1.0:
                ratios.setdefault(model, []).append(ratio)
    first = [
        f"{label} in {len(seconds)} of {len(scenes)} scenes ({_range(seconds, lambda s: prefixed(s, 's', 2))})"
        for label, seconds in sorted(wins.items(), key=lambda item: -len(item[1]))
    ]
    slower = [
        f"the best {model_label(model)} method takes {_range(found, number)} times as long "
        f"({len(found)} of {len(scenes)})"
        for model, found in ratios.items()
    ]
    return f"To {target_text(target)} the fastest is {'; '.join([' and '.join(first), *slower])}." if first else ""


def _range(values: Sequence[float], shown: Callable[[float], str]) -> str:
    low, high = shown(min(values)), shown(max(values))
    return low if low == high else f"{low} to {high}"


def omissions(curves: Curves) -> list[str]:
    """A sentence on the settings that the time budget left out, where there are any."""
    count, total = sum(map(left_out, curves)), sum(len(curve.statuses) for curve in curves)
    if not count:
        return []
    return [
        f"The budget left out {count} of {total} settings, always the finest of their ladders: what they would reach "
        "is given as not measured."
    ]
