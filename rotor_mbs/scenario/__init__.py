"""Scenes: what a rotor is and what happens to it, read strictly from TOML. Knows no model."""
