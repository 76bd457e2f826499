"""The Wheelwire link: typed messages in frames on a serial line. See SPEC.md and MESSAGES.md.

```python
decoder = Decoder()
for message in decoder.feed(data):
    if isinstance(message, types.WheelState):
        print(message.left_ticks)
```

The message classes are in `types`, their coded values in `codes`, the firmware's parameters in
`parameters`. The names below are imported when first used: a capture is the only thing that needs
numpy, and the generator must run while `types` is out of date.
"""

from __future__ import annotations

from importlib import import_module
from typing import TYPE_CHECKING, Any

if TYPE_CHECKING:
    from .bulk import decode_capture, dtype, iter_capture
    from .codec import PROTOCOL_VERSION, message_id, schema_hash
    from .decoder import Decoder
    from .framing import Counters, Encoder, encode_frame
    from .types import AnyMessage
else:
    _HOMES = {
        "AnyMessage": "types",
        "Counters": "framing",
        "Decoder": "decoder",
        "Encoder": "framing",
        "PROTOCOL_VERSION": "codec",
        "decode_capture": "bulk",
        "dtype": "bulk",
        "encode_frame": "framing",
        "iter_capture": "bulk",
        "message_id": "codec",
        "schema_hash": "codec",
    }

    def __getattr__(name: str) -> Any:
        if name not in _HOMES:
            raise AttributeError(f"module {__name__!r} has no attribute {name!r}")
        found = getattr(import_module(f".{_HOMES[name]}", __name__), name)
        globals()[name] = found  # so that this is asked once
        return found


__all__ = [
    "PROTOCOL_VERSION",
    "AnyMessage",
    "Counters",
    "Decoder",
    "Encoder",
    "decode_capture",
    "dtype",
    "encode_frame",
    "iter_capture",
    "message_id",
    "schema_hash",
]
