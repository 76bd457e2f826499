"""Driving by hand: keys to presses, presses to setpoints, a terminal, and the loop."""
