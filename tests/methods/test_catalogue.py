"""The catalogue of methods: unknown names, facts of the built-in methods, and methods of other packages."""

from __future__ import annotations

import sys
from collections.abc import Iterator
from pathlib import Path

import pytest
from support.packages import install

from rotor_mbs.errors import InputError
from rotor_mbs.methods import catalogue
from rotor_mbs.methods.catalogue import find_method, methods

GROUP = "rotor_mbs.methods"
MADE_UP = (Path(__file__).parents[1] / "extension" / "rotor_rk4.py").read_text()
MADE_UP += """
TAKEN = Method(name="lagrange/taylor", label="x", build=Solver, items=items)
"""


@pytest.fixture
def site(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Iterator[Path]:
    """A folder on sys.path for packages that a test installs."""
    monkeypatch.syspath_prepend(tmp_path)
    catalogue._plug_ins.cache_clear()
    yield tmp_path
    catalogue._plug_ins.cache_clear()
    sys.modules.pop("made_up", None)


def test_an_unknown_name_is_refused_with_the_nearest_one() -> None:
    for name, nearest in (("rk67", ", perhaps exudyn_tree/rk67;"), ("foo/bar", ";")):
        with pytest.raises(InputError) as caught:
            find_method(name)
        (line,) = caught.value.problems
        assert line.startswith(f"unknown method {name!r}{nearest} allowed: ")
        assert line.endswith("allowed: " + ", ".join(method.name for method in methods()))
    with pytest.raises(InputError, match="unknown method 'reference'"):
        catalogue.check_names(["reference"])  # it is computed for every scene, and not asked for by name


def test_facts_of_the_built_in_methods_agree_with_each_other() -> None:
    assert len({method.name for method in methods()}) == len(methods())
    for method in methods():
        assert (method.order is not None) == method.fixed_step == ("step" in method.defaults)
        assert method.is_corrected == bool(method.ladders)
        assert not (method.erratum and (method.is_corrected or method.is_default))
        assert not method.fallback or find_method(method.fallback).is_corrected
    assert [*catalogue.ladders(["exudyn_tree/generalized_alpha"])] == [
        "exudyn_tree/generalized_alpha", "exudyn_tree/generalized_alpha_rho0.7", "exudyn_tree/generalized_alpha_rho1.0",
    ]  # fmt: skip


def test_plug_ins_that_cannot_be_used_are_left_out_with_one_line_each(
    site: Path, caplog: pytest.LogCaptureFixture
) -> None:
    entry_points = {"a": "no_such_module:METHOD", "b": "made_up:MISSING", "c": "made_up:np", "d": "made_up:TAKEN"}
    install(site, "made_up", MADE_UP, GROUP, {**entry_points, "e": "made_up:METHOD"})
    install(site, "own_exit", "raise SystemExit(3)\n", GROUP, {"x": "own_exit:X"})
    assert "outside/rk4" in {method.name for method in methods()}
    assert find_method("outside/rk4").distributions == ("made_up",)
    assert sorted(record.getMessage().partition(" omitted")[0] for record in caplog.records) == [
        "plug-in a of no_such_module:METHOD", "plug-in b of made_up:MISSING", "plug-in c of made_up:np",
        "plug-in d of made_up:TAKEN: method lagrange/taylor", "plug-in x of own_exit:X",
    ]  # fmt: skip
    assert "omitted: SystemExit: 3" in caplog.text


def test_reading_a_built_in_method_imports_no_plug_in(site: Path) -> None:
    install(site, "made_up", "raise SystemExit('imported')", GROUP, {"own": "made_up:METHOD"})
    assert find_method("exudyn_tree/rk67").label
