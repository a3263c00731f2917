"""Commands that list and show scenes and methods, run studies, and write files and pages.

The commands `run`, `reproduce` and `reference` are in `cli.runs`, `check` and `test-method` in
`cli.verdicts`. A command imports the modules that only it needs when it is called. Therefore `list`
does not load `scenario.scene`, and `report` loads no model.
"""

from __future__ import annotations

import argparse
import errno
import json
import sys
import time
from collections import Counter
from dataclasses import asdict
from pathlib import Path
from typing import Any

from rotor_mbs.cli import EXIT_BAD_INPUT, EXIT_FAILED, EXIT_OK, print_line
from rotor_mbs.cli.arguments import pages_beside
from rotor_mbs.cli.terminal import print_json, print_not_computed, print_table
from rotor_mbs.errors import InputError, MethodRefusal, StoreError
from rotor_mbs.methods.base import Method
from rotor_mbs.methods.catalogue import (
    check_names,
    find_method,
    find_method_or_none,
    methods,
)
from rotor_mbs.methods.method_file import ENDING
from rotor_mbs.methods.selection import problems_of_methods
from rotor_mbs.processes import cores
from rotor_mbs.runs.progress import ProgressLine
from rotor_mbs.scenario.catalogue import (
    MAPPING_ENDING,
    check_scene_name,
    find_scenes,
    list_scenes,
    list_sweeps,
    only_scene,
)
from rotor_mbs.scenario.keys import counted
from rotor_mbs.scenario.toml_file import file_path, shown_key
from rotor_mbs.solution.status import REFUSED


def list_all(arguments: argparse.Namespace) -> int:
    """Print the shipped scenes and sweeps with their titles, and all methods with their labels.

    Parameters
    ----------
    arguments : `json`, whether JSON is printed.
    """
    scenes, sweeps = list_scenes(), list_sweeps()
    labels = [(method.name, method.label) for method in methods()]
    if arguments.json:
        kinds = {"scene": scenes, "sweep": sweeps, "method": labels}
        rows = [
            {"name": name, "title": title, "kind": kind}
            for kind in kinds
            for name, title in kinds[kind]
        ]
        print_json(rows)
        return 0
    headings: dict[str, list[tuple[str, str]]] = {}
    for name, title in scenes:
        headings.setdefault(f"scenes: {name.partition('/')[0]}", []).append((name, title))
    headings |= {"sweeps": sweeps, "methods": labels}
    width = max(len(name) for entries in headings.values() for name, _ in entries)
    for heading, entries in headings.items():
        print(heading, *(f"  {name:{width}}  {title}" for name, title in entries), "", sep="\n")
    print(
        "next: rotor-mbs show NAME; rotor-mbs run SCENE [-m METHOD]; rotor-mbs sweep SWEEP; "
        "rotor-mbs new FILE.toml"
    )
    return 0


def new(arguments: argparse.Namespace) -> int:
    """Write a new scene file.

    The scene is a copy of a source, is made from an OpenFAST model, or is a commented example with
    all keys. For an OpenFAST model, a mapping file for its results is written beside the scene.

    Parameters
    ----------
    arguments : `file`, the scene file to write; `source`, the name of a scene, a TOML file or a
        .fst file, or None.

    Raises
    ------
    InputError
        If the file's name is not allowed, a file exists already or cannot be created, or the source
        cannot be read.
    """
    from rotor_mbs.scenario.scene import new_scene_text

    path = arguments.file
    source = None if arguments.source is None else file_path(arguments.source)
    if path.suffix != ".toml":
        raise InputError(f"{path}: is not a TOML file's name; allowed: a name that ends in .toml")
    check_scene_name(path)
    lines = [f"{path}: edit it, then: rotor-mbs run {path}"]
    if source is None:
        texts = {path: new_scene_text()}
    elif source.suffix.lower() == ".fst":
        texts, lines = _files_of_model(path, source)
    elif source.is_file() and source.suffix != ".toml":
        allowed = "a scene's name, a path that ends in .toml, or in .fst (an OpenFAST model)"
        raise InputError(f"{source}: is neither a scene nor an OpenFAST model; allowed: {allowed}")
    else:
        texts = {path: only_scene(arguments.source).text}
    # All names are checked before the first file is written.
    for new_file in texts:
        if new_file.exists() or new_file.is_symlink():
            raise InputError(
                f"{new_file}: cannot be created: File exists; allowed: a file that does not exist "
                "yet"
            )
    for new_file, text in texts.items():
        try:
            with new_file.open("x", encoding="utf-8") as file:
                file.write(text)
        except OSError as exc:
            raise InputError(
                f"{new_file}: cannot be created: {exc.strerror}; allowed: a file that does not "
                "exist yet"
            ) from exc
    print(*lines, sep="\n")
    return 0


def _files_of_model(path: Path, model: Path) -> tuple[dict[Path, str], list[str]]:
    """Return the texts of a scene file and a mapping file for an OpenFAST model.

    Parameters
    ----------
    path : path of the scene file; the mapping file is beside it.
    model : the .fst file of the model.

    Returns
    -------
    dict of str by Path, list of str
        The text of each file, and the lines to print about the model and the files.
    """
    from rotor_mbs.scenario.openfast import read_rotor
    from rotor_mbs.scenario.openfast_scene import mapping_text, scene_of_rotor

    rotor = read_rotor(model)
    scene = scene_of_rotor(rotor)
    mapping = path.with_suffix(MAPPING_ENDING)
    lines = []
    for number, blade in enumerate(rotor.blades, 1):
        line = f"blade {number}: {blade.mass:.3f} kg, cone {blade.cone:g} deg; {blade.source}"
        lines.append(line)
    if rotor.has_equal_blades:
        lines = [f"{len(lines)} blades: {lines[0].partition(': ')[2]}"]
    total = sum(rotor.hub_inertia)
    lines.append(
        f"shaft: tilt {rotor.tilt:g} deg, {rotor.speed:g} rpm; hub and generator {total:.6g} kg m^2"
    )
    for note in rotor.left_out:
        lines.append(f"not in the scene: {note.partition(': ')[0]}")
    lines.append(f"{path}: edit it, then: rotor-mbs run {path}")
    results = model.with_suffix(".out")
    lines.append(
        f"{mapping}: for results, rotor-mbs compare {results} --scene {path} --columns {mapping}"
    )
    return {path: scene.text, mapping: mapping_text(rotor)}, lines


def show(arguments: argparse.Namespace) -> int:
    """Print a scene with its methods, the settings of a method, or a summary of a results file.

    Parameters
    ----------
    arguments : `scene`, the name of a scene or method, or the path of a file; `build`, whether the
        items that each model builds are printed; `json`, whether JSON is printed.
    """
    from rotor_mbs.runs.trailer import is_of_this_program

    if arguments.scene.endswith(ENDING):
        for name in check_names(arguments.scene):
            _show_method(find_method(name), as_json=arguments.json)
        return 0
    method, path = find_method_or_none(arguments.scene), Path(arguments.scene)
    if method is not None:
        _show_method(method, as_json=arguments.json)
    elif path.suffix in _HDF5_SUFFIXES or is_of_this_program(path):
        from rotor_mbs.analysis.file_summary import summary_of

        summary = summary_of(path)
        if arguments.json:
            print_json(summary.as_dictionary(), indent=1)
        else:
            print(summary)
    else:
        _show_scene(arguments)
    return 0


def _show_method(method: Method, *, as_json: bool) -> None:
    """Print the settings of a method with their defaults, allowed values and meanings.

    Parameters
    ----------
    method : the method.
    as_json : whether JSON is printed.
    """
    declared, defaults = method.settings.declared(), method.defaults
    if as_json:
        rules = {}
        for name, setting in declared.items():
            rules[name] = {"allowed": setting["allowed"], "doc": setting["doc"]}
        facts = {"name": method.name, "label": method.label, "settings": defaults, "allowed": rules}
        print_json(facts, indent=1)
        return
    print(f"{method.name}: {method.label}\n")
    for name, setting in declared.items():
        rule = f"{setting['allowed']}; {setting['doc']}".rstrip("; ")
        print(f"  {name:26} {defaults[name]!s:>16}  {rule}")
    print(
        f"\nto change a setting: rotor-mbs run SCENE -m {method.name} --set NAME=VALUE"
        if declared
        else "no settings"
    )


def _show_scene(arguments: argparse.Namespace) -> None:
    """Print the data of a scene, and all methods; a method that cannot run it has the reason.

    Parameters
    ----------
    arguments : `scene`, the name of the scene or the path of its file; `build`, whether the items
        that each model builds are printed; `json`, whether JSON is printed.
    """
    from rotor_mbs.scenario.scene import scene_keys, scene_tables, unit_of, without_times

    scene = only_scene(arguments.scene)
    models: dict[str, dict[str, Any]] = {}
    for method in methods():
        facts = {
            "name": method.model,
            "methods": [],
            "items": [],
            "refused": "",
            "is_linearized": False,
        }
        model = models.setdefault(method.model, facts)
        model["methods"].append(method.name)
        model["is_linearized"] |= method.linearize is not None
        # All methods of a model build the same items. Those of the first method that returns items
        # are shown.
        if not model["items"]:
            try:
                model["items"], model["refused"] = list(map(asdict, method.items(scene))), ""
            except MethodRefusal as exc:
                model["refused"] = str(exc)
    tables = scene_tables(scene)
    if arguments.json:
        print_json({"name": scene.name, "scene": tables, "models": models}, indent=1)
        return
    print(f"{scene.label}\n")
    for path, value in scene_keys(scene):
        unit = "" if unit_of(path) == "1" else f", {unit_of(path)}"
        print(f"  {shown_key(path) + unit:28} {without_times(value)}")
    print("\nmethods" + (", and the items that each model builds" if arguments.build else ""))
    for name, model in models.items():
        first, *others = model["methods"]
        # "lagrange/taylor, /ode45, ..."
        line = ", ".join([first, *(other.removeprefix(name) for other in others)])
        if model["refused"]:
            line += f"  (not available: {model['refused']})"
        elif model["is_linearized"]:
            line += "  (linearized by `rotor-mbs modes`)"
        print(f"  {line}")
        for item in model["items"] if arguments.build else ():
            print(f"    {item['kind']:9} {item['name']:28} {item['detail']}".rstrip())


_HDF5_SUFFIXES = (".h5", ".hdf5", ".nc")
_DISK_IS_FULL = (errno.ENOSPC, errno.EDQUOT, errno.EFBIG)


def bench(arguments: argparse.Namespace) -> int:
    """Measure errors and run times of methods, print them, and write the pages of the results file.

    A point that fails is a result of the measurement, and does not change the exit status.

    Parameters
    ----------
    arguments : `scenes`, their names; `method`, the names of methods; `output`, the results file;
        `repeats`, the maximum number of timed runs of a point; `budget`, the time for a scene in s.

    Returns
    -------
    int
        1 if a curve was not computed, otherwise 0.
    """
    from rotor_mbs.analysis.text_tables import bench_table
    from rotor_mbs.runs.read import read_records
    from rotor_mbs.studies.bench import run_bench

    scenes, output = find_scenes(arguments.scenes), arguments.output
    with ProgressLine() as progress:
        made, refused = run_bench(
            scenes,
            arguments.method,
            output,
            repeats=arguments.repeats,
            budget_s=arguments.budget,
            workers=cores(),
            on_progress=progress,
        )
    measured = len({outcome.scene for outcome in made})
    is_incomplete = print_not_computed(made, refused)
    not_run = {refusal.scene for refusal in refused if not refusal.method}
    names = {scene.name for scene in scenes} - not_run
    print_table(
        bench_table([curve for curve in read_records(output, "bench") if curve.scene in names])
    )
    text = f"{counted(measured, 'scene')} measured, {len(names) - measured} already stored"
    if refused:
        text += f", {counted(len(refused), 'curve')} not run"
    print(f"{output}: {text}")
    _write_pages(output)
    return int(is_incomplete)


def stability(arguments: argparse.Namespace) -> int:
    """Run the suite of stiff and extreme scenes, and write the pages of the results file.

    A table with the number of runs that are ok is printed, by method and folder of scenes.

    Parameters
    ----------
    arguments : `scenes`, the names of scenes, by default those of the suite; `method`, the names of
        methods; `set`, settings; `output`, the results file; `jobs`, the number of processes;
        `timeout`, the time limit of a run in s.

    Returns
    -------
    int
        1 if a run was not computed, otherwise 0.
    """
    from rotor_mbs.studies.stability import SUITE, run_suite, suite_runs, suite_table

    start, scenes = time.monotonic(), find_scenes(arguments.scenes or SUITE)
    with ProgressLine() as progress:
        made, refused = run_suite(
            scenes, arguments.output, workers=arguments.jobs, timeout_s=arguments.timeout,
            methods=arguments.method, settings=dict(arguments.set or ()), on_progress=progress,
        )  # fmt: skip
    is_incomplete = print_not_computed(made, refused)
    runs = suite_runs(arguments.output)
    print_table(suite_table(runs))
    text = f"{counted(len(scenes), 'scene')}, {counted(len(runs), 'run')}"
    if refused:
        text += f", {len(refused)} not run"
    print(f"{arguments.output}: {text}, {time.monotonic() - start:.0f} s")
    _write_pages(arguments.output)
    return int(is_incomplete)


def modes(arguments: argparse.Namespace) -> int:
    """Compute and print the modes of scenes, and write the pages of the results file.

    Parameters
    ----------
    arguments : `scenes`, their names; `speeds`, the rotor speeds in rad/s; `method`, the names of
        methods whose models are compared; `output`, the results file; `jobs`, the number of
        processes; `timeout`, the time limit of a scene in s; `json`, whether JSON is printed and no
        pages are written.

    Returns
    -------
    int
        1 if two models disagree, the modes of a model do not satisfy its own equations, or a scene
        was not computed; 2 if no scene has modes; otherwise 0.
    """
    from rotor_mbs.analysis.modes import mode_rows, mode_summary, read_modes
    from rotor_mbs.studies.modes import modes_of_scenes

    scenes = find_scenes(arguments.scenes)
    with ProgressLine() as progress:
        made = modes_of_scenes(
            scenes,
            arguments.output,
            speeds=arguments.speeds,
            names=arguments.method,
            workers=arguments.jobs,
            timeout_s=arguments.timeout,
            on_progress=progress,
        )
    is_incomplete = print_not_computed(made)
    if all(outcome.status == REFUSED for outcome in made):
        return EXIT_BAD_INPUT
    lost = {outcome.scene for outcome in made if not outcome.is_stored}
    found = read_modes(arguments.output) if len(lost) < len(scenes) else {}
    # Scenes whose modes were not computed by this call are left out, even if the file has modes of
    # them from an earlier call.
    chosen = [
        found[scene.name] for scene in scenes if scene.name in found and scene.name not in lost
    ]
    if arguments.json:
        for modes in chosen:
            print(*modes.notes, sep="\n", end="\n" if modes.notes else "", file=sys.stderr)
        print_json({modes.scene: mode_rows(modes) for modes in chosen}, indent=1)
    else:
        for modes in chosen:
            print(mode_summary(modes))
        _write_pages(arguments.output)
    return int(is_incomplete or not all(modes.agrees for modes in chosen))


def compare(arguments: argparse.Namespace) -> int:
    """Compare data of another program with a scene, see `api.comparisons.compare`.

    The verdict is printed as text or JSON. A page and a file with the numbers are written.

    Parameters
    ----------
    arguments : `data`, the data file; `scene`, the name of the scene or the path of its file;
        `columns`, the mapping file; `tolerance`, in rad, or relative for loads and modes;
        `timeout`, the time limit in s; `output`, the folder of the page and the file; `json`,
        whether the verdict is printed as JSON.

    Returns
    -------
    int
        0 if the data agree with the scene, otherwise 1.

    Raises
    ------
    InputError, StoreError
        If the data cannot be compared, or the file with the numbers exists and is of another kind.
    """
    from rotor_mbs.api.comparisons import compare as compare_data
    from rotor_mbs.comparison.verdict import as_dictionary
    from rotor_mbs.runs.trailer import COMPARISON, may_extend

    stored = arguments.output / "comparison.h5"
    may_extend(stored, COMPARISON)  # before anything is computed
    comparison = compare_data(
        arguments.data,
        only_scene(arguments.scene),
        columns=arguments.columns,
        tolerance=arguments.tolerance,
        timeout=arguments.timeout,
    )
    page = comparison.to_html(arguments.output)
    comparison.save(stored)
    if arguments.json:
        print_json(as_dictionary(comparison.verdict), indent=1)
    else:
        print(comparison, f"page: {page}, numbers: {stored}", sep="\n")
    return 0 if comparison.agrees else 1


def export(arguments: argparse.Namespace) -> int:
    """Write a scene in the format of another program, and print the paths of the written files."""
    from rotor_mbs.studies.export import FORMATS
    from rotor_mbs.studies.export import export as export_scene

    scene = only_scene(arguments.scene)
    output = arguments.output or Path(scene.name.rpartition("/")[2] + FORMATS[arguments.to][0])
    print(*export_scene(scene, arguments.to, output), sep="\n")
    return 0


def report(arguments: argparse.Namespace) -> int:
    """Write the pages of the results file `arguments.file`.

    The pages are written into the folder `arguments.output`, by default one beside the file.
    """
    from rotor_mbs.report.build import write_report

    output = arguments.output or pages_beside(arguments.file)
    index = write_report(arguments.file, output, jobs=cores())
    print(index)
    if arguments.open:
        import webbrowser  # imported only if needed

        webbrowser.open(index.resolve().as_uri())
    return 0


def figures(arguments: argparse.Namespace) -> int:
    """Write the figures of the paper, for a manuscript, to files in `arguments.output`."""
    from rotor_mbs.report.figures import write_figures

    print(
        *write_figures(arguments.file, arguments.output, arguments.format, arguments.figure or ()),
        sep="\n",
    )
    return 0


def animate(arguments: argparse.Namespace) -> int:
    """Write an animation of the motion of `arguments.scene` that `arguments.file` stores."""
    from rotor_mbs.report.animation import write_animation

    output = arguments.output or file_path(arguments.scene.rpartition("/")[2] + ".webp")
    print(write_animation(arguments.file, arguments.scene, output, arguments.offset))
    return 0


def sweep(arguments: argparse.Namespace) -> int:
    """Run a parameter study, and store its runs in one dataset.

    Parameters
    ----------
    arguments : `file`, the sweep file; `method`, the names of methods; `engine`, the kind of worker
        processes, and `jobs`, their number; `part`, (K, N) for part K of N; `timeout`, the time
        limit of a run in s; `output`, the dataset; `fresh`, whether stored runs are computed again;
        `dry_run`, whether only the number and size of the runs are printed; `metadata`, whether a
        Croissant file is written; `datasets`, a folder for the files of the splits, or None;
        `json`, whether JSON is printed.

    Returns
    -------
    int
        1 if a run of a method with the corrected equations is not ok, something was refused, or the
        disk is full; 2 if all runs were refused, or the dataset cannot be used; otherwise 0.

    Raises
    ------
    InputError
        If the sweep or the engine is not valid.
    """
    from rotor_mbs.runs.engines import open_task_pool

    # The pool is opened first, so that its workers load their code while the sweep is read.
    with open_task_pool(arguments.engine, arguments.jobs) as pool:
        from rotor_mbs.scenario.sweep import load_sweep
        from rotor_mbs.studies.sweep import plan_sweep, run_sweep

        study = load_sweep(arguments.file, problems_of_methods)
        plan = plan_sweep(study, arguments.method, arguments.part, arguments.timeout)
        if arguments.dry_run:
            for refusal in plan.refused:
                print_line(str(refusal), sys.stderr)
            size = plan.runs * plan.table().row_type.itemsize
            if arguments.json:
                facts = {"runs": plan.runs, "methods": list(plan.methods), "bytes": size}
                print(json.dumps(facts))
            else:
                print(f"{plan.runs:,} runs with {', '.join(plan.methods)}: {size / 1e6:,.3f} MB")
            return 0
        stream = sys.stderr if arguments.json else sys.stdout  # only JSON on the standard output
        if not plan.runs:  # for example in a job array with more parts than runs
            if arguments.json:
                print(
                    json.dumps(
                        {
                            "event": "end",
                            "runs": 0,
                            "made": 0,
                            "statuses": {},
                            "files": [],
                            "seconds": 0.0,
                        }
                    )
                )
            print("no runs in this part", file=stream)
            return 0
        output = arguments.output or Path(f"{plan.sweep.name}.h5")
        made: Counter[str] = Counter()

        def on_progress(done: int, total: int, statuses: Counter[str]) -> None:
            made.update(statuses)
            progress.runs(done, total, statuses)

        try:
            with ProgressLine() as progress:
                result = run_sweep(plan, output, pool, on_progress, fresh=arguments.fresh)
        except StoreError as exc:
            print_line(str(exc), sys.stderr)
            is_full = isinstance(exc.__cause__, OSError) and exc.__cause__.errno in _DISK_IS_FULL
            # If runs were stored, the same command can continue, and the status is that of a
            # failure. If none were stored, the file is bad input.
            return EXIT_FAILED if is_full or made else EXIT_BAD_INPUT
        if arguments.json:
            facts = {
                "runs": result.runs,
                "made": result.made,
                "statuses": result.statuses,
                "files": [str(result.path)],
            }
            print(json.dumps({"event": "end", **facts, "seconds": round(result.seconds, 3)}))
        else:
            by_status = ", ".join(
                f"{count} {status}" for status, count in Counter(result.statuses).most_common()
            )
            by_status = by_status or "none stored"
            rate = f", {result.made / result.seconds:.4g} per s" if result.made else ""
            computed = f"{result.made} computed in {result.seconds:.1f} s{rate}"
            print(f"{result.path}: {counted(result.runs, 'run')}: {by_status}; {computed}")
        if result.older:
            print_line(
                f"{result.older} stored runs are from other versions; --fresh recomputes them",
                sys.stderr,
            )
        for line in result.lost:
            print_line(f"{line}; not computed; repeat the command to try again", sys.stderr)
        for line in result.refused:
            print_line(line, sys.stderr)
        if arguments.metadata:
            from rotor_mbs.studies.sweep_metadata import describe

            print(f"{result.path}: described in {describe(result.path).name}", file=stream)
        if arguments.datasets:
            from rotor_mbs.studies.sweep_metadata import write_splits

            names = ", ".join(place.name for place in write_splits(result.path, arguments.datasets))
            print(f"{arguments.datasets}: {names}", file=stream)
        if result.refused and not result.statuses:
            return EXIT_BAD_INPUT
        return EXIT_OK if result.is_ok else EXIT_FAILED


def _write_pages(results: Path) -> None:
    from rotor_mbs.report.build import write_report

    print(f"report: {write_report(results, pages_beside(results))}")
