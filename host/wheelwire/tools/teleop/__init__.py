"""Driving by hand, with the keys of a terminal.

`terminal` gives each key at once and shows a line. `keys` decodes its bytes into keys, and keys
that live for a while into what they ask for: forward, to the left, until when. `drive` makes
setpoints of that, carries out the other keys (stop, e-stop, clear, speed), and has the loop.
Data flow: bytes -> keys -> presses -> setpoints -> driver; its newest sample goes to the line.
"""
