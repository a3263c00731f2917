"""A case: everything that decides one stored record, and the content hash that the record is found by."""

from __future__ import annotations

import functools
import hashlib
import json
from collections.abc import Mapping
from dataclasses import dataclass, field

from rotor_mbs.methods.catalogue import find_method
from rotor_mbs.runs.versions import NUMERICS, fingerprint, versions_with
from rotor_mbs.scenario.scene import Scene, scene_hash

RUN = "run"
_FIXED_WORK = 3.0  # building, judging, storing


@dataclass(frozen=True, eq=False)
class Case:
    """One thing to compute: a scene by a method, for a study.

    settings    in place of the method's defaults
    study       what is done with the method: "run", "bench", "steps", ...
    options     further numbers and texts that decide the record; JSON can represent them
    reference   key of the case whose record this one is compared with; "" where there is none
    sources     files and folders of the package whose code decides the record, besides scenes, methods and models
    """

    scene: Scene
    method: str
    settings: Mapping[str, object] = field(default_factory=dict)
    study: str = RUN
    options: Mapping[str, object] = field(default_factory=dict)
    reference: str = ""
    sources: tuple[str, ...] = ()

    @property
    def label(self) -> str:
        """The case in a line of progress."""
        return f"{self.scene.name} {self.method}" + ("" if self.study == RUN else f" {self.study}")

    @property
    def work(self) -> float:
        """Roughly how much there is to compute, for estimates: 1 is 10 s of a scene by the fastest method."""
        return _FIXED_WORK + find_method(self.method).relative_cost * self.scene.duration / 10.0

    @functools.cached_property
    def scene_hash(self) -> str:
        return scene_hash(self.scene)

    @functools.cached_property
    def key(self) -> str:
        """SHA-256, in hexadecimal, of all that the record depends on."""
        method = find_method(self.method)
        settings = method.settings.of(self.method, self.settings).as_dict()
        content = {
            "scene": [self.scene.name, self.scene_hash],
            "method": [self.method, {name: str(value) for name, value in settings.items()}],
            "study": [self.study, dict(self.options)],
            "reference": self.reference,
            "code": [versions_with(*method.distributions), fingerprint(*NUMERICS), fingerprint(*self.sources)],
        }
        return hashlib.sha256(json.dumps(content, sort_keys=True).encode()).hexdigest()
