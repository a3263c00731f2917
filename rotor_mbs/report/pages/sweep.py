"""Build the page of a sweep from its results file.

The page shows the statuses of the runs, a map of a quantity over two parameters, the curves of a
run that the reader chooses, quantities over each parameter, and the runs that are not ok with the
reasons.
"""

from __future__ import annotations

import math
import re
from collections.abc import Sequence
from dataclasses import dataclass
from functools import cached_property

import numpy as np
from markupsafe import Markup
from numpy.typing import NDArray

from rotor_mbs.analysis.text_tables import sweep_parameters
from rotor_mbs.report.elements import (
    Array,
    Curve,
    Element,
    Fact,
    Fold,
    Grid,
    HeatMap,
    Horizontal,
    Legend,
    Note,
    PageContent,
    PageTable,
    Plot,
    Row,
    RunChoice,
    Section,
    SourceText,
    TableCell,
)
from rotor_mbs.report.files import MAX_NUMBERS
from rotor_mbs.report.looks import BLUE, Look, coordinate_look, step_look, with_capital
from rotor_mbs.report.numbers import number, prefix_of, shortest, text_range, typeset_title
from rotor_mbs.report.pages import is_wide, words_of
from rotor_mbs.report.pages.scene_plots import Jumps, blade_look, jumps_of
from rotor_mbs.runs.rows import text_of
from rotor_mbs.runs.sweeps import StoredSweep, parameter_name
from rotor_mbs.scenario.scene import KEYS_OF_LOADS
from rotor_mbs.solution.quantities import LOADS
from rotor_mbs.solution.status import GOOD, STATUSES

_COUNTS = ("steps", "rhs_evaluations", "time_reached")  # columns that do not describe the motion
_MAX_ROWS = 500  # largest number of rows in the table of all runs
_MAX_CELLS = 24  # largest number of cells in each direction of a map
# The page says that a parameter decides a quantity if the parameter explains more than this share
# of the quantity's variance.
_DECIDES = 0.6
_COORDINATE = re.compile(r"initial\.(angles|rates)\[(\d+)\]")


@dataclass(frozen=True)
class RunQuantity:
    """A quantity with one number per run.

    name, unit : name and unit of the quantity.
    values : (runs,) the numbers, in this unit.
    """

    name: str
    unit: str
    values: Array

    @property
    def title(self) -> str:
        """Return the name of the quantity, with the unit in brackets if it has one."""
        return f"{self.name} ({self.unit})" if self.unit else self.name


class _Sweep:
    """A stored sweep with the columns that several parts of its page need.

    Functions of this module refer to a run by its index, its place in these columns.

    stored : the open file of the sweep.
    statuses : (runs,) code of each run's status; negative if the run was not computed.
    numbers : (runs,) number of each run.
    keys : names of the parameters of the sweep.
    parameters : values of each parameter by its name, (runs,).
    codes : (runs,) index of each run's method in `stored.methods`.
    """

    def __init__(self, stored: StoredSweep) -> None:
        self.stored = stored
        self.statuses = np.asarray(stored.column("status"))
        self.numbers = np.asarray(stored.column("run"))
        self.keys = list(stored.keys)
        self.parameters = {
            key: np.asarray(stored.column(parameter_name(key)), float) for key in self.keys
        }
        self.codes = np.asarray(stored.column("method_code"))

    def unit(self, key: str) -> str:
        """Return the unit of a parameter; "" for a number without unit."""
        unit = self.stored.columns[parameter_name(key)].units.replace("^2", "²")
        return "" if unit == "1" else unit

    def axis_name(self, key: str) -> str:
        """Return the name of a parameter in words, with its unit in brackets if it has one."""
        unit = self.unit(key)
        return f"{field_name(key)} ({unit})" if unit else field_name(key)

    def status_of(self, run: int) -> str:
        """Return the status of a run in words; "missing" if the run was not computed."""
        code = int(self.statuses[run])
        return words_of(STATUSES[code]) if code >= 0 else "missing"

    @cached_property
    def is_good(self) -> NDArray[np.bool_]:
        """Return whether each run needs no attention, (runs,): its status is ok or completed."""
        return np.isin(
            self.statuses, [code for code, status in enumerate(STATUSES) if status in GOOD]
        )

    @cached_property
    def good_words(self) -> str:
        """Return the statuses of good runs in words: "ok", "completed", or "ok or completed".

        A good run of the printed equations is "completed", because their accuracy is not judged.
        """
        present = [STATUSES[code] for code in np.unique(self.statuses[self.is_good]).tolist()]
        return " or ".join(present) or "ok"

    def tone(self, run: int) -> str:
        """Return the colour of a run's status: "good", "bad", or "" for a completed run."""
        return "good" if self.status_of(run) == "ok" else "" if self.is_good[run] else "bad"

    @cached_property
    def varied(self) -> list[str]:
        """Return the parameters with more than one value."""
        return [key for key in self.keys if len(np.unique(self.parameters[key])) > 1]

    @cached_property
    def grid_keys(self) -> list[str]:
        """Return the parameters of a grid that have more than one value.

        The parameter that changes slowest from run to run is the first. The list is empty if the
        runs are not a grid.
        """
        return self.varied if len(self.stored.shape) == len(self.keys) else []

    def value(self, key: str, value: float) -> str:
        """Return a parameter in words with a value and its unit: "blade mass 1000 kg"."""
        return f"{field_name(key)} {brief(value)} {self.unit(key)}".rstrip()

    def described(self, run: int) -> str:
        """Return the parameters of a run with their values, and its method if there are several."""
        parts = [self.value(key, self.parameters[key][run]) for key in self.varied]
        if len(self.stored.methods) > 1:
            parts.append(self.stored.methods[int(self.codes[run])])
        return ", ".join(parts)


def sweep_page(stored: StoredSweep) -> PageContent:
    """Return the content of the page of a sweep.

    Parameters
    ----------
    stored : the open file of the sweep. The map and all curves have only the runs of its first
        method.
    """
    sweep = _Sweep(stored)
    quantities = run_quantities(sweep)
    first_method = sweep.codes == sweep.codes[0] if len(sweep.codes) else np.zeros(0, bool)
    curves, places = _curves(sweep, first_method)
    sections = []
    map_element = _map(sweep, quantities, first_method)
    top: list[list[Element]] = []
    if map_element is not None:
        top.append([map_element])
    if curves:
        legend = Legend(
            list({curve.key: curve.look for plot in curves for curve in plot.curves}.items())
        )
        shown = np.flatnonzero(places >= 0)
        choice = RunChoice(
            [(int(run), f"{sweep.numbers[run]}: {sweep.described(int(run))}") for run in shown]
        )
        heading = Markup('<h3 id="picked" aria-live="polite"></h3>')
        top.append([*([] if map_element is not None else [choice]), heading, legend, *curves])
    if top:
        say = ""
        if curves and (places < 0).any():
            count = int((places >= 0).sum())
            say = (
                f"Curves of {count} of {len(places)} runs: those that are not {sweep.good_words}, "
                "the corners, "
            )
            say += "and every few."
            if len(stored.methods) > 1:
                say += f" By {stored.methods[int(sweep.codes[0])]} alone."
        sections.append(
            Section(
                "map",
                "Map and curves" if map_element is not None else "Curves of a run",
                [Grid(len(top), top)],
                say,
            )
        )
    # The reader can choose a run only if the page has a map or curves.
    is_shown = map_element is not None or bool(curves)
    sections.append(_over_parameters(sweep, quantities, first_method))
    sections.append(_faults_section(sweep, with_links=is_shown))
    sections.append(_runs_section(sweep, quantities, with_links=is_shown))
    sections.append(_details_section(sweep, quantities))
    data: dict[str, object] = {}
    if is_shown:
        data = {
            "values": [
                [_json_number(value) for value in quantity.values.tolist()]
                for quantity in quantities
            ],
            "labels": [sweep.described(run) for run in range(len(sweep.statuses))],
            "statuses": [sweep.status_of(run) for run in range(len(sweep.statuses))],
            "numbers": sweep.numbers.tolist(),
            "places": places.tolist(),
            "start": _start(sweep, quantities, places),
        }
    title = typeset_title(str(stored.attributes["title"]))
    about = with_capital(str(stored.attributes["summary"]).rstrip("."))
    return PageContent(
        title, about, sweep_answer(sweep, quantities), _facts(sweep, quantities), sections,
        data={"sweep": data} if data else {},
    )  # fmt: skip


def _json_number(value: float) -> float | None:
    return float(f"{value:.4g}") if math.isfinite(value) else None


def brief(value: float) -> str:
    """Return a parameter's value as text with at most four digits."""
    return shortest(float(f"{value:.4g}"))


def field_name(key: str) -> str:
    """Return a varied parameter in words: "initial rotor angle" for "initial.angles[0]"."""
    parts = _COORDINATE.fullmatch(key)
    if parts is None:
        return re.sub(r"[._]", " ", key)
    is_rate, coordinate = parts[1] == "rates", int(parts[2])
    if not coordinate:
        return "initial rotor speed" if is_rate else "initial rotor angle"
    return f"initial pitch {'rate' if is_rate else 'angle'} of blade {coordinate}"


# ---- Numbers of the runs


def run_quantities(sweep: _Sweep) -> list[RunQuantity]:
    """Return the quantities that differ from run to run, the most important first.

    The first quantity is the range of a pitch angle. Loads, rotor speed and stored metrics follow.
    The value of a run that was not computed is NaN.

    Parameters
    ----------
    sweep : the stored sweep.
    """
    stored = sweep.stored
    complete = sweep.statuses >= 0
    found = []
    if "angles" in stored.columns:
        pitch = np.degrees(np.asarray(stored.column("angles"), float)[:, :, 1:])
        if pitch.shape[2]:
            with np.errstate(all="ignore"):
                ranges = _over(np.nanmax, pitch, 1) - _over(np.nanmin, pitch, 1)
            found.append(
                RunQuantity("range of a pitch angle", "degrees", _over(np.nanmax, ranges, 1))
            )
    for load in sorted(LOADS, key=lambda load: not load.name.endswith("root_moment")):
        if load.name in stored.columns:
            values = np.asarray(stored.column(load.name), float)
            sizes = (
                np.linalg.norm(values, axis=-1) if load.dimensions[-1] == "axis" else np.abs(values)
            )
            largest = _over(np.nanmax, sizes.reshape(len(sizes), -1), 1)
            known = largest[np.isfinite(largest)]
            scale, prefix = prefix_of(float(known.max(initial=0.0)))
            found.append(
                RunQuantity(
                    f"largest {load.name.replace('_', ' ')}",
                    f"{prefix}{load.units}",
                    largest / scale,
                )
            )
    if "rates" in stored.columns:
        speed = np.asarray(stored.column("rates"), float)[:, -1, 0]
        found.append(RunQuantity("rotor speed at the end", "rad/s", speed))
    left_out = {*map(parameter_name, sweep.keys), *_COUNTS, "time_limit_s", "code", "crc32"}
    order = ("pitch_max", "rotor_rate_max", "rotor_angle_size_max")
    names = [
        name
        for name, column in stored.columns.items()
        if column.dimensions == ("run",) and name not in left_out
    ]
    for name in sorted(names, key=lambda name: order.index(name) if name in order else len(order)):
        values = np.asarray(stored.column(name))
        if values.dtype.kind == "f":
            column = stored.columns[name]
            unit = "" if column.units == "1" else column.units
            numbers = values.astype(float)
            if name == "pitch_max":  # the page shows all pitch angles in degrees
                numbers, unit = np.degrees(numbers), "degrees"
            found.append(RunQuantity(column.long_name.partition("; ")[0], unit, numbers))
    shown = []
    for quantity in found:
        values = np.where(complete, quantity.values, np.nan)
        known = values[np.isfinite(values)]
        # If the range of a quantity is rounding error, the quantity is left out.
        if len(known) > 1 and float(np.ptp(known)) > 1e-9 * float(np.abs(known).max()):
            shown.append(RunQuantity(quantity.name, quantity.unit, values))
    return shown


def _over(statistic: object, values: Array, axis: int) -> Array:
    """Return a statistic along an axis; NaN for slices without a finite number.

    Parameters
    ----------
    statistic : function of NumPy that ignores NaN, such as `numpy.nanmax`.
    values : array of any shape.
    axis : axis that the statistic removes.
    """
    assert callable(statistic)
    # NumPy warns about slices without a number. To avoid the warning, such slices are filled with
    # zeros, and their results are replaced by NaN.
    known = np.isfinite(values).any(axis=axis)
    filled = np.where(np.expand_dims(known, axis), values, 0.0)
    return np.where(known, statistic(filled, axis=axis), np.nan)


def explained(values: Array, parameter: Array) -> float:
    """Return the share of the variance of a quantity that a parameter explains, from 0 to 1.

    If the values of the quantity span decades, the variance is that of their logarithms.

    Parameters
    ----------
    values : (runs,) values of the quantity. Values that are not finite are ignored.
    parameter : (runs,) values of the parameter.
    """
    known = np.isfinite(values)
    y = np.log(values[known]) if is_wide(values) else values[known]
    whole = float(((y - y.mean()) ** 2).sum())
    if not whole:
        return 0.0
    # Analysis of variance: runs with the same value of the parameter form a group. The result is
    # the sum of squares between groups, divided by the total sum of squares.
    between = 0.0
    for value in np.unique(parameter[known]):
        group = y[parameter[known] == value]
        between += len(group) * float((group.mean() - y.mean()) ** 2)
    return between / whole


# ---- Answer and facts


def sweep_answer(sweep: _Sweep, quantities: Sequence[RunQuantity]) -> list[Markup]:
    """Return sentences on the statuses of the runs and on the first two quantities.

    A sentence on a quantity gives its extreme values and the parameter that decides it, if there is
    one.

    Parameters
    ----------
    sweep : the stored sweep.
    quantities : quantities of the runs, the most important first.
    """
    count = len(sweep.statuses)
    good = int(sweep.is_good.sum())
    text = (
        Markup("<b>{} of {} runs {} {}</b>").format(
            good, count, "is" if good == 1 else "are", sweep.good_words
        )
        if good < count
        else Markup("<b>All {} runs are {}</b>").format(count, sweep.good_words)
    )
    for code in np.unique(sweep.statuses[~sweep.is_good]):
        runs = np.flatnonzero(sweep.statuses == code)
        name = words_of(STATUSES[code]) if code >= 0 else "not computed"
        text += Markup(", {} {} {}").format(len(runs), "is" if len(runs) == 1 else "are", name)
        where = common_values(sweep, runs)
        if where:
            text += f", all at {where}"
    sentences = [text + "."]
    for quantity in quantities[:2]:
        values = np.where(sweep.is_good, quantity.values, np.nan)
        if np.isfinite(values).sum() < 2:
            continue
        low, high = int(np.nanargmin(values)), int(np.nanargmax(values))
        unit = _unit_after(quantity.unit)
        name = with_capital(quantity.name)
        if is_wide(values):
            text = Markup("The {} is largest, <b>{}{}</b>, at {}, and smallest, <b>{}{}</b>, at {}")
            text = text.format(
                quantity.name,
                number(float(values[high])),
                unit,
                sweep.described(high),
                number(float(values[low])),
                unit,
                sweep.described(low),
            )
        else:
            ends = [number(float(values[run]), 3) for run in (low, high)]
            if ends[0] == ends[1]:
                text = Markup("{} is <b>{}{}</b> in all of them").format(name, ends[0], unit)
            else:
                text = Markup("{} stays between <b>{} and {}{}</b>").format(name, *ends, unit)
        sentences.append(text + _deciding(sweep, values) + ".")
    if "shaft_moment" not in sweep.stored.columns:
        without_effect = [key for key in KEYS_OF_LOADS if key in sweep.varied]
        for key in without_effect:
            text = Markup("The {} changes nothing: it enters the loads alone, which are no output.")
            sentences.append(text.format(field_name(key)))
    return sentences


def _unit_after(unit: str) -> str:
    return "°" if unit == "degrees" else f" {unit}" if unit else ""


def _deciding(sweep: _Sweep, values: Array) -> str:
    """Return a clause on the parameter that explains most of the variance of a quantity.

    The clause is "" if this parameter explains too little, or if the sweep is not a grid of two
    parameters or more.

    Parameters
    ----------
    sweep : the stored sweep.
    values : (runs,) values of the quantity.
    """
    if len(sweep.varied) < 2 or not sweep.grid_keys:
        return ""
    shares = {key: explained(values, sweep.parameters[key]) for key in sweep.varied}
    key = max(shares, key=lambda key: shares[key])
    return f"; {field_name(key)} decides" if shares[key] > _DECIDES else ""


def common_values(sweep: _Sweep, runs: NDArray[np.int64]) -> str:
    """Return in words the parameters that have the same value in all given runs; "" if none has.

    Parameters
    ----------
    sweep : the stored sweep.
    runs : indices of the runs.
    """
    parts = []
    for key in sweep.varied:
        own = np.unique(sweep.parameters[key][runs])
        if len(own) == 1:
            parts.append(sweep.value(key, own[0]))
    return " and ".join(parts)


def _facts(sweep: _Sweep, quantities: Sequence[RunQuantity]) -> list[Fact]:
    """Return the facts at the top of the page, at most four.

    The facts are the number of good runs, the ranges of at most two parameters, and the ranges of
    the first quantities.

    Parameters
    ----------
    sweep : the stored sweep.
    quantities : quantities of the runs, the most important first.
    """
    count, good = len(sweep.statuses), int(sweep.is_good.sum())
    is_checked = sweep.good_words == "ok"
    note = "" if is_checked else "nothing is claimed of the printed equations"
    tone = "bad" if good < count else "good" if is_checked else ""
    facts = [Fact(f"Runs that are {sweep.good_words}", f"{good} of {count}", note, tone)]
    for key in sweep.varied[:2]:
        values = sweep.parameters[key]
        low, high = brief(values.min()), brief(values.max())
        note = f"{len(np.unique(values))} values"
        shown = f"{text_range(low, high)} {sweep.unit(key)}".rstrip()
        facts.append(Fact(with_capital(field_name(key)), shown, note))
    for quantity in quantities[: 4 - len(facts)]:
        known = quantity.values[np.isfinite(quantity.values)]
        digits = 2 if is_wide(known) else 3  # the sentence in the answer has as many digits
        ends = text_range(*(number(float(end), digits) for end in (known.min(), known.max())))
        facts.append(Fact(with_capital(quantity.name), f"{ends}{_unit_after(quantity.unit)}"))
    return facts


# ---- Map and curves


def _map(
    sweep: _Sweep, quantities: Sequence[RunQuantity], shown: NDArray[np.bool_]
) -> HeatMap | None:
    """Return the map of the runs over two parameters.

    None is returned if the sweep is not a grid of two parameters, if the grid is too large, or if
    there is no quantity.

    Parameters
    ----------
    sweep : the stored sweep.
    quantities : quantities from which the reader chooses the one that the map shows.
    shown : (runs,) whether each run is in the map. These are the runs of the first method.
    """
    if len(sweep.grid_keys) != 2 or not quantities:
        return None
    rows_key, columns_key = sweep.grid_keys
    rows, columns = (np.unique(sweep.parameters[key]) for key in (rows_key, columns_key))
    if max(len(rows), len(columns)) > _MAX_CELLS:
        return None
    cells: list[list[tuple[int, str] | None]] = []
    for row in rows[::-1]:
        line: list[tuple[int, str] | None] = []
        for column in columns:
            is_here = (
                (sweep.parameters[rows_key] == row)
                & (sweep.parameters[columns_key] == column)
                & shown
            )
            runs = np.flatnonzero(is_here)
            if not len(runs):
                line.append(None)
                continue
            run = int(runs[0])
            status = STATUSES[int(sweep.statuses[run])] if sweep.statuses[run] >= 0 else "missing"
            kind = (
                ""
                if status in GOOD
                else "warn"
                if status in ("inaccurate", "unchecked")
                else "failed"
            )
            line.append((run, kind))
        cells.append(line)
    note = f"Down: {sweep.axis_name(rows_key)}. Across: {sweep.axis_name(columns_key)}."
    if any(cell is not None and cell[1] == "warn" for line in cells for cell in line):
        note += " !: inaccurate or unchecked."
    if any(cell is not None and cell[1] == "failed" for line in cells for cell in line):
        note += " ✗: failed."
    if len(sweep.stored.methods) > 1:
        note += f" By {sweep.stored.methods[int(sweep.codes[shown][0])]} alone."
    label = (
        f"Runs by {field_name(rows_key)} and {field_name(columns_key)}; arrow keys move, the "
        "curves follow"
    )
    names = [with_capital(quantity.title) for quantity in quantities]
    texts = ([brief(value) for value in values] for values in (columns, rows[::-1]))
    columns_text, rows_text = texts
    return HeatMap(
        label, names, columns_text, rows_text, cells, f"{note} Click a cell for its curves."
    )


def _curves(sweep: _Sweep, shown: NDArray[np.bool_]) -> tuple[list[Plot], NDArray[np.int64]]:
    """Return the plots that show the curves of one run at a time.

    Parameters
    ----------
    sweep : the stored sweep.
    shown : (runs,) whether each run may have curves. These are the runs of the first method.

    Returns
    -------
    plots : list of Plot
        The values of a curve are a table, (chosen runs, samples), of which the page shows one row.
    places : (runs,) ndarray of int
        Row of each run in these tables; -1 if the page does not have its curves.
    """
    stored = sweep.stored
    places = np.full(len(sweep.statuses), -1)
    if "time" not in stored.columns:
        return [], places
    time = np.asarray(stored.column("time"), float)
    wanted: list[tuple[str, str, list[tuple[str, Look, str, int]]]] = []
    blades = stored.columns.get("angles") and stored.column("angles").shape[2] - 1
    if blades:
        wanted.append(
            (
                "Pitch angle",
                "degrees",
                [(f"blade-{i + 1}", blade_look(i), "angles", 1 + i) for i in range(blades)],
            )
        )
    if "pitch_actuator_moment" in stored.columns:
        count = stored.column("pitch_actuator_moment").shape[2]
        curves = [
            (f"blade-{i + 1}", blade_look(i), "pitch_actuator_moment", i) for i in range(count)
        ]
        wanted.append(("Pitch actuator moment", "N m", curves))
    if "rates" in stored.columns:
        wanted.append(("Rotor speed", "rad/s", [("rotor", coordinate_look(0), "rates", 0)]))
    elif "angles" in stored.columns:
        wanted.append(("Rotor angle", "rad", [("rotor", coordinate_look(0), "angles", 0)]))
    if not wanted or len(time) < 2:
        return [], places
    columns = sum(len(curves) for _, _, curves in wanted)
    # If the samples are too many for the curves of four runs, only every n-th sample is used, with
    # n = `every`.
    every = max(1, math.ceil(len(time) * columns / (MAX_NUMBERS // 4)))
    samples = time[::every]
    runs = chosen_runs(sweep, shown, max(4, MAX_NUMBERS // (columns * len(samples))))
    places[runs] = np.arange(len(runs))
    axis = Horizontal("time", "s", "t", float(time[0]), float(time[-1]))
    jumps = _jumps(sweep)
    plots: list[Plot] = []
    for title, unit, curves in wanted:
        tables = []
        for _, _, name, k in curves:
            values = np.asarray(stored.column(name)[runs], float)[:, ::every, k]
            tables.append(np.degrees(values) if unit == "degrees" else values)
        scale, prefix = (1.0, "")
        if unit == "N m":
            known = [float(np.abs(table[np.isfinite(table)]).max(initial=0.0)) for table in tables]
            scale, prefix = prefix_of(max(known))
        # A load jumps where the prescribed loads jump. Its curve is interrupted before the first
        # used sample after each jump.
        breaks = (
            [-(-place // every) for place in jumps.breaks(time)] if title.endswith("moment") else []
        )
        drawn = []
        for (key, look, _, _), table in zip(curves, tables, strict=True):
            drawn.append(Curve(key, look, samples, table / scale, breaks))
        note = f"every {every}th sample" if every > 1 else ""
        marks = jumps.marks(with_text=not plots)
        plots.append(
            Plot(title, f"{prefix}{unit}", axis, drawn, 138, note, marks=marks, least=1e-9)
        )
    return plots, places


def _jumps(sweep: _Sweep) -> Jumps:
    """Return the jumps of the base scene's loads.

    No jumps are returned if the sweep varies the duration, or the loads that may jump: the torque
    and the pitch commands. The jumps may then differ from run to run.
    """
    attributes = sweep.stored.attributes
    if not attributes.get("scene_toml") or any(
        key.startswith(("torque", "bearing.rest", "duration")) for key in sweep.keys
    ):
        return Jumps([], [])
    return jumps_of(sweep.stored.base_scene)


def chosen_runs(sweep: _Sweep, shown: NDArray[np.bool_], most: int) -> NDArray[np.int64]:
    """Return the indices of the runs whose curves are on the page, ascending.

    All runs are chosen if there are at most `most`. Otherwise at most half of the chosen runs are
    the corners of the parameter ranges and runs that are not ok. The others are equally spaced
    among all runs.

    Parameters
    ----------
    sweep : the stored sweep.
    shown : (runs,) whether each run may be chosen.
    most : largest number of chosen runs.
    """
    runs = np.flatnonzero(shown & (sweep.statuses >= 0))
    if len(runs) <= most:
        return runs
    is_corner = np.ones(len(sweep.statuses), bool)
    for key in sweep.varied:
        values = sweep.parameters[key]
        is_corner &= (values == values.min()) | (values == values.max())
    # Corners come before failed runs, because the list is cut off at half of the number.
    first = [*np.flatnonzero(shown & is_corner), *runs[~sweep.is_good[runs]]]
    first = list(dict.fromkeys(int(run) for run in first if sweep.statuses[run] >= 0))[: most // 2]
    others = runs[np.linspace(0, len(runs) - 1, most - len(first)).astype(int)]
    return np.unique([*first, *others.tolist()])


def _start(sweep: _Sweep, quantities: Sequence[RunQuantity], places: NDArray[np.int64]) -> int:
    """Return the index of the run that the page shows before the reader chooses another one.

    The run is chosen among good runs with curves. In a grid it is the run nearest to the middle. In
    another sweep it is the run whose first quantity is nearest to the median.

    Parameters
    ----------
    sweep : the stored sweep.
    quantities : quantities of the runs, the most important first.
    places : (runs,) row of each run in the tables of the curves; -1 if it has no curves.
    """
    candidates = np.flatnonzero((places >= 0) & sweep.is_good)
    if not len(candidates):
        candidates = np.flatnonzero(places >= 0) if (places >= 0).any() else np.arange(len(places))
    if sweep.grid_keys:
        # Distance from the middle of the grid, as the sum of the distances in steps along each
        # parameter.
        away = np.zeros(len(candidates))
        for key in sweep.grid_keys:
            values, index = np.unique(sweep.parameters[key], return_inverse=True)
            away += np.abs(index[candidates] - (len(values) - 1) / 2.0)
        return int(candidates[away.argmin()])
    if not quantities:
        return int(candidates[0])
    values = quantities[0].values[candidates]
    middle = np.nanmedian(values) if np.isfinite(values).any() else 0.0
    return int(candidates[np.nan_to_num(np.abs(values - middle), nan=np.inf).argmin()])


# ---- Over the parameters


def _over_parameters(
    sweep: _Sweep, quantities: Sequence[RunQuantity], shown: NDArray[np.bool_]
) -> Section:
    """Return the section with plots of the first three quantities over the parameters.

    For a grid of two parameters the quantities are plotted over the first parameter, with a curve
    for each value of the second one. For any other sweep they are plotted over each of the first
    three parameters, with a point for each run.

    Parameters
    ----------
    sweep : the stored sweep.
    quantities : quantities of the runs, the most important first.
    shown : (runs,) whether each run is drawn. These are the runs of the first method.
    """
    chosen = quantities[:3]
    elements: list[Grid | Fold | Element] = []
    if not sweep.varied or not chosen:
        return Section("slices", "", [])
    methods = sweep.stored.methods
    method = f" By {methods[int(sweep.codes[shown][0])]} alone." if len(methods) > 1 else ""
    keys = sweep.grid_keys
    if len(keys) == 2:
        key, other = keys
        others = np.unique(sweep.parameters[other])
        items = [
            (f"step-{i}", step_look(i, len(others), brief(value))) for i, value in enumerate(others)
        ]
        cards: list[list[Element]] = []
        for quantity in chosen:
            curves = []
            for i, value in enumerate(others):
                mine = shown & (sweep.parameters[other] == value)
                curves.append(
                    _parameter_curve(
                        f"step-{i}", items[i][1], sweep.parameters[key][mine], quantity.values[mine]
                    )
                )
            cards.append([_parameter_plot(sweep, key, quantity, curves)])
        say = f"Horizontally: {sweep.axis_name(key)}. A curve per {sweep.axis_name(other)}.{method}"
        if _is_log(sweep.parameters[key]) and not sweep.parameters[key].all():
            say += " The axis is logarithmic: runs at 0 are in the map."
        return Section("slices", f"Over {field_name(key)}", [Legend(items), Grid(3, cards)], say)
    for key in sweep.varied[:3]:
        cards = []
        for quantity in chosen:
            look = Look(BLUE, "-", "", "runs")
            curve = _parameter_curve(
                "runs", look, sweep.parameters[key][shown], quantity.values[shown]
            )
            is_line = len(sweep.varied) == 1
            curve = Curve(
                curve.key, curve.look, curve.x, curve.y, dots="line" if is_line else "only"
            )
            cards.append([_parameter_plot(sweep, key, quantity, [curve])])
        elements += [Note(f"Horizontally: {sweep.axis_name(key)}.{method}"), Grid(3, cards)]
    heading = (
        f"Over {field_name(sweep.varied[0])}" if len(sweep.varied) == 1 else "Over each parameter"
    )
    return Section("slices", heading, elements)


def _parameter_curve(key: str, look: Look, parameter: Array, values: Array) -> Curve:
    order = np.argsort(parameter, kind="stable")
    return Curve(key, look, parameter[order], values[order], dots="line")


def _is_log(parameter: Array) -> bool:
    """Return whether the axis of a parameter is logarithmic.

    It is logarithmic if no value is negative and the positive values span decades.
    """
    return bool((parameter >= 0.0).all()) and is_wide(parameter[parameter > 0.0])


def _parameter_plot(
    sweep: _Sweep, key: str, quantity: RunQuantity, curves: Sequence[Curve]
) -> Plot:
    """Return the plot of a quantity over a parameter.

    If the axis of the parameter is logarithmic, runs in which the parameter is zero are left out.

    Parameters
    ----------
    sweep : the stored sweep.
    key : name of the parameter.
    quantity : the quantity on the vertical axis.
    curves : curves of the quantity over the values of the parameter.
    """
    parameter = sweep.parameters[key]
    positive = parameter[parameter > 0.0]
    is_log = _is_log(parameter)
    shown = positive if is_log else parameter
    if is_log and len(positive) < len(parameter):
        kept = []
        for curve in curves:
            mask = curve.x > 0.0
            kept.append(Curve(curve.key, curve.look, curve.x[mask], curve.y[mask], dots=curve.dots))
        curves = kept
    unit = sweep.unit(key)
    low, high = float(shown.min()), float(shown.max())
    # The range is extended a little, so that the first and the last dot are drawn whole.
    if is_log:
        room = (high / low) ** 0.02
        low, high = low / room, high * room
    elif any(curve.dots for curve in curves):
        room = 0.02 * (high - low)
        low, high = low - room, high + room
    axis = Horizontal(field_name(key), unit, field_name(key), low, high, is_log)
    return Plot(
        with_capital(quantity.name),
        quantity.unit,
        axis,
        curves,
        220,
        log=is_wide(quantity.values),
        still=True,
    )


# ---- Tables


def _faults_section(sweep: _Sweep, *, with_links: bool) -> Section:
    """Return the section with a table of the runs that are not ok.

    Runs with the same status and reason form a row. It has their number, the ranges of the
    parameters, and an example.

    Parameters
    ----------
    sweep : the stored sweep.
    with_links : whether the number of the example is a link that shows this run in the map or the
        plots of the page.
    """
    groups: dict[tuple[int, str], list[int]] = {}
    messages = [text_of(characters) for characters in sweep.stored.column("message")]
    for run in np.flatnonzero(~sweep.is_good).tolist():
        # Reasons that differ only in their numbers belong to the same group.
        words = re.sub(r"[-+]?\d[\d.]*(e[-+]?\d+)?", "#", messages[run])
        groups.setdefault((int(sweep.statuses[run]), words), []).append(run)
    rows: list[Row] = []
    for (code, _), runs in sorted(groups.items(), key=lambda group: -len(group[1])):
        name = words_of(STATUSES[code]) if code >= 0 else "not computed"
        row: list[TableCell | str] = [TableCell(name, "bad"), str(len(runs))]
        for key in sweep.varied[:4]:
            values = sweep.parameters[key][runs]
            low, high = brief(values.min()), brief(values.max())
            row.append(text_range(low, high))
        # The example of a group is the run with the largest defect.
        sizes = np.asarray(sweep.stored.column("defect_max"))[runs]
        worst = runs[int(np.nan_to_num(sizes, nan=-1.0).argmax())]
        reason = messages[worst] or "no reason is stored"
        row.append(TableCell(reason, mark="across"))
        row.append(TableCell(str(sweep.numbers[worst]), href=f"#run-{worst}" if with_links else ""))
        rows.append(row)
    head = (
        "Status",
        "Runs",
        *(with_capital(sweep.axis_name(key)) for key in sweep.varied[:4]),
        "Reason",
        "Example",
    )
    heading = f"Runs that are not {sweep.good_words}"
    return Section("faults", heading, [PageTable(heading, head, rows)] if rows else [])


def _runs_section(sweep: _Sweep, quantities: Sequence[RunQuantity], *, with_links: bool) -> Section:
    """Return the section with a folded table of the runs, with those that are not ok first.

    The table has at most _MAX_ROWS rows.

    Parameters
    ----------
    sweep : the stored sweep.
    quantities : quantities of the runs. The table has columns for as many of them as fit.
    with_links : whether the number of a run is a link that shows the run in the map or the plots of
        the page.
    """
    chosen = quantities[: max(1, 6 - len(sweep.varied))]
    order = [*np.flatnonzero(~sweep.is_good).tolist(), *np.flatnonzero(sweep.is_good).tolist()][
        :_MAX_ROWS
    ]
    several = len(sweep.stored.methods) > 1
    rows: list[Row] = []
    for run in order:
        tone = sweep.tone(run)
        sign = "✓ " if tone == "good" else ""
        row: list[TableCell | str] = [
            TableCell(
                str(sweep.numbers[run]),
                href=f"#run-{run}" if with_links else "",
                order=float(sweep.numbers[run]),
            )
        ]
        if several:
            row.append(sweep.stored.methods[int(sweep.codes[run])])
        for key in sweep.varied[:4]:
            value = float(sweep.parameters[key][run])
            row.append(TableCell(brief(value), order=value))
        row.append(TableCell(f"{sign}{sweep.status_of(run)}", tone))
        for quantity in chosen[: max(1, 7 - len(row))]:
            value = float(quantity.values[run])
            known = value if math.isfinite(value) else None
            row.append(TableCell(number(known, 3), order=known))
        rows.append(row)
    width = len(rows[0]) if rows else 0
    parameters = [with_capital(sweep.axis_name(key)) for key in sweep.varied[:4]]
    head = ["Run", *(["Method"] if several else []), *parameters, "Status"]
    head += [with_capital(quantity.title) for quantity in chosen][: width - len(head)]
    table = PageTable("All runs", head, rows, sortable=True)
    count = len(sweep.statuses)
    hint = (
        "click a heading to sort"
        if count <= _MAX_ROWS
        else f"the first {_MAX_ROWS}, those that are not {sweep.good_words} before the others"
    )
    return Section("runs", "All runs", [Fold(f"{count} runs", hint, [table])] if rows else [])


def _details_section(sweep: _Sweep, quantities: Sequence[RunQuantity]) -> Section:
    """Return the section of folded details: parameters, distributions of quantities, sweep file.

    Parameters
    ----------
    sweep : the stored sweep.
    quantities : quantities of the runs. Their quantiles over the good runs are shown.
    """
    stored = sweep.stored
    parameters = sweep_parameters(stored)
    rows: list[Row] = []
    for quantity in quantities:
        values = quantity.values[sweep.is_good & np.isfinite(quantity.values)]
        if len(values) > 1:
            quantiles = [
                number(float(value), 3)
                for value in np.quantile(values, (0.0, 0.05, 0.5, 0.95, 1.0))
            ]
            rows.append((with_capital(quantity.title), *quantiles))
    head = (
        f"Result of the {sweep.good_words} runs",
        "Smallest",
        "5 %",
        "Median",
        "95 %",
        "Largest",
    )
    folds: list[Grid | Fold | Element] = [
        Fold(
            "Parameters",
            f"{len(sweep.keys)} that were varied",
            [
                PageTable(
                    "Parameters", [with_capital(text) for text in parameters.head], parameters.rows
                )
            ],
        ),
    ]
    if rows:
        folds.append(
            Fold("Distributions", f"{len(rows)} numbers", [PageTable("Results", head, rows)])
        )
    toml = str(stored.attributes.get("sweep_toml", ""))
    if toml:
        folds.append(Fold("Sweep file", "", [SourceText(toml)]))
    return Section("details", "In detail", folds)
