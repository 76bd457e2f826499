"""The tool kit around a robot: what its owner uses, and no program that drives loads."""
