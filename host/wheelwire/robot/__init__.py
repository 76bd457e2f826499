"""A robot: every verb of it, for threads; `wheelwire.aio` has its twin for asyncio.

robot.py        `Robot`, for threads
verbs.py        what both have: checks and expiry of a setpoint, what is known without waiting, and
                each verb that waits, described once
calls.py        requests to the device, and what their errors say of a stop
parameters.py, board.py, sensors.py, black_boxes.py  what a device has stored, measures, recorded
callbacks.py    `on_lost` and the like, on a thread; loop_callbacks.py: the same on asyncio
loop_link.py    how coroutines wait for a link's thread
"""
