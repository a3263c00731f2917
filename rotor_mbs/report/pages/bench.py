"""Pages on error against run time from a results file: one for each scene, an index, and the numbers as CSV beside."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path

from markupsafe import Markup

from rotor_mbs.analysis.work_precision import by_scene
from rotor_mbs.errors import StoreError
from rotor_mbs.report.core.canvas import Panels, svg_text
from rotor_mbs.report.core.elements import Picture, Sample, Section, mark_sample, run_sample
from rotor_mbs.report.core.environment import render
from rotor_mbs.report.core.files import INDEX, page_names, write_pages
from rotor_mbs.report.core.svg import embedded
from rotor_mbs.report.names import GREY, Look, look_of
from rotor_mbs.report.pages import bench_tables as tables
from rotor_mbs.report.pages import bench_texts as texts
from rotor_mbs.report.plots.work_precision import FRONT_COLOUR, diagram, has_visible_floor
from rotor_mbs.scenario.names import natural_order
from rotor_mbs.store.bench import GROWTH, Curve, read_curves
from rotor_mbs.store.read import open_results

_MACHINE = ("rotor_mbs", "python", "exudyn", "heyoka", "numpy", "scipy", "platform", "cpu", "created")


@dataclass(frozen=True)
class BenchPage:
    """A page. up: file of the index, "" on the index itself; csv: file beside it; machine: (what, version)."""

    title: str
    about: str
    lead: Sequence[str]
    sections: Sequence[Section]
    csv: str
    csv_label: str = texts.CSV
    up: str = ""
    machine: Sequence[tuple[str, str]] = ()


def write_bench_report(results: Path, output: Path) -> Path:
    """Pages into the folder `output`; returns the index. Raises StoreError, also where the file has no bench."""
    grouped = by_scene(read_curves(results))
    if not grouped:
        raise StoreError(f"{results}: no bench in it, nothing to report")
    with open_results(results) as opened:
        machine = [(name, str(opened.attributes[name])) for name in _MACHINE if opened.attributes.get(name)]
    growth = {name: curves for name, curves in grouped.items() if name.startswith(f"{GROWTH}/")}
    scenes = {name: grouped[name] for name in natural_order(grouped) if name not in growth}
    files = page_names(scenes)
    pages = {INDEX: render("bench", _index(scenes, growth, files, machine))}
    pages["bench.csv"] = tables.csv_text([curve for curves in scenes.values() for curve in curves])
    for name, curves in scenes.items():
        csv = files[name].removesuffix(".html") + ".csv"
        pages[files[name]] = render("bench", _scene(name, curves, csv))
        pages[csv] = tables.csv_text(curves)
    write_pages(output, pages)
    return output / INDEX


def _scene(name: str, curves: Sequence[Curve], csv: str) -> BenchPage:
    facts = curves[0].attributes
    pictures = [
        _picture(diagram(curves), "run", name, texts.RUN_CAPTION),
        _picture(diagram(curves, with_setup=True), "setup", name, texts.SETUP_CAPTION),
    ]
    sections = [
        Section("diagram", texts.DIAGRAM_HEADING, pictures, _legend(curves)),
        Section("reach", texts.REACH_HEADING, tables=[tables.reach_table(curves)], notes=[texts.REACH_NOTE]),
        Section("order", texts.ORDER_HEADING, tables=[tables.order_table(curves)]),
        Section("failures", texts.FAILURES_HEADING, tables=[tables.failure_table(curves)]),
        Section("points", texts.POINTS_HEADING, tables=[tables.point_table(curves)]),
    ]
    notes = [
        texts.horizon(facts["horizon_s"], facts["duration_s"], facts["uncertainty_rad"]),
        texts.sampling(facts["samples"], facts["budget_s"], facts["load_before"], facts["pinned_core"]),
    ]
    lead = [*tables.summary(name, curves), *notes]
    shown = [section for section in sections if section.has_content]
    return BenchPage(f"{texts.TITLE}: {name}", name, lead, shown, csv, up=INDEX)


def _index(
    scenes: Mapping[str, Sequence[Curve]],
    growth: Mapping[str, Sequence[Curve]],
    files: Mapping[str, str],
    machine: Sequence[tuple[str, str]],
) -> BenchPage:
    pictures = [
        _picture(diagram(curves, height=2.6, small=True), f"s{i}", name, name, href=files[name])
        for i, (name, curves) in enumerate(scenes.items())
    ]
    every = [curve for curves in scenes.values() for curve in curves]
    one_of_each = list({curve.name: curve for curve in every}.values())
    sections = []
    if scenes:
        overview = tables.overview_table(scenes, files)
        sections.append(Section("fastest", texts.OVERVIEW_HEADING, tables=[overview], notes=[texts.REACH_NOTE]))
        sections.append(Section("scenes", texts.SCENES_HEADING, pictures, _legend(one_of_each)))
    sections += [
        Section(name.replace("/", "-"), texts.growth_heading(name), tables=[tables.growth_table(measured)])
        for name, measured in growth.items()
    ]
    return BenchPage(texts.TITLE, texts.LEAD, tables.overview(scenes), sections, "bench.csv", machine=machine)


def _picture(panels: Panels, kind: str, scene: str, caption: str, href: str = "") -> Picture:
    svg = embedded(svg_text(panels.figure), f"bench-{kind}", f"{texts.TITLE}, {scene}", caption)
    shown = Markup(f'<a href="{href}">{caption}</a>') if href else caption
    return Picture(Markup(svg), shown)


def _legend(curves: Sequence[Curve]) -> list[Sample]:
    return [
        *(run_sample(tables.name(curve), look_of(curve.name)) for curve in curves),
        Sample(texts.FRONT, FRONT_COLOUR, width=6.0),
        mark_sample(texts.FAILED, Look(GREY, "-", "x")),
        *([Sample(texts.FLOOR, GREY, width=8.0)] if has_visible_floor(curves) else []),
    ]
