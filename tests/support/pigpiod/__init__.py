"""A stand-in for pigpiod on a Pi 4, with a model robot behind its pins.

It speaks the daemon's socket protocol to pigpio's own client and models its traps: the 8 kHz clamp
of DMA PWM, the -100 of hardware PWM under `-t 0`, sampling every 5 us, a buffer of 120 ms for a
client that does not read. Command numbers and errors are pigpio.h's.
"""
