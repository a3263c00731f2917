"""Integrate and linearize the closed form of the rotor's Lagrange equations, for rigid blades."""
