"""Why a robot stops: each cause has a name, a sentence and what to look at first.

`docs/causes.md` says which data tells which causes apart; `diagnosis` applies it.
"""

from __future__ import annotations

from collections.abc import Iterable, Iterator, Mapping, Sequence
from types import MappingProxyType
from typing import TYPE_CHECKING, NamedTuple

from wheelwire_protocol.codes import (
    BatteryLevel,
    EstopSource,
    Fault,
    Held,
    PeripheralKind,
    Reflex,
    RefusalCode,
    ResetReason,
    SensorState,
)

if TYPE_CHECKING:
    from ...link.sensor_stream import InputsMeasurement


class Cause(NamedTuple):
    """One cause of a stop.

    Attributes:
        sentence: What happened. A wheel's begins with its side, "{wheel}", a sensor's with its
            name, "{channel}".
        look_at: What to look at first.
    """

    sentence: str
    look_at: str


CAUSES: dict[str, Cause] = {
    # --- faults of a wheel
    "encoder_dead": Cause(
        "{wheel} wheel stopped counting at full speed although it was still driven",
        "the encoder's plug and its wires",
    ),
    "encoder_one_channel": Cause(
        "{wheel} wheel's count went up and down by one while it was driven: one of its encoder's "
        "two channels is dead",
        "the encoder's wires A and B",
    ),
    "wheel_blocked": Cause("{wheel} wheel was held fast while driven", "what touches the wheel"),
    "motor_open": Cause(
        "{wheel} wheel rolled to a stop although it was driven harder and harder: its motor drew "
        "no current",
        "the motor's plug and the output of the power stage",
    ),
    "wheel_never_counted": Cause(
        "{wheel} wheel did not count once since the drive began: encoder, motor or a blocked wheel",
        "the plugs of motor and encoder; turn the wheel by hand and watch `wheelwire monitor`",
    ),
    "wheel_reversed": Cause(
        "{wheel} wheel's speed grew against its drive",
        "whether the wheel turned backward: if so its motor is reversed, else its encoder; "
        "`wheelwire setup` finds out, and corrects the right one",
    ),
    "encoder_implausible": Cause(
        "{wheel} wheel was driven harder than its measured speed explains, while it still counted",
        "the encoder, which may lose edges; then the load",
    ),
    # --- other faults
    "control_overrun": Cause(
        "The control loop ran too late", "what was written to flash just then; overrun_limit_us"
    ),
    "driver_failed": Cause(
        "A motor or encoder peripheral did not start", "the pins in the wiring guide"
    ),
    "overspeed": Cause(
        "The robot rolled much faster than its limit and its setpoint for a second",
        "the slope, or who pushed it; then the encoders and `max_velocity_mps`",
    ),
    "store_full": Cause(
        "The flash of the saved parameters has no free page", "the flash: reset the parameters"
    ),
    "store_newer": Cause("The saved parameters are of a newer firmware", "the firmware's release"),
    "store_unreadable": Cause(
        "The saved parameters are damaged or gone", "`wheelwire params import`, or a reset of them"
    ),
    "store_outdated": Cause(
        "An earlier firmware wrote the board or the parameters that are stored",
        "`wheelwire board write`, then `wheelwire params import`",
    ),
    "no_board": Cause("No board is stored that this device can use", "`wheelwire board write`"),
    "external_fault": Cause(
        "An input of the board stopped the robot", "`wheelwire sensors`, then what is wired to it"
    ),
    "cliff_seen": Cause("{channel} saw no floor", "where the robot stands, then that sensor"),
    "stage_tripped": Cause(
        "{channel} reported that a power stage has tripped", "the motors' currents, then its heat"
    ),
    "battery_at_stop": Cause(
        "The battery fell to the level at which the robot stops", "the battery's charge"
    ),
    "sensor_stale": Cause(
        "{channel}, which can stop the robot, gave no usable samples",
        "`wheelwire sensors`, then that sensor's wires",
    ),
    "bumper_pressed": Cause(
        "{channel} was pressed, and held the robot off",
        "what it touches, then that bumper and its wire",
    ),
    # --- emergency stops, and stops that somebody asked for
    "contact_open": Cause(
        "The emergency stop's contact opened", "the emergency stop's button, then its wire"
    ),
    "estop_by_session": Cause(
        "The emergency stop was requested over this link", "the program that asked"
    ),
    "estop_by_stranger": Cause(
        "Another program sent an emergency stop to the port", "who else has the port"
    ),
    "estop_before_reset": Cause(
        "An emergency stop was latched before the device's reset", "what caused it; then clear it"
    ),
    "latch_record_damaged": Cause(
        "The record of latched e-stops is damaged, which counts as an emergency stop",
        "the robot; then clear it",
    ),
    "fault_before_reset": Cause(
        "A fault was latched before the device's reset", "the fault that is named in the evidence"
    ),
    "stop_by_session": Cause("The stop was requested over this link", "the program that asked"),
    "stop_by_stranger": Cause("Another program sent a stop to the port", "who else has the port"),
    "zero_setpoint": Cause(
        "The wheels stand still because the program sent a speed of zero", "the program that asked"
    ),
    "new_session": Cause(
        "Another program opened a session, which ended this one", "who else has the port"
    ),
    "trial_expired": Cause(
        "A trial of parameters was not renewed in time", "the program that tries parameters"
    ),
    "host_hung_up": Cause("The program closed the link while the robot drove", "the program's log"),
    # --- setpoints that stopped coming
    "host_killed": Cause(
        "The program ended without closing the robot: it was killed, or its computer lost power",
        "the system's log",
    ),
    "recording_cut": Cause(
        "The recording was cut off while the robot drove on: its disk was gone, or only a part of "
        "the file was copied",
        "the disk that was recorded to",
    ),
    "host_frozen": Cause("The program was frozen: not even its link ran", "the host's load"),
    "cable_pulled": Cause("The connection to the robot was lost", "the cable's plug"),
    "line_corrupt": Cause(
        "Setpoints were damaged on the line", "the cable, the common ground, the baud rate"
    ),
    "setpoints_refused": Cause("The device refused the setpoints", "what the refusal says"),
    "setpoints_expired": Cause(
        "The setpoints were too old when they arrived",
        "the host's load and the setpoints' time to live",
    ),
    "ttl_too_short": Cause(
        "Each setpoint expired before the next one came: the robot starts and stops",
        "the program's loop: send more often, or give a longer ttl",
    ),
    "program_paused": Cause(
        "The program sent no more setpoints, although its link went on",
        "the program: it stopped sending setpoints",
    ),
    # --- resets
    "brownout": Cause(
        "The device was reset because its supply dipped",
        "the battery, then the wires of the supply",
    ),
    "panic": Cause("The firmware crashed", "`wheelwire info`, the core dump"),
    "task_watchdog": Cause(
        "A task of the firmware hung, and the watchdog reset it", "the firmware"
    ),
    "interrupt_watchdog": Cause(
        "Interrupts were blocked, and the watchdog reset the device", "the core dump"
    ),
    "power_lost": Cause("The device lost its power", "the supply"),
    "reset_pin": Cause("The reset pin restarted the device", "the button, or who opened the port"),
    "restart_requested": Cause("A program requested the restart", "the program that asked"),
    "restarted_itself": Cause("The firmware restarted itself", "the board on trial"),
    "reset_unknown": Cause("The device was reset, and cannot say why", "the supply"),
    # --- it never drove
    "board_unconfirmed": Cause(
        "Nobody has confirmed the board, so nothing drives", "`wheelwire board confirm`"
    ),
    "board_on_trial": Cause("A board is on trial", "`wheelwire board confirm`"),
    "contradiction": Cause("Parameters contradict each other", "`wheelwire info`"),
    "command_numbers_spent": Cause(
        "The session has used up its 4294967295 command numbers, so no setpoint of it is obeyed",
        "the program: opening the robot again begins at 1",
    ),
    "unarmed": Cause(
        "After a clear, a start of the chip or a bumper the program sent a speed at once",
        "the program: it must send zero first, or pause",
    ),
    "clock_unsynchronised": Cause("The clock is not synchronised yet", "the program"),
    "no_session": Cause(
        "The device knows no session of this program", "whether the device was reset"
    ),
    "protocol_mismatch": Cause(
        "Host and firmware are of different releases", "the releases on both sides"
    ),
    "box_damaged": Cause(
        "A fault stopped the robot, and the black box that tells which one is damaged",
        "the flash, unless it is the only damaged one",
    ),
    # --- a request that the device refused
    "value_not_finite": Cause("The value is not a finite number", "the program's computation"),
    "value_out_of_range": Cause(
        "The value is beyond what the device allows", "`wheelwire params list`: it has the bounds"
    ),
    "value_not_whole": Cause("The parameter takes whole numbers only", "the value"),
    "parameter_unknown": Cause(
        "The firmware has no such parameter", "`wheelwire params list`, then the firmware's release"
    ),
    "not_stopped": Cause(
        "The robot drives, or an emergency stop is latched: nothing is changed meanwhile",
        "the state: stop it, or clear the emergency stop, and ask again",
    ),
    "store_failed": Cause("The flash could not be written", "the flash"),
    "rate_too_high": Cause(
        "The rate is higher than the control loop or the line allows",
        "control_rate_hz, then the baud rate",
    ),
    "still_starting": Cause(
        "The device is about to start, or to restart", "the state: ask again in a moment"
    ),
    "parameters_on_trial": Cause(
        "Parameters are on trial", "the program that tries them: keep or revert them first"
    ),
    "board_refused": Cause(
        "The board breaks a rule of this device, or is not the one that the device has",
        "`wheelwire board check`, then `wheelwire board read`",
    ),
    "no_board_on_trial": Cause(
        "No board waits for a confirmation", "`wheelwire board read`, then `wheelwire board write`"
    ),
    "not_supported": Cause("This device cannot do that", "`wheelwire info`: it names the device"),
    # --- the supply
    "battery_low": Cause(
        "The battery was already low at rest, and the device reset", "the battery's charge"
    ),
    "battery_sags": Cause(
        "The supply is good at rest, falls under load, and the device reset",
        "the wires and plugs of the supply",
    ),
    "battery_empty": Cause(
        "The battery ran empty, and the device lost its supply", "the battery's charge"
    ),
}

WHEEL_FAULTS: dict[Fault, tuple[str, str]] = {
    Fault.LEFT_NOT_COUNTING: ("left", "wheel_never_counted"),
    Fault.RIGHT_NOT_COUNTING: ("right", "wheel_never_counted"),
    Fault.LEFT_REVERSED: ("left", "wheel_reversed"),
    Fault.RIGHT_REVERSED: ("right", "wheel_reversed"),
    Fault.LEFT_ENCODER_IMPLAUSIBLE: ("left", "encoder_implausible"),
    Fault.RIGHT_ENCODER_IMPLAUSIBLE: ("right", "encoder_implausible"),
}
"""The wheel, and the cause unless the samples tell more."""
COUNTING_FAULTS = Fault.LEFT_NOT_COUNTING | Fault.RIGHT_NOT_COUNTING

OTHER_FAULTS: dict[Fault, str] = {
    Fault.CONTROL_OVERRUN: "control_overrun",
    Fault.DRIVER_FAILED: "driver_failed",
    Fault.STORE_FULL: "store_full",
    Fault.STORE_NEWER: "store_newer",
    Fault.STORE_UNREADABLE: "store_unreadable",
    Fault.STORE_OUTDATED: "store_outdated",
    Fault.NO_BOARD: "no_board",
    Fault.EXTERNAL: "external_fault",
    Fault.OVERSPEED: "overspeed",
}

RESETS: dict[ResetReason, str] = {
    ResetReason.UNKNOWN: "reset_unknown",
    ResetReason.POWER_ON: "power_lost",
    ResetReason.EXTERNAL: "reset_pin",
    ResetReason.SOFTWARE: "restarted_itself",
    ResetReason.PANIC: "panic",
    ResetReason.TASK_WATCHDOG: "task_watchdog",
    ResetReason.INTERRUPT_WATCHDOG: "interrupt_watchdog",
    ResetReason.BROWNOUT: "brownout",
}

ESTOPS: dict[EstopSource, str] = {
    EstopSource.CONTACT: "contact_open",
    EstopSource.SESSION: "estop_by_session",
    EstopSource.OTHER_PROGRAM: "estop_by_stranger",
    EstopSource.BEFORE_POWER_ON: "estop_before_reset",
    EstopSource.DAMAGED_RECORD: "latch_record_damaged",
}
LATCHES = Held.ESTOP | Held.CONTACT | Held.FAULT
"""What the robot's state says as well."""
SENSED: dict[Held, str] = {
    Held.CLIFF: "cliff_seen",
    Held.FAULT_INPUT: "stage_tripped",
    Held.BATTERY: "battery_at_stop",
    Held.BATTERY_UNKNOWN: "sensor_stale",
}
"""Sensors that stop the robot."""
_STOPPING_INPUTS = {PeripheralKind.CLIFF: "cliff_seen", PeripheralKind.STAGE_FAULT: "stage_tripped"}

REFUSALS: dict[RefusalCode, str] = {
    RefusalCode.EXPIRED: "setpoints_expired",
    RefusalCode.BOARD_UNCONFIRMED: "board_unconfirmed",
    RefusalCode.BOARD_ON_TRIAL: "board_on_trial",
    RefusalCode.CONTRADICTION: "contradiction",
    RefusalCode.UNARMED: "unarmed",
    RefusalCode.COMMAND_SEQ_SPENT: "command_numbers_spent",
    RefusalCode.CLOCK_UNSYNCHRONISED: "clock_unsynchronised",
    RefusalCode.NO_SESSION: "no_session",
    RefusalCode.NO_TRIAL: "trial_expired",
    RefusalCode.PROTOCOL_VERSION: "protocol_mismatch",
    RefusalCode.SCHEMA: "protocol_mismatch",
}
"""Causes by the refusal of a setpoint or a hello; any other one is `setpoints_refused`."""
REQUEST_REFUSALS: dict[RefusalCode, str] = {
    RefusalCode.NOT_FINITE: "value_not_finite",
    RefusalCode.OUT_OF_RANGE: "value_out_of_range",
    RefusalCode.NOT_INTEGRAL: "value_not_whole",
    RefusalCode.UNKNOWN_PARAMETER: "parameter_unknown",
    RefusalCode.NOT_STOPPED: "not_stopped",
    RefusalCode.STORE_FAILED: "store_failed",
    RefusalCode.RATE_TOO_HIGH: "rate_too_high",
    RefusalCode.BOOTING: "still_starting",
    RefusalCode.ON_TRIAL: "parameters_on_trial",
    RefusalCode.BOARD_REFUSED: "board_refused",
    RefusalCode.NO_BOARD_ON_TRIAL: "no_board_on_trial",
    RefusalCode.NOT_SUPPORTED: "not_supported",
}
"""Causes by the refusal of a request, in addition to those above."""
LATCHED = (RefusalCode.ESTOPPED, RefusalCode.FAULT)
"""The robot has stopped before, by what is latched."""
HELD = (*LATCHED, RefusalCode.CAUSE_PRESENT)
"""Something latched refuses these; after CAUSE_PRESENT it cannot be cleared yet."""
ESTOPPED = "contact_open", "estop_by_session", "estop_by_stranger"
"""Any of them, as far as the state alone tells."""
_FLAG_ALONE = {"wheel_never_counted": ("encoder_dead", "wheel_blocked")}
"""The flag alone does not say whether the wheel had counted before."""


def sentence_of(causes: Sequence[str], side: str = "") -> str:
    """What happened: one of these causes. `side`: of the wheel, or the name of the sensor."""
    names = {"wheel": side.capitalize() or "A", "channel": side or "A sensor"}
    first, *others = (CAUSES[name].sentence.format(**names) for name in causes)
    return first + "".join(f"; or {text[0].lower()}{text[1:]}" for text in others) + "."


def look_at_of(causes: Iterable[str]) -> str:
    """What to look at first, and then: of one of these causes."""
    return ", then ".join(dict.fromkeys(CAUSES[name].look_at for name in causes))


def sensor_causes(inputs: InputsMeasurement) -> dict[str, str]:
    """The sensors that stop the robot by a report of the device: their names, and the cause."""
    message, states = inputs.message, inputs.states
    found = {}
    for number, info in inputs.infos.items() if message.reflexes & Reflex.STOP else ():
        if info.kind in _STOPPING_INPUTS and message.triggered >> number & 1:
            found[info.name] = _STOPPING_INPUTS[info.kind]
        elif info.kind is PeripheralKind.BATTERY and states[number] is not SensorState.OK:
            found[info.name] = "sensor_stale"
        elif info.kind is PeripheralKind.BATTERY and message.level == BatteryLevel.STOP:
            found[info.name] = "battery_at_stop"
    return found


def sensed_causes(held: Held) -> dict[str, str]:
    """The sensors among these that stop the robot: their names, and the cause."""
    return {channel_of(flag): cause for flag, cause in SENSED.items() if flag in held}


def channel_of(flag: Held) -> str:
    """What a person calls a sensor: `Bumper front left`."""
    return str(flag.name).replace("_", " ").capitalize()


def latched_causes(
    faults: Fault, sensors: Mapping[str, str] = MappingProxyType({})
) -> Iterator[tuple[Fault, tuple[str, ...], str]]:
    """Each latched fault, the causes that its flag alone leaves open, and the wheel's side.

    Args:
        faults: Those that are latched.
        sensors: What `sensor_causes` found: of the first of them, the cause and its name.
    """
    for fault in Fault:
        if fault is Fault.EXTERNAL and fault in faults and sensors:
            channel, name = next(iter(sensors.items()))
            yield fault, (name,), channel
        elif fault in faults:
            side, name = WHEEL_FAULTS.get(fault) or ("", OTHER_FAULTS[fault])
            yield fault, _FLAG_ALONE.get(name, (name,)), side


STORED = Fault.NO_BOARD | Fault.STORE_UNREADABLE | Fault.STORE_OUTDATED
"""What is stored cannot be used: each start finds this again until it is rewritten."""


def cure_of_stores(faults: Fault, robot: str) -> str:
    """The commands that end these faults, in order; empty if none of them is in `STORED`.

    Args:
        faults: Those that are latched.
        robot: The robot's address, as a command takes it.
    """
    if not faults & STORED:
        return ""
    steps = []
    if Fault.NO_BOARD in faults:
        steps.append(f"`wheelwire board write {robot} FILE` with the file of its board")
    if faults & ~Fault.NO_BOARD & STORED:
        steps.append(
            f"`wheelwire params import {robot} FILE --save`, or `wheelwire params reset {robot}` "
            "for the defaults"
        )
    return ", then ".join((*steps, f"`wheelwire clear {robot}`"))
