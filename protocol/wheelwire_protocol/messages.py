"""All messages of the link: the only definition of the wire layout."""

from __future__ import annotations

from construct import (
    Bytes,
    Float32l,
    Int8sl,
    Int8ul,
    Int16sl,
    Int16ul,
    Int32sl,
    Int32ul,
    Int64ul,
    Struct,
)

from .board import (
    NAME_SIZE,
    PIN_FUNCTIONS,
    BoardLine,
    ConfigurationState,
    ContactKind,
    EncoderPulls,
    Module,
    Stage,
)
from .codes import (
    BoxCause,
    Capability,
    Chip,
    Contradiction,
    EstopSource,
    EventCode,
    Fault,
    Group,
    Held,
    RefusalCode,
    ResetReason,
    StopCause,
    StopFlag,
    StopMode,
    SupervisorEvent,
    SupervisorState,
    TrialAction,
    Unit,
)
from .message import Field, Message, field
from .sensors import (
    MOST_ANALOG,
    MOST_PERIPHERALS,
    Axis,
    BatteryLevel,
    PeripheralFlag,
    PeripheralKind,
    Place,
    RangeQuality,
    Reflex,
    SensorChip,
    SensorEventCode,
    SensorState,
)

PROTOCOL_VERSION = 2


def _pin(name: str) -> Field:
    return field(name, Int8sl, Unit.NONE, "GPIO; -1: none.")


def board_fields() -> list[Field]:
    """The packed struct in which a board is sent and stored: its fields, in order."""
    return [
        field("version", Int8ul, Unit.NONE, "Version of this struct."),
        field("chip", Int8ul, Unit.NONE, "The chip whose pins these are.", Chip),
        field("module", Int8ul, Unit.NONE, "What carries the chip.", Module),
        field("stage", Int8ul, Unit.NONE, "The power stage of both wheels.", Stage),
        field("line", Int8ul, Unit.NONE, "The line to the host.", BoardLine),
        field("name", Bytes(NAME_SIZE), Unit.NONE, "ASCII, filled up with zeros."),
        *map(_pin, PIN_FUNCTIONS),
        field(
            "encoder_pulls", Int8ul, Unit.NONE, "Pulls of all four encoder inputs.", EncoderPulls
        ),
        field("estop_contact", Int8ul, Unit.NONE, "What a press does.", ContactKind),
        field("pwm_frequency_hz", Int16ul, Unit.HERTZ, "Default of the parameter of this name."),
        field("encoder_filter_ns", Int16ul, Unit.NANOSECOND, "Default of glitch_filter_ns."),
        field(
            "battery_divider_permille",
            Int16ul,
            Unit.NONE,
            "Battery volts per volt at the pin, times 1000.",
        ),
        # 64 bits, because the GPIOs of an ESP32-S3 go up to 48.
        field("pulldowns", Int64ul, Unit.NONE, "GPIOs with an external pull-down, as bits."),
    ]


BOARD = Struct(*board_fields())
BOARD_SIZE: int = BOARD.sizeof()


def peripheral_fields() -> list[Field]:
    """The packed struct in which one peripheral is sent and stored: its fields, in order."""
    return [
        field("kind", Int8ul, Unit.NONE, "What it is.", PeripheralKind),
        field("chip", Int8ul, Unit.NONE, "The chip of an IMU, POWER or RANGE.", SensorChip),
        field("place", Int8ul, Unit.NONE, "Where it is.", Place),
        field("flags", Int8ul, Unit.NONE, "Properties of its pin.", PeripheralFlag),
        _pin("pin_a"),
        _pin("pin_b"),
        _pin("pin_c"),
        field("address", Int8ul, Unit.NONE, "Its address on the I2C bus; 0: the chip's usual one."),
        field("forward", Int8ul, Unit.NONE, "The IMU's axis that points forward.", Axis),
        field("up", Int8ul, Unit.NONE, "The IMU's axis that points up.", Axis),
        field("value_a", Int16ul, Unit.NONE, "Depends on the kind; see SPEC.md."),
        field("value_b", Int16ul, Unit.NONE, "Depends on the kind."),
        field("value_c", Int16ul, Unit.NONE, "Depends on the kind."),
    ]


PERIPHERAL_SIZE: int = Struct(*peripheral_fields()).sizeof()


BOX_PART_SIZE = 56
"""Bytes of a black box that one message carries."""


def _session() -> Field:
    return field("session_id", Int32ul, Unit.NONE, "Nonce XOR boot_id of the session.")


def _request() -> Field:
    return field("request_id", Int16ul, Unit.NONE, "Counts up in a session; the answer returns it.")


def _parameter() -> Field:
    return field("parameter", Int8ul, Unit.NONE, "Parameter id, from the table of parameters.")


def _boot() -> Field:
    return field(
        "boot_id", Int32ul, Unit.NONE, "Random at reset. A new value voids all earlier ticks."
    )


def _command() -> list[Field]:
    return [
        _session(),
        field("command_seq", Int32ul, Unit.NONE, "Counts up; only a newer one is obeyed."),
        # A moment, not a duration: a delay on the way can then only shorten a setpoint's life.
        field("expiry_us", Int64ul, Unit.MICROSECOND, "Device clock at which it expires."),
    ]


# --- from the host -----------------------------------------------------------------------------

# Frozen are the messages by which any host can identify any device and stop it, whatever releases
# the two are of. Their ids and layouts never change.
HELLO = Message(
    id=0x01,
    name="Hello",
    doc="Opens a session. Repeating it with the same nonce changes nothing.",
    body=Struct(
        field("nonce", Int32ul, Unit.NONE, "Random; with boot_id it names the session."),
        field("protocol_version", Int16ul, Unit.NONE, "The host's protocol version."),
        field("schema_hash", Int32ul, Unit.NONE, "Hash of the host's message definitions."),
    ),
    frozen=True,
)
STOP = Message(
    id=0x02,
    name="Stop",
    doc="Stops both wheels at once, bypassing the slew limit. Needs no session.",
    body=Struct(
        _session(),
        _request(),
        # Else a setpoint that was sent before the stop and arrives after it would drive again.
        field(
            "command_seq",
            Int32ul,
            Unit.NONE,
            "Setpoints of this session up to this number are void.",
        ),
        field("mode", Int8ul, Unit.NONE, "How to stop.", StopMode),
    ),
    frozen=True,
)
ESTOP = Message(
    id=0x03,
    name="Estop",
    doc="Stops both wheels and latches until cleared. Needs no session.",
    body=Struct(_session(), _request()),
    frozen=True,
)
SET_WHEEL_VELOCITY = Message(
    id=0x04,
    name="SetWheelVelocity",
    doc="Velocity setpoint of both wheels, closed loop. The latest wins.",
    body=Struct(
        *_command(),
        field("left_mps", Float32l, Unit.METRE_PER_SECOND, "At the rim, forward positive."),
        field("right_mps", Float32l, Unit.METRE_PER_SECOND, "At the rim, forward positive."),
    ),
)
SET_DUTY = Message(
    id=0x05,
    name="SetDuty",
    doc="Duty setpoint of both wheels, open loop. The latest wins.",
    body=Struct(
        *_command(),
        field("left_duty_q15", Int16sl, Unit.DUTY_Q15, "Forward positive."),
        field("right_duty_q15", Int16sl, Unit.DUTY_Q15, "Forward positive."),
    ),
)
PING = Message(
    id=0x06,
    name="Ping",
    doc="One exchange of the clock synchronisation. Never repeated: a lost one stays lost.",
    body=Struct(
        _session(),
        _request(),
        field("host_us", Int64ul, Unit.MICROSECOND, "Host clock at sending."),
    ),
)
CLEAR_ESTOP = Message(
    id=0x07,
    name="ClearEstop",
    doc="Ends the emergency stop; refused while its cause lasts.",
    body=Struct(_session(), _request()),
)
CLEAR_FAULT = Message(
    id=0x08,
    name="ClearFault",
    doc="Clears all latched faults; refused while their cause lasts.",
    body=Struct(_session(), _request()),
)
SET_STREAM_RATE = Message(
    id=0x09,
    name="SetStreamRate",
    doc="Sets how often WheelState is sent in this session.",
    body=Struct(
        _session(),
        _request(),
        field("rate_hz", Int16ul, Unit.HERTZ, "0 is off."),
    ),
)
PARAMETER_GET = Message(
    id=0x0A,
    name="ParameterGet",
    doc="Asks for one parameter; the answer is ParameterValue.",
    body=Struct(_session(), _request(), _parameter()),
    answer="ParameterValue",
    reads=True,
)
PARAMETER_SET = Message(
    id=0x0B,
    name="ParameterSet",
    doc="Sets one parameter until the next reset; the answer is ParameterValue.",
    body=Struct(
        _session(),
        _request(),
        _parameter(),
        field("value", Float32l, Unit.NONE, "In the parameter's unit."),
    ),
    answer="ParameterValue",
)
PARAMETER_SAVE = Message(
    id=0x0C,
    name="ParameterSave",
    doc="Writes parameters to the store. Only while stopped: flash writes stall the chip.",
    body=Struct(
        _session(),
        _request(),
        field(
            "parameter",
            Int8ul,
            Unit.NONE,
            "Id of the one to save; the others stay as they are in the store. 0: save all.",
        ),
    ),
)
PARAMETER_RESET = Message(
    id=0x0D,
    name="ParameterReset",
    doc="Sets all parameters to their defaults and empties the store. Only while stopped.",
    body=Struct(_session(), _request()),
)
PARAMETER_LIST = Message(
    id=0x0E,
    name="ParameterList",
    doc="Asks for the parameter at an index; the answer is ParameterEntry.",
    body=Struct(
        _session(),
        _request(),
        field("parameter_index", Int8ul, Unit.NONE, "0 to parameter_count - 1."),
    ),
    answer="ParameterEntry",
    reads=True,
)
LINK_COUNTERS_GET = Message(
    id=0x0F,
    name="LinkCountersGet",
    doc="Asks for the device's link counters; the answer is LinkCounters.",
    body=Struct(_session(), _request()),
    answer="LinkCounters",
    reads=True,
)

CONTROL_COUNTERS_GET = Message(
    id=0x10,
    name="ControlCountersGet",
    doc="Asks for the control loop's counters; the answer is ControlCounters.",
    body=Struct(_session(), _request()),
    answer="ControlCounters",
    reads=True,
)

PARAMETER_TRIAL = Message(
    id=0x11,
    name="ParameterTrial",
    doc="Begins, renews or ends a trial of parameters, which the session's end reverts.",
    body=Struct(
        _session(),
        _request(),
        field("action", Int8ul, Unit.NONE, "What to do.", TrialAction),
        field(
            "timeout_s", Float32l, Unit.SECOND, "Life of the trial after BEGIN or RENEW: 0.2 to 60."
        ),
    ),
)

GROUP_GET = Message(
    id=0x12,
    name="GroupGet",
    doc="Asks for the hash of a group of messages; the answer is GroupInfo.",
    body=Struct(_session(), _request(), field("group", Int8ul, Unit.NONE, "Which.", Group)),
    answer="GroupInfo",
    reads=True,
)
RESTART = Message(
    id=0x13,
    name="Restart",
    doc="Restarts the device, shortly after the Ack. Only while stopped.",
    body=Struct(_session(), _request()),
)

CONTRADICTIONS_GET = Message(
    id=0x14,
    name="ContradictionsGet",
    doc="Asks which parameters contradict each other; the answer is Contradictions.",
    body=Struct(_session(), _request()),
    answer="Contradictions",
    reads=True,
)

HOLD_GET = Message(
    id=0x15,
    name="HoldGet",
    doc="Asks what holds the robot, and what ended its last motion; the answer is Hold.",
    body=Struct(_session(), _request()),
    answer="Hold",
    reads=True,
)

# --- the configuration, from the host: ids 0x20 to 0x2f ------------------------------------------

CONFIGURATION_GET = Message(
    id=0x20,
    name="ConfigurationGet",
    doc="Asks for the active configuration; the answer is ConfigurationValue.",
    body=Struct(_session(), _request()),
    group=Group.CONFIGURATION,
    answer="ConfigurationValue",
    reads=True,
)
PERIPHERAL_GET = Message(
    id=0x21,
    name="PeripheralGet",
    doc="Asks for one of its peripherals; the answer is PeripheralValue.",
    body=Struct(
        _session(),
        _request(),
        field("channel", Int8ul, Unit.NONE, "Index of the entry, from 0."),
    ),
    group=Group.CONFIGURATION,
    answer="PeripheralValue",
    reads=True,
)
BOARD_SET = Message(
    id=0x22,
    name="BoardSet",
    doc="Sets the board that ConfigurationWrite stores. Nothing changes before that.",
    # The board last: the firmware copies it to and from the end of the body as it is packed.
    body=Struct(_session(), _request(), *board_fields()),
    group=Group.CONFIGURATION,
)
PERIPHERAL_SET = Message(
    id=0x23,
    name="PeripheralSet",
    doc="As BoardSet, one of its peripherals.",
    body=Struct(
        _session(),
        _request(),
        field("channel", Int8ul, Unit.NONE, "Index of the entry, from 0."),
        *peripheral_fields(),
    ),
    group=Group.CONFIGURATION,
)
CONFIGURATION_WRITE = Message(
    id=0x24,
    name="ConfigurationWrite",
    doc="Stores what was set, to be tried from the next restart on. Only while stopped.",
    body=Struct(
        _session(),
        _request(),
        field(
            "peripheral_count", Int8ul, Unit.NONE, "How many peripherals count; 0: there is none."
        ),
        field(
            "fingerprint", Int32ul, Unit.NONE, "Of the configuration that is meant: see SPEC.md."
        ),
    ),
    group=Group.CONFIGURATION,
)
CONFIGURATION_CONFIRM = Message(
    id=0x25,
    name="ConfigurationConfirm",
    doc="Confirms the configuration on trial, or the image's own. Only while stopped.",
    body=Struct(
        _session(),
        _request(),
        field("fingerprint", Int32ul, Unit.NONE, "Of the configuration that is meant."),
    ),
    group=Group.CONFIGURATION,
)

# --- the recorder, from the host: ids 0x30 to 0x3f -----------------------------------------------

BOX_GET = Message(
    id=0x30,
    name="BoxGet",
    doc="Asks for what one of the stored black boxes is of; the answer is BoxValue.",
    body=Struct(
        _session(),
        _request(),
        field("age", Int8ul, Unit.NONE, "How many were stored after it; 0: the newest."),
    ),
    group=Group.RECORDER,
    answer="BoxValue",
    reads=True,
)
BOX_READ = Message(
    id=0x31,
    name="BoxRead",
    doc="Asks for a part of a black box; the answer is BoxPart. Not while driving.",
    body=Struct(
        _session(),
        _request(),
        # Not by its age: a box that is stored meanwhile must not change which one is read.
        field("number", Int32ul, Unit.NONE, "Number of the box."),
        field("offset", Int32ul, Unit.NONE, "Offset from its beginning, in bytes."),
    ),
    group=Group.RECORDER,
    answer="BoxPart",
    reads=True,
)
LEDGER_GET = Message(
    id=0x32,
    name="LedgerGet",
    doc="Asks for the counts that outlive a reset; the answer is LedgerValue.",
    body=Struct(_session(), _request()),
    group=Group.RECORDER,
    answer="LedgerValue",
    reads=True,
)

# --- the store, from the host: ids 0x40 to 0x4f --------------------------------------------------

UNSAVED_GET = Message(
    id=0x40,
    name="UnsavedGet",
    doc="Asks which parameters a reset would change; the answer is UnsavedValue.",
    body=Struct(_session(), _request()),
    group=Group.STORE,
    answer="UnsavedValue",
    reads=True,
)

# --- sensors, from the host: ids 0x50 to 0x5f ----------------------------------------------------

SENSOR_STREAM = Message(
    id=0x50,
    name="SensorStream",
    doc="Asks for a SensorInfo of each channel, and for samples in this session.",
    body=Struct(
        _session(),
        _request(),
        field(
            "rate_hz",
            Int16ul,
            Unit.HERTZ,
            "Highest rate of the IMU; other sensors have their own. 0: no samples.",
        ),
    ),
    group=Group.SENSOR,
)

# --- what the firmware runs on, from the host: ids 0x60 to 0x6f ----------------------------------

MEMORY_GET = Message(
    id=0x60,
    name="MemoryGet",
    doc="Asks how much of the chip's memory is left; the answer is MemoryValue.",
    body=Struct(_session(), _request()),
    group=Group.PLATFORM,
    answer="MemoryValue",
    reads=True,
)

# --- from the device ---------------------------------------------------------------------------

# The upper half of the ids: a device knows none of them, so that an echo of its own frames does
# nothing.
DEVICE_HELLO = Message(
    id=0x80,
    name="DeviceHello",
    doc="Answers Hello: who this is, and whether the session is open.",
    body=Struct(
        # Shows which hello this answers: a late answer to a previous one must not open a session.
        field("nonce", Int32ul, Unit.NONE, "The host's, repeated."),
        field("protocol_version", Int16ul, Unit.NONE, "The device's protocol version."),
        field("schema_hash", Int32ul, Unit.NONE, "Hash of the device's message definitions."),
        field("refusal", Int8ul, Unit.NONE, "NONE: the session is open.", RefusalCode),
        _boot(),
        field("device_us", Int64ul, Unit.MICROSECOND, "Device clock, from reset."),
        field("reset_reason", Int8ul, Unit.NONE, "Why the device last started.", ResetReason),
        field("board", Int8ul, Unit.NONE, "What the firmware runs on.", Chip),
        field("board_id", Int64ul, Unit.NONE, "The chip's MAC address."),
        field("capabilities", Int32ul, Unit.NONE, "What this device can do.", Capability),
        field("version_major", Int8ul, Unit.NONE, "The firmware's major version."),
        field("version_minor", Int8ul, Unit.NONE, "The firmware's minor version."),
        field("version_patch", Int8ul, Unit.NONE, "The firmware's patch version."),
        field(
            "git_hash",
            Int32ul,
            Unit.NONE,
            "First 8 hex digits of the firmware's commit; 0: unknown.",
        ),
    ),
    frozen=True,
)
WHEEL_STATE = Message(
    id=0x81,
    name="WheelState",
    doc="Both encoders, latched at the same instant, and the state of the controller.",
    body=Struct(
        _boot(),
        # 32 bits, since each byte counts in the message that is sent most: the host extends them.
        field(
            "t_us", Int32ul, Unit.MICROSECOND, "Device clock at the latch. Wraps after 71.6 min."
        ),
        field("left_ticks", Int32sl, Unit.TICK, "Cumulative, forward positive. Wraps at 2^32."),
        field("right_ticks", Int32sl, Unit.TICK, "Cumulative, forward positive. Wraps at 2^32."),
        field("left_mps", Float32l, Unit.METRE_PER_SECOND, "Measured at the rim."),
        field("right_mps", Float32l, Unit.METRE_PER_SECOND, "Measured at the rim."),
        field("left_duty_q15", Int16sl, Unit.DUTY_Q15, "On the output now; 0 when not driving."),
        field("right_duty_q15", Int16sl, Unit.DUTY_Q15, "On the output now; 0 when not driving."),
        field("command_seq", Int32ul, Unit.NONE, "Setpoint obeyed, or last obeyed; 0: none yet."),
        field("supervisor", Int8ul, Unit.NONE, "The safety supervisor's state.", SupervisorState),
        field("faults", Int16ul, Unit.NONE, "Latched fault flags.", Fault),
        field("overruns", Int16ul, Unit.NONE, "Control steps that came late, since reset. Wraps."),
        field("battery_mv", Int16ul, Unit.MILLIVOLT, "Battery voltage; 0: not measured."),
    ),
)
REFUSE = Message(
    id=0x82,
    name="Refuse",
    doc="A request or setpoint was not obeyed. Nothing moved or changed because of it.",
    body=Struct(
        _session(),
        field("message_id", Int8ul, Unit.NONE, "Id of the message refused."),
        field("code", Int8ul, Unit.NONE, "Why.", RefusalCode),
        field("reference", Int32ul, Unit.NONE, "Its request_id, or its command_seq."),
    ),
    frozen=True,
)
ACK = Message(
    id=0x83,
    name="Ack",
    doc="The request was carried out.",
    body=Struct(
        _session(),
        _request(),
        field("message_id", Int8ul, Unit.NONE, "Id of the message carried out."),
    ),
)
PONG = Message(
    id=0x84,
    name="Pong",
    doc="Answers Ping.",
    body=Struct(
        _session(),
        _request(),
        field("host_us", Int64ul, Unit.MICROSECOND, "From the Ping."),
        field("received_us", Int64ul, Unit.MICROSECOND, "Device clock when the Ping was read."),
        field("sent_us", Int64ul, Unit.MICROSECOND, "Device clock when this was written."),
    ),
)
PARAMETER_VALUE = Message(
    id=0x85,
    name="ParameterValue",
    doc="The active value.",
    body=Struct(
        _session(),
        _request(),
        _parameter(),
        field("value", Float32l, Unit.NONE, "In the parameter's unit."),
    ),
)
PARAMETER_ENTRY = Message(
    id=0x86,
    name="ParameterEntry",
    doc="One parameter with this device's bounds.",
    body=Struct(
        _session(),
        _request(),
        field("parameter_index", Int8ul, Unit.NONE, "As asked."),
        # In every entry: the host learns from the first one how many to ask for.
        field("parameter_count", Int8ul, Unit.NONE, "How many parameters there are."),
        _parameter(),
        field("value", Float32l, Unit.NONE, "The active value."),
        field("default_value", Float32l, Unit.NONE, "After a ParameterReset."),
        field("minimum", Float32l, Unit.NONE, "Smallest value allowed."),
        field("maximum", Float32l, Unit.NONE, "Largest value allowed."),
    ),
)
EVENT = Message(
    id=0x87,
    name="Event",
    doc="Reports what a state frame may show too late or not at all.",
    body=Struct(
        _boot(),
        field("t_us", Int32ul, Unit.MICROSECOND, "Device clock when it happened."),
        field("code", Int8ul, Unit.NONE, "What.", EventCode),
        field("cause", Int8ul, Unit.NONE, "What moved the supervisor.", SupervisorEvent),
        field("before", Int8ul, Unit.NONE, "State left.", SupervisorState),
        field("after", Int8ul, Unit.NONE, "State entered.", SupervisorState),
        field("faults", Int16ul, Unit.NONE, "Latched fault flags.", Fault),
        field(
            "speed_mps",
            Float32l,
            Unit.METRE_PER_SECOND,
            "With ROLLING, the speed of the faster wheel; otherwise 0.",
        ),
    ),
)
LINK_COUNTERS = Message(
    id=0x88,
    name="LinkCounters",
    doc="Counts of the device's receiver, sender and supervisor since reset. All wrap.",
    body=Struct(
        _session(),
        _request(),
        field("frames_received", Int32ul, Unit.NONE, "Good frames."),
        field("frames_sent", Int32ul, Unit.NONE, "Frames handed to the line."),
        field("bad_crc", Int32ul, Unit.NONE, "Frames with a wrong CRC."),
        field("bad_cobs", Int32ul, Unit.NONE, "Frames that are not COBS, or too short or long."),
        field("unknown_id", Int32ul, Unit.NONE, "Good frames with an unknown id."),
        field(
            "wrong_length", Int32ul, Unit.NONE, "Good frames with the wrong length for their id."
        ),
        field(
            "seq_lost",
            Int32ul,
            Unit.NONE,
            "Frames missing by their sequence numbers, less those that came late.",
        ),
        field("send_dropped", Int32ul, Unit.NONE, "Frames not sent because the line was full."),
        field("refused", Int32ul, Unit.NONE, "Requests and setpoints refused."),
        field(
            "faults_tripped", Int16ul, Unit.NONE, "Faults tripped, including those cleared at once."
        ),
    ),
)

CONTROL_COUNTERS = Message(
    id=0x89,
    name="ControlCounters",
    doc="Counts of the control loop and the encoders since reset. All wrap.",
    body=Struct(
        _session(),
        _request(),
        field("late_steps", Int32ul, Unit.NONE, "Steps more than half a period late."),
        field("latest_step_us", Int32ul, Unit.MICROSECOND, "Longest time between two steps."),
        field(
            "saturated_steps",
            Int32ul,
            Unit.NONE,
            "Steps in which a wheel's velocity loop needed more than its output can give.",
        ),
        field(
            "left_illegal",
            Int32ul,
            Unit.NONE,
            "Impossible transitions of the left encoder: lost edges. A chip's counter sees none.",
        ),
        field("right_illegal", Int32ul, Unit.NONE, "As left_illegal."),
    ),
)

GROUP_INFO = Message(
    id=0x8A,
    name="GroupInfo",
    doc="The hash of a group of messages.",
    body=Struct(
        _session(),
        _request(),
        field("group", Int8ul, Unit.NONE, "As asked.", Group),
        field("hash", Int32ul, Unit.NONE, "0: this device has no such group."),
    ),
)

CONTRADICTIONS = Message(
    id=0x8B,
    name="Contradictions",
    doc="Which parameters contradict each other, or the board.",
    body=Struct(
        _session(),
        _request(),
        field(
            "active",
            Int32ul,
            Unit.NONE,
            "Contradictions of the active values: nothing drives.",
            Contradiction,
        ),
        field(
            "refused",
            Int32ul,
            Unit.NONE,
            "Contradictions of the values that this session was last refused.",
            Contradiction,
        ),
    ),
)

HOLD = Message(
    id=0x8C,
    name="Hold",
    doc="What holds the robot, and what ended its last motion. Sent unasked, too, when a session "
    "opens, when one of them changes, and each second.",
    body=Struct(
        _session(),
        field("request_id", Int16ul, Unit.NONE, "As asked; 0: nobody asked."),
        field("held", Int32ul, Unit.NONE, "What holds it now; 0: nothing.", Held),
        field("estop_source", Int8ul, Unit.NONE, "Who latched the e-stop.", EstopSource),
        field(
            "contradictions",
            Int32ul,
            Unit.NONE,
            "Contradictions of the active parameters.",
            Contradiction,
        ),
        field("stop_cause", Int8ul, Unit.NONE, "What ended the last motion.", StopCause),
        field("stop_flags", Int8ul, Unit.NONE, "More about that stop.", StopFlag),
        field("stop_reset", Int8ul, Unit.NONE, "With RESET: why.", ResetReason),
        field("stop_held", Int32ul, Unit.NONE, "What held the robot once it had stopped.", Held),
        field("stop_faults", Int16ul, Unit.NONE, "Faults latched at it.", Fault),
        field("stop_session", Int32ul, Unit.NONE, "Session whose setpoint drove until then."),
        field("stop_command", Int32ul, Unit.NONE, "Number of that setpoint."),
        field(
            "stop_us", Int64ul, Unit.MICROSECOND, "Device clock at it; 0: before the last start."
        ),
        field("stop_mmps", Int16ul, Unit.MILLIMETRE_PER_SECOND, "Speed of the faster wheel at it."),
        field("rolled_mm", Int16ul, Unit.MILLIMETRE, "How far that wheel has turned since."),
    ),
)

# --- the configuration, from the device: ids 0xa0 to 0xaf ----------------------------------------

CONFIGURATION_VALUE = Message(
    id=0xA0,
    name="ConfigurationValue",
    doc="The active configuration, without its peripherals.",
    body=Struct(
        _session(),
        _request(),
        field("state", Int8ul, Unit.NONE, "Where it is from.", ConfigurationState),
        field("peripheral_count", Int8ul, Unit.NONE, "How many peripherals it has."),
        field("fingerprint", Int32ul, Unit.NONE, "Its checksum: see SPEC.md."),
        *board_fields(),
    ),
    group=Group.CONFIGURATION,
)
PERIPHERAL_VALUE = Message(
    id=0xA1,
    name="PeripheralValue",
    doc="One of its peripherals; of kind NONE if it has fewer.",
    body=Struct(
        _session(),
        _request(),
        field("channel", Int8ul, Unit.NONE, "Index of the entry, from 0."),
        *peripheral_fields(),
    ),
    group=Group.CONFIGURATION,
)

# --- the recorder, from the device: ids 0xb0 to 0xbf ---------------------------------------------


def _count(name: str, doc: str) -> Field:
    return field(name, Int32ul, Unit.NONE, doc)


BOX_VALUE = Message(
    id=0xB0,
    name="BoxValue",
    doc="What a stored black box is of. With number 0 there is none of this age.",
    body=Struct(
        _session(),
        _request(),
        field("box_count", Int8ul, Unit.NONE, "How many boxes are stored."),
        field("age", Int8ul, Unit.NONE, "As asked."),
        field(
            "is_current",
            Int8ul,
            Unit.NONE,
            "1: what it ends with is how the device stands now, or the reset that began this boot.",
        ),
        field("number", Int32ul, Unit.NONE, "Counts up over all boxes of the device, from 1."),
        field("size", Int32ul, Unit.NONE, "Size in bytes."),
        field("cause", Int8ul, Unit.NONE, "Why it was stored.", BoxCause),
        field(
            "reset_reason",
            Int8ul,
            Unit.NONE,
            "Reason for the reset before the boot in which it was stored.",
            ResetReason,
        ),
        field("boot_id", Int32ul, Unit.NONE, "Number of the boot in which it was recorded."),
        field("core", Int32ul, Unit.NONE, "Hash of the core that recorded it."),
        field(
            "release", Int32ul, Unit.NONE, "The firmware's version: major << 16, minor << 8, patch."
        ),
        field(
            "git_hash",
            Int32ul,
            Unit.NONE,
            "First 8 hex digits of the firmware's commit; 0: unknown.",
        ),
        field("board", Int32ul, Unit.NONE, "Fingerprint of the board; 0: none."),
        field("faults", Int32ul, Unit.NONE, "Latched when it was stored.", Fault),
        field("stored_us", Int64ul, Unit.MICROSECOND, "Device clock when it was stored."),
    ),
    group=Group.RECORDER,
)
BOX_PART = Message(
    id=0xB1,
    name="BoxPart",
    doc="A part of a black box. With size 0 the device has no such box, or it is not that long.",
    body=Struct(
        _session(),
        _request(),
        field("number", Int32ul, Unit.NONE, "As asked."),
        field("offset", Int32ul, Unit.NONE, "As asked."),
        field("size", Int8ul, Unit.NONE, "Bytes of the data that count; less at the end alone."),
        field("data", Bytes(BOX_PART_SIZE), Unit.NONE, "The bytes, filled up with zeros."),
    ),
    group=Group.RECORDER,
)
LEDGER_VALUE = Message(
    id=0xB2,
    name="LedgerValue",
    doc="What happened to the robot in its life, up to now. All counts wrap.",
    body=Struct(
        _session(),
        _request(),
        field("uptime_s", Int32ul, Unit.SECOND, "In all."),
        # In the order of ResetReason.
        *(
            _count(f"resets_{reason.name.lower()}", f"Starts for the reason {reason.name}.")
            for reason in ResetReason
        ),
        _count("stops_session", "Drives that a new session ended."),
        _count("stops_stop", "Drives that a stop ended."),
        _count("stops_deadline", "Drives that ended because a setpoint ran out."),
        _count("stops_estop", "Emergency stops."),
        _count("stops_fault", "Faults."),
    ),
    group=Group.RECORDER,
)
UNSAVED_VALUE = Message(
    id=0xC0,
    name="UnsavedValue",
    doc="The parameters whose active value is not the one that the next start would load.",
    body=Struct(
        _session(),
        _request(),
        field("parameters", Int64ul, Unit.NONE, "Bit n: the parameter with id n + 1."),
    ),
    group=Group.STORE,
)

# --- sensors, from the device: ids 0xd0 to 0xdf --------------------------------------------------


def _channel() -> Field:
    return field("channel", Int8ul, Unit.NONE, "Index of the peripheral's entry.")


def _taken() -> list[Field]:
    return [
        _boot(),
        field("t_us", Int32ul, Unit.MICROSECOND, "Device clock, as in WheelState."),
        _channel(),
    ]


def _axes(name: str, doc: str) -> list[Field]:
    return [field(f"{name}_{axis}", Int16sl, Unit.COUNT, doc) for axis in "xyz"]


SENSOR_INFO = Message(
    id=0xD0,
    name="SensorInfo",
    doc="What a channel is, and in which units it measures.",
    body=Struct(
        _session(),
        _channel(),
        field("channel_count", Int8ul, Unit.NONE, "How many channels there are."),
        field("kind", Int8ul, Unit.NONE, "What it is.", PeripheralKind),
        field("chip", Int8ul, Unit.NONE, "Which chip.", SensorChip),
        field("place", Int8ul, Unit.NONE, "Where it is.", Place),
        field("forward", Int8ul, Unit.NONE, "The IMU's axis that points forward.", Axis),
        field("up", Int8ul, Unit.NONE, "The IMU's axis that points up.", Axis),
        field("state", Int8ul, Unit.NONE, "Whether its samples can be used.", SensorState),
        field("rate_hz", Int16ul, Unit.HERTZ, "At which samples are sent; 0: on a change."),
        field("gyro_scale", Float32l, Unit.RADIAN_PER_SECOND, "One count."),
        field("accelerometer_scale", Float32l, Unit.METRE_PER_SECOND_SQUARED, "One count."),
        field("gyro_noise", Float32l, Unit.RADIAN_PER_SECOND, "Standard deviation."),
        field(
            "accelerometer_noise", Float32l, Unit.METRE_PER_SECOND_SQUARED, "Standard deviation."
        ),
        *_axes(
            "bias",
            "As its entry says: an IMU's bias at rest, in counts of its gyroscope, or an analogue "
            "input's divider and number.",
        ),
    ),
    group=Group.SENSOR,
)
IMU = Message(
    id=0xD1,
    name="Imu",
    doc="One sample of an IMU, in the axes of its chip. Never sent twice.",
    body=Struct(
        *_taken(),
        field("sample", Int16ul, Unit.NONE, "Counts the samples that the chip gave. Wraps."),
        field(
            "bound_us",
            Int16ul,
            Unit.MICROSECOND,
            "It was measured at t_us, give or take so much.",
        ),
        *_axes("gyro", "Times gyro_scale of SensorInfo."),
        *_axes("accelerometer", "Times accelerometer_scale of SensorInfo."),
        field("temperature_cdeg", Int16sl, Unit.CENTIDEGREE_CELSIUS, "Temperature of the chip."),
    ),
    group=Group.SENSOR,
)
POWER = Message(
    id=0xD2,
    name="Power",
    doc="The supply: of a power sensor, or of the board's battery divider.",
    body=Struct(
        *_taken(),
        field("voltage_mv", Int16ul, Unit.MILLIVOLT, "Measured."),
        field("current_ma", Int32sl, Unit.MILLIAMPERE, "Drawn; 0 if nothing measures it."),
        field("used_mah", Float32l, Unit.MILLIAMPERE_HOUR, "Drawn since the device started."),
        field("level", Int8ul, Unit.NONE, "Level of the battery.", BatteryLevel),
    ),
    group=Group.SENSOR,
)
INPUTS = Message(
    id=0xD3,
    name="Inputs",
    doc="All digital inputs, and what the sensors forbid. Sent on a change, and each second.",
    body=Struct(
        _boot(),
        field("t_us", Int32ul, Unit.MICROSECOND, "Device clock, as in WheelState."),
        field("levels", Int16ul, Unit.NONE, "Bit n: the level at the pin of channel n."),
        field("triggered", Int16ul, Unit.NONE, "Bit n: channel n acts on the robot."),
        field("stale", Int16ul, Unit.NONE, "Bit n: the samples of channel n cannot be used."),
        field("reflexes", Int8ul, Unit.NONE, "What is forbidden now.", Reflex),
        field("level", Int8ul, Unit.NONE, "Level of the battery.", BatteryLevel),
        *(
            field(f"edges_{n}", Int16ul, Unit.NONE, f"Edges at channel {n} since reset. Wraps.")
            for n in range(MOST_PERIPHERALS)
        ),
        *(
            field(f"analog_{n}_mv", Int16ul, Unit.MILLIVOLT, f"Analogue input {n}; 0: none.")
            for n in range(1, MOST_ANALOG + 1)
        ),
    ),
    group=Group.SENSOR,
)
SENSOR_EVENT = Message(
    id=0xD4,
    name="SensorEvent",
    doc="Something happened to a channel, or its reflex acted.",
    body=Struct(
        *_taken(),
        field("code", Int8ul, Unit.NONE, "What.", SensorEventCode),
        field("value", Int16ul, Unit.NONE, "By code."),
    ),
    group=Group.SENSOR,
)
RANGE = Message(
    id=0xD6,
    name="Range",
    doc="One measurement of a range sensor. Never sent twice.",
    body=Struct(
        *_taken(),
        field("sample", Int16ul, Unit.NONE, "Counts the measurements. Wraps."),
        field("bound_us", Int16ul, Unit.MICROSECOND, "As in Imu."),
        field("distance_mm", Int16ul, Unit.MILLIMETRE, "Has a meaning only if quality is GOOD."),
        field("quality", Int8ul, Unit.NONE, "What the echo says.", RangeQuality),
    ),
    group=Group.SENSOR,
)

# --- what the firmware runs on, from the device: ids 0xe0 to 0xef --------------------------------


def _bytes(name: str, doc: str) -> Field:
    return field(name, Int32ul, Unit.NONE, doc)


MEMORY_VALUE = Message(
    id=0xE0,
    name="MemoryValue",
    doc="How much of the chip's memory is left, measured once a second.",
    body=Struct(
        _session(),
        _request(),
        _bytes("free_heap", "Bytes of heap that are free now."),
        _bytes("least_free_heap", "Fewest bytes of heap that were free since the start."),
        # Named as the firmware names its tasks.
        _bytes("control_stack", "Fewest bytes that were left of the control task's stack."),
        _bytes("housekeeping_stack", "The same of the housekeeping task."),
        _bytes("sensors_stack", "The same of the task that reads sensors; 0: there is none."),
    ),
    group=Group.PLATFORM,
)

MESSAGES = tuple(defined for defined in list(globals().values()) if isinstance(defined, Message))
"""In the order of their definitions, in which each group's hash covers their layouts."""

# It has to stay below 254: then no run of COBS is too long for one code byte, and both decoders
# rely on that.
MAX_PAYLOAD = max(message.payload_size for message in MESSAGES)
