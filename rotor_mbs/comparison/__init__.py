"""Data of other programs against a scene: files to columns, columns to channels, and the verdict.

From a file to a verdict, in this order: `files` and `formats` (a file in a process of its own, by
which library), `columns` (names, units, numbers), `channels` and `mapping` (which column is which
coordinate or load), `data` (SI units, rounding), `trajectory`, `loads`, `modes` (against the closed
form), `verdict`. What could explain a difference: `hypotheses` (one type, one search), and the
candidates of `data_mistakes`, `other_rotors` by `defect_search`, `faults` (in time); `causes` says
in which order. The public function is `rotor_mbs.compare`.
"""
