"""The parameters of the velocity loop, from what was identified.

The gains follow the SIMC rules of S. Skogestad, "Simple analytic rules for model reduction and PID
controller tuning", Journal of Process Control 13 (2003) 291-309. For a process
`k exp(-delay s) / (lag s + 1)` and a closed loop of the time constant `closed_s`:

    proportional gain = lag / (k (closed_s + delay))
    integral time     = min(lag, 4 (closed_s + delay))

The process is speed over duty, so `k` is 1 / velocity_feedforward.
"""

from __future__ import annotations

from ...robot.robot import Robot
from .identification import Identification, within

CLOSED_LOOP_DELAYS = 2.0
"""Time constant of the closed loop, in delays of the process. SIMC's fastest recommended one is 1;
twice that leaves room for what the model lacks, such as play in the gearbox."""

FLOOR_INERTIA = 3.0
"""The assumed inertia of the robot, relative to that of its raised wheels, until it is measured on
the floor. The inertia of a gear motor's rotor is multiplied by the square of the gear ratio, so the
robot's mass adds only a few times as much: the simulator's plants have 3.1 to 6.4. This is about
the lowest of them: too much feed-forward jerks the robot, and the loop makes up for too little."""


def simc_pi(k: float, lag_s: float, delay_s: float, closed_s: float) -> tuple[float, float]:
    """The PI controller for a first-order process with delay: Skogestad 2003, table 1.

    Args:
        k: The process's steady gain.
        lag_s: Its time constant.
        delay_s: Its delay.
        closed_s: The time constant wanted of the closed loop.

    Returns:
        The gain, in the reciprocal of the process gain's unit, and the integral time, of
        `gain (1 + 1 / (integral_s s))`.
    """
    return lag_s / (k * (closed_s + delay_s)), min(lag_s, 4 * (closed_s + delay_s))


def tuned(identification: Identification, robot: Robot) -> dict[str, float]:
    """The parameters that fit the measurements, by name, for the present loop.

    acceleration_feedforward is velocity_feedforward times the time constant. A wheel's velocity
    error is the growth of its following error, and path_gain adds a part of the following error
    itself to the command: that acts as integral gain, and is taken off it.

    Values that could not be measured are left out: nominal_supply_v without a measured battery, and
    the gains without a time constant, or if speed over duty is not a line.

    Raises:
        LinkLost: The robot is out of reach.
    """
    feedforward = identification.velocity_feedforward
    values = {
        "velocity_feedforward": feedforward,
        "static_feedforward": identification.static_feedforward,
    }
    if identification.supply_v is not None:
        values["nominal_supply_v"] = identification.supply_v
    lag_s, delay_s = identification.time_constant_s, identification.delay_s
    bent = identification.left.nonlinearity or identification.right.nonlinearity
    if lag_s is not None and delay_s is not None and not bent:
        if not identification.on_the_floor:
            lag_s *= FLOOR_INERTIA
        # The loop cannot act sooner than in its next step, however short the fitted delay is.
        delay_s = max(delay_s, 1 / robot.parameters["control_rate_hz"])
        gain, integral_s = simc_pi(1 / feedforward, lag_s, delay_s, CLOSED_LOOP_DELAYS * delay_s)
        path_gain = robot.parameters["path_gain"]
        values |= {
            "acceleration_feedforward": feedforward * lag_s,
            "proportional_gain": gain,
            "integral_gain": gain * max(0.0, 1 / integral_s - path_gain),
        }
    # More digits than four mean nothing.
    return {name: float(f"{within(name, value):.4g}") for name, value in values.items()}
