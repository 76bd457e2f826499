"""The ESP-IDF project as PlatformIO reads it, without either of them."""

from __future__ import annotations

import configparser
import os
import runpy
import subprocess
import sys
from pathlib import Path
from typing import Any

import pytest

ROOT = Path(__file__).parents[2]
FIRMWARE = ROOT / "firmware" / "esp32"
ENVIRONMENTS = ["esp32", "esp32s3", "esp32c6"]

# What the IDF's project.cmake does with the project, as far as these tests look.
STAND_IN = """
macro(project)
  _project(${ARGV} NONE)
  message(STATUS "COMPONENTS: ${COMPONENTS}")
endmacro()
"""


def components(idf: Path, build: Path) -> list[str]:
    """The components that the project asks the IDF in `idf` for."""
    cmake_folder = idf / "tools" / "cmake"
    cmake_folder.mkdir(parents=True)
    (cmake_folder / "project.cmake").write_text(STAND_IN)
    result = subprocess.run(
        [Path(sys.executable).with_name("cmake"), "-S", ROOT, "-B", build],
        env={**os.environ, "IDF_PATH": str(idf)},
        capture_output=True,
        text=True,
        check=True,
    )
    (line,) = (x for x in result.stdout.splitlines() if "COMPONENTS: " in x)
    return line.partition("COMPONENTS: ")[2].split(";")


def test_the_idf_builds_main_alone(tmp_path: Path) -> None:
    assert components(tmp_path / "idf", tmp_path / "build") == ["main"]


def test_platformio_finds_its_own_component(tmp_path: Path) -> None:
    """Without it PlatformIO ends with "Failed to find the default IDF component"."""
    (tmp_path / "idf" / "components" / "__pio_env").mkdir(parents=True)
    assert components(tmp_path / "idf", tmp_path / "build") == ["main", "__pio_env"]


def platformio_option(environment: str, name: str) -> str | None:
    """An option of platformio.ini; [env] holds for every environment that does not set it."""
    config = configparser.ConfigParser(interpolation=None)
    config.read(ROOT / "platformio.ini")
    return config.get(f"env:{environment}", name, fallback=config.get("env", name, fallback=None))


@pytest.mark.parametrize("environment", ENVIRONMENTS)
def test_the_flash_header_says_4_mb(environment: str) -> None:
    """PlatformIO writes the board's size into the header, whatever the IDF's configuration says."""
    assert platformio_option(environment, "board_upload.flash_size") == "4MB"
    chip = FIRMWARE / f"sdkconfig.defaults.{environment}"
    defaults = [*(FIRMWARE / "sdkconfig.defaults").read_text().splitlines()]
    defaults += chip.read_text().splitlines()
    sizes = [x for x in defaults if "ESPTOOLPY_FLASHSIZE" in x]
    assert sizes == ["CONFIG_ESPTOOLPY_FLASHSIZE_4MB=y"]


class Scons:
    """The `env` of a PlatformIO script."""

    def __init__(self, project: Path) -> None:
        self._values = {"$PROJECT_DIR": str(project), "$PIOENV": "esp32"}

    def subst(self, name: str) -> str:
        return self._values[name]


@pytest.fixture
def project(tmp_path: Path) -> Path:
    """A project whose defaults were written at 1000 s and its sdkconfig.esp32 at 2000 s."""
    folder = tmp_path / "firmware" / "esp32"
    folder.mkdir(parents=True)
    for name in ("sdkconfig.defaults", "sdkconfig.defaults.esp32"):
        (folder / name).write_text("CONFIG_FREERTOS_HZ=1000\n")
        os.utime(folder / name, (1000, 1000))
    sdkconfig = tmp_path / "sdkconfig.esp32"
    sdkconfig.write_text(
        "CONFIG_FREERTOS_HZ=100\n"
        "CONFIG_WHEELWIRE_PIN_LEFT_ENABLE=14\n"
        "# CONFIG_WHEELWIRE_STATUS_LED is not set\n"
    )
    os.utime(sdkconfig, (2000, 2000))
    return tmp_path


def run_before_build(project: Path) -> None:
    """Run the scripts that platformio.ini names for before a build."""
    scripts = (platformio_option("esp32", "extra_scripts") or "").split()
    for script in scripts:
        names: dict[str, Any] = {"Import": lambda _: None, "env": Scons(project)}
        runpy.run_path(str(ROOT / script.removeprefix("pre:")), names)


@pytest.mark.parametrize("changed", ["sdkconfig.defaults", "sdkconfig.defaults.esp32"])
def test_a_changed_default_takes_effect(project: Path, changed: str) -> None:
    """And the pins that a user has set stay as they are."""
    os.utime(project / "firmware" / "esp32" / changed, (3000, 3000))
    run_before_build(project)
    assert (project / "sdkconfig.esp32").read_text() == (
        "CONFIG_WHEELWIRE_PIN_LEFT_ENABLE=14\n# CONFIG_WHEELWIRE_STATUS_LED is not set\n"
    )


def test_unchanged_defaults_leave_the_configuration_alone(project: Path) -> None:
    before = (project / "sdkconfig.esp32").read_text()
    run_before_build(project)
    assert (project / "sdkconfig.esp32").read_text() == before


def test_a_first_build_has_no_configuration(project: Path) -> None:
    (project / "sdkconfig.esp32").unlink()
    run_before_build(project)
    assert not (project / "sdkconfig.esp32").exists()
