"""The robot whose pins are this computer's: what the ESP32 does elsewhere, done here in Python.

The same supervisor, velocity loop, parameters and limits as the firmware's, without its promises:
a thread of a busy computer may be late, and a killed process stops nothing by itself.
"""
