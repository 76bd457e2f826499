"""Drivers: one class for each way to reach the motors and encoders, all behind `BaseDriver`.

base.py         what every driver offers; driving.py: checks, kinematics and expiry of a setpoint
factory.py      `open_driver`; options.py: each driver's options, their defaults and checks
transport_driver.py  a robot behind a `Link`; linked.py: what threads and asyncio have in common
serial.py, l298n.py, pigpio.py, mock.py  each only opens its link; pins.py and pin_options.py:
                the Pi's own pins
device_parameters.py, device_board.py    parameters and boards; requests.py: one description of
                each operation for threads and for asyncio
callbacks.py    `on_lost` and the like, on a thread; loop_callbacks.py: the same on asyncio
loop_link.py    how coroutines wait for a link's thread
"""
