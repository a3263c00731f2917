"""Trajectories of other programs: files to named columns, columns to the angles and rates of a scene."""
