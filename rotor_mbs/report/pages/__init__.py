"""One module per page: stored data to the content of the page."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path

from rotor_mbs.analysis.claim_study import ClaimStudy
from rotor_mbs.analysis.claims import Claim
from rotor_mbs.analysis.published import Erratum
from rotor_mbs.report.core.files import Site
from rotor_mbs.runs.records import Record


@dataclass(frozen=True)
class Context:
    """What the page of a scene or a figure needs to know of the rest of the file.

    files       the file name of each scene's page, in order
    claims      of the paper about these scenes
    conditions  what the paper does not print, by key
    study       the claims on many runs, and the numbers under other conditions; None where there is none
    curves      error against run time, by scene
    errata      empty where there is no such page
    """

    results: Path
    files: Mapping[str, str]
    claims: Sequence[Claim]
    conditions: Mapping[str, str]
    study: ClaimStudy | None
    curves: Mapping[str, Sequence[Record]]
    errata: Sequence[Erratum]
    site: Site
