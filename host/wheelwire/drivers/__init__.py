"""Drivers: one short file for each way to reach the motors and encoders of a robot.

serial.py, l298n.py, pigpio.py, mock.py, replay.py, attached.py  each only opens its link
transport.py    the base of drivers for other kinds of lines
options.py      each driver's options, their defaults and checks; pins.py and pin_options.py: those
                of this computer's own pins
"""
