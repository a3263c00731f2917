"""Define the Python API, `import rotor_mbs as rm`, on the studies that the command line runs.

Prints nothing. A wrong value raises `rotor_mbs.errors.InputError`, an unreadable or foreign file
`StoreError`, an argument of a wrong type `TypeError`. Matplotlib, the templates of pages, xarray
and pandas are loaded when a picture, a page or such a table is asked for.
"""
