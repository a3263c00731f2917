"""Load the methods that a Python file defines: `-m ./mine.py` loads the methods `mine/...`.

The file is read once. Its text is sent with every task to the worker process, which does not need
the file. All tasks are therefore computed by the same code, even if the file changes meanwhile.
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
from functools import cache, partial
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

if TYPE_CHECKING:
    from rotor_mbs.processes.worker import Worker
    from rotor_mbs.scenario.scene import Scene

ENDING = ".py"
_LOAD_S = 300.0  # time limit, s; large engines load in seconds, on a busy machine in minutes
_NAME = re.compile(r"[A-Za-z0-9_][A-Za-z0-9_.-]*")
_TOLERANCES = (
    "tolerance",
    "relative_tolerance",
    "accuracy",
)  # names of settings; a method without a setting `step` gets a ladder of the first that it has


@dataclass(frozen=True)
class MethodFile:
    """A Python file that defines methods.

    Attributes
    ----------
    path : path of the file, as the user has given it.
    text : content of the file.
    """

    path: str
    text: str

    @property
    def model(self) -> str:
        """Return the model's part of the methods' names: "mine" for "folder/mine.py"."""
        return Path(self.path).stem

    def load(self, built_in: Iterable[Method]) -> dict[str, Method]:
        """Return the methods of the file by name.

        The name is "mine/rk4", also if the file calls the method "rk4" or "other/rk4".

        Parameters
        ----------
        built_in : methods of the catalogue that are of no file. They are not returned even if the
            file imports them.

        Raises
        ------
        InputError
            If the file raises an error; the message then has the file and the line number. Also if
            the file defines no method, or a name or an attribute of a method is not allowed.
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
        """Run the file's text and return its module. Raises InputError if the text fails."""
        module = ModuleType(f"rotor_mbs_method_file_{self.model}")
        module.__file__ = self.path
        sys.modules[module.__name__] = module  # dataclasses look the module up there
        with self.located(), _without_folder(self.path), _loading, quiet():
            exec(compile(self.text, self.path, "exec", dont_inherit=True), vars(module))
        return module

    def defined(self, module: ModuleType) -> list[Method]:
        """Return the methods among the variables of a module and in its lists, each once."""
        methods: dict[Method, None] = {}
        for value in vars(module).values():
            for item in value if isinstance(value, list | tuple) else [value]:
                if isinstance(item, Method):
                    methods[item] = None
        return list(methods)

    def name_of(self, method: Method) -> str:
        """Return the name of a method of the file, with the file's name as model."""
        return f"{self.model}/{method.name.rpartition('/')[2]}"

    def _named(self, method: Method) -> Method:
        """Return a copy of a method of the file, with the file's name as model.

        If the method has no ladder, but a step or a tolerance as setting, the copy gets a ladder.

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
        """Return the items of a method; raise MethodRefusal if it cannot represent the scene.

        A method that does not list its items is built only to see whether it refuses the scene.
        The code of the method runs in another process, which it may end or hang.
        """
        name = self.name_of(method)
        late = f"{name}: not built for {scene.name} within {_LOAD_S:g} s"
        ended = f"{name}: ended the process that built it for {scene.name}"
        items: list[BuiltItem] = _ask(self, (method.name, scene), late, ended)
        return items

    def build_items(self, method: Method, scene: Scene) -> list[BuiltItem]:
        """Return the items of a method, whose code runs in this process; see `_items`."""
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
        """Raise an InputError with file and line number in place of an error in the block.

        Errors of the class RotorError, which this package raises on purpose, are passed on.
        """
        try:
            yield
        except RotorError:
            raise
        except (Exception, SystemExit) as exc:  # other people's code may raise any error
            raise InputError(located(exc, [self.path])) from exc


def located(error: BaseException, paths: Iterable[str]) -> str:
    """Return an error as one line of text.

    Parameters
    ----------
    error : the error.
    paths : paths of files. If code of one of them raised the error, or called the code that raised
        it, the line begins with the file and the line number.
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
    """Read a Python file, and test it by running it in another process.

    Parameters
    ----------
    path : path of the file.

    Raises
    ------
    InputError
        If the file cannot be read, raises an error, or ends or hangs the process that runs it.
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


# Only one thread at a time runs a file, because `quiet` redirects the output of the whole process.
_loading = threading.Lock()


@cache
def _worker() -> Worker:
    """Return the process in which files are tested; a file may end it, or never return."""
    # Imported here, as most commands load no method file.
    from rotor_mbs.processes.worker import Worker

    worker = Worker(is_silent=True)
    atexit.register(worker.close)
    return worker


def _ask(file: MethodFile, built: tuple[str, Scene] | None, late: str, ended: str) -> Any:
    """Load a file in another process, and return the items that one of its methods has there.

    Parameters
    ----------
    file : the file to load.
    built : name of a method, as the file has it, and the scene for which the method is built. None
        if the file is only to be loaded; None is then returned.
    late, ended : messages of the errors if this takes too long, and if the process ends.

    Raises
    ------
    MethodRefusal
        If the method cannot represent the scene.
    InputError
        If the file or the method raises an error, takes too long, or ends the process.
    ResourceError
        If the process cannot be started.
    """
    from rotor_mbs.processes.worker import TaskLostError, memory_limit_text

    worker = _worker()
    try:
        try:
            return worker.run(_answer, (file, built), _LOAD_S)
        except InputError:
            if built is not None:
                raise
        # The process may have loaded modules that the file imports before the user corrected them,
        # or have an old import path. A new process has neither.
        worker.end_process()
        return worker.run(_answer, (file, built), _LOAD_S)
    except TaskLostError as exc:
        if exc.exit_code is None:
            raise InputError(f"{late}{memory_limit_text()}") from None
        raise InputError(f"{ended} (exit code {exc.exit_code})") from None


_executed: dict[MethodFile, ModuleType] = {}  # modules of the files that the other process has run


def _answer(question: tuple[MethodFile, tuple[str, Scene] | None]) -> Any:
    """Run a file and return the items of one of its methods; called by `_ask` in the other process.

    A file that has run without an error is not run again.
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

    In a file drake.py, `import drake` then imports the package drake, not the file itself.
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
            with suppress(OSError):  # the stream is closed
                kept[number] = os.dup(number)
                os.dup2(nowhere.fileno(), number)
        try:
            yield
        finally:
            for number, saved in kept.items():
                os.dup2(saved, number)
                os.close(saved)
