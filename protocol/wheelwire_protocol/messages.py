"""All messages of the link: the only definition of the wire layout."""

from __future__ import annotations

from typing import Any

from .board_layout import board_fields, peripheral_fields
from .codes import (
    MOST_PERIPHERALS,
    BatteryLevel,
    BoxCause,
    Capability,
    Chip,
    ConfigurationState,
    Contradiction,
    EstopSource,
    EventCode,
    Fault,
    Group,
    Held,
    PeripheralKind,
    Place,
    RangeQuality,
    Reflex,
    RefusalCode,
    ResetReason,
    SensorEventCode,
    SensorState,
    StopCause,
    StopFlag,
    StopMode,
    SupervisorEvent,
    SupervisorState,
    TrialAction,
    Unit,
)
from .message import Field, Message, chars, f32, i16, i32, message, u8, u16, u32, u64
from .peripherals import MOST_ANALOG, Axis, SensorChip

PROTOCOL_VERSION = 2

BOX_PART_SIZE = 56
"""Bytes of a black box that one message carries."""

_SESSION = u32("session_id")
_REQUEST = u16("request_id", "Counts up; the answer repeats it.")
_PARAMETER = u8("parameter")
_BOOT = u32("boot_id")
_CHANNEL = u8("channel")


def _command() -> list[Field]:
    return [
        _SESSION,
        u32("command_seq", "Counts up; older ones are ignored."),
        # A moment, not a duration: a delay on the way can then only shorten a setpoint's life.
        u64("expiry_us", "Device clock when it expires.", unit=Unit.MICROSECOND),
    ]


def request(id_: int, name: str, doc: str, *fields: Field, **properties: Any) -> Message:
    """A message that names its session, and has a number in it."""
    return message(id_, name, doc, _SESSION, _REQUEST, *fields, **properties)


def query(id_: int, name: str, doc: str, answered_by: str, *fields: Field) -> Message:
    """A request that changes nothing."""
    return request(id_, name, doc, *fields, answer=answered_by, reads=True)


answer = request
"""It repeats the session and the number of its request."""


# --- from the host -----------------------------------------------------------------------------

# The frozen messages let any host identify and stop any device, whatever their releases. Their ids
# and layouts never change.
HELLO = message(
    0x01,
    "Hello",
    "Opens a session.",
    u32("nonce", "Random; names the session, with boot_id."),
    u16("protocol_version"),
    u32("schema_hash"),
    frozen=True,
)
STOP = request(
    0x02,
    "Stop",
    "Stops both wheels at once. Needs no session.",
    # Otherwise a setpoint sent before the stop, but arriving after it, would drive again.
    u32("command_seq", "Setpoints up to this one are void."),
    u8("mode", codes=StopMode),
    frozen=True,
)
ESTOP = request(0x03, "Estop", "Stops both wheels until cleared. Needs no session.", frozen=True)
SET_WHEEL_VELOCITY = message(
    0x04,
    "SetWheelVelocity",
    "Wheel velocities, closed loop.",
    *_command(),
    f32("left_mps", "Forward positive.", unit=Unit.METRE_PER_SECOND),
    f32("right_mps", "Forward positive.", unit=Unit.METRE_PER_SECOND),
)
SET_DUTY = message(
    0x05,
    "SetDuty",
    "Duties, open loop.",
    *_command(),
    i16("left_duty_q15", "Forward positive.", unit=Unit.DUTY_Q15),
    i16("right_duty_q15", "Forward positive.", unit=Unit.DUTY_Q15),
)
PING = request(
    0x06,
    "Ping",
    "Synchronises the clocks. Never repeated.",
    u64("host_us", "Host clock when sent.", unit=Unit.MICROSECOND),
)
CLEAR_ESTOP = request(0x07, "ClearEstop", "Ends the e-stop, if its cause is gone.")
CLEAR_FAULT = request(0x08, "ClearFault", "Ends all faults, if their causes are gone.")
SET_STREAM_RATE = request(
    0x09,
    "SetStreamRate",
    "Sets the rate of WheelState for this session.",
    u16("rate_hz", "0: off.", unit=Unit.HERTZ),
)
PARAMETER_GET = query(0x0A, "ParameterGet", "Asks for one parameter.", "ParameterValue", _PARAMETER)
PARAMETER_SET = request(
    0x0B,
    "ParameterSet",
    "Sets one parameter until the next reset.",
    _PARAMETER,
    f32("value"),
    answer="ParameterValue",
)
PARAMETER_SAVE = request(
    0x0C,
    "ParameterSave",
    "Saves parameters in flash. Only while stopped.",
    u8("parameter", "0: all."),
)
PARAMETER_RESET = request(
    0x0D, "ParameterReset", "Restores and saves all defaults. Only while stopped."
)
PARAMETER_LIST = query(
    0x0E,
    "ParameterList",
    "Asks for the parameter at an index.",
    "ParameterEntry",
    u8("parameter_index", "0 to parameter_count - 1."),
)
LINK_COUNTERS_GET = query(0x0F, "LinkCountersGet", "Asks for LinkCounters.", "LinkCounters")

CONTROL_COUNTERS_GET = query(
    0x10, "ControlCountersGet", "Asks for ControlCounters.", "ControlCounters"
)

PARAMETER_TRIAL = request(
    0x11,
    "ParameterTrial",
    "Begins, renews or ends a trial of parameters.",
    u8("action", codes=TrialAction),
    f32("timeout_s", "Of BEGIN and RENEW: 0.2 to 60.", unit=Unit.SECOND),
)

GROUP_GET = query(
    0x12,
    "GroupGet",
    "Asks for the hash of a group of messages.",
    "GroupInfo",
    u8("group", codes=Group),
)
RESTART = request(0x13, "Restart", "Restarts the device. Only while stopped.")

CONTRADICTIONS_GET = query(0x14, "ContradictionsGet", "Asks for Contradictions.", "Contradictions")

HOLD_GET = query(0x15, "HoldGet", "Asks for Hold.", "Hold")

# --- the configuration, from the host: ids 0x20 to 0x2f ------------------------------------------

CONFIGURATION_GET = query(
    0x20, "ConfigurationGet", "Asks for the active configuration.", "ConfigurationValue"
)
PERIPHERAL_GET = query(
    0x21, "PeripheralGet", "Asks for one of its peripherals.", "PeripheralValue", u8("channel")
)
BOARD_SET = request(0x22, "BoardSet", "Prepares the board for ConfigurationWrite.", *board_fields())
PERIPHERAL_SET = request(
    0x23,
    "PeripheralSet",
    "Prepares a peripheral for ConfigurationWrite.",
    _CHANNEL,
    *peripheral_fields(),
)
CONFIGURATION_WRITE = request(
    0x24,
    "ConfigurationWrite",
    "Stores the prepared configuration on trial. Only while stopped.",
    u8("peripheral_count"),
    u32("fingerprint"),
)
CONFIGURATION_CONFIRM = request(
    0x25,
    "ConfigurationConfirm",
    "Confirms the configuration. Only while stopped.",
    u32("fingerprint"),
)

# --- the recorder, from the host: ids 0x30 to 0x3f -----------------------------------------------

BOX_GET = query(
    0x30,
    "BoxGet",
    "Asks what a stored black box contains.",
    "BoxValue",
    u8("age", "0: the newest box."),
)
BOX_READ = query(
    0x31,
    "BoxRead",
    "Asks for a part of a black box. Only while stopped.",
    "BoxPart",
    # Not by its age: a box stored during the download must not change which one is read.
    u32("number"),
    u32("offset", "In bytes."),
)
LEDGER_GET = query(0x32, "LedgerGet", "Asks for the counts that survive a reset.", "LedgerValue")

# --- the store, from the host: ids 0x40 to 0x4f --------------------------------------------------

UNSAVED_GET = query(0x40, "UnsavedGet", "Asks which parameters are not saved.", "UnsavedValue")

# --- sensors, from the host: ids 0x50 to 0x5f ----------------------------------------------------

SENSOR_STREAM = request(
    0x50,
    "SensorStream",
    "Asks for SensorInfo and samples, for this session.",
    u16("rate_hz", "Highest rate of the IMU; 0: no samples.", unit=Unit.HERTZ),
)

# --- what the firmware runs on, from the host: ids 0x60 to 0x6f ----------------------------------

MEMORY_GET = query(0x60, "MemoryGet", "Asks how much memory is free.", "MemoryValue")

# --- from the device ---------------------------------------------------------------------------

# The upper half of the ids. A device accepts none of them, so an echo of its own frames does
# nothing.
DEVICE_HELLO = message(
    0x80,
    "DeviceHello",
    "Answers Hello: identity, and whether the session is open.",
    # Shows which hello this answers: a late answer to a previous one must not open a session.
    u32("nonce", "From Hello."),
    u16("protocol_version"),
    u32("schema_hash"),
    u8("refusal", "NONE: the session is open.", RefusalCode),
    u32("boot_id", "Random at each reset, which zeroes the ticks."),
    u64("device_us", unit=Unit.MICROSECOND),
    u8("reset_reason", codes=ResetReason),
    u8("board", codes=Chip),
    u64("board_id", "The chip's MAC address."),
    u32("capabilities", codes=Capability),
    u8("version_major", "Of the firmware."),
    u8("version_minor", "Of the firmware."),
    u8("version_patch", "Of the firmware."),
    u32("git_hash", "First 8 hex digits of its commit; 0: unknown."),
    frozen=True,
)
WHEEL_STATE = message(
    0x81,
    "WheelState",
    "Both encoders, read at one instant, and the controller's state.",
    _BOOT,
    # 32 bits, since each byte counts in the message that is sent most: the host extends them.
    u32("t_us", "Device clock. Wraps after 71.6 min.", unit=Unit.MICROSECOND),
    i32("left_ticks", "Forward positive. Wraps.", unit=Unit.TICK),
    i32("right_ticks", "Forward positive. Wraps.", unit=Unit.TICK),
    f32("left_mps", "Measured at the rim.", unit=Unit.METRE_PER_SECOND),
    f32("right_mps", "Measured at the rim.", unit=Unit.METRE_PER_SECOND),
    i16("left_duty_q15", "Applied; 0 when not driving.", unit=Unit.DUTY_Q15),
    i16("right_duty_q15", "Applied; 0 when not driving.", unit=Unit.DUTY_Q15),
    u32("command_seq", "Setpoint obeyed last; 0: none yet."),
    u8("supervisor", codes=SupervisorState),
    u16("faults", codes=Fault),
    u16("overruns", "Late control steps since reset. Wraps."),
    u16("battery_mv", "0: not measured.", unit=Unit.MILLIVOLT),
)
REFUSE = message(
    0x82,
    "Refuse",
    "Refuses a request or setpoint: nothing moved or changed.",
    _SESSION,
    u8("message_id", "Of the refused message."),
    u8("code", codes=RefusalCode),
    u32("reference", "Its request_id or command_seq."),
    frozen=True,
)
ACK = answer(
    0x83, "Ack", "Confirms that a request was carried out.", u8("message_id", "Of the request.")
)
PONG = answer(
    0x84,
    "Pong",
    "Answers Ping, with the device clock.",
    u64("host_us", "From Ping.", unit=Unit.MICROSECOND),
    u64("received_us", unit=Unit.MICROSECOND),
    u64("sent_us", unit=Unit.MICROSECOND),
)
PARAMETER_VALUE = answer(
    0x85, "ParameterValue", "A parameter's active value.", _PARAMETER, f32("value")
)
PARAMETER_ENTRY = answer(
    0x86,
    "ParameterEntry",
    "One parameter, with its bounds.",
    u8("parameter_index"),
    # In every entry: the host learns from the first one how many to ask for.
    u8("parameter_count"),
    _PARAMETER,
    f32("value"),
    f32("default_value"),
    f32("minimum"),
    f32("maximum"),
)
EVENT = message(
    0x87,
    "Event",
    "Reports a change of state, or another incident.",
    _BOOT,
    u32("t_us", "Device clock.", unit=Unit.MICROSECOND),
    u8("code", codes=EventCode),
    u8("cause", codes=SupervisorEvent),
    u8("before", codes=SupervisorState),
    u8("after", codes=SupervisorState),
    u16("faults", codes=Fault),
    f32("speed_mps", "With ROLLING: of the faster wheel.", unit=Unit.METRE_PER_SECOND),
)
LINK_COUNTERS = answer(
    0x88,
    "LinkCounters",
    "Counts of the link since reset. All wrap.",
    u32("frames_received"),
    u32("frames_sent"),
    u32("bad_crc"),
    u32("bad_cobs", "Not COBS, too short or too long."),
    u32("unknown_id"),
    u32("wrong_length"),
    u32("seq_lost", "Frames missing by seq."),
    u32("send_dropped", "The line was full."),
    u32("refused", "Requests and setpoints."),
    u16("faults_tripped"),
)

CONTROL_COUNTERS = answer(
    0x89,
    "ControlCounters",
    "Counts of the control loop since reset. All wrap.",
    u32("late_steps", "More than half a period late."),
    u32("latest_step_us", "Longest time between steps.", unit=Unit.MICROSECOND),
    u32("saturated_steps", "Steps in which a wheel needed more duty than there is."),
    u32("left_illegal", "Lost edges; always 0 on a chip."),
    u32("right_illegal", "Lost edges; always 0 on a chip."),
)

GROUP_INFO = answer(
    0x8A,
    "GroupInfo",
    "The hash of a group of messages.",
    u8("group", codes=Group),
    u32("hash", "0: no such group."),
)

CONTRADICTIONS = answer(
    0x8B,
    "Contradictions",
    "Parameters that contradict each other or the board.",
    u32("active", codes=Contradiction),
    u32("refused", "Of the values refused last.", Contradiction),
)

HOLD = message(
    0x8C,
    "Hold",
    "What holds the robot, and what ended its last motion.",
    _SESSION,
    u16("request_id", "0: sent unasked."),
    u32("held", "0: nothing.", Held),
    u8("estop_source", codes=EstopSource),
    u32("contradictions", codes=Contradiction),
    u8("stop_cause", codes=StopCause),
    u8("stop_flags", codes=StopFlag),
    u8("stop_reset", "With RESET.", ResetReason),
    u32("stop_held", codes=Held),
    u16("stop_faults", codes=Fault),
    u32("stop_session"),
    u32("stop_command", "Its last setpoint."),
    u64("stop_us", "Device clock; 0: before this start.", unit=Unit.MICROSECOND),
    u16("stop_mmps", "Of the faster wheel.", unit=Unit.MILLIMETRE_PER_SECOND),
    u16("rolled_mm", "How far that wheel turned since.", unit=Unit.MILLIMETRE),
)

# --- the configuration, from the device: ids 0xa0 to 0xaf ----------------------------------------

CONFIGURATION_VALUE = answer(
    0xA0,
    "ConfigurationValue",
    "The active configuration.",
    u8("state", codes=ConfigurationState),
    u8("peripheral_count"),
    u32("fingerprint"),
    *board_fields(),
)
PERIPHERAL_VALUE = answer(
    0xA1,
    "PeripheralValue",
    "A peripheral; of kind NONE if it has fewer.",
    _CHANNEL,
    *peripheral_fields(),
)

# --- the recorder, from the device: ids 0xb0 to 0xbf ---------------------------------------------

BOX_VALUE = answer(
    0xB0,
    "BoxValue",
    "What a stored black box contains.",
    u8("box_count"),
    u8("age"),
    u8("is_current", "1: it ends with the present latch, or the last reset."),
    u32("number", "From 1; 0: no such box."),
    u32("size", "In bytes."),
    u8("cause", codes=BoxCause),
    u8("reset_reason", "Before the boot that stored it.", ResetReason),
    u32("boot_id", "Boot that recorded it."),
    u32("core", "Hash of the firmware's core."),
    u32("release", "Firmware: major << 16, minor << 8, patch."),
    u32("git_hash", "First 8 hex digits of its commit; 0: unknown."),
    u32("board", "Fingerprint; 0: none."),
    u32("faults", codes=Fault),
    u64("stored_us", unit=Unit.MICROSECOND),
)
BOX_PART = answer(
    0xB1,
    "BoxPart",
    "A part of a black box.",
    u32("number"),
    u32("offset"),
    u8("size", "Valid bytes; 0: no such box, or past its end."),
    chars(BOX_PART_SIZE, "data"),
)
LEDGER_VALUE = answer(
    0xB2,
    "LedgerValue",
    "Counts over the robot's life. All wrap.",
    u32("uptime_s", unit=Unit.SECOND),
    # In the order of ResetReason.
    *(u32(f"resets_{reason.name.lower()}") for reason in ResetReason),
    u32("stops_session", "Drives that it ended."),
    u32("stops_stop", "Drives that it ended."),
    u32("stops_deadline", "Drives that it ended."),
    u32("stops_estop"),
    u32("stops_fault"),
)
UNSAVED_VALUE = answer(
    0xC0,
    "UnsavedValue",
    "Parameters whose active value is not saved.",
    u64("parameters", "Bit n: parameter n + 1."),
)

# --- sensors, from the device: ids 0xd0 to 0xdf --------------------------------------------------


def _taken() -> list[Field]:
    return [_BOOT, u32("t_us", "Device clock.", unit=Unit.MICROSECOND), _CHANNEL]


def _axes(name: str, doc: str) -> list[Field]:
    return [i16(f"{name}_{axis}", doc, unit=Unit.COUNT) for axis in "xyz"]


SENSOR_INFO = message(
    0xD0,
    "SensorInfo",
    "A sensor, and its units.",
    _SESSION,
    _CHANNEL,
    u8("channel_count"),
    u8("kind", codes=PeripheralKind),
    u8("chip", codes=SensorChip),
    u8("place", codes=Place),
    u8("forward", codes=Axis),
    u8("up", codes=Axis),
    u8("state", codes=SensorState),
    u16("rate_hz", "Rate of samples; 0: on a change.", unit=Unit.HERTZ),
    f32("gyro_scale", "One count.", unit=Unit.RADIAN_PER_SECOND),
    f32("accelerometer_scale", "One count.", unit=Unit.METRE_PER_SECOND_SQUARED),
    f32("gyro_noise", "Standard deviation.", unit=Unit.RADIAN_PER_SECOND),
    f32("accelerometer_noise", "Standard deviation.", unit=Unit.METRE_PER_SECOND_SQUARED),
    *_axes("bias", "value_a, value_b, value_c of the peripheral."),
)
IMU = message(
    0xD1,
    "Imu",
    "A sample of an IMU, in its chip's axes.",
    *_taken(),
    u16("sample", "Counts samples. Wraps."),
    u16("bound_us", "Uncertainty of t_us.", unit=Unit.MICROSECOND),
    *_axes("gyro", "Times gyro_scale of SensorInfo."),
    *_axes("accelerometer", "Times accelerometer_scale of SensorInfo."),
    i16("temperature_cdeg", unit=Unit.CENTIDEGREE_CELSIUS),
)
POWER = message(
    0xD2,
    "Power",
    "The supply, by power sensor or battery divider.",
    *_taken(),
    u16("voltage_mv", unit=Unit.MILLIVOLT),
    i32("current_ma", "Drawn; 0: not measured.", unit=Unit.MILLIAMPERE),
    f32("used_mah", "Since the start.", unit=Unit.MILLIAMPERE_HOUR),
    u8("level", codes=BatteryLevel),
)
INPUTS = message(
    0xD3,
    "Inputs",
    "All inputs, and what the sensors forbid.",
    _BOOT,
    u32("t_us", "Device clock.", unit=Unit.MICROSECOND),
    u16("levels", "Bit n: level at the pin of channel n."),
    u16("triggered", "Bit n: channel n has triggered."),
    u16("stale", "Bit n: channel n has no valid samples."),
    u8("reflexes", codes=Reflex),
    u8("level", codes=BatteryLevel),
    *(u16(f"edges_{n}", "Since reset. Wraps.") for n in range(MOST_PERIPHERALS)),
    *(u16(f"analog_{n}_mv", "0: none.", unit=Unit.MILLIVOLT) for n in range(1, MOST_ANALOG + 1)),
)
SENSOR_EVENT = message(
    0xD4,
    "SensorEvent",
    "A sensor's change, or its reflex.",
    *_taken(),
    u8("code", codes=SensorEventCode),
    u16("value", "See SensorEventCode."),
)
RANGE = message(
    0xD6,
    "Range",
    "A measurement of a range sensor.",
    *_taken(),
    u16("sample", "Counts samples. Wraps."),
    u16("bound_us", "Uncertainty of t_us.", unit=Unit.MICROSECOND),
    u16("distance_mm", "Only if quality is GOOD.", unit=Unit.MILLIMETRE),
    u8("quality", codes=RangeQuality),
)

# --- what the firmware runs on, from the device: ids 0xe0 to 0xef --------------------------------

MEMORY_VALUE = answer(
    0xE0,
    "MemoryValue",
    "Bytes of free memory, measured once a second.",
    u32("free_heap", "Now."),
    u32("least_free_heap", "Least since the start."),
    # Named as the firmware names its tasks.
    u32("control_stack", "Least since the start."),
    u32("housekeeping_stack", "Least since the start."),
    u32("sensors_stack", "Least since the start; 0: no such task."),
)

MESSAGES = tuple(defined for defined in list(globals().values()) if isinstance(defined, Message))
"""In the order of definition, which is also the order of the layouts in each group's hash."""

# It has to stay below 254: then no run of COBS is too long for one code byte, and both decoders
# rely on that.
MAX_PAYLOAD = max(message.payload_size for message in MESSAGES)
