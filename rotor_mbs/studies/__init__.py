"""Studies: one module per command, which computes runs or records from scenes.

Modules of this package neither parse arguments nor print.
"""
