"""Simulation of wind-turbine rotors with independent models, compared with a reference and a
published paper.

This is the Python API. Modules are loaded on first use.

    scenes, scene, load      list the shipped scenes; read a shipped scene; read a TOML file
    scene_from_openfast      make a scene of the rotor in an OpenFAST model
    run                      simulate a scene with one method (`Run`) or several (`Results`)
    sweep                    run a parameter study (`Results`)
    compare                  compare data of another program with a scene (`DataComparison`)
    check                    check the accuracy of stored runs (`Checks`)
    bench                    measure error against run time (`BenchCurves`)
    test_method              examine a method of one's own (`Checks`)
    export                   export a scene for MuJoCo or Exudyn, or its reference as CSV
    modes                    compute frequencies, damping, mode shapes over rotor speed (`Modes`)
    open                     open any file that the program wrote (`Results`, `Modes`, ...)

Examples
--------
>>> import rotor_mbs as rm
>>> scene = rm.scene("paper/fig08").replace(duration=1.0, samples=101)
>>> run = rm.run(scene, "exudyn_tree/rk67")
>>> run.status, run.angles.shape
('ok', (101, 4))
"""

# Type checkers take this name to be true. Importing it from `typing` would take as long as all
# other code of this module.
TYPE_CHECKING = False

__version__ = "0.1.0"

if TYPE_CHECKING:
    from rotor_mbs.api.benches import BenchCurves as BenchCurves
    from rotor_mbs.api.benches import bench as bench
    from rotor_mbs.api.checks import Checks as Checks
    from rotor_mbs.api.checks import check as check
    from rotor_mbs.api.checks import test_method as test_method
    from rotor_mbs.api.comparisons import DataComparison as DataComparison
    from rotor_mbs.api.comparisons import compare as compare
    from rotor_mbs.api.files import open as open
    from rotor_mbs.api.modes import Modes as Modes
    from rotor_mbs.api.modes import modes as modes
    from rotor_mbs.api.results import Results as Results
    from rotor_mbs.api.results import Run as Run
    from rotor_mbs.api.runs import load as load
    from rotor_mbs.api.runs import run as run
    from rotor_mbs.api.runs import scene as scene
    from rotor_mbs.api.runs import scenes as scenes
    from rotor_mbs.api.runs import sweep as sweep
    from rotor_mbs.errors import InputError as InputError
    from rotor_mbs.errors import MethodRefusal as MethodRefusal
    from rotor_mbs.errors import RotorError as RotorError
    from rotor_mbs.errors import StoreError as StoreError
    from rotor_mbs.methods.base import Method as Method
    from rotor_mbs.scenario.openfast_scene import scene_from_openfast as scene_from_openfast
    from rotor_mbs.scenario.scene import Blade as Blade
    from rotor_mbs.scenario.scene import Scene as Scene
    from rotor_mbs.studies.export import export as export

_MODULES = {
    "rotor_mbs.api.benches": "bench BenchCurves",
    "rotor_mbs.api.checks": "check Checks test_method",
    "rotor_mbs.api.comparisons": "compare DataComparison",
    "rotor_mbs.api.files": "open",
    "rotor_mbs.api.modes": "modes Modes",
    "rotor_mbs.api.results": "Results Run",
    "rotor_mbs.api.runs": "load run scene scenes sweep",
    "rotor_mbs.errors": "InputError MethodRefusal RotorError StoreError",
    "rotor_mbs.methods.base": "Method",
    "rotor_mbs.scenario.openfast_scene": "scene_from_openfast",
    "rotor_mbs.scenario.scene": "Blade Scene",
    "rotor_mbs.studies.export": "export",
}
_HOME = {name: module for module, names in _MODULES.items() for name in names.split()}

__all__ = sorted(_HOME)


def __getattr__(name: str) -> object:
    """Return a public name, and import its module on first use (PEP 562)."""
    import importlib

    if name not in _HOME:
        raise AttributeError(f"module {__name__!r} has no attribute {name!r}")
    return getattr(importlib.import_module(_HOME[name]), name)


def __dir__() -> list[str]:
    return sorted([*globals(), *_HOME])
