"""Methods that a Python file defines, named by its path: `-m ./mine.py` has `mine/...`.

The file's text is read once and goes with every task to its worker process, which needs no file and computes what this
process has read.
"""

from __future__ import annotations

import atexit
import os
import pickle
import re
import subprocess
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

from rotor_mbs.errors import InputError, RotorError, one_line
from rotor_mbs.methods.base import BuiltItem, Ladder, Method, no_items, step_ladder, tolerance_ladder

if TYPE_CHECKING:
    from rotor_mbs.scenario.scene import Scene

ENDING = ".py"
_LOAD_S = 300.0  # large engines load in seconds, on a busy machine in minutes
_NAME = re.compile(r"[A-Za-z0-9_][A-Za-z0-9_.-]*")
_TOLERANCES = ("tolerance", "relative_tolerance", "accuracy")  # settings that make a ladder where there is no step
_SERVING = "from rotor_mbs.methods.method_file import answer_questions; answer_questions()"
_MOST_PROCESSES = 16  # of files that are loaded apart
_END_S = 5.0  # until such a process has ended


@dataclass(frozen=True)
class MethodFile:
    path: str  # as it is named
    text: str

    @property
    def model(self) -> str:
        """What the names of its methods begin with: "mine" of "folder/mine.py"."""
        return Path(self.path).stem

    def load(self, built_in: Iterable[Method]) -> dict[str, Method]:
        """Its methods by name: "mine/rk4", also where the file calls it "rk4". Raises InputError: a line with file and
        line number for whatever the file raises."""
        if not _NAME.fullmatch(self.model):
            raise InputError(f"{self.path}: allowed: a file's name of letters, digits, - and _")
        taken = next((known for known in built_in if known.model == self.model), None)
        if taken is not None:
            raise InputError(f"{self.path}: {taken.name} has this name; allowed: another file name")
        module = ModuleType(f"rotor_mbs_method_file_{self.model}")
        module.__file__ = self.path
        sys.modules[module.__name__] = module  # dataclasses look there
        with self.located(), _without_folder(self.path), _loading, quiet():
            exec(compile(self.text, self.path, "exec", dont_inherit=True), vars(module))
        methods: dict[str, Method] = {}
        values = (value if isinstance(value, list | tuple) else [value] for value in vars(module).values())
        defined = dict.fromkeys(one for several in values for one in several if isinstance(one, Method))
        for method in defined:
            if any(method is known for known in built_in):  # imported
                continue
            own = self._named(method)
            if own.name in methods or not _NAME.fullmatch(own.name.rpartition("/")[2]):
                raise InputError(f"{self.path}: method {own.name!r}; allowed: names of letters and digits, each once")
            methods[own.name] = own
        if not methods:
            raise InputError(f"{self.path}: defines no Method; allowed: at least one (docs/your-engine.md)")
        return methods

    def _named(self, method: Method) -> Method:
        name = f"{self.model}/{method.name.rpartition('/')[2]}"
        ladders = [replace(one, method=name) if one.method == method.name else one for one in method.ladders]
        if not ladders:
            allowed = method.settings.allowed()
            tolerance = next((setting for setting in _TOLERANCES if setting in allowed), "")
            if "step" in allowed:
                ladders = [step_ladder(6)]
            elif tolerance:
                steps = [10.0**-k for k in range(3, 14) if allowed[tolerance].at_least <= 10.0**-k]
                ladders = [tolerance_ladder(lambda value: {tolerance: value}, *steps)]
            order = method.order if "step" in allowed else None
            ladders = [replace(ladder, method=name, label=method.label, order=order) for ladder in ladders]
        return replace(
            method,
            name=name,
            items=partial(self._items, method),
            bounds=tuple(replace(bound, method=name) for bound in method.bounds),
            ladders=tuple[Ladder, ...](ladders),
            sources=(self.text,),
        )

    def _items(self, method: Method, scene: Scene) -> list[BuiltItem]:
        """Where the method does not say what it builds, it is built: what it cannot represent it refuses there. In a
        process of its own: somebody's code may end or hang it."""
        items: list[BuiltItem] = _apart(self).ask(f"{self.model}/{method.name.rpartition('/')[2]}", scene)
        return items

    def build_items(self, method: Method, scene: Scene) -> list[BuiltItem]:
        """As `_items`, in this process."""
        with self.located():
            if method.items is not no_items:
                return method.items(scene)
            method.build(scene, method.settings())
            return []

    @contextmanager
    def located(self) -> Iterator[None]:
        """What is raised in the block, but by this package on purpose, is an InputError with file and line number."""
        try:
            yield
        except RotorError:
            raise
        except (Exception, SystemExit) as exc:  # whatever somebody's code raises
            raise InputError(located(exc, [self.path])) from exc


def located(error: BaseException, paths: Iterable[str]) -> str:
    """One line of what was raised, with file and line number where that was in one of the files."""
    paths = list(paths)
    if isinstance(error, SyntaxError) and error.filename in paths:
        return f"{error.filename}:{error.lineno}: {type(error).__name__}: {error.msg}"
    frames = [frame for frame in traceback.extract_tb(error.__traceback__) if frame.filename in paths]
    return f"{frames[-1].filename}:{frames[-1].lineno}: {one_line(error)}" if frames else one_line(error)


def read_file(path: str) -> MethodFile:
    """Raises InputError for a file that cannot be read, and for one that ends or hangs the process that loads it."""
    try:
        file = MethodFile(path, Path(path).read_text(encoding="utf-8"))
    except (OSError, ValueError) as exc:
        raise InputError(f"{path}: {getattr(exc, 'strerror', None) or exc}; allowed: a Python file") from exc
    _apart(file)
    return file


class _Process:
    """A process that has loaded a file, and builds its methods. Raises InputError where the file ends or hangs it."""

    def __init__(self, file: MethodFile) -> None:
        self._path = file.path
        # Without -P, Python would import from this folder.
        command = [sys.executable, "-P", "-c", _SERVING]
        pipe, nothing = subprocess.PIPE, subprocess.DEVNULL
        self._process = subprocess.Popen(command, stdin=pipe, stdout=pipe, stderr=nothing)
        late = f"{self._path}: not loaded within {_LOAD_S:g} s"
        self._ask(file, late, f"{self._path}: ended the process that loaded it")

    def ask(self, name: str, scene: Scene) -> Any:
        """What the method builds for the scene. Raises MethodRefusal, InputError."""
        late = f"{name}: not built for {scene.name} within {_LOAD_S:g} s"
        answer = self._ask((name, scene), late, f"{name}: ended the process that built it for {scene.name}")
        if isinstance(answer, RotorError):
            raise answer
        return answer

    def _ask(self, question: object, late: str, ended: str) -> Any:
        timer = threading.Timer(_LOAD_S, self._process.kill)
        timer.start()
        try:
            assert self._process.stdin is not None
            assert self._process.stdout is not None
            pickle.dump(question, self._process.stdin)
            self._process.stdin.flush()
            return pickle.load(self._process.stdout)
        except (OSError, EOFError):
            is_late = not timer.is_alive()
            self.close()
            raise InputError(late if is_late else f"{ended} (exit code {self._process.returncode})") from None
        finally:
            timer.cancel()

    def close(self) -> None:
        _processes.pop(self._path, None)
        with suppress(subprocess.TimeoutExpired):
            self._process.communicate(timeout=_END_S)  # it ends with its input
        self._process.kill()
        self._process.wait()


_loading = threading.Lock()  # where files are loaded by several threads, their output is restored in order
_processes: dict[str, tuple[MethodFile, _Process]] = {}


def _apart(file: MethodFile) -> _Process:
    """The process that has loaded this text of the file."""
    known = _processes.get(file.path)
    if known is not None and known[0] == file:
        return known[1]
    if known is not None:
        known[1].close()
    elif len(_processes) == _MOST_PROCESSES:
        next(iter(_processes.values()))[1].close()
    process = _Process(file)
    _processes[file.path] = file, process
    return process


@atexit.register
def _close_processes() -> None:
    for _, process in list(_processes.values()):
        process.close()


def answer_questions() -> None:
    """What a `_Process` does: loads the file, then builds what is asked. What loading raises is raised again where it
    counts."""
    answers = os.fdopen(os.dup(1), "wb")
    with open(os.devnull, "wb") as nowhere:  # noqa: PTH123  (a device)
        os.dup2(nowhere.fileno(), 1)
    questions = sys.stdin.buffer
    file: MethodFile = pickle.load(questions)
    methods: dict[str, Method] = {}
    with suppress(InputError):
        methods = file.load(())
    answer: object = None
    while True:
        pickle.dump(answer, answers)
        answers.flush()
        try:
            name, scene = pickle.load(questions)
        except EOFError:
            return
        try:
            items = methods[name].items
            assert isinstance(items, partial)
            answer = file.build_items(items.args[0], scene)
        except RotorError as exc:
            answer = exc


@contextmanager
def _without_folder(path: str) -> Iterator[None]:
    """A file drake.py that says `import drake` means the package, not itself."""
    before, folder = list(sys.path), Path(path).resolve().parent
    sys.path[:] = [place for place in before if Path(place).resolve() != folder]
    try:
        yield
    finally:
        sys.path[:] = before


@contextmanager
def quiet() -> Iterator[None]:
    """What is printed in the block goes nowhere, also what compiled code prints. For one thread at a time."""
    with Path(os.devnull).open("w", encoding="utf-8") as nowhere, redirect_stdout(nowhere), redirect_stderr(nowhere):
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
