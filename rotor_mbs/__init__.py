"""rotor_mbs: scenes of a bladed rotor by independent models, compared with a reference, and with a published paper.

The Python API. Everything is loaded when it is first used: importing this package imports nothing else.

    scenes, scene, load      names of the shipped scenes; one of them; a scene of one's own from a TOML file
    run                      one scene by one method: a `Run`; by several, judged by its reference: `Runs`
    sweep                    one scene over the values of its parameters: `Runs`
    compare                  a trajectory of another program against a scene's reference: a `DataComparison`
    export                   a scene for MuJoCo or Exudyn, or its reference as CSV
    modes                    natural frequencies, damping and shapes over rotor speed: `Modes`
    open                     the `Runs` in a file: of scenes, or of a sweep

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
    from rotor_mbs.report.data_comparison import DataComparison as DataComparison
    from rotor_mbs.report.data_comparison import compare as compare
    from rotor_mbs.report.mode_study import modes as modes
    from rotor_mbs.scenario.scene import Blade as Blade
    from rotor_mbs.scenario.scene import Scene as Scene
    from rotor_mbs.studies.export import export as export

_MODULES = {
    "rotor_mbs.api": "Run Runs load open run scene scenes sweep",
    "rotor_mbs.errors": "InputError MethodRefusal RotorError StoreError",
    "rotor_mbs.methods.base": "Method",
    "rotor_mbs.report.data_comparison": "DataComparison compare",
    "rotor_mbs.report.mode_study": "modes",
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
