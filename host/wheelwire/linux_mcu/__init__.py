"""This computer as the microcontroller: a process that runs the firmware's core on its own pins.

Two processes, started as one: the *core* steps the firmware's core and moves the pins; the *guard*
beside it watches the core and pulls the bridge's EN low when that dies or hangs. The application
reaches the core over a socket, by the protocol that an ESP32 speaks. Nothing here decides anything
about the robot: a pin is moved, an edge is counted, bytes are passed on.
"""
