"""Interrupts a call before a chosen bytecode, like a signal handler."""

from __future__ import annotations

import gc
import sys
import threading
from collections.abc import Callable
from types import CodeType, FrameType
from typing import Any


def interrupted(call: Callable[[], object], step: int, handler: Callable[[], object]) -> bool:
    """Run `call`, and `handler` before its bytecode number `step`; False if it has fewer.

    Only this thread's bytecodes count, and not the handler's.
    """
    left = step

    def is_due() -> bool:
        nonlocal left
        left -= 1
        return left == 0

    # The interpreter swallows exceptions in callbacks of its garbage collection.
    collects = gc.isenabled()
    gc.disable()
    try:
        _watch(call, is_due, handler)
    finally:
        if collects:
            gc.enable()
    return left <= 0


if sys.version_info >= (3, 12):
    # There a trace function misses bytecodes: those of frames, or of code objects, that were known
    # before it asked for them.
    _TOOL = 4  # debuggers, coverage and profilers have others

    def _watch(
        call: Callable[[], object], is_due: Callable[[], bool], handler: Callable[[], object]
    ) -> None:
        monitoring, thread = sys.monitoring, threading.get_ident()
        instruction = monitoring.events.INSTRUCTION

        def watch(_code: CodeType, _offset: int) -> None:
            if threading.get_ident() == thread and is_due():
                monitoring.set_events(_TOOL, 0)
                handler()

        monitoring.use_tool_id(_TOOL, __name__)
        monitoring.register_callback(_TOOL, instruction, watch)
        try:
            try:
                monitoring.set_events(_TOOL, instruction)
                call()
            finally:  # its first bytecodes are watched, too
                monitoring.set_events(_TOOL, 0)
        finally:
            monitoring.register_callback(_TOOL, instruction, None)
            monitoring.free_tool_id(_TOOL)

else:

    def _watch(
        call: Callable[[], object], is_due: Callable[[], bool], handler: Callable[[], object]
    ) -> None:
        def watch(frame: FrameType, event: str, _argument: Any) -> Any:
            frame.f_trace_opcodes, frame.f_trace_lines = True, False
            if event == "opcode" and is_due():
                sys.settrace(None)
                handler()
            return watch

        before = sys.gettrace()
        sys.settrace(watch)
        try:
            call()
        finally:
            sys.settrace(before)
