"""A Raspberry Pi's GPIO chip in a process of its own, with a model robot behind its pins.

A line has one owner, as the kernel's character device has it: a second process is refused until the
first has let go or is dead. A dead owner's outputs stay as they were, its software PWM high.
"""
