"""A Raspberry Pi's GPIO chip in a process of its own, with a model robot behind its pins.

As with the kernel's character device, a line has one owner: a second process is refused until the
first has released it or has died. A dead owner's outputs keep their levels, its software PWM stays
high.
"""
