"""Simulation of wind-turbine rotors with independent models, compared with a reference and a published paper.

This is the Python API. Modules are loaded on first use.

    scenes, scene, load      names of the shipped scenes; a shipped scene; a scene from a TOML file
    run                      simulate a scene with one method (`Run`) or several (`Runs`)
    sweep                    run a parameter study (`Runs`)
    compare                  compare data of another program with a scene (`DataComparison`)
    export                   export a scene for MuJoCo or Exudyn, or its reference as CSV
    modes                    natural frequencies, damping and mode shapes over rotor speed (`Modes`)
    open                     open the runs of a results file or a sweep (`Runs`)

Examples
--------
>>> import rotor_mbs as rm
>>> scene = rm.scene("paper/fig08").replace(duration=1.0, samples=101)
>>> run = rm.run(scene, "exudyn_tree/rk67")
>>> run.status, run.angles.shape
('ok', (101, 4))
"""

TYPE_CHECKING = False  # what type checkers take for true; importing `typing` would cost as much as all else here

__version__ = "0.1.0"

if TYPE_CHECKING:
    from rotor_mbs.api import Run as Run
    from rotor_mbs.api import Runs as Runs
    from rotor_mbs.api import load as load
    from rotor_mbs.api import open as open
    from rotor_mbs.api import run as run
    from rotor_mbs.api import scene as scene
    from rotor_mbs.api import scenes as scenes
    from rotor_mbs.api import sweep as sweep
    from rotor_mbs.errors import InputError as InputError
    from rotor_mbs.errors import MethodRefusal as MethodRefusal
    from rotor_mbs.errors import RotorError as RotorError
    from rotor_mbs.errors import StoreError as StoreError
    from rotor_mbs.methods.base import Method as Method
    from rotor_mbs.report.pages.comparison import DataComparison as DataComparison
    from rotor_mbs.report.pages.comparison import compare as compare
    from rotor_mbs.report.pages.modes import modes as modes
    from rotor_mbs.scenario.scene import Blade as Blade
    from rotor_mbs.scenario.scene import Scene as Scene
    from rotor_mbs.studies.export import export as export

_MODULES = {
    "rotor_mbs.api": "Run Runs load open run scene scenes sweep",
    "rotor_mbs.errors": "InputError MethodRefusal RotorError StoreError",
    "rotor_mbs.methods.base": "Method",
    "rotor_mbs.report.pages.comparison": "DataComparison compare",
    "rotor_mbs.report.pages.modes": "modes",
    "rotor_mbs.scenario.scene": "Blade Scene",
    "rotor_mbs.studies.export": "export",
}
_HOME = {name: module for module, names in _MODULES.items() for name in names.split()}

__all__ = sorted(_HOME)


def __getattr__(name: str) -> object:
    """PEP 562: a public name is imported when it is first asked for."""
    import importlib

    if name not in _HOME:
        raise AttributeError(f"module {__name__!r} has no attribute {name!r}")
    return getattr(importlib.import_module(_HOME[name]), name)


def __dir__() -> list[str]:
    return sorted([*globals(), *_HOME])
