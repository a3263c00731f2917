"""The command line: the only layer that knows all the others. Loads a command's code when that command is given."""

from __future__ import annotations

import os
import sys
from collections.abc import Sequence

from rotor_mbs.errors import InputError, MethodRefusal, RotorError, StoreError

EXIT_OK, EXIT_FAILED, EXIT_BAD_INPUT, EXIT_INTERRUPTED = 0, 1, 2, 130


def main(argv: Sequence[str] | None = None) -> int:
    """Runs a command; returns the exit status of the contract (0, 1, 2, 130)."""
    try:
        from rotor_mbs.cli.arguments import parse

        arguments = parse(sys.argv[1:] if argv is None else argv)
        return int(arguments.command(arguments))
    except (InputError, MethodRefusal, StoreError) as exc:
        print(exc, file=sys.stderr)
        return EXIT_BAD_INPUT
    except RotorError as exc:
        print(exc, file=sys.stderr)
        return EXIT_FAILED
    except KeyboardInterrupt:
        print("interrupted; what was finished is kept, the same command goes on from there", file=sys.stderr)
        return EXIT_INTERRUPTED
    except BrokenPipeError:
        # The reader of our output went away (`rotor-mbs list | head`): nothing more to print.
        os.dup2(os.open(os.devnull, os.O_WRONLY), sys.stdout.fileno())
        return EXIT_OK
