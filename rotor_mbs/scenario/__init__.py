"""Scenes: what a rotor is, what acts on it, and how it starts. The lowest layer; it must not know models.

scene           Scene and Blade: plain numbers; the scene's hash and rotor key
scene_file      a scene read from TOML, and written
catalogue       the scenes that are shipped, and what a command's arguments mean
variants        scenes with other numbers at some keys (Scene.replace, sweeps)
sweep           a sweep file; sweep_design: its rows
accuracy_bounds the bounds that results are judged by
validation      pydantic types and error lines for all input files; schema: the keys of a scene and of a bounds file
plausibility    numbers that look like a slip
time_table      loads over time: values, linear segments, where an engine stops
toml_file, expression    what these are built on
"""
