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
    _MODULES = {
        "bulk": "decode_capture dtype iter_capture",
        "codec": "PROTOCOL_VERSION message_id schema_hash",
        "decoder": "Decoder",
        "framing": "Counters Encoder encode_frame",
        "types": "AnyMessage",
    }
    _HOMES = {name: module for module, names in _MODULES.items() for name in names.split()}

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
