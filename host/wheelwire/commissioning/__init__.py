"""A robot's first hour: its wiring, its motors and its gains, found by measuring."""
