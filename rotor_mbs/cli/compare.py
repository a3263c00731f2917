"""`compare`: data of another program against a scene's reference; status 1 where they do not agree."""

from __future__ import annotations

import argparse
import json

from rotor_mbs.analysis.data_verdict import as_dictionary
from rotor_mbs.report.data_comparison import compare_data
from rotor_mbs.scenario.catalogue import only_scene


def compare(arguments: argparse.Namespace) -> int:
    """The verdict as a table, its page, and the numbers as a results file; with --json the verdict alone."""
    found = compare_data(
        arguments.data, only_scene(arguments.scene), columns=arguments.columns, tolerance=arguments.tolerance
    )
    page, stored = found.to_html(arguments.output), arguments.output / "comparison.h5"
    found.save(stored)
    if arguments.json:
        print(json.dumps(as_dictionary(found.verdict), ensure_ascii=False, indent=1))
    else:
        print(found)
        print(f"page: {page}, numbers: {stored}")
    return 0 if found.agrees else 1
