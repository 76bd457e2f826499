"""A robot on the whole screen of a terminal: what it does, and the keys that stop or drive it.

`source` looks at a driver, some 20 times a second -> `model`: what was seen recently, as data ->
`panels`: the text of each part of the screen, plots by `canvas` -> `app`: Textual's widgets
`controls`: what the keys ask of the robot, in other threads than the screen's; `tuning`: values on
trial

Only `app` and `screens` know Textual (extra `view`).
"""
