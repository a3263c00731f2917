"""Progress and tables on a terminal and in a log."""

from __future__ import annotations

import io
import signal
import time
from collections.abc import Callable
from contextlib import suppress

import pytest
from support.commands import rotor_mbs

from rotor_mbs.cli.terminal import ProgressLine, coloured
from rotor_mbs.errors import MethodRefusal
from rotor_mbs.studies.run import Outcome


class Terminal(io.StringIO):
    def isatty(self) -> bool:
        return True


def outcome(method: str = "lagrange/dop853", share: float = 0.5, **result: object) -> Outcome:
    return Outcome(f"paper/fig05 {method}", method, **{"status": "ok", **result}, share=share)  # type: ignore[arg-type]


def test_a_log_has_a_plain_line_for_each_case() -> None:
    log = io.StringIO()
    with ProgressLine(log) as progress:
        progress(1, 2, outcome("reference", is_shipped=True))
        progress(2, 2, outcome(status="diverged", message="not finite", seconds=1.5))
    assert log.getvalue().splitlines() == [
        "[1/2] paper/fig05 reference ok (read, not computed)",
        "[2/2] paper/fig05 lagrange/dop853 diverged 1.500 s: not finite",
    ]


def test_a_terminal_shows_the_share_of_the_work_and_renews_itself_without_news(
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    monkeypatch.delenv("NO_COLOR", raising=False)
    screen = Terminal()
    with ProgressLine(screen) as progress:
        progress(1, 100, outcome(share=0.25))
        first = len(screen.getvalue())
        assert " 25%, about" in screen.getvalue()
        deadline = time.monotonic() + 10.0
        while len(screen.getvalue()) == first and time.monotonic() < deadline:
            time.sleep(0.05)
        assert len(screen.getvalue()) > first
        progress(2, 100, outcome(status="diverged", message="x" * 200))  # wider than any terminal: kept whole
    assert "x" * 200 in screen.getvalue()
    assert "\x1b[31mdiverged\x1b[0m" in screen.getvalue()


def test_colour_is_for_terminals_that_want_it(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.delenv("NO_COLOR", raising=False)
    assert coloured("largest error (rad)", Terminal()) == "largest error (rad)"
    assert coloured("17 of 17 ok", Terminal()) == "17 of 17 \x1b[32mok\x1b[0m"
    assert coloured("17 of 17 ok", io.StringIO()) == "17 of 17 ok"
    monkeypatch.setenv("NO_COLOR", "1")
    assert coloured("17 of 17 ok", Terminal()) == "17 of 17 ok"


def test_an_estimate_counts_what_comes_after_the_cases() -> None:
    screen = Terminal()
    with ProgressLine(screen, parts=(0.5, 0.5)) as progress:
        progress(1, 2, outcome(share=0.5))
        assert " 25%, about" in screen.getvalue()
        progress(2, 2, outcome(share=1.0))
        progress.stage("pages", 0, 10)
        progress.stage("pages", 5, 10)
        assert " 75%, about" in screen.getvalue()
        assert "pages 5/10" in screen.getvalue()


def _ends_by(patch: pytest.MonkeyPatch, action: Callable[[], object]) -> tuple[int, str]:
    """Status and errors of a command in which `action` takes the place of its first step."""
    patch.setattr("rotor_mbs.cli.runs.find_scenes", lambda _: action())
    ended = rotor_mbs("run", "paper/fig03")
    return ended.status, ended.err


@pytest.mark.parametrize("error", [SystemError, ImportError, MethodRefusal])
def test_an_interrupt_inside_compiled_code_is_an_interrupt(
    error: type[Exception], monkeypatch: pytest.MonkeyPatch
) -> None:
    """h5py's locks make a SystemError of it, loading an engine an ImportError, which may be taken for a lack."""

    def interrupted() -> None:
        raise error("initialization failed") from KeyboardInterrupt()

    status, errors = _ends_by(monkeypatch, interrupted)
    assert status == 130
    assert errors.startswith("interrupted; ")


@pytest.mark.parametrize("number", [signal.SIGINT, signal.SIGTERM, signal.SIGHUP])
def test_an_interrupt_that_becomes_another_error_without_a_trace(number: int, monkeypatch: pytest.MonkeyPatch) -> None:
    """NumPy's own loading: PyCapsule_Import("datetime") forgets why the import failed."""

    def interrupted() -> None:
        if signal.getsignal(number) == signal.SIG_IGN:  # as nohup does with SIGHUP, which then is not the command's
            pytest.skip("the signal is ignored here")
        with suppress(KeyboardInterrupt):
            signal.raise_signal(number)
        raise ImportError("PyCapsule_Import could not import module")

    assert _ends_by(monkeypatch, interrupted)[0] == 130


@pytest.mark.parametrize("error", [SystemError, ImportError])
def test_code_that_cannot_be_loaded_is_one_line(error: type[Exception], monkeypatch: pytest.MonkeyPatch) -> None:
    """As where there is no memory for a library: "failed to map segment from shared object"."""

    def short_of_memory() -> None:
        raise error("failed to map segment")

    line = f"code cannot be loaded: {error.__name__}: failed to map segment\n"
    assert _ends_by(monkeypatch, short_of_memory) == (1, line)


class _InterruptedAtItsEnd:
    def __del__(self) -> None:
        raise KeyboardInterrupt


def test_an_interrupt_where_python_ignores_exceptions_comes_again(monkeypatch: pytest.MonkeyPatch) -> None:
    def interrupted() -> list[object]:
        _InterruptedAtItsEnd()
        time.sleep(1.0)
        return []

    assert _ends_by(monkeypatch, interrupted)[0] == 130
