"""The page of a sweep, from its dataset alone: what was varied, how the runs ended, its picture, distributions."""

from __future__ import annotations

import re
import tomllib
from collections.abc import Sequence

import numpy as np

from rotor_mbs.analysis.sweep_numbers import GROWN, spread_of, stability_map
from rotor_mbs.errors import InputError, StoreError
from rotor_mbs.report.core.elements import LegendEntry, PageTable, Picture, Section, line_entry
from rotor_mbs.report.core.looks import Look, with_capital
from rotor_mbs.report.core.numbers import number, with_unit
from rotor_mbs.report.core.svg import picture
from rotor_mbs.report.pages.index import versions
from rotor_mbs.report.pages.scene_tables import status_text
from rotor_mbs.report.plots import sweep as plots
from rotor_mbs.scenario.scene_file import parse_scene
from rotor_mbs.solution.status import STATUSES
from rotor_mbs.store.sweep_columns import parameter_name
from rotor_mbs.store.sweep_dataset import StoredSweep

_SPAN = 50.0  # between the smallest and the largest value, beyond which a distribution has a logarithmic axis
_COUNTS = ("steps", "rhs_evaluations", "time_reached")  # columns that say nothing of the motion
_RESPONSE, _MOST_RESPONSES = "pitch_max", 3
_COORDINATE = re.compile(r"initial\.(angles|rates)\[(\d+)\]")


def sweep_page(sweep: StoredSweep) -> dict[str, object]:
    """What the template needs."""
    asked, lines = _asked_picture(sweep)
    statuses = sweep.column("status")
    shown = [asked] if asked else _responses(sweep, statuses == STATUSES.index("ok"))
    return {
        "title": sweep.attributes["title"],
        "summary": [with_capital(sweep.attributes["summary"].rstrip(".")) + ".", *lines],
        "picture": Section(shown, tables=[_status_table(statuses)] if shown else []),
        "statuses": Section(tables=[] if shown else [_status_table(statuses)]),
        "parameters": Section(tables=[_parameter_table(sweep)]),
        "distributions": Section(_distributions(sweep, statuses == STATUSES.index("ok"))),
        "toml": str(sweep.attributes.get("sweep_toml", "")),
        "versions": versions(sweep.attributes),
    }


def field_name(key: str) -> str:
    """A varied parameter as one speaks of it: "initial pitch of blade 2" for "initial.angles[2]"."""
    found = _COORDINATE.fullmatch(key)
    if found is None:
        return re.sub(r"[._]", " ", key)
    is_rate, coordinate = found[1] == "rates", int(found[2])
    if not coordinate:
        return "initial rotor speed" if is_rate else "initial rotor angle"
    return f"initial pitch {'rate' if is_rate else 'angle'} of blade {coordinate}"


def _asked_picture(sweep: StoredSweep) -> tuple[Picture | None, list[str]]:
    """The picture that the sweep's file asks for, and what it says; neither where it cannot be drawn (yet)."""
    try:
        asked = tomllib.loads(str(sweep.attributes.get("sweep_toml", "")))
    except tomllib.TOMLDecodeError:
        return None, []
    try:
        if asked.get("picture") == "spread":
            return _spread(sweep)
        if asked.get("picture") == "map":
            return _map(sweep, asked.get("change", {}))
    except (InputError, StoreError) as exc:
        return None, [f"No picture: {exc}."]
    return None, []


def _spread(sweep: StoredSweep) -> tuple[Picture, list[str]]:
    found = spread_of(sweep)
    line = (
        f"Nearby starts part with the largest Lyapunov exponent {found.exponent:.3f} ± {found.uncertainty:.3f} per s "
        f"({found.pairs} pairs, {found.start:.2f} to {found.end:.2f} s)."
    )
    legend = [
        line_entry(f"10 to 90 % of {found.pairs} pairs", "#0072b2", width=8.0),
        line_entry("median", "#0072b2"),
        line_entry(f"growth {found.exponent:.2f} ± {found.uncertainty:.2f} per s", "#d55e00", "--"),
    ]
    return picture(plots.spread_panels(found), "spread", "Separation of nearby starts", line, legend=legend), [line]


def _map(sweep: StoredSweep, change: dict[str, object]) -> tuple[Picture, list[str]]:
    found = stability_map(sweep, _largest_start(sweep, change))
    labels = [f"{field_name(key)} ({unit})" for key, unit in ((found.x_key, found.x_unit), (found.y_key, found.y_unit))]
    line = f"The pitches grow {GROWN:g}-fold in {found.unstable.sum()} of {found.growth.size} runs."
    legend: Sequence[LegendEntry] = [LegendEntry(f"{GROWN:g} times its start", Look("#d55e00", "-", ""))]
    if found.unstable.all() or not found.unstable.any():
        legend = []
    caption = "Growth of the pitches: the largest pitch of a run, of the largest at its start"
    return picture(plots.map_panels(found, *labels), "map", caption, f"{caption}. {line}", legend=legend), [line]


def _largest_start(sweep: StoredSweep, change: dict[str, object]) -> float:
    """rad: the largest pitch at the start, of the base scene as the sweep changes it."""
    scene = parse_scene(str(sweep.attributes["scene_toml"]), str(sweep.attributes["base_scene"]))
    angles = list(scene.initial_angles)
    for key, value in change.items():
        found = _COORDINATE.fullmatch(key)
        if found and found[1] == "angles" and isinstance(value, int | float):
            angles[int(found[2])] = float(value)
    return max((abs(angle) for angle in angles[1:]), default=0.0)


def _status_table(statuses: object) -> PageTable:
    codes, counts = np.unique(np.asarray(statuses), return_counts=True)
    total = int(counts.sum())
    rows = [
        (status_text(STATUSES[code]) if code >= 0 else "missing", str(count), f"{100.0 * count / total:.1f} %")
        for code, count in sorted(zip(codes.tolist(), counts.tolist(), strict=True), key=lambda pair: -pair[1])
    ]
    return PageTable("How the runs ended", ("Status", "Runs", "Share"), rows, (1, 2))


def _parameter_table(sweep: StoredSweep) -> PageTable:
    rows = []
    for key in sweep.keys:
        values, unit = sweep.column(parameter_name(key)), sweep.columns[parameter_name(key)].units
        limits = [with_unit(float(value), unit, 4) for value in (np.nanmin(values), np.nanmax(values))]
        rows.append((field_name(key), key, *limits, str(len(np.unique(values)))))
    return PageTable("Varied parameters", ("Parameter", "Key", "From", "To", "Values"), rows, (2, 3, 4))


def _responses(sweep: StoredSweep, ok: object) -> list[Picture]:
    """The largest pitch of each run that ended well, over each of the first parameters that were varied."""
    values = sweep.column(_RESPONSE)[np.asarray(ok)] if _RESPONSE in sweep.columns else np.empty(0)
    found = []
    for key in sweep.keys[:_MOST_RESPONSES]:
        name = parameter_name(key)
        parameter = sweep.column(name)[np.asarray(ok)]
        if len(values) < 2 or not np.isfinite(values).all() or not np.ptp(parameter):
            continue
        label, unit = field_name(key), sweep.columns[name].units
        logarithmic = parameter.min() > 0.0 and parameter.max() > _SPAN * parameter.min()
        caption = f"The largest pitch of each run over the {label}"
        x_label = label if unit == "1" else f"{label} ({unit})"
        panels = plots.response(parameter, values, x_label, "largest pitch (rad)", logarithmic=logarithmic)
        found.append(picture(panels, f"over-{name}", caption, caption))
    return found


def _distributions(sweep: StoredSweep, ok: object) -> list[Picture]:
    """A picture for each number of the runs that ended well."""
    found = []
    left_out = {*map(parameter_name, sweep.keys), *_COUNTS}
    for name, column in sweep.columns.items():
        if column.dimensions != ("run",) or name in left_out or sweep.column(name).dtype.kind != "f":
            continue
        values = sweep.column(name)[np.asarray(ok)]
        values = values[np.isfinite(values)]
        if len(values) < 2 or not np.ptp(values):
            continue
        positive = values[values > 0.0]
        logarithmic = len(positive) > 1 and positive.max() > _SPAN * positive.min() and len(positive) == len(values)
        low, middle, high = (number(float(x), 3) for x in np.quantile(values, (0.05, 0.5, 0.95)))
        unit = "" if column.units == "1" else f" ({column.units})"
        caption = f"{with_capital(column.long_name)}: median {middle}, 5 to 95 % from {low} to {high}{unit}"
        panels = plots.distribution(values, f"{name.replace('_', ' ')}{unit}", logarithmic=logarithmic)
        found.append(picture(panels, f"of-{name}", caption, f"{caption}, over {len(values)} runs."))
    return found
