"""Scenes: what a rotor is, what acts on it, and how it starts."""
