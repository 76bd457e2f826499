"""A DC gear motor with its wheel behind one half of an L298N. Constants are those at the wheel."""

from __future__ import annotations

import math
from dataclasses import dataclass

STRIBECK_RADPS = 0.3
"""Speed at which half of the static friction is gone."""
LONGEST_STEP_S = 1e-3
"""Explicit Euler: far below the mechanical time constant of about 0.1 s."""


@dataclass(frozen=True, slots=True)
class MotorModel:
    """A 200 rpm TT motor at 7.4 V, its wheel, and half of the robot's mass.

    The rating is for the voltage behind the bridge: the supply less the bridge's drop.
    """

    supply_v: float = 7.4
    drop_v: float = 1.3
    drop_ohm: float = 1.2
    no_load_rpm: float = 200.0
    stall_current_a: float = 1.0
    stall_torque_nm: float = 0.09
    coulomb_nm: float = 0.006
    static_nm: float = 0.009
    viscous_nms: float = 1e-4
    wheel_radius_m: float = 0.033
    carried_kg: float = 0.4
    rotor_inertia_kgm2: float = 5e-5

    @property
    def circuit_ohm(self) -> float:
        """Resistance of winding and bridge, which limits the current at standstill."""
        return (self.supply_v - self.drop_v) / self.stall_current_a

    @property
    def torque_nm_per_a(self) -> float:
        """At the wheel; the gearbox's losses are in it."""
        return self.stall_torque_nm / self.stall_current_a

    @property
    def emf_vs(self) -> float:
        """Back-EMF per speed in V s/rad, from the no-load point."""
        speed = self.no_load_rpm * 2 * math.pi / 60
        current = self.friction_nm(speed) / self.torque_nm_per_a
        return (self.supply_v - self.drop_v - self.circuit_ohm * current) / speed

    @property
    def inertia_kgm2(self) -> float:
        """Seen at the wheel."""
        return self.carried_kg * self.wheel_radius_m**2 + self.rotor_inertia_kgm2

    def friction_nm(self, speed_radps: float) -> float:
        """Against the motion: Coulomb, Stribeck's excess near standstill, viscous."""
        excess = (self.static_nm - self.coulomb_nm) / (1 + (speed_radps / STRIBECK_RADPS) ** 2)
        return self.coulomb_nm + excess + self.viscous_nms * abs(speed_radps)


class Motor:
    """The levels of its bridge in, its speed out."""

    def __init__(self, model: MotorModel) -> None:
        self.speed_radps = 0.0
        self.blocked = False
        """The wheel is held fast."""
        self.reversed = False
        """The motor's wires are swapped."""
        self.load_nm = 0.0
        """Load torque against forward motion."""
        self._model = model
        self._winding_ohm = model.circuit_ohm - model.drop_ohm
        self._emf_vs = model.emf_vs

    @property
    def speed_mps(self) -> float:
        """Speed at the rim."""
        return self.speed_radps * self._model.wheel_radius_m

    def step(self, dt_s: float, in1: bool, in2: bool, enable: float) -> float:
        """Advance by at most LONGEST_STEP_S; returns the angle turned, in radians."""
        if self.blocked:
            self.speed_radps = 0.0
            return 0.0
        polarity = -1.0 if self.reversed else 1.0
        current = polarity * self._current_a(in1, in2, enable, polarity)
        torque = self._model.torque_nm_per_a * current - self.load_nm
        self.speed_radps = self._next_speed(dt_s / self._model.inertia_kgm2, torque)
        return self.speed_radps * dt_s

    def _next_speed(self, rate: float, torque: float) -> float:
        """Static friction holds a standing wheel; a change of sign stops at zero first."""
        speed, model = self.speed_radps, self._model
        if speed == 0:
            if abs(torque) <= model.static_nm:
                return 0.0
            return rate * (torque - math.copysign(model.static_nm, torque))
        changed = speed + rate * (torque - math.copysign(model.friction_nm(speed), speed))
        return changed if changed * speed > 0 else 0.0

    def _current_a(self, in1: bool, in2: bool, enable: float, polarity: float) -> float:
        """Average over a PWM period, through a winding whose inductance carries it over the gap."""
        model = self._model
        if enable <= 0:
            return 0.0  # coast: the diodes block below the supply voltage
        emf = polarity * self._emf_vs * self.speed_radps
        if in1 == in2:
            # Brake: shorted through a transistor and a diode, so no current below their drop.
            voltage = max(0.0, abs(emf) - model.drop_v)
            return -math.copysign(enable * voltage / model.circuit_ohm, emf)
        applied = math.copysign(model.supply_v - model.drop_v, 1 if in1 else -1)
        return (enable * applied - emf) / (self._winding_ohm + enable * model.drop_ohm)
