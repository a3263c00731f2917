"""rotor_mbs: every scene of a rotor built two independent ways, compared, and held against a paper.

The way of the data, and of the imports (an upper layer may import a lower one, never the reverse):

    scenario -> models -> runner -> store (HDF5) -> analysis -> report;  cli knows them all

Importing this package imports nothing else: the command line must start in a blink.
"""

__version__ = "0.1.0"
