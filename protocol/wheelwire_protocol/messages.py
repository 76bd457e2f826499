"""All messages of the link: the only definition of the wire layout."""

from __future__ import annotations

from . import codes
from .board_layout import Board, Peripheral
from .codes import Group, Unit
from .message import (
    Definition,
    Field,
    chars,
    f32,
    fields_of,
    i16,
    i32,
    messages_in,
    u8,
    u16,
    u32,
    u64,
)
from .peripherals import MOST_ANALOG, Axis, SensorChip

PROTOCOL_VERSION = 2

BOX_PART_SIZE = 56
"""Bytes of a black box that one message carries."""


class Setpoint(Definition):
    """What every setpoint has: for whom, which, and how long."""

    session_id = u32()
    command_seq = u32("Counts up; older ones are ignored.")
    # A moment, not a duration: a delay on the way can then only shorten a setpoint's life.
    expiry_us = u64("Device clock when it expires.", unit=Unit.MICROSECOND)


class Request(Definition):
    """A message that names its session, and has a number in it."""

    session_id = u32()
    request_id = u16("Counts up; the answer repeats it.")


class Query(Request, reads=True):
    """A request that changes nothing."""


Answer = Request
"""It repeats the session and the number of its request."""


class Dated(Definition):
    """What is of one moment: the boot, and the device's clock."""

    boot_id = u32()
    t_us = u32("Device clock.", unit=Unit.MICROSECOND)


# --- from the host -----------------------------------------------------------------------------

# The frozen messages let any host identify and stop any device, whatever their releases. Their ids
# and layouts never change.


class Hello(Definition, id=0x01, frozen=True):
    """Opens a session."""

    nonce = u32("Random; names the session, with boot_id.")
    protocol_version = u16()
    schema_hash = u32()


class Stop(Request, id=0x02, frozen=True):
    """Stops both wheels at once. Needs no session."""

    # Otherwise a setpoint sent before the stop, but arriving after it, would drive again.
    command_seq = u32("Setpoints up to this one are void.")
    mode = u8(codes=codes.StopMode)


class Estop(Request, id=0x03, frozen=True):
    """Stops both wheels until cleared. Needs no session."""


class SetWheelVelocity(Setpoint, id=0x04):
    """Wheel velocities, closed loop."""

    left_mps = f32("Forward positive.", unit=Unit.METRE_PER_SECOND)
    right_mps = f32("Forward positive.", unit=Unit.METRE_PER_SECOND)


class SetDuty(Setpoint, id=0x05):
    """Duties, open loop."""

    left_duty_q15 = i16("Forward positive.", unit=Unit.DUTY_Q15)
    right_duty_q15 = i16("Forward positive.", unit=Unit.DUTY_Q15)


class Ping(Request, id=0x06, answer="Pong"):
    """Synchronises the clocks. Never repeated."""

    host_us = u64("Host clock when sent.", unit=Unit.MICROSECOND)


class ClearEstop(Request, id=0x07):
    """Ends the e-stop, if its cause is gone."""


class ClearFault(Request, id=0x08):
    """Ends all faults, if their causes are gone."""


class SetStreamRate(Request, id=0x09):
    """Sets the rate of WheelState for this session."""

    rate_hz = u16("0: off.", unit=Unit.HERTZ)


class ParameterGet(Query, id=0x0A, answer="ParameterValue"):
    """Asks for one parameter."""

    parameter = u8()


class ParameterSet(Request, id=0x0B, answer="ParameterValue"):
    """Sets one parameter until the next reset."""

    parameter = u8()
    value = f32()


class ParameterSave(Request, id=0x0C):
    """Saves parameters in flash. Only while stopped."""

    parameter = u8("0: all.")


class ParameterReset(Request, id=0x0D):
    """Restores and saves all defaults. Only while stopped."""


class ParameterList(Query, id=0x0E, answer="ParameterEntry"):
    """Asks for the parameter at an index."""

    parameter_index = u8("0 to parameter_count - 1.")


class LinkCountersGet(Query, id=0x0F, answer="LinkCounters"):
    """Asks for LinkCounters."""


class ControlCountersGet(Query, id=0x10, answer="ControlCounters"):
    """Asks for ControlCounters."""


class ParameterTrial(Request, id=0x11):
    """Begins, renews or ends a trial of parameters."""

    action = u8(codes=codes.TrialAction)
    timeout_s = f32("Of BEGIN and RENEW: 0.2 to 60.", unit=Unit.SECOND)


class GroupGet(Query, id=0x12, answer="GroupInfo"):
    """Asks for the hash of a group of messages."""

    group = u8(codes=Group)


class Restart(Request, id=0x13):
    """Restarts the device. Only while stopped."""


class ContradictionsGet(Query, id=0x14, answer="Contradictions"):
    """Asks for Contradictions."""


class HoldGet(Query, id=0x15, answer="Hold"):
    """Asks for Hold."""


# --- the configuration, from the host: ids 0x20 to 0x2f ------------------------------------------


class ConfigurationGet(Query, id=0x20, answer="ConfigurationValue"):
    """Asks for the active configuration."""


class PeripheralGet(Query, id=0x21, answer="PeripheralValue"):
    """Asks for one of its peripherals."""

    channel = u8()


class BoardSet(Request, id=0x22):
    """Prepares the board for ConfigurationWrite."""

    board = fields_of(Board)


class PeripheralSet(Request, id=0x23):
    """Prepares a peripheral for ConfigurationWrite."""

    channel = u8()
    peripheral = fields_of(Peripheral)


class ConfigurationWrite(Request, id=0x24):
    """Stores the prepared configuration on trial. Only while stopped."""

    peripheral_count = u8()
    fingerprint = u32()


class ConfigurationConfirm(Request, id=0x25):
    """Confirms the configuration. Only while stopped."""

    fingerprint = u32()


# --- the recorder, from the host: ids 0x30 to 0x3f -----------------------------------------------


class BoxGet(Query, id=0x30, answer="BoxValue"):
    """Asks what a stored black box contains."""

    age = u8("0: the newest box.")


class BoxRead(Query, id=0x31, answer="BoxPart"):
    """Asks for a part of a black box. Only while stopped."""

    # Not by its age: a box stored during the download must not change which one is read.
    number = u32()
    offset = u32("In bytes.")


class LedgerGet(Query, id=0x32, answer="LedgerValue"):
    """Asks for the counts that survive a reset."""


# --- the store, from the host: ids 0x40 to 0x4f --------------------------------------------------


class UnsavedGet(Query, id=0x40, answer="UnsavedValue"):
    """Asks which parameters are not saved."""


# --- sensors, from the host: ids 0x50 to 0x5f ----------------------------------------------------


class SensorStream(Request, id=0x50):
    """Asks for SensorInfo and samples, for this session."""

    rate_hz = u16("Highest rate of the IMU; 0: no samples.", unit=Unit.HERTZ)


# --- what the firmware runs on, from the host: ids 0x60 to 0x6f ----------------------------------


class MemoryGet(Query, id=0x60, answer="MemoryValue"):
    """Asks how much memory is free."""


# --- from the device ---------------------------------------------------------------------------

# The upper half of the ids. A device accepts none of them, so an echo of its own frames does
# nothing.


class DeviceHello(Definition, id=0x80, frozen=True):
    """Answers Hello: identity, and whether the session is open."""

    # Shows which hello this answers: a late answer to a previous one must not open a session.
    nonce = u32("From Hello.")
    protocol_version = u16()
    schema_hash = u32()
    refusal = u8("NONE: the session is open.", codes.RefusalCode)
    boot_id = u32("Random at each reset, which zeroes the ticks.")
    device_us = u64(unit=Unit.MICROSECOND)
    reset_reason = u8(codes=codes.ResetReason)
    board = u8(codes=codes.Chip)
    board_id = u64("The chip's MAC address.")
    capabilities = u32(codes=codes.Capability)
    version_major = u8("Of the firmware.")
    version_minor = u8("Of the firmware.")
    version_patch = u8("Of the firmware.")
    git_hash = u32("First 8 hex digits of its commit; 0: unknown.")


class WheelState(Definition, id=0x81):
    """Both encoders, read at one instant, and the controller's state."""

    boot_id = u32()
    # 32 bits, since each byte counts in the message that is sent most: the host extends them.
    t_us = u32("Device clock. Wraps after 71.6 min.", unit=Unit.MICROSECOND)
    left_ticks = i32("Forward positive. Wraps.", unit=Unit.TICK)
    right_ticks = i32("Forward positive. Wraps.", unit=Unit.TICK)
    left_mps = f32("Measured at the rim.", unit=Unit.METRE_PER_SECOND)
    right_mps = f32("Measured at the rim.", unit=Unit.METRE_PER_SECOND)
    left_duty_q15 = i16("Applied; 0 when not driving.", unit=Unit.DUTY_Q15)
    right_duty_q15 = i16("Applied; 0 when not driving.", unit=Unit.DUTY_Q15)
    command_seq = u32("Setpoint obeyed last; 0: none yet.")
    supervisor = u8(codes=codes.SupervisorState)
    faults = u16(codes=codes.Fault)
    overruns = u16("Late control steps since reset. Wraps.")
    battery_mv = u16("0: not measured.", unit=Unit.MILLIVOLT)


class Refuse(Definition, id=0x82, frozen=True):
    """Refuses a request or setpoint: nothing moved or changed."""

    session_id = u32()
    message_id = u8("Of the refused message.")
    code = u8(codes=codes.RefusalCode)
    reference = u32("Its request_id or command_seq.")


class Ack(Answer, id=0x83):
    """Confirms that a request was carried out."""

    message_id = u8("Of the request.")


class Pong(Answer, id=0x84):
    """Answers Ping, with the device clock."""

    host_us = u64("From Ping.", unit=Unit.MICROSECOND)
    received_us = u64(unit=Unit.MICROSECOND)
    sent_us = u64(unit=Unit.MICROSECOND)


class ParameterValue(Answer, id=0x85):
    """A parameter's active value."""

    parameter = u8()
    value = f32()


class ParameterEntry(Answer, id=0x86):
    """One parameter, with its bounds."""

    parameter_index = u8()
    # In every entry: the host learns from the first one how many to ask for.
    parameter_count = u8()
    parameter = u8()
    value = f32()
    default_value = f32()
    minimum = f32()
    maximum = f32()


class Event(Dated, id=0x87):
    """Reports a change of state, or another incident."""

    code = u8(codes=codes.EventCode)
    cause = u8(codes=codes.SupervisorEvent)
    before = u8(codes=codes.SupervisorState)
    after = u8(codes=codes.SupervisorState)
    faults = u16(codes=codes.Fault)
    speed_mps = f32("With ROLLING: of the faster wheel.", unit=Unit.METRE_PER_SECOND)


class LinkCounters(Answer, id=0x88):
    """Counts of the link since reset. All wrap."""

    frames_received = u32()
    frames_sent = u32()
    bad_crc = u32()
    bad_cobs = u32("Not COBS, too short or too long.")
    unknown_id = u32()
    wrong_length = u32()
    seq_lost = u32("Frames missing by seq.")
    send_dropped = u32("The line was full.")
    refused = u32("Requests and setpoints.")
    faults_tripped = u16()


class ControlCounters(Answer, id=0x89):
    """Counts of the control loop since reset. All wrap."""

    late_steps = u32("More than half a period late.")
    latest_step_us = u32("Longest time between steps.", unit=Unit.MICROSECOND)
    saturated_steps = u32("Steps in which a wheel needed more duty than there is.")
    left_illegal = u32("Lost edges; always 0 on a chip.")
    right_illegal = u32("Lost edges; always 0 on a chip.")


class GroupInfo(Answer, id=0x8A):
    """The hash of a group of messages."""

    group = u8(codes=Group)
    hash = u32("0: no such group.")


class Contradictions(Answer, id=0x8B):
    """Parameters that contradict each other or the board."""

    active = u32(codes=codes.Contradiction)
    refused = u32("Of the values refused last.", codes.Contradiction)


class Hold(Definition, id=0x8C):
    """What holds the robot, and what ended its last motion."""

    session_id = u32()
    request_id = u16("0: sent unasked.")
    held = u32("0: nothing.", codes.Held)
    estop_source = u8(codes=codes.EstopSource)
    contradictions = u32(codes=codes.Contradiction)
    stop_cause = u8(codes=codes.StopCause)
    stop_flags = u8(codes=codes.StopFlag)
    stop_reset = u8("With RESET.", codes.ResetReason)
    stop_held = u32(codes=codes.Held)
    stop_faults = u16(codes=codes.Fault)
    stop_session = u32()
    stop_command = u32("Its last setpoint.")
    stop_us = u64("Device clock; 0: before this start.", unit=Unit.MICROSECOND)
    stop_mmps = u16("Of the faster wheel.", unit=Unit.MILLIMETRE_PER_SECOND)
    rolled_mm = u16("How far that wheel turned since.", unit=Unit.MILLIMETRE)


# --- the configuration, from the device: ids 0xa0 to 0xaf ----------------------------------------


class ConfigurationValue(Answer, id=0xA0):
    """The active configuration."""

    state = u8(codes=codes.ConfigurationState)
    peripheral_count = u8()
    fingerprint = u32()
    board = fields_of(Board)


class PeripheralValue(Answer, id=0xA1):
    """A peripheral; of kind NONE if it has fewer."""

    channel = u8()
    peripheral = fields_of(Peripheral)


# --- the recorder, from the device: ids 0xb0 to 0xbf ---------------------------------------------


class BoxValue(Answer, id=0xB0):
    """What a stored black box contains."""

    box_count = u8()
    age = u8()
    is_current = u8("1: it ends with the present latch, or the last reset.")
    number = u32("From 1; 0: no such box.")
    size = u32("In bytes.")
    cause = u8(codes=codes.BoxCause)
    reset_reason = u8("Before the boot that stored it.", codes.ResetReason)
    boot_id = u32("Boot that recorded it.")
    core = u32("Hash of the firmware's core.")
    release = u32("Firmware: major << 16, minor << 8, patch.")
    git_hash = u32("First 8 hex digits of its commit; 0: unknown.")
    board = u32("Fingerprint; 0: none.")
    faults = u32(codes=codes.Fault)
    stored_us = u64(unit=Unit.MICROSECOND)


class BoxPart(Answer, id=0xB1):
    """A part of a black box."""

    number = u32()
    offset = u32()
    size = u8("Valid bytes; 0: no such box, or past its end.")
    data = chars(BOX_PART_SIZE)


class LedgerValue(Answer, id=0xB2):
    """Counts over the robot's life. All wrap."""

    uptime_s = u32(unit=Unit.SECOND)
    # In the order of ResetReason.
    resets = tuple(u32(name=f"resets_{reason.name.lower()}") for reason in codes.ResetReason)
    stops_session = u32("Drives that it ended.")
    stops_stop = u32("Drives that it ended.")
    stops_deadline = u32("Drives that it ended.")
    stops_estop = u32()
    stops_fault = u32()


class UnsavedValue(Answer, id=0xC0):
    """Parameters whose active value is not saved."""

    parameters = u64("Bit n: parameter n + 1.")


# --- sensors, from the device: ids 0xd0 to 0xdf --------------------------------------------------


def _axes(name: str, doc: str) -> tuple[Field, ...]:
    return tuple(i16(doc, unit=Unit.COUNT, name=f"{name}_{axis}") for axis in "xyz")


class Sample(Dated):
    """What is of one sensor at one moment."""

    channel = u8()


class SensorInfo(Definition, id=0xD0):
    """A sensor, and its units."""

    session_id = u32()
    channel = u8()
    channel_count = u8()
    kind = u8(codes=codes.PeripheralKind)
    chip = u8(codes=SensorChip)
    place = u8(codes=codes.Place)
    forward = u8(codes=Axis)
    up = u8(codes=Axis)
    state = u8(codes=codes.SensorState)
    rate_hz = u16("Rate of samples; 0: on a change.", unit=Unit.HERTZ)
    gyro_scale = f32("One count.", unit=Unit.RADIAN_PER_SECOND)
    accelerometer_scale = f32("One count.", unit=Unit.METRE_PER_SECOND_SQUARED)
    gyro_noise = f32("Standard deviation.", unit=Unit.RADIAN_PER_SECOND)
    accelerometer_noise = f32("Standard deviation.", unit=Unit.METRE_PER_SECOND_SQUARED)
    bias = _axes("bias", "value_a, value_b, value_c of the peripheral.")


class Imu(Sample, id=0xD1):
    """A sample of an IMU, in its chip's axes."""

    sample = u16("Counts samples. Wraps.")
    bound_us = u16("Uncertainty of t_us.", unit=Unit.MICROSECOND)
    gyro = _axes("gyro", "Times gyro_scale of SensorInfo.")
    accelerometer = _axes("accelerometer", "Times accelerometer_scale of SensorInfo.")
    temperature_cdeg = i16(unit=Unit.CENTIDEGREE_CELSIUS)


class Power(Sample, id=0xD2):
    """The supply, by power sensor or battery divider."""

    voltage_mv = u16(unit=Unit.MILLIVOLT)
    current_ma = i32("Drawn; 0: not measured.", unit=Unit.MILLIAMPERE)
    used_mah = f32("Since the start.", unit=Unit.MILLIAMPERE_HOUR)
    level = u8(codes=codes.BatteryLevel)


class Inputs(Dated, id=0xD3):
    """All inputs, and what the sensors forbid."""

    levels = u16("Bit n: level at the pin of channel n.")
    triggered = u16("Bit n: channel n has triggered.")
    stale = u16("Bit n: channel n has no valid samples.")
    reflexes = u8(codes=codes.Reflex)
    level = u8(codes=codes.BatteryLevel)
    edges = tuple(
        u16("Since reset. Wraps.", name=f"edges_{n}") for n in range(codes.MOST_PERIPHERALS)
    )
    analog = tuple(
        u16("0: none.", unit=Unit.MILLIVOLT, name=f"analog_{n}_mv")
        for n in range(1, MOST_ANALOG + 1)
    )


class SensorEvent(Sample, id=0xD4):
    """A sensor's change, or its reflex."""

    code = u8(codes=codes.SensorEventCode)
    value = u16("See SensorEventCode.")


class Range(Sample, id=0xD6):
    """A measurement of a range sensor."""

    sample = u16("Counts samples. Wraps.")
    bound_us = u16("Uncertainty of t_us.", unit=Unit.MICROSECOND)
    distance_mm = u16("Only if quality is GOOD.", unit=Unit.MILLIMETRE)
    quality = u8(codes=codes.RangeQuality)


# --- what the firmware runs on, from the device: ids 0xe0 to 0xef --------------------------------


class MemoryValue(Answer, id=0xE0):
    """Bytes of free memory, measured once a second."""

    free_heap = u32("Now.")
    least_free_heap = u32("Least since the start.")
    # Named as the firmware names its tasks.
    control_stack = u32("Least since the start.")
    housekeeping_stack = u32("Least since the start.")
    sensors_stack = u32("Least since the start; 0: no such task.")


MESSAGES = messages_in(globals().values())
"""In the order of definition, which is also the order of the layouts in each group's hash."""

# It has to stay below 254: then no run of COBS is too long for one code byte, and both decoders
# rely on that.
MAX_PAYLOAD = max(message.payload_size for message in MESSAGES)
