"""Tables of runs in HDF5 files, and the runner that fills them."""
