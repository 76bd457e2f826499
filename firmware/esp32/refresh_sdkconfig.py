"""Let a change of sdkconfig.defaults* take effect in the next PlatformIO build.

PlatformIO keeps the configuration in sdkconfig.<environment>, whose values override the defaults.
When a defaults file is newer, only Wheelwire's own options (pins, baud rate: what a user sets in
menuconfig) stay, and the IDF fills in the rest from the defaults.
"""

from pathlib import Path

Import("env")  # SCons gives a script both names.
project = Path(env.subst("$PROJECT_DIR"))
sdkconfig = project / f"sdkconfig.{env.subst('$PIOENV')}"
changed_ns = max(p.stat().st_mtime_ns for p in project.glob("firmware/esp32/sdkconfig.defaults*"))

if sdkconfig.exists() and sdkconfig.stat().st_mtime_ns < changed_ns:
    lines = sdkconfig.read_text(encoding="utf-8").splitlines(keepends=True)
    sdkconfig.write_text("".join(x for x in lines if "CONFIG_WHEELWIRE_" in x), encoding="utf-8")
    print(f"{sdkconfig.name}: regenerated from the changed defaults; Wheelwire's options stay")
