"""A model robot in Python, for the mock driver and for stand-ins of hardware.

The physics of the simulated ESP32's robot, in plainer steps, and held to it by test.
"""
