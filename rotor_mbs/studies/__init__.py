"""Studies: one module per job, which computes records from scenes.

None of them knows a terminal or an argument parser.
"""
