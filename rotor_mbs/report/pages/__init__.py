"""One module per page: a report's data to the content of the page."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from functools import cached_property

import numpy as np

from rotor_mbs.analysis import published, run_selection
from rotor_mbs.analysis.claims import Claim, claims
from rotor_mbs.analysis.published import ClaimStudy, Erratum
from rotor_mbs.analysis.stability import SuiteRun, suite_runs
from rotor_mbs.analysis.work_precision import by_scene
from rotor_mbs.methods.catalogue import errata_methods
from rotor_mbs.report.core.files import page_names
from rotor_mbs.runs.read import OpenResults
from rotor_mbs.runs.records import Record, read_records

_SUITE_FOLDERS = {"stiff", "extreme"}


class Report(OpenResults):
    """An open results file, and what its pages show of it. What no page asks for is not read."""

    @cached_property
    def is_suite(self) -> bool:
        """Whether the file is of the stability suite: it has ladders of steps, or all its scenes are of the suite."""
        folders = {name.partition("/")[0] for name, scene in self.scenes.items() if scene.methods}
        return bool(read_records(self.path, "stability")) or (bool(folders) and folders <= _SUITE_FOLDERS)

    @cached_property
    def files(self) -> Mapping[str, str]:
        """The file of each scene's page, in order."""
        return page_names(name for name, scene in self.scenes.items() if scene.methods or not self.is_suite)

    @cached_property
    def claims(self) -> Sequence[Claim]:
        """Of the paper, about these scenes."""
        return claims(self.scenes)

    @cached_property
    def conditions(self) -> Mapping[str, str]:
        """What the paper does not print."""
        return published.conditions() if self.claims else {}

    @cached_property
    def study(self) -> ClaimStudy | None:
        """The claims on many runs, and the numbers under other conditions."""
        return published.claim_study() if self.claims else None

    @cached_property
    def errata(self) -> Sequence[Erratum]:
        """Empty where no run is of equations that have them."""
        printed = {run_selection.PRINTED, *errata_methods().values()}
        return published.errata() if any(printed & {*scene.runs} for scene in self.scenes.values()) else ()

    @cached_property
    def curves(self) -> Mapping[str, Sequence[Record]]:
        """Error against run time, by scene."""
        return by_scene(read_records(self.path, "bench"))

    @cached_property
    def suite_runs(self) -> Sequence[SuiteRun]:
        return suite_runs(self.path) if self.is_suite else ()

    @cached_property
    def ladders(self) -> Sequence[Record]:
        """Errors over steps that were measured for the suite."""
        records = read_records(self.path, "stability")
        return [record for record in records if np.isfinite(record.arrays["angle_error_max"]).any()]
