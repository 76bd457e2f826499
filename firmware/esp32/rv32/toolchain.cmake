# Debian's bare-metal RISC-V compiler and picolibc, for RV32IMC: what an ESP32-C6 has but for
# atomics, which the core does not use. No floating-point unit.
set(CMAKE_SYSTEM_NAME Generic)
set(CMAKE_SYSTEM_PROCESSOR riscv32)

# There is no C++ library for this target; g++ would link one.
set(CMAKE_CXX_COMPILER riscv64-unknown-elf-gcc)
set(CMAKE_TRY_COMPILE_TARGET_TYPE STATIC_LIBRARY)

# Specification 2.2 has the counters' CSRs in the base instruction set; later ones do not.
set(CMAKE_CXX_FLAGS_INIT "-march=rv32imc -mabi=ilp32 -misa-spec=2.2")
# The other build of picolibc copies memory byte by byte.
string(APPEND CMAKE_CXX_FLAGS_INIT " --specs=picolibc.specs --picolibc-buildtype=release")

# QEMU's `virt` starts at 0x80000000, where its RAM begins.
string(
  CONCAT CMAKE_EXE_LINKER_FLAGS_INIT
         "--crt0=semihost --oslib=semihost"
         " -Wl,--defsym=__flash=0x80000000 -Wl,--defsym=__flash_size=1M"
         " -Wl,--defsym=__ram=0x80100000 -Wl,--defsym=__ram_size=1M"
         " -Wl,--defsym=__stack_size=16K")
