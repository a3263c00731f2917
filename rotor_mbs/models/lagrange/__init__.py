"""Evaluate the right closed form of the rotor's Euler-Lagrange equations, for any rigid blades."""
