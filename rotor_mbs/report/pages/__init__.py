"""One module per page: stored data to the content of the page."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import NamedTuple

from rotor_mbs.analysis.claims import Claim
from rotor_mbs.analysis.published import ClaimStudy, Erratum
from rotor_mbs.analysis.stability import SuiteRun
from rotor_mbs.runs.records import Record


class Context(NamedTuple):
    """What the page of a scene or a figure needs to know of the rest of the file."""

    files: Mapping[str, str]  # the name of each scene's page, in order
    claims: Sequence[Claim] = ()  # of the paper about these scenes
    conditions: Mapping[str, str] = {}  # what the paper does not print
    study: ClaimStudy | None = None  # the claims on many runs, and the numbers under other conditions
    curves: Mapping[str, Sequence[Record]] = {}  # error against run time, by scene
    errata: Sequence[Erratum] = ()  # empty where there is no such page
    suite_runs: Sequence[SuiteRun] = ()  # of the stability suite, with the errors over steps that it measured
    ladders: Sequence[Record] = ()
