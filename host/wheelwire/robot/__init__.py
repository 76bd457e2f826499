"""A robot: every verb of it, for threads; `wheelwire.aio` has its twin for asyncio.

base.py         the interface of every driver
robot.py        a robot behind a `Link`; linked.py: what threads and asyncio have in common
driving.py      checks, kinematics and expiry of a setpoint
calls.py        one description of each operation for threads and for asyncio
parameters.py, board.py, sensors.py, black_boxes.py  what a device has stored, measures, recorded
callbacks.py    `on_lost` and the like, on a thread; loop_callbacks.py: the same on asyncio
loop_link.py    how coroutines wait for a link's thread
explanations.py what an error says of the stop behind it
"""
