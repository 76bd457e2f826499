"""A robot without hardware: the firmware with a plant behind it, and a bad line before it.

`simulator` runs the simulated device as a process behind a port, in real time; `libfwsim` has it in
this process, in virtual time, and `virtual_link` joins that to a session. `bad_line` is the bad
line without a clock or port; `impaired_simulator` puts it between a `Simulator` and the host. Data
flow: host -> port -> bad line, if any -> firmware's core -> plant, and back as state frames; the
    plant's true state comes separately, as variables or `TrueState`. `plants/` and `profiles/` are
data that `wheelwire.tools.files` reads.
"""
