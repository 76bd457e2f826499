"""One version of ESP-IDF everywhere, and what of the firmware an image has."""

from __future__ import annotations

import re
from pathlib import Path

ROOT = Path(__file__).parents[3]
FIRMWARE = ROOT / "firmware" / "esp32"
PANIC = FIRMWARE / "main" / "panic.cpp"
PLATFORM_OF = {"5.5.3": "6.13.0"}
"""Which release of PlatformIO's espressif32 brings which ESP-IDF, by its platform.json."""


def only(pattern: str, path: Path) -> str:
    """The one match in a file."""
    (found,) = set(re.findall(pattern, path.read_text()))
    assert isinstance(found, str)
    return found


def test_release_editor_and_documentation_have_the_same() -> None:
    idf = only(r"espressif/idf:v([\d.]+)", ROOT / ".github" / "workflows" / "ci.yml")
    assert only(r"espressif32@([\d.]+)", ROOT / "platformio.ini") == PLATFORM_OF[idf]
    for page in ("versions.md", "platformio.md"):
        assert only(r"ESP-IDF (\d[\d.]*\d)", ROOT / "docs" / page) == idf


def test_each_wrapper_of_the_panic_handler_is_linked() -> None:
    wrapped = set(re.findall(r"void __wrap_(\w+)\(", PANIC.read_text()))
    linked = set(re.findall(r"--wrap=(\w+)", (FIRMWARE / "main" / "CMakeLists.txt").read_text()))
    assert wrapped == linked == {"panicHandler", "xt_unhandled_exception"}


SELF_TEST_IF = re.compile(
    r"#if CONFIG_WHEELWIRE_SELF_TEST\n.*?(?:#else\n(.*?))?#endif\n"  # app_main.cpp
    r"|if\(CONFIG_WHEELWIRE_SELF_TEST\)\n.*?endif\(\)\n",  # CMakeLists.txt
    re.DOTALL,
)


def test_the_ordinary_image_has_nothing_of_the_self_test() -> None:
    for name in ("app_main.cpp", "CMakeLists.txt"):
        text = (FIRMWARE / "main" / name).read_text()
        assert "self_test" in text
        assert "self_test" not in SELF_TEST_IF.sub(lambda found: found[1] or "", text)
    option = (FIRMWARE / "main" / "Kconfig.projbuild").read_text().split("WHEELWIRE_SELF_TEST\n")[1]
    assert "default n" in option
    others = [
        path
        for folder in ("core", "recorder", "sensors", "main")
        for path in (FIRMWARE / folder).glob("*.?pp")
        if not path.name.startswith(("self_test", "app_main", "fail_core"))
    ]
    assert len(others) > 100
    assert not [path for path in others if re.search("self_?test", path.read_text(), re.I)]


def test_a_release_has_a_self_test_image_of_each_chip() -> None:
    workflow = (ROOT / ".github" / "workflows" / "ci.yml").read_text()
    build = workflow.split("  firmware:\n")[1].split("\n\n")[0]
    assert "chip: [esp32, esp32s3, esp32c6]" in build
    assert "SELF_TEST: wheelwire-selftest-${{ matrix.chip }}.bin" in build
    assert "echo CONFIG_WHEELWIRE_SELF_TEST=y" in build
    published = build.split("path: |")[1]
    assert "${{ env.IMAGE }}" in published
    assert "${{ env.SELF_TEST }}" in published
