"""Compare data of other programs with a scene: read columns, identify channels, give a verdict.

The modules in the order in which data pass through them:

- `files` starts a worker process with limits; `formats` reads the file in that process.
- `columns` defines the columns that are read: names, units, numbers.
- `channels`, `mapping` and `openfast` find which column is which coordinate or load.
- `data` converts the numbers to SI units (`units`), orders the rows (`times`), and finds the
  rounding of the numbers.
- `trajectory`, `loads` and `modes` compare the data with the closed form.
- `verdict` defines the result of the comparison.

Other modules search for what could explain a difference. `hypotheses` defines a possible cause and
the search. `data_mistakes`, `other_rotors` (tried by `defect_search`) and `faults` (at a time)
contain the possible causes. `causes` determines the order in which they are tried.

The public function is `rotor_mbs.compare`.
"""
