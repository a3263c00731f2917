"""Run the command line by `python -m rotor_mbs`."""

import sys

from rotor_mbs.cli import main

if __name__ == "__main__":
    sys.exit(main())
