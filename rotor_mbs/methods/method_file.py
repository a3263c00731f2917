"""Load methods that a Python file defines, named by its path: `-m ./mine.py` has `mine/...`.

The file's text is read once and goes with every task to its worker process, which needs no file and
computes what this process has read.
"""

from __future__ import annotations

import atexit
import os
import re
import sys
import threading
import traceback
from collections.abc import Iterable, Iterator
from contextlib import contextmanager, redirect_stderr, redirect_stdout, suppress
from dataclasses import dataclass, replace
from functools import partial
from pathlib import Path
from types import ModuleType
from typing import TYPE_CHECKING, Any

from rotor_mbs.errors import InputError, RotorError, one_line, shown_value
from rotor_mbs.methods.base import (
    BuiltItem,
    Method,
    checked_result,
    method_fault,
    no_items,
    step_ladder,
    tolerance_ladder,
)
from rotor_mbs.processes.worker import TaskLostError, Worker, memory_limit_text

if TYPE_CHECKING:
    from rotor_mbs.scenario.scene import Scene

ENDING = ".py"
_LOAD_S = 300.0  # large engines load in seconds, on a busy machine in minutes
_NAME = re.compile(r"[A-Za-z0-9_][A-Za-z0-9_.-]*")
_TOLERANCES = (
    "tolerance",
    "relative_tolerance",
    "accuracy",
)  # settings that make a ladder where there is no step


@dataclass(frozen=True)
class MethodFile:
    """A Python file that defines methods.

    Attributes
    ----------
    path : as it is given.
    text : its content.
    """

    path: str  # as it is given
    text: str

    @property
    def model(self) -> str:
        """Return the model in the names of its methods: "mine" for "folder/mine.py"."""
        return Path(self.path).stem

    def load(self, built_in: Iterable[Method]) -> dict[str, Method]:
        """Return its methods by name: "mine/rk4", also where the file calls it "rk4".

        Parameters
        ----------
        built_in : methods that are none of the file's, also where it imports them.

        Raises
        ------
        InputError
            A line with file and line number for whatever the file raises, and where it has no
            method or a name that is not allowed.
        """
        built_in = list(built_in)
        if not _NAME.fullmatch(self.model):
            raise InputError(f"{self.path}: allowed: a file's name of letters, digits, - and _")
        taken = next((known for known in built_in if known.model == self.model), None)
        if taken is not None:
            raise InputError(f"{self.path}: {taken.name} has this name; allowed: another file name")
        methods: dict[str, Method] = {}
        module = self.execute()
        for method in self.defined(module):
            if any(method is known for known in built_in):  # imported
                continue
            if fault := method_fault(method):
                raise InputError(f"{self.path}: Method {shown_value(method.name)}: {fault}")
            own = self._named(method)
            if own.name in methods or not _NAME.fullmatch(own.name.rpartition("/")[2]):
                raise InputError(
                    f"{self.path}: method {own.name!r}; allowed: names of letters and digits, each "
                    "once"
                )
            methods[own.name] = own
        if not methods:
            problem = "defines no Method; allowed: at least one"
            if "METHOD" in vars(module):
                problem = f"METHOD is {shown_value(module.METHOD)}; allowed: a Method"
            raise InputError(f"{self.path}: {problem} (docs/your-engine.md)")
        return methods

    def execute(self) -> ModuleType:
        """Run the file's text and return its module. Raises InputError."""
        module = ModuleType(f"rotor_mbs_method_file_{self.model}")
        module.__file__ = self.path
        sys.modules[module.__name__] = module  # dataclasses look there
        with self.located(), _without_folder(self.path), _loading, quiet():
            exec(compile(self.text, self.path, "exec", dont_inherit=True), vars(module))
        return module

    def defined(self, module: ModuleType) -> list[Method]:
        """Return the methods that its module has, also in lists, each once."""
        methods: dict[Method, None] = {}
        for value in vars(module).values():
            for item in value if isinstance(value, list | tuple) else [value]:
                if isinstance(item, Method):
                    methods[item] = None
        return list(methods)

    def name_of(self, method: Method) -> str:
        """Return the name of a method under the file's name."""
        return f"{self.model}/{method.name.rpartition('/')[2]}"

    def _named(self, method: Method) -> Method:
        """Return a method with the file's name as model.

        It gets a ladder if it has none but a step or a tolerance.

        Parameters
        ----------
        method : as the file defines it.
        """
        name = self.name_of(method)
        ladders = method.ladders
        if not ladders:
            declared = method.settings.declared()
            tolerance = next((setting for setting in _TOLERANCES if setting in declared), "")
            if "step" in declared:
                ladders = (step_ladder(6),)
            elif tolerance:
                kind = declared[tolerance]["kind"]
                values = [10.0**-k for k in range(3, 14) if kind.accepts(10.0**-k)]
                if values:
                    ladders = (tolerance_ladder(lambda value: {tolerance: value}, *values),)
        return replace(
            method,
            name=name,
            items=partial(self._items, method),
            bounds=tuple(replace(bound, method=name) for bound in method.bounds),
            ladders=ladders,
            sources=(self.text,),
        )

    def _items(self, method: Method, scene: Scene) -> list[BuiltItem]:
        """Return the items that a method builds, or refuse what it cannot represent.

        A method that does not list its items is built to see whether it refuses the scene. This is
        done in another process, as code of others may end or hang it.
        """
        name = self.name_of(method)
        late = f"{name}: not built for {scene.name} within {_LOAD_S:g} s"
        ended = f"{name}: ended the process that built it for {scene.name}"
        items: list[BuiltItem] = _ask(self, (method.name, scene), late, ended)
        return items

    def build_items(self, method: Method, scene: Scene) -> list[BuiltItem]:
        """Return the items that a method builds, in this process; see `_items`."""
        with self.located():
            if method.items is not no_items:
                items = method.items(scene)
                checked: list[BuiltItem] = checked_result(
                    items, list, "items", method.items, method.name
                )
                return checked
            method.build(scene, method.settings())
            return []

    @contextmanager
    def located(self) -> Iterator[None]:
        """Raise an error of the block as an InputError with file and line number.

        Errors that this package raises on purpose are passed on.
        """
        try:
            yield
        except RotorError:
            raise
        except (Exception, SystemExit) as exc:  # code of others may raise any type
            raise InputError(located(exc, [self.path])) from exc


def located(error: BaseException, paths: Iterable[str]) -> str:
    """Return an error in one line.

    Parameters
    ----------
    error : the error.
    paths : files; the line has the file and line number if the error was raised in one of them.
    """
    paths = list(paths)
    if isinstance(error, SyntaxError) and error.filename in paths:
        return f"{error.filename}:{error.lineno}: {type(error).__name__}: {error.msg}"
    frames = [
        frame for frame in traceback.extract_tb(error.__traceback__) if frame.filename in paths
    ]
    return (
        f"{frames[-1].filename}:{frames[-1].lineno}: {one_line(error)}"
        if frames
        else one_line(error)
    )


def read_file(path: str) -> MethodFile:
    """Read a Python file, and run it in another process.

    Parameters
    ----------
    path : of the file.

    Raises
    ------
    InputError
        If the file cannot be read, raises an error, or ends or hangs the process that loads it.
    """
    try:
        file = MethodFile(path, Path(path).read_text(encoding="utf-8"))
    except (OSError, ValueError) as exc:
        raise InputError(
            f"{path}: {getattr(exc, 'strerror', None) or exc}; allowed: a Python file"
        ) from exc
    _ask(
        file,
        None,
        f"{path}: not loaded within {_LOAD_S:g} s",
        f"{path}: ended the process that loaded it",
    )
    return file


# where files are loaded by several threads, their output is restored in order
_loading = threading.Lock()
_worker = Worker(is_silent=True)  # that loads files; code of others may end or hang it
atexit.register(_worker.close)


def _ask(file: MethodFile, built: tuple[str, Scene] | None, late: str, ended: str) -> Any:
    """Load a file in another process, and return what a method of it builds there.

    Parameters
    ----------
    file : the file to load.
    built : a method of it, by the name that the file gives it, and the scene for which it is built;
        None to load alone.
    late, ended : messages if it takes too long, and if it ends its process.

    Raises
    ------
    MethodRefusal, InputError
        As the file and its method do, and for a file that is late or ends the process.
    ResourceError
        If the process cannot be started.
    """
    try:
        try:
            return _worker.run(_answer, (file, built), _LOAD_S)
        except InputError:
            if built is not None:
                raise
        # The process has the modules that the file imports, and the import path, as they were: a
        # new one sees what was corrected since.
        _worker.end_process()
        return _worker.run(_answer, (file, built), _LOAD_S)
    except TaskLostError as exc:
        if exc.exit_code is None:
            raise InputError(f"{late}{memory_limit_text()}") from None
        raise InputError(f"{ended} (exit code {exc.exit_code})") from None


_executed: dict[MethodFile, ModuleType] = {}  # in the other process


def _answer(question: tuple[MethodFile, tuple[str, Scene] | None]) -> Any:
    """Run a file, and build the method in the question, in the other process; see `_ask`.

    A file that was run without an error is not run again.
    """
    file, built = question
    if file not in _executed:
        _executed[file] = file.execute()
    if built is None:
        return None
    name, scene = built
    (method,) = (method for method in file.defined(_executed[file]) if method.name == name)
    return file.build_items(method, scene)


@contextmanager
def _without_folder(path: str) -> Iterator[None]:
    """Remove the folder of a file from the import path in the block.

    In a file drake.py, `import drake` then imports the package, not the file itself.
    """
    before, folder = list(sys.path), Path(path).resolve().parent
    sys.path[:] = [place for place in before if Path(place).resolve() != folder]
    try:
        yield
    finally:
        sys.path[:] = before


@contextmanager
def quiet() -> Iterator[None]:
    """Drop everything that is printed in the block, also by compiled code.

    Only one thread at a time may be in such a block.
    """
    with (
        Path(os.devnull).open("w", encoding="utf-8") as nowhere,
        redirect_stdout(nowhere),
        redirect_stderr(nowhere),
    ):
        kept: dict[int, int] = {}
        for number in (1, 2):
            with suppress(OSError):  # closed
                kept[number] = os.dup(number)
                os.dup2(nowhere.fileno(), number)
        try:
            yield
        finally:
            for number, saved in kept.items():
                os.dup2(saved, number)
                os.close(saved)
