"""The enumerations on the wire, each member with the sentence that users are shown; and units."""

from __future__ import annotations

import enum
from functools import cache
from typing import TYPE_CHECKING, cast

if TYPE_CHECKING:
    from typing_extensions import Self


class DocumentedEnum(enum.IntEnum):
    """An IntEnum whose members have a doc: `NAME = value, "doc"`. It prints as its name."""

    doc: str

    def __new__(cls, value: int, doc: str = "") -> DocumentedEnum:
        """Create a member with its doc."""
        member = int.__new__(cls, value)
        # Without this, Enum would compute the value from both arguments, as int(value, doc).
        member._value_ = value
        member.doc = doc
        return member

    def __str__(self) -> str:
        return self.name

    def __format__(self, spec: str) -> str:
        return _formatted(self, spec)


class DocumentedFlag(enum.IntFlag):
    """An IntFlag whose single flags have a doc: `NAME = bit, "doc"`. It prints as `A|B`."""

    doc: str

    def __new__(cls, value: int, doc: str = "") -> DocumentedFlag:
        """Create a member with its doc."""
        member = int.__new__(cls, value)
        member._value_ = value
        member.doc = doc
        return member

    @classmethod
    def _missing_(cls, value: object) -> Self:
        """The flags of a combined value; a negative value is the complement."""
        # Python 3.11.2, Debian 12's, knows of few of the bits of flags that __new__ gives values.
        if isinstance(value, int) and value < 0:
            return cls(value & sum(cls))
        return cast("Self", super()._missing_(value))

    def __str__(self) -> str:
        names = [str(flag.name) for flag in type(self) if flag & self]
        unknown = int(self) & ~sum(type(self))
        return "|".join([*names, *([f"{unknown:#x}"] if unknown else [])]) or "NONE"

    def __format__(self, spec: str) -> str:
        return _formatted(self, spec)


def _formatted(code: DocumentedEnum | DocumentedFlag, spec: str) -> str:
    """In words, unless a format for numbers is given, such as `{code:02x}` or `{code:d}`."""
    return format(int(code) if spec[-1:] in _OF_NUMBERS and spec else str(code), spec)


_OF_NUMBERS = "bcdeEfFgGnoxX%"


class SupervisorState(DocumentedEnum):
    """The safety supervisor's states. Only DRIVING lets the outputs drive."""

    BOOT = 0, "Starting; the outputs coast."
    IDLE = 1, "Stopped, ready for a setpoint."
    DRIVING = 2, "Obeying a setpoint that has not expired."
    TIMED_OUT = 3, "The setpoint expired; the next fresh one drives again."
    ESTOPPED = 4, "Emergency stop, latched until it is cleared."
    FAULT = 5, "A fault, latched until it is cleared."

    @property
    def is_latched(self) -> bool:
        """Whether only a clear ends it."""
        return self in (SupervisorState.ESTOPPED, SupervisorState.FAULT)


class SupervisorEvent(DocumentedEnum):
    """What moves the supervisor from one state to another."""

    STARTED = 0, "Start-up is complete."
    SESSION = 1, "A host opened a session; the previous session's setpoint is void."
    SETPOINT = 2, "A fresh setpoint was accepted."
    STOP = 3, "A stop was requested."
    DEADLINE = 4, "The setpoint's deadline passed."
    ESTOP = 5, "An emergency stop, by message or by the input."
    CLEAR_ESTOP = 6, "The emergency stop was cleared."
    FAULT = 7, "A fault was detected."
    CLEAR_FAULT = 8, "The faults were cleared."


class RefusalCode(DocumentedEnum):
    """Why the device refused, and what to do about it."""

    NONE = 0, "Not refused."
    PROTOCOL_VERSION = (
        1,
        "Different protocol version; use firmware and host library of one release.",
    )
    SCHEMA = 2, "Different message schema; use firmware and host library of one release."
    NO_SESSION = 3, "No session of this host is open (was the device reset?); say hello first."
    CLOCK_UNSYNCHRONISED = 4, "No ping was answered in this session yet; synchronise the clock."
    EXPIRED = 5, "The setpoint had expired on arrival; use a longer time to live."
    NOT_FINITE = 6, "Not a finite number."
    OUT_OF_RANGE = 7, "Out of bounds; list the parameters to see the bounds."
    UNKNOWN_PARAMETER = 8, "No such parameter in this firmware; list the parameters."
    ESTOPPED = 9, "Emergency stop is latched; remove its cause, then clear it."
    FAULT = 10, "A fault is latched; remove its cause, then clear it."
    CAUSE_PRESENT = 11, "The cause is still present; close the e-stop contact or fix the fault."
    NOT_STOPPED = (
        12,
        (
            "Not possible while driving, while a wheel turns, or with an e-stop latched; stop or "
            "clear first, and wait until the wheels stand."
        ),
    )
    STORE_FAILED = (
        13,
        "The parameter store could not be written; values apply until the next reset.",
    )
    RATE_TOO_HIGH = 14, "Above the control rate or the line's capacity; request a lower rate."
    NOT_INTEGRAL = 15, "This parameter takes whole numbers only."
    BOOTING = 16, "The device is still starting; try again in a moment."
    ON_TRIAL = 17, "Not possible while parameters are on trial; keep or revert them first."
    NO_TRIAL = (
        18,
        "The trial of parameters is over and the previous values are active: "
        "it was not renewed in time, or its session ended. Revert it, then begin another.",
    )
    BOARD_REFUSED = 19, "The board breaks a rule of this device; see `wheelwire board check`."
    BOARD_ON_TRIAL = 20, "A board is on trial: confirm it, or wait until the previous one returns."
    NO_BOARD_ON_TRIAL = 21, "No board is on trial; write one and restart the device first."
    NOT_SUPPORTED = 22, "This device cannot do that; see its documentation for what does."
    BOARD_UNCONFIRMED = (
        23,
        "Nobody has confirmed which board this device is on, so it drives nothing: "
        "confirm it with `wheelwire board confirm`, or store another with `wheelwire board write`.",
    )
    UNARMED = (
        24,
        "The device started, an e-stop or a fault was cleared, or a bumper held the robot off: "
        "first send a zero setpoint, or none at all for rearm_gap_s and for ttl_max_s.",
    )
    CONTRADICTION = 25, "Parameters contradict each other; `wheelwire info` lists which ones."
    COMMAND_SEQ_SPENT = 26, "The session has used up its command numbers; open another one."


class Group(DocumentedEnum):
    """Messages that belong together, with a hash of their own. Every device has BASE."""

    BASE = 0, "Sessions, setpoints, stops, requests, state: what every device has."
    CONFIGURATION = 1, "The configuration: the board's pins, and the peripherals on it."
    RECORDER = 2, "Black boxes and ledger: what the device recorded of its stops."
    STORE = 3, "What the device has stored: which parameters a reset would change."
    SENSOR = 4, "Sensors, inputs and reflexes: what the peripherals measure and forbid."
    PLATFORM = 5, "What the firmware runs on: how much of the chip's memory is left."


class Failure(DocumentedEnum):
    """What a self-test image does to a core."""

    NONE = 0, "Nothing."
    CRASH = 1, "A task calls abort()."
    HANG = 2, "No task runs any more; interrupts go on."
    FREEZE = 3, "Nothing runs any more: interrupts are off, too."


class StopMode(DocumentedEnum):
    """What the outputs do to stop the wheels."""

    # COAST and BRAKE are the values of the parameter stop_mode, which the firmware casts to this.
    CONFIGURED = 0, "As the parameter stop_mode says."
    COAST = 1, "Outputs off."
    BRAKE = 2, "Windings shorted for brake_time_s, then outputs off."
    BRAKE_UNTIL_DRIVEN = 3, "Windings shorted until the next setpoint drives."


class TrialAction(DocumentedEnum):
    """What becomes of a trial of parameters."""

    BEGIN = 1, "Values that are set from now on are on trial, for timeout_s."
    RENEW = 2, "The trial goes on, for timeout_s from now."
    KEEP = 3, "Ends the trial; the active values stay."
    REVERT = 4, "Ends the trial: stops the wheels and restores the previous values."


class ResetReason(DocumentedEnum):
    """Why the device last started."""

    UNKNOWN = 0, "Not known."
    POWER_ON = 1, "Power was applied."
    EXTERNAL = 2, "The reset pin, or the USB bridge's automatic-reset circuit."
    SOFTWARE = 3, "The firmware restarted itself."
    PANIC = 4, "The firmware crashed."
    TASK_WATCHDOG = 5, "A task hung."
    INTERRUPT_WATCHDOG = 6, "Interrupts were blocked."
    BROWNOUT = 7, "The supply voltage dipped."


class EventCode(DocumentedEnum):
    """What an Event message reports."""

    SUPERVISOR = 0, "The supervisor changed its state."
    CONFIGURATION_COPY_LOST = (
        1,
        "One of the two stored copies of the configuration was lost; it is rewritten from the"
        " other one once the robot stands.",
    )
    STORE_EMPTY = 2, "No parameters were saved yet; the defaults are active."
    TRIAL_EXPIRED = 3, "A trial was not renewed in time: stopped, with the previous parameters."
    ROLLING = 4, "The robot rolls although it is not driven: a slope, or somebody pushes it."
    PARAMETERS_COPY_LOST = 5, "As CONFIGURATION_COPY_LOST, of the saved parameters."
    LATCHES_COPY_LOST = 6, "As CONFIGURATION_COPY_LOST, of the record of a latched e-stop."


class Chip(DocumentedEnum):
    """What the firmware runs on."""

    SIMULATED = 0, "The firmware's core on a computer, with a simulated robot."
    ESP32 = 1, "ESP32."
    ESP32S3 = 2, "ESP32-S3."
    ESP32C6 = 3, "ESP32-C6."
    LINUX = 4, "A Linux computer whose own pins drive the wheels, such as a Raspberry Pi."


class BoxCause(DocumentedEnum):
    """Why a black box was stored."""

    REQUEST = 0, "Somebody asked for it."
    FAULT = 1, "A fault."
    ESTOP = 2, "An emergency stop."
    RESET = 3, "A panic or a watchdog reset the device."


class Fault(DocumentedFlag):
    """Latched fault flags; any of them stops both wheels."""

    # WheelState and Event carry 16 bits of these.
    LEFT_NOT_COUNTING = (
        1,
        "The left wheel was driven hard and did not count: "
        "encoder dead, wire off, or wheel blocked.",
    )
    RIGHT_NOT_COUNTING = (
        2,
        "The right wheel was driven hard and did not count: "
        "encoder dead, wire off, or wheel blocked.",
    )
    LEFT_REVERSED = (
        4,
        "The left wheel's speed grew against its drive. If it turned backward, swap the motor's "
        "wires or set left_motor_inverted; if forward, encoder A and B or left_encoder_inverted.",
    )
    RIGHT_REVERSED = (
        8,
        "The right wheel's speed grew against its drive. If it turned backward, swap the motor's "
        "wires or set right_motor_inverted; if forward, encoder A and B or right_encoder_inverted.",
    )
    CONTROL_OVERRUN = (
        16,
        "The control loop ran too late: reduce the load, or raise overrun_limit_us.",
    )
    DRIVER_FAILED = (
        32,
        "A motor or encoder peripheral did not start: check the pins in the wiring guide.",
    )
    LEFT_ENCODER_IMPLAUSIBLE = (
        64,
        "The left wheel was driven harder than its measured speed explains: "
        "encoder edges are lost, or the load is heavier than plausibility_margin allows.",
    )
    RIGHT_ENCODER_IMPLAUSIBLE = (
        128,
        "The right wheel was driven harder than its measured speed explains: "
        "encoder edges are lost, or the load is heavier than plausibility_margin allows.",
    )
    STORE_FULL = (
        256,
        "The flash of the saved parameters has no free page, so they could not be read and "
        "the defaults are active: reset the parameters, which erases them and the board, clear the "
        "fault and restart. Afterwards nothing drives until `wheelwire board write`.",
    )
    STORE_NEWER = (
        512,
        "The saved parameters have the format of a newer firmware, and the defaults are active: "
        "install that firmware, or reset the parameters and clear the fault.",
    )
    STORE_UNREADABLE = (
        1024,
        "The saved parameters are damaged or gone, and the defaults are active: load a file with "
        "`wheelwire params import`, or reset the parameters, and clear the fault. If the whole "
        "flash partition is damaged, a reset erases the board, too, and nothing drives until "
        "`wheelwire board write`.",
    )
    NO_BOARD = (
        2048,
        "No board is stored that this device can use, so it drives no pin: "
        "write one with `wheelwire board write`.",
    )
    EXTERNAL = (
        4096,
        "An input of the board stopped the robot: remove what triggered it, then clear the fault.",
    )
    OVERSPEED = (
        8192,
        "The robot rolled much faster than its limit and its setpoint for a second: "
        "the slope is steeper than its motors hold, or somebody pushed it.",
    )
    STORE_OUTDATED = (
        16384,
        "The flash holds parameters or a board as an earlier firmware wrote them, and nothing "
        "drives: write the board with `wheelwire board write`, load the parameters with "
        "`wheelwire params import` or reset them, and clear the fault.",
    )


# A dictionary takes a seventh of the time of the class. Each state frame needs them, and each
# control step at a computer's own pins.
supervisor_state = cache(SupervisorState)
fault_flags = cache(Fault)


class Capability(DocumentedFlag):
    """What this device can do, and what it has stored."""

    BATTERY = 1, "Reports the battery voltage."
    ESTOP_INPUT = 2, "Has an emergency-stop input."
    SIMULATED_PLANT = 4, "Drives a simulated motor and encoder."
    CORE_DUMP = 8, "Has the core dump of a crash in its flash."
    RESTART = 16, "Restarts when it is asked to."


# The schema hash covers names, values and order of all of these: with a new member, host and
# firmware have to be of one release. The docs are not part of it.
class Contradiction(DocumentedFlag):
    """Active parameters that contradict each other, or the board. While any do, nothing drives."""

    OVERRUN_LIMIT = (
        1,
        "overrun_limit_us is less than 1.5 control periods (control_rate_hz): every step would "
        "trip CONTROL_OVERRUN; raise one of the two.",
    )
    PWM_FREQUENCY = (
        2,
        "pwm_frequency_hz is more than the board's power stage can switch; lower it.",
    )
    STREAM_RATE = (
        4,
        "stream_rate_hz is above control_rate_hz: there is one state for each control step; "
        "lower the one or raise the other.",
    )
    SUPPLY_DROP = (
        8,
        "supply_drop_v is not below nominal_supply_v and unmeasured_supply_v: nothing would be "
        "left for the motor; correct one of the three.",
    )
    TICK_RATE = (
        16,
        "max_velocity_mps gives more ticks in a control period than a counter can tell apart "
        "(counts_per_revolution, wheel_radius, control_rate_hz); lower max_velocity_mps.",
    )
    GLITCH_FILTER = (
        32,
        "glitch_filter_ns swallows the encoder's pulses at max_velocity_mps "
        "(counts_per_revolution, wheel_radius); lower one of the two.",
    )


class Held(DocumentedFlag):
    """What keeps the robot from driving now, or from driving one way."""

    BOOTING = 1, "It is still starting, or about to restart: wait a moment."
    SENSORS_UNREAD = 2, "A sensor that can stop it was not read since the start: wait a moment."
    BUMPER_FRONT = 4, "Its front bumper is pressed: it can only back out."
    BUMPER_FRONT_LEFT = 8, "Its left front bumper is pressed: it can only back out."
    BUMPER_FRONT_RIGHT = 16, "Its right front bumper is pressed: it can only back out."
    BUMPER_REAR = 32, "Its rear bumper is pressed: it can only drive forward."
    BUMPER_REAR_LEFT = 64, "Its left rear bumper is pressed: it can only drive forward."
    BUMPER_REAR_RIGHT = 128, "Its right rear bumper is pressed: it can only drive forward."
    CLIFF = 256, "A cliff sensor sees no floor: lift the robot away from the edge."
    FAULT_INPUT = 512, "The fault output of its power stage is active: let it cool, check it."
    BATTERY = 1024, "Its battery is empty: charge it."
    BATTERY_UNKNOWN = (
        2048,
        "Its battery is not measured, which counts as empty: check the divider or the sensor.",
    )
    CONTACT = 4096, "Its e-stop contact is open: release it, and check its wire."
    ESTOP = 8192, "An e-stop is latched: look, then clear it with `wheelwire clear`."
    FAULT = 16384, "A fault is latched: remove its cause, then clear it with `wheelwire clear`."
    UNARMED = (
        32768,
        "It started, or was cleared, and its program sent a speed at once: it waits for a "
        "zero setpoint or a pause.",
    )
    UNARMED_FORWARD = (
        65536,
        "A bumper held it off: it waits for a zero setpoint or a pause before it goes forward.",
    )
    UNARMED_REVERSE = (
        131072,
        "A bumper held it off: it waits for a zero setpoint or a pause before it goes backward.",
    )
    CONFIGURATION_UNCONFIRMED = (
        262144,
        "Nobody has confirmed its board: look, then `wheelwire board confirm`.",
    )
    CONFIGURATION_ON_TRIAL = (
        524288,
        "Its configuration is on trial: confirm it with `wheelwire board confirm`, or wait until "
        "the previous one returns.",
    )
    CONFIGURATION_UNUSABLE = (
        1048576,
        "Its stored configuration is missing, damaged or of another board: write it with "
        "`wheelwire board write`.",
    )
    CONTRADICTION = 2097152, "Its parameters contradict each other: correct the ones named."
    TRIAL_OVER = (
        4194304,
        "A trial of parameters ended by itself: revert it, or open another session.",
    )


class EstopSource(DocumentedEnum):
    """Who latched the e-stop."""

    NONE = 0, "No e-stop is latched."
    CONTACT = 1, "The e-stop contact."
    SESSION = 2, "The program whose session was open."
    OTHER_PROGRAM = 3, "A program beside the one whose session was open."
    BEFORE_POWER_ON = 4, "Not known: it was latched before the power came on."
    DAMAGED_RECORD = 5, "The record of latched e-stops is damaged, which counts as an e-stop."


class StopCause(DocumentedEnum):
    """What ended the last motion."""

    UNKNOWN = (
        0,
        "What ended the last motion is unknown: the robot has lost power since, or has not moved.",
    )
    DEADLINE = 1, "The setpoint of the program that drove expired, and no newer one came."
    STOP = 2, "The program that drove stopped it."
    STOP_OTHER = 3, "A program beside the one that drove stopped it."
    ESTOP_CONTACT = 4, "The e-stop contact opened."
    ESTOP_SESSION = 5, "The program that drove called for an e-stop."
    ESTOP_OTHER = 6, "A program beside the one that drove called for an e-stop."
    FAULT = 7, "A fault stopped it."
    BUMPER = 8, "A bumper held it off."
    CLIFF = 9, "A cliff sensor saw no floor."
    FAULT_INPUT = 10, "Its power stage reported a fault."
    BATTERY = 11, "Its battery was empty, or not measured."
    NEW_SESSION = 12, "Another session was opened: the program that drove lost its own."
    HANG_UP = 13, "The line of the program that drove was closed."
    TRIAL_ENDED = 14, "A trial of parameters ended while it drove."
    RESET = 15, "The device was reset while it drove."


class StopFlag(DocumentedFlag):
    """More about the last stop."""

    AT_REST = 1, "The wheels have come to rest: rolled_mm is final."
    EARLIER_START = 2, "It was before the device last started."


class ConfigurationState(DocumentedEnum):
    """Where the active configuration is from."""

    DAMAGED = 0, "The stored configuration cannot be used: nothing is driven."
    BUILT_IN = 1, "It is the firmware's own, which nobody confirmed: nothing is driven."
    STORED = 2, "It was confirmed."
    TRIAL = 3, "It was written, and waits for its confirmation: nothing drives."


ENUMERATIONS: tuple[type[DocumentedEnum], ...] = (
    SupervisorState,
    SupervisorEvent,
    RefusalCode,
    Group,
    StopMode,
    TrialAction,
    ResetReason,
    EventCode,
    Chip,
    EstopSource,
    StopCause,
)
FLAGS: tuple[type[DocumentedFlag], ...] = (Fault, Capability, Contradiction, Held, StopFlag)
RECORDER_CODES: tuple[type[DocumentedEnum], ...] = (BoxCause,)
"""The codes of the group RECORDER."""


# --- what a device says of its sensors; `peripherals` has what a board says ----------------------

MOST_PERIPHERALS = 10
"""Entries of a list. A channel is the index of an entry."""


class PeripheralKind(DocumentedEnum):
    """What is connected, and what the firmware does with it."""

    NONE = 0, "Nothing; the end of the list."
    IMU = 1, "Gyroscope and accelerometer on an I2C bus."
    POWER = 2, "Voltage and current of the supply, by a chip on an I2C bus."
    BATTERY = 3, "Levels of the battery at which the robot warns, slows down and stops."
    BUMPER = 4, "A normally closed switch to ground: no driving towards it while it is open."
    CLIFF = 5, "A digital sensor that sees no floor: the robot stops."
    STAGE_FAULT = 6, "The fault output of a power stage, low when it has tripped: the robot stops."
    RANGE = 7, "Distance to what is ahead, by the echo of a sound."
    ANALOG = 8, "A voltage at a pin of ADC1, by a divider."


class Place(DocumentedEnum):
    """Where on the robot it is."""

    NONE = 0, "Nowhere in particular."
    FRONT = 1, "At the front."
    FRONT_LEFT = 2, "At the front, left."
    FRONT_RIGHT = 3, "At the front, right."
    REAR = 4, "At the rear."
    REAR_LEFT = 5, "At the rear, left."
    REAR_RIGHT = 6, "At the rear, right."
    LEFT = 7, "At the left side."
    RIGHT = 8, "At the right side."


FRONT_PLACES = (Place.FRONT, Place.FRONT_LEFT, Place.FRONT_RIGHT)
REAR_PLACES = (Place.REAR, Place.REAR_LEFT, Place.REAR_RIGHT)


class SensorState(DocumentedEnum):
    """Whether a sensor's samples can be used. Only OK ones are sent."""

    UNREAD = 0, "Not read since the start."
    OK = 1, "Its newest sample is fresh."
    ABSENT = 2, "It does not answer, or another chip does."
    HUNG = 3, "Its bus is stuck: a line is held low, or a transfer does not end."
    RESET = 4, "It has lost its settings, as after a dip of its supply; it is set up again."
    MISSED = 5, "No new sample came within two periods."
    FROZEN = 6, "It repeats one raw sample: the chip no longer measures."
    ZERO = 7, "A divider reads 0 mV, as with a broken wire."


class RangeQuality(DocumentedEnum):
    """What a range sensor's echo says."""

    GOOD = 0, "Something is at this distance."
    FAR = 1, "No echo: nothing is within the sensor's reach."
    NEAR = 2, "Something is nearer than the sensor can measure."


class BatteryLevel(DocumentedEnum):
    """How full the battery is, by the levels of its entry."""

    UNKNOWN = 0, "Not judged: there is no entry for it, or no measurement yet."
    OK = 1, "Above the level of the warning."
    WARN = 2, "Below the level of the warning."
    LIMIT = 3, "Below the level at which the robot slows down to half its speed."
    STOP = 4, "Below the level at which it stops, until it is charged."


class SensorEventCode(DocumentedEnum):
    """What a SensorEvent reports."""

    STATE = 0, "The sensor's state changed; `value` is the SensorState."
    TRIGGERED = 1, "The input triggered; `value` is what its reflex does."
    RELEASED = 2, "The input is free again; `value` is what its reflex did."
    BATTERY = 3, "The battery's level changed; `value` is the BatteryLevel."
    REDUCED = 4, "The line is too slow for the rate asked for; `value` is the rate [Hz]."
    IDENTITY = 5, "Another chip answers in its place; `value` is what it says it is."


class Reflex(DocumentedFlag):
    """What the sensors forbid now, whatever the host commands."""

    NO_FORWARD = 1, "A front bumper: the robot may only back out."
    NO_REVERSE = 2, "A rear bumper: the robot may only drive forward."
    STOP = 4, "A cliff, a power stage or the battery: nothing drives; EXTERNAL."
    LIMIT = 8, "The battery is low: half of the speed at most."
    UNREAD = 16, "A sensor that can stop the robot was not read since the start."


DIGITAL_INPUTS = (PeripheralKind.BUMPER, PeripheralKind.CLIFF, PeripheralKind.STAGE_FAULT)
INPUTS = (*DIGITAL_INPUTS, PeripheralKind.ANALOG)
"""The kinds that share one sample."""


def channel_name(kind: PeripheralKind, place: Place, number: int = 0) -> str:
    """What users call a channel: `imu`, `bumper.front_left`, `range.front`, `analog_1`.

    Args:
        kind: What is connected.
        place: Place on the robot.
        number: Number of an analogue input.
    """
    name = kind.name.lower()
    if kind is PeripheralKind.ANALOG:
        return f"{name}_{number}"
    return name if place is Place.NONE else f"{name}.{place.name.lower()}"


class Unit(enum.Enum):
    """The unit of a field, as written in MESSAGES.md."""

    NONE = ""
    TICK = "tick"
    MICROSECOND = "us"
    NANOSECOND = "ns"
    SECOND = "s"
    METRE = "m"
    MILLIMETRE = "mm"
    METRE_PER_SECOND = "m/s"
    MILLIMETRE_PER_SECOND = "mm/s"
    METRE_PER_SECOND_SQUARED = "m/s^2"
    HERTZ = "Hz"
    PER_SECOND = "1/s"
    VOLT = "V"
    MILLIVOLT = "mV"
    MILLIAMPERE = "mA"
    MILLIAMPERE_HOUR = "mAh"
    CENTIDEGREE_CELSIUS = "0.01 degC"
    RADIAN_PER_SECOND = "rad/s"
    COUNT = "count"
    DUTY = "duty (-1..1)"
    DUTY_Q15 = "duty x 32767"
    DUTY_PER_SECOND = "duty/s"
    DUTY_PER_MPS = "duty/(m/s)"
    DUTY_PER_MPS2 = "duty/(m/s^2)"
    DUTY_PER_METRE = "duty/m"
