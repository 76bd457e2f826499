# A toolchain for another processor than this computer's: zig, which PyPI has as `ziglang`.
#
# The environment names the target, WHEELWIRE_ZIG_TARGET (`aarch64-linux-gnu.2.17`: with the oldest
# glibc that it must run on), and the processor where it is not the target's plainest one,
# WHEELWIRE_ZIG_CPU.
set(CMAKE_SYSTEM_NAME Linux)
string(REGEX MATCH "^[^-]+" CMAKE_SYSTEM_PROCESSOR "$ENV{WHEELWIRE_ZIG_TARGET}")

find_program(ZIG zig HINTS "$ENV{WHEELWIRE_ZIG}" REQUIRED)
# What is not optimised, zig sanitizes, and then misses a runtime.
set(zig_arguments "-target $ENV{WHEELWIRE_ZIG_TARGET} -fno-sanitize=undefined")
if(NOT "$ENV{WHEELWIRE_ZIG_CPU}" STREQUAL "")
  string(APPEND zig_arguments " -mcpu=$ENV{WHEELWIRE_ZIG_CPU}")
endif()

set(CMAKE_C_COMPILER ${ZIG})
set(CMAKE_C_COMPILER_ARG1 "cc ${zig_arguments}")
set(CMAKE_CXX_COMPILER ${ZIG})
set(CMAKE_CXX_COMPILER_ARG1 "c++ ${zig_arguments}")

# `zig ar` is two words, which CMake does not take for an archiver.
set(CMAKE_AR ${ZIG})
set(CMAKE_RANLIB ${ZIG})
foreach(language C CXX)
  set(CMAKE_${language}_ARCHIVE_CREATE "<CMAKE_AR> ar qc <TARGET> <OBJECTS>")
  set(CMAKE_${language}_ARCHIVE_APPEND "<CMAKE_AR> ar q <TARGET> <OBJECTS>")
  set(CMAKE_${language}_ARCHIVE_FINISH "<CMAKE_RANLIB> ranlib <TARGET>")
endforeach()

set(CMAKE_FIND_ROOT_PATH_MODE_LIBRARY ONLY)
set(CMAKE_FIND_ROOT_PATH_MODE_INCLUDE ONLY)
