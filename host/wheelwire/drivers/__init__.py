"""Drivers: one class per way to reach the motors and encoders, all behind `BaseDriver`."""
