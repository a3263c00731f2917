"""Define the Python API, `import rotor_mbs as rm`.

The functions call the same studies as the command line. They print nothing except the progress of
long calls. A wrong value raises `rotor_mbs.errors.InputError`, a file that cannot be read or is not
of this program raises `StoreError`, and an argument of a wrong type raises `TypeError`. Matplotlib,
the templates of pages, xarray and pandas are loaded when they are first needed.
"""
