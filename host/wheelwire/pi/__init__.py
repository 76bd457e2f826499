"""This computer as the microcontroller: a process that runs the firmware's core on its own pins.

It is two processes: the *core* steps the firmware's core and moves the pins; its parent, the
*guard*, pulls the bridge's EN low if the core process dies or hangs. The application talks to the
core over a socket, with the protocol that an ESP32 speaks. No code here makes a decision about the
robot: it sets pins, counts edges and passes bytes on.

`launch` starts both from the application; `__main__` is where they begin, with `McuSettings` in
JSON. `core` has the loop, `line` its socket, `gpio` and `encoder` the pins, `i2c` the buses,
`storage` the files; `guard` watches. Data flow: socket -> `line` -> the firmware's core -> outputs
-> `gpio`; edges -> `encoder` -> ticks -> the core -> `line`.
"""
