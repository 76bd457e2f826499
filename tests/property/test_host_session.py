from typing import Any

from hypothesis import given
from hypothesis import strategies as st

from support.core_device import UNHURRIED, CoreDevice
from support.examples import examples
from support.messages import any_message_or_nan
from support.virtual_line import VirtualLine
from wheelwire.errors import WheelwireError
from wheelwire.link.session import Session
from wheelwire.simulation.bad_line import Impairment
from wheelwire_protocol.codes import SupervisorState
from wheelwire_protocol.framing import Encoder
from wheelwire_protocol.types import AnyMessage, ParameterSet, SetWheelVelocity


@given(chunks=st.lists(st.binary(max_size=200), max_size=20))
def test_random_bytes_never_raise_and_are_never_a_sample(chunks: list[bytes]) -> None:
    session = Session(lambda: 7)
    session.connect(0)
    for now, chunk in enumerate(chunks):
        assert session.receive(chunk, now * 1000) == []
        session.advance(now * 1000)


@examples(50)
@given(messages=st.lists(any_message_or_nan, max_size=20), mine=st.booleans())
def test_well_formed_nonsense_never_raises(messages: list[AnyMessage], mine: bool) -> None:
    line = VirtualLine(watched=(1,), device=CoreDevice(**UNHURRIED)).open()
    encoder = Encoder()
    for message in messages:
        if mine:  # as if the device itself had gone mad
            ids = {"session_id": line.device.session_id, "boot_id": line.device.boot_id}
            known: dict[str, Any] = {n: ids[n] for n in ids if n in message._fields}
            message = message._replace(**known)
        line.now_us += 700
        line.session.receive(encoder.encode(message), line.now_us)
        line.session.advance(line.now_us)
        try:
            line.drive()
        except WheelwireError:
            continue


@examples(50)
@given(
    seed=st.integers(0, 2**16),
    loss=st.floats(0, 0.2),
    repeat=st.floats(0, 0.3),
    flip=st.floats(0, 0.2),
    jitter_us=st.integers(0, 60_000),
)
def test_on_a_bad_line_nothing_is_renewed_done_twice_or_sampled_twice(
    seed: int, loss: float, repeat: float, flip: float, jitter_us: int
) -> None:
    impairment = Impairment(loss=loss, repeat=repeat, flip=flip, delay_us=200, jitter_us=jitter_us)
    device = CoreDevice(drift=100e-6, **UNHURRIED)
    line = VirtualLine(seed, to_device=impairment, to_host=impairment, device=device)
    line.session.connect(line.now_us)
    asked: list[float] = []
    for number in range(120):
        line.run(0.02)
        if number == 70:
            device.reset()
        try:
            speed_mps = 0.0 if number % 20 == 0 else 0.1  # zero arms, also after the reset
            line.drive(speed_mps, speed_mps, ttl_s=0.3)
            if number % 10 == 0:
                value = 0.1 + number / 1000
                message = ParameterSet(0, 0, 6, value)
                line.post(message)
                asked.append(value)
        except WheelwireError:
            continue
    line.run(1.5)

    expiries: dict[tuple[int, int], int] = {}
    copies: dict[tuple[int, int], int] = {}
    for m in line.sent:
        if isinstance(m, SetWheelVelocity):
            key = (m.session_id, m.command_seq)
            assert expiries.setdefault(key, m.expiry_us) == m.expiry_us
            copies[key] = copies.get(key, 0) + 1
    assert max(copies.values(), default=0) <= 2

    done = device.asked(ParameterSet)
    assert len({(m.session_id, m.request_id) for m in done}) == len(done) <= len(asked)
    latches = [(s.boot_id, s.t_us) for s in line.samples]
    assert len(set(latches)) == len(latches)
    assert device.obeyed
    assert device.supervisor is not SupervisorState.DRIVING
