"""Scenes: what a rotor is, what acts on it, and how it starts.

toml_file, expression   TOML text with the line of every key; arithmetic in quotes
keys                    what the value of a key may be; tables read by the keys that a dataclass declares
time_table              loads over time: values, linear segments, where an engine stops
scene                   Scene and Blade: the keys of a scene, its hash, its written file
scene_file, catalogue   a scene read from a file; the shipped scenes, and what a command's arguments mean
plausibility            numbers that look like a slip
sweep, sweep_design     a sweep file; its rows
variants                the scenes of a sweep
accuracy_bounds         the bounds that results are judged by
"""
