"""What the C headers declare, as ctypes sees it."""

import ctypes
from pathlib import Path

import pytest

from wheelwire_protocol import core_abi
from wheelwire_protocol.generate.c_abi import generate

HEADER = """\
#define TOY_SIZE 7
typedef struct toy toy; /* Opaque; of it there are only pointers. */
typedef struct toy_part {
  uint64_t t_us;
  char name[12]; /* In UTF-8. */
} toy_part;
enum toy_state_kind { TOY_STATE_OFF = 0, TOY_STATE_ON = 1 };
typedef int (*toy_save)(void* context, const uint8_t* block, size_t size);
TOY_EXPORT toy* toy_create(const uint8_t* data, uint8_t* out, toy_save save);
TOY_EXPORT void toy_look(const toy* one, toy** other, toy_part* part,
                         const toy_part** parts);
"""


def declared(folder: Path, header: str) -> dict[str, object]:
    path = folder / "toy.h"
    path.write_text(header)
    names: dict[str, object] = {}
    exec(generate(path, "toy"), names)  # noqa: S102 - it was just made here
    return names


def test_each_declaration_becomes_the_type_of_the_same_layout(tmp_path: Path) -> None:
    toy = declared(tmp_path, HEADER)
    part, save = toy["Part"], toy["Save"]
    assert isinstance(part, type)
    assert issubclass(part, ctypes.Structure)
    assert part._fields_ == (("t_us", ctypes.c_uint64), ("name", ctypes.c_char * 12))
    assert toy["SIZE"] == 7
    assert [(one.name, one.value) for one in toy["StateKind"]] == [("OFF", 0), ("ON", 1)]  # type: ignore[attr-defined]
    pointer = ctypes.c_void_p
    assert toy["SIGNATURES"] == {
        "toy_create": (pointer, (ctypes.c_char_p, pointer, save)),
        "toy_look": (
            None,
            (
                pointer,
                ctypes.POINTER(pointer),
                ctypes.POINTER(part),
                ctypes.POINTER(ctypes.POINTER(part)),
            ),
        ),
    }


def test_bytes_that_a_callback_gets_may_have_zeros(tmp_path: Path) -> None:
    """As a string they would end at the first one."""
    save = declared(tmp_path, HEADER)["Save"]
    assert save._argtypes_ == (ctypes.c_void_p, ctypes.c_void_p, ctypes.c_size_t)  # type: ignore[attr-defined]


@pytest.mark.parametrize(
    "unknown",
    [
        "TOY_EXPORT int toy_count(long number);",
        "typedef union toy_any { int number; } toy_any;",
        "static int toy_number;",
    ],
)
def test_what_is_not_known_is_refused(tmp_path: Path, unknown: str) -> None:
    with pytest.raises((KeyError, ValueError)):
        declared(tmp_path, HEADER + unknown)


def test_the_cores_structures_are_as_long_as_in_c() -> None:
    """Counted by hand, with the padding that C adds."""
    assert ctypes.sizeof(core_abi.Inputs) == 32
    assert ctypes.sizeof(core_abi.Outputs) == 40
